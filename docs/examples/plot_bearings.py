"""
Main bearings of a three-cylinder
=================================

Six counterweights with open mass and angle halve the mean force on the main bearings. The polar diagrams show where
block and journals wear.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("tractor-three-bearings")
bearings = figure(result, "bearings")
