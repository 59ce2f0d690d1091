"""Lower bounds for mounts that are open together with unbalances and throws, by boxes of all these numbers (E68-E72).

Without this extension the bound is that of `mount_relaxation`.
"""

from laufruhe.extension import Extension

EXTENSION = Extension(
    "joint_mounts",
    provers=tuple(f"laufruhe.extensions.joint_mounts.prover:{name}" for name in ("CORNERS", "LOADS", "THROWS")),
)
