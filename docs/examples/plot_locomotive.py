"""
A locomotive's wheels
=====================

Weights in the driving wheels of a two-cylinder locomotive, for the least hammer blow on the rails under limits on
surging and swaying.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("locomotive-two-cylinder")
bearings = figure(result, "bearings")
