"""Indicator diagrams of steam cylinders, pumps and compressors: a picture and a file of numbers."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.indicator_diagrams"
EXTENSION = Extension(
    "indicator_diagrams", sections=(f"{_HERE}.diagram:SECTION",), pictures=(f"{_HERE}.diagram:PICTURE",)
)
