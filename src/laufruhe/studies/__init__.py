"""Sweeps and comparisons described by study files."""

from laufruhe.studies.points import Point, points_of
from laufruhe.studies.runner import run

__all__ = ["Point", "points_of", "run"]
