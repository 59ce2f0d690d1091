"""
Where balancer shafts should stand
==================================

Sizes, places and heights of two shafts are decided together. The drawing is to scale, with decided parts in blue.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("tractor-four-shaft-heights")
engine = figure(result, "engine")
