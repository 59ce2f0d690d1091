"""
A single-cylinder and its counterweight
=======================================

A counterweight for about half of the reciprocating mass reduces vertical force and adds lateral force. The pictures
show the path of the force on each mount, and loads over the crank angle, before and after.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("tractor-single")
polar = figure(result, "polar")

# %%
cycle = figure(result, "cycle")
