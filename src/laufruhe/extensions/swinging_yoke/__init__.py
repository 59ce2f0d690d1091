"""Swinging yokes, as of shapers: a slotted lever that a crank swings drives a ram (K14 to K17)."""

from laufruhe.extension import Extension

EXTENSION = Extension("swinging_yoke", drives=("laufruhe.extensions.swinging_yoke.drive:SWINGING_YOKE",))
