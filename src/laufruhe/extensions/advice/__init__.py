"""Advice about a file: numbers to check, and numberings that fit a firing order."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.advice"
EXTENSION = Extension("advice", advice=(f"{_HERE}.plausibility:ADVICE", f"{_HERE}.firing_orders:ADVICE"))
