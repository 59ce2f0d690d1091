"""Norms of signals, one class in each file, and their table by the names in problem files."""

from __future__ import annotations

from collections.abc import Mapping

from laufruhe.extension import extended
from laufruhe.numerics.norms.maximum import Maximum
from laufruhe.numerics.norms.mean import Mean
from laufruhe.numerics.norms.norm import Cones, Grid, Norm, lengths, norm_instance, softened_lengths
from laufruhe.numerics.norms.peak_to_peak import PeakToPeak
from laufruhe.numerics.norms.rms import RootMeanSquare

__all__ = ["MEAN", "NORMS", "RMS", "Cones", "Grid", "Norm", "lengths", "softened_lengths"]

_CLASSES = extended("norms", Norm, (Mean, Maximum, RootMeanSquare, PeakToPeak))
NORMS: Mapping[str, Norm] = {name: norm_instance(norm) for name, norm in _CLASSES.items()}
MEAN, RMS = NORMS["mean"], NORMS["rms"]
