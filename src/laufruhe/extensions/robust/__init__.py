"""Built engines: designs for the worst that tolerances allow, or for a share, and measured parts that are chosen."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.robust"
EXTENSION = Extension(
    "robust",
    keys=tuple(f"{_HERE}.file:{name}" for name in ("TOLERANCES", "ROBUST", "ASSEMBLY")),
    notes=(f"{_HERE}.file:NOTE",),
    reductions=tuple(f"{_HERE}.reductions:{name}" for name in ("ASSEMBLY", "TOLERANCES")),
    sections=tuple(f"{_HERE}.section:{name}" for name in ("ASSEMBLY", "TOLERANCES")),
    pictures=tuple(f"{_HERE}.section:{name}_PICTURE" for name in ("TOLERANCES", "ASSEMBLY")),
    study_kinds=(f"{_HERE}.study:ToleranceStudy",),
)
