"""Design of engines as built: for a worst case within tolerances, for a share of engines, or by choice of parts."""

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
