"""
A waterworks engine
===================

Steam and pumps on one rod: indicator diagrams of the chambers, and the least flywheel.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("../../problems/waterworks-steam-pump.toml")
indicator = figure(result, "indicator")

# %%
torque = figure(result, "torque")
