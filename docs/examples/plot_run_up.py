"""
Start and shut-down on soft mounts
==================================

On its way through the resonances of soft mounts the engine moves most, and bump stops act.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("../../problems/soft-mounts-run-up.toml")
run_up = figure(result, "run_up")
