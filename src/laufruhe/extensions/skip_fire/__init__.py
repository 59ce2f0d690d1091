"""Firing patterns of engines that skip firings: the smoothest of all patterns (T17)."""

from laufruhe.extension import Extension

EXTENSION = Extension("skip_fire", study_kinds=("laufruhe.extensions.skip_fire.study:SkipFirePart",))
