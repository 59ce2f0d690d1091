"""
What uneven firing buys
=======================

If firing intervals may differ by a few degrees, the throws of a nine-cylinder can stand where its rocking couple
vanishes.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("../../problems/inline-nine-uneven.toml")
trade = figure(result, "trade")
