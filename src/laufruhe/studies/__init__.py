"""Sweeps and comparisons described by study files."""

from laufruhe.studies.runner import run
from laufruhe.studies.scenes import Point, Scenes

__all__ = ["Point", "Scenes", "run"]
