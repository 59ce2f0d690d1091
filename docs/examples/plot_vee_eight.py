"""
The crank of a V8
=================

Throws and firing order of a 90 degree V8 are open. Every crank star with even firing is ranked, each with its own best
counterweights.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("vee-eight-open")
star = figure(result, "star")

# %%
firings = figure(result, "firings")
