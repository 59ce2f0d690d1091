"""
A torsional damper
==================

Inertia and damping of a viscous damper are decided for the least shaft stress in two resonances. The pictures show the
modes of the crankshaft and the torque over crank speed.
"""

import laufruhe
from laufruhe.plots import figure

result = laufruhe.solve("inline-five-damper")
twist_modes = figure(result, "twist_modes")

# %%
twist_response = figure(result, "twist_response")
