"""Radial engines: a master rod carries the articulated rods of the other cylinders on knuckle pins (K11-K13)."""

from laufruhe.extension import Extension

EXTENSION = Extension("radial", layouts=("laufruhe.extensions.radial.layout:RADIAL",))
