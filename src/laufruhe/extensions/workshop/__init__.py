"""Counterweights and balancer weights as bodies: sizes that follow from unbalances, and clearances in the crankcase."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.workshop"
EXTENSION = Extension(
    "workshop",
    keys=(f"{_HERE}.file:KEY",),
    weight_keys=(f"{_HERE}.file:KEY_OF_BODY",),
    sections=(f"{_HERE}.section:SECTION",),
)
