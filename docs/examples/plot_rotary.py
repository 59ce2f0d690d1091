"""
A rotary engine
===============

Two rotors on eccentrics. The lightest end weights that leave no force and no couple, and the volume of the chambers.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("rotary-two")
engine = figure(result, "engine")

# %%
chambers = figure(result, "chambers")
