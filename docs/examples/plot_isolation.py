"""
Soft mounts
===========

The smallest sag that keeps the bounce mode below a given frequency, and the force that such mounts transmit.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("study-soft-mounts")
transmissibility = figure(result, "transmissibility")
