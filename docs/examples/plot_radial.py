"""
A radial engine
===============

Seven cylinders, one master rod and six articulated rods. The pistons move a little differently, so a small force
remains that no single counterweight balances.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("radial-seven")
engine = figure(result, "engine")

# %%
polar = figure(result, "polar")
