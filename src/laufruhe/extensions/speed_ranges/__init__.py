"""Speed ranges: the worst response over a range of crank speeds, minimised or under a limit that is a curve."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.speed_ranges"
EXTENSION = Extension(
    "speed_ranges",
    keys=(f"{_HERE}.file:KEY",),
    reductions=(f"{_HERE}.reduction:REDUCTION",),
    sections=(f"{_HERE}.section:SECTION",),
    pictures=(f"{_HERE}.section:PICTURE",),
)
