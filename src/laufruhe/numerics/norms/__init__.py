"""Norms of signals, one a file; a problem file names them as this table does."""

from __future__ import annotations

from collections.abc import Mapping

from laufruhe.extension import additions
from laufruhe.numerics.norms.maximum import Maximum
from laufruhe.numerics.norms.mean import Mean
from laufruhe.numerics.norms.norm import Cones, Grid, Norm, SmoothProgram, lengths, only, softened_lengths
from laufruhe.numerics.norms.peak_to_peak import PeakToPeak
from laufruhe.numerics.norms.rms import RootMeanSquare
from laufruhe.numerics.norms.worst_mean import WorstMean

__all__ = ["MEAN", "NORMS", "RMS", "Cones", "Grid", "Norm", "SmoothProgram", "lengths", "softened_lengths"]

_OWN = (Mean, Maximum, RootMeanSquare, PeakToPeak, WorstMean)
NORMS: Mapping[str, Norm] = {
    norm.name: norm for norm in map(only, (*_OWN, *additions("norms", Norm, [norm.name for norm in _OWN])))
}
MEAN, RMS = NORMS["mean"], NORMS["rms"]
