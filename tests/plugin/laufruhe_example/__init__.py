"""Additions of this package to laufruhe."""

from laufruhe.extension import Extension

EXTENSION = Extension(
    "example",
    norms=("laufruhe_example.worst_twentieth:WorstTwentieth",),
    channels=("laufruhe_example.level:HORIZONTAL",),
    layouts=("laufruhe_example.six_bank:SIX_BANK",),
    quantities=("laufruhe_example.crank_radius:CRANK_RADIUS",),
    study_kinds=("laufruhe_example.crest_factor:CrestFactorPart",),
)
