"""Measures from Python functions of a user, for `laufruhe.own_measure`."""

from laufruhe.extension import Extension

EXTENSION = Extension("own_measures")
