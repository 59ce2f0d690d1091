"""Rhombic drives: power piston and displacer of a Stirling engine on two cranks, one turning back (K24)."""

from laufruhe.extension import Extension

EXTENSION = Extension("rhombic", drives=("laufruhe.extensions.rhombic.drive:RHOMBIC",))
