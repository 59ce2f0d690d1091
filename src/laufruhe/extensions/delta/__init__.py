"""Delta engines: rows of three cylinders in a triangle, on three cranks geared to each other (K18)."""

from laufruhe.extension import Extension

EXTENSION = Extension("delta", layouts=("laufruhe.extensions.delta.layout:DELTA",))
