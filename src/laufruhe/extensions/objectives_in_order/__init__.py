"""Several objectives in order (P12), and what an optimum leaves free: the range of equally good designs (P17)."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.objectives_in_order"
EXTENSION = Extension(
    "objectives_in_order", reductions=(f"{_HERE}.solver:ORDER",), diagnoses=(f"{_HERE}.equal_designs:FREE_DECISIONS",)
)
