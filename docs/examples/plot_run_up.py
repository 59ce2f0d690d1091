"""
Start and shut-down on soft mounts
==================================

A start takes the engine through the resonances of its soft mounts. There it moves most, and bump stops act.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("soft-mounts-run-up")
run_up = figure(result, "run_up")
