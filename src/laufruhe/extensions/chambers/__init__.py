"""Chambers on both sides of pistons: steam engines, pumps, compressors, their stages and indicator diagrams."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.chambers"
EXTENSION = Extension(
    "chambers",
    gas_models=(f"{_HERE}.table:ChambersTable",),
    advice=(f"{_HERE}.stages:ADVICE",),
    sections=(f"{_HERE}.diagram:SECTION",),
    pictures=(f"{_HERE}.diagram:PICTURE",),
)
