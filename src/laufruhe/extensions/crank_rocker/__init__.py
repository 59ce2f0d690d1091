"""Crank-rockers: a crank swings a rocker by a coupler, and the rocker drives the piston (K22, K23)."""

from laufruhe.extension import Extension

EXTENSION = Extension("crank_rocker", drives=("laufruhe.extensions.crank_rocker.drive:CRANK_ROCKER",))
