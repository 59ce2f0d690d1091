"""
Balancer shafts of a tractor engine
===================================

Two shafts at twice crank speed take the mean mount force of a four-cylinder to a quarter. Bars: mean and maximum force
on each mount. Spectrum: what orders of crank speed the loads are made of.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("../../problems/tractor-four-lanchester.toml")
bars = figure(result, "bars")

# %%
spectrum = figure(result, "spectrum")
