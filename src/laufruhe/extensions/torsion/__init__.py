"""Torsional vibration of the crankshaft: discs, shafts and absorbers, their modes, stresses, decisions and bounds."""

from laufruhe.extension import Extension

EXTENSION = Extension("torsion", keys=("laufruhe.extensions.torsion.file:KEY",))
