"""
Which piston into which cylinder
================================

Eight measured pistons and rods for four cylinders. The picture compares the best of 2,822,400 assemblies with random
ones.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("../../problems/selective-assembly.toml")
assembly = figure(result, "assembly")
