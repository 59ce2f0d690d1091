"""Studies of what balances an engine: free forces by layout, balance factors, balancer shafts, percentiles of loads."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.balance_studies"
EXTENSION = Extension(
    "balance_studies",
    study_kinds=(
        f"{_HERE}.balancer_sizing:BalancerSizing",
        f"{_HERE}.counterweight_fraction:CounterweightFraction",
        f"{_HERE}.free_forces:FreeForces",
        f"{_HERE}.percentile:PercentilePart",
    ),
)
