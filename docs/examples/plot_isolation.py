"""
Soft mounts
===========

The least sag with which the bounce mode stays below a wanted frequency, and the force that such mounts transmit.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("../../problems/study-soft-mounts.toml")
transmissibility = figure(result, "transmissibility")
