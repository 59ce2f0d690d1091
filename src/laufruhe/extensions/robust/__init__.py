"""Built engines: designs for the worst that tolerances allow, or for a share, and measured parts that are chosen."""

from laufruhe.extension import Extension

_HOME = "laufruhe.extensions.robust"
EXTENSION = Extension(
    "robust",
    reductions=(f"{_HOME}.reductions:ASSEMBLY", f"{_HOME}.reductions:TOLERANCES"),
    study_kinds=(f"{_HOME}.study:Tolerance",),
)
