"""
The lightest flywheel of a diesel engine
========================================

Torque over the cycle, the work that the flywheel stores, and the crank speed that results.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("../../problems/diesel-70-hp-flywheel.toml")
torque = figure(result, "torque")
