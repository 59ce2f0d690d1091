"""Studies of swept numbers and of layouts: comparisons, balance factors, balancer shafts, free forces."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.sweeps"
EXTENSION = Extension(
    "sweeps",
    study_kinds=(
        f"{_HERE}.balancer_sizing:BalancerSizing",
        f"{_HERE}.counterweight_fraction:CounterweightFraction",
        f"{_HERE}.free_forces:FreeForces",
        f"{_HERE}.layout_comparison:LayoutComparison",
    ),
)
