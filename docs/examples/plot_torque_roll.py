"""
Mounts on the torque-roll axis
==============================

Nine stiffnesses of three mounts are decided so that torque excites one mode only. Bars: share of each motion in the
kinetic energy of each natural mode.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("powertrain-torque-roll")
modes = figure(result, "modes")
