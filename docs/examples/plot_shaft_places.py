"""
Where balancer shafts should stand
==================================

Sizes, places and heights of two shafts are decided together. The drawing is to scale; what was decided is marked.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("../../problems/tractor-four-shaft-heights.toml")
engine = figure(result, "engine")
