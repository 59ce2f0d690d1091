"""Advice about a file: numbers to check, numberings that fit a firing order, pressures between stages."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.advice"
EXTENSION = Extension(
    "advice",
    advice=(f"{_HERE}.plausibility:ADVICE", f"{_HERE}.firing_orders:ADVICE", f"{_HERE}.compressor_stages:ADVICE"),
)
