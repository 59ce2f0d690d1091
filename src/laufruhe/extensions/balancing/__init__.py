"""Balancing at the machine: bob weights of throws, and holes and slugs that correct an unbalance in two planes."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.balancing"
EXTENSION = Extension(
    "balancing",
    keys=(f"{_HERE}.file:BOB_WEIGHTS", f"{_HERE}.file:CORRECTION"),
    sections=(f"{_HERE}.bob_weights:SECTION",),
    commands=(f"{_HERE}.command:BALANCE",),
)
