"""
A waterworks engine
===================

Steam piston and pumps on one rod. Indicator diagrams of the chambers, and the smallest flywheel.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("waterworks-steam-pump")
indicator = figure(result, "indicator")

# %%
torque = figure(result, "torque")
