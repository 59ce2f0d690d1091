"""What this package adds to laufruhe."""

from laufruhe.extension import Extension

EXTENSION = Extension(
    "example",
    norms=("laufruhe_example.worst_twentieth:WorstTwentieth",),
    channels=("laufruhe_example.resultant:RESULTANT",),
    layouts=("laufruhe_example.x_engine:X_ENGINE",),
    quantities=("laufruhe_example.crank_radius:CRANK_RADIUS",),
    study_kinds=("laufruhe_example.percentile:PercentilePart",),
)
