"""
Uneven firing of a nine-cylinder
================================

If firing intervals may differ by a few degrees, throws of a nine-cylinder exist whose rocking couple vanishes.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("inline-nine-uneven")
trade = figure(result, "trade")
