"""
Which piston into which cylinder
================================

Eight measured pistons and rods for four cylinders. The picture compares the best of 2,822,400 assemblies with random
ones.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("selective-assembly")
assembly = figure(result, "assembly")
