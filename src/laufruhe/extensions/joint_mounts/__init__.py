"""Bound mounts that are open together with unbalances and throws: boxes of all of them, and their corners (E68-E72).

Without it such designs are bounded by spring forces alone, where `mount_relaxation` is there.
"""

from laufruhe.extension import Extension

EXTENSION = Extension(
    "joint_mounts",
    provers=tuple(f"laufruhe.extensions.joint_mounts.prover:{name}" for name in ("CORNERS", "LOADS", "THROWS")),
)
