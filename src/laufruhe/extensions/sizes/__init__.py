"""Proven optima of open sizes of the running gear: boxes of sizes, alone, beside stars, and beside elastic mounts."""

from laufruhe.extension import Extension

EXTENSION = Extension(
    "sizes",
    methods=tuple(f"laufruhe.extensions.sizes.methods:{name}" for name in ("ALONE", "WITH_STARS", "WITH_MOUNTS")),
)
