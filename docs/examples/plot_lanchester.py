"""
Balancer shafts of a tractor engine
===================================

Two shafts at twice crank speed reduce the mean mount force of a four-cylinder to a quarter. Bars: mean and maximum
force on each mount. Spectrum: amplitude of the loads by order of crank speed.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("tractor-four-lanchester")
bars = figure(result, "bars")

# %%
spectrum = figure(result, "spectrum")
