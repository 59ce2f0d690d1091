"""Engines run up and shut down through resonance: [run_up] of a file, how it is decided, its tables and picture."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.run_ups"
EXTENSION = Extension(
    "run_ups",
    keys=(f"{_HERE}.file:KEY",),
    reductions=(f"{_HERE}.reduction:REDUCTION",),
    sections=(f"{_HERE}.section:SECTION",),
    pictures=(f"{_HERE}.pictures:PICTURE",),
)
