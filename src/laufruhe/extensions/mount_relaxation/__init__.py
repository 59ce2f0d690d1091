"""Bound designs on open mounts by the forces of their springs: a semidefinite relaxation (E42-E45, E52-E54, E57-E66).

Without it boxes of the core bound the same designs, with a wider gap where many numbers are open.
"""

from laufruhe.extension import Extension

EXTENSION = Extension("mount_relaxation", provers=("laufruhe.extensions.mount_relaxation.prover:SPRINGS",))
