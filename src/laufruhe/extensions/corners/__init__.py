"""Bound mounts with unbalances by multipliers that are found on the mounts at the corners of boxes (E69, E70).

Without it unbalances beside two to five numbers of mounts are bounded by boxes of both (E71), with a wider gap.
"""

from laufruhe.extension import Extension

EXTENSION = Extension("corners", provers=("laufruhe.extensions.corners.prover:CORNERS",))
