"""Counterweights and balancer weights as bodies: sizes, clearances in the crankcase, and drawings."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.workshop"
EXTENSION = Extension(
    "workshop",
    keys=(f"{_HERE}.file:KEY",),
    weight_keys=(f"{_HERE}.file:KEY_OF_BODY",),
    sections=(f"{_HERE}.section:SECTION",),
    pictures=(f"{_HERE}.section:PICTURE",),
    commands=(f"{_HERE}.command:COMMAND",),
)
