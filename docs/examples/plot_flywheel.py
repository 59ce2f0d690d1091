"""
The lightest flywheel of a diesel engine
========================================

Torque over the cycle, work that the flywheel stores, and crank speed.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("diesel-70-hp-flywheel")
torque = figure(result, "torque")
