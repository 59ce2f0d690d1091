"""Measures, orders and natural frequencies of a design over a range of speeds."""

from laufruhe.extension import Extension

EXTENSION = Extension("speed_maps", study_kinds=("laufruhe.extensions.speed_maps.part:SpeedMapStudy",))
