"""Which parts of the physics a problem needs, and time and error of simpler physics (F10, F13 to F15)."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.fidelity.command"
EXTENSION = Extension("fidelity", commands=(f"{_HERE}:EXPLAIN", f"{_HERE}:TRADE"))
