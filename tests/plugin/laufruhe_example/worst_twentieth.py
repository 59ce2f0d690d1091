"""The mean of the largest twentieth of the lengths."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms.maximum import Maximum
from laufruhe.numerics.norms.norm import Grid, Norm, lengths
from laufruhe.numerics.spectrum import Spectrum

MAXIMUM = Maximum()


class WorstTwentieth(Norm):
    """Mean of the largest twentieth; it claims no convexity, so that designs are found locally."""

    name = "worst twentieth"

    def value(self, grid: Grid, rows: Array) -> float:
        """Return the mean of the largest twentieth of the lengths."""
        size = np.sort(lengths(rows))
        return float(size[-max(len(size) // 20, 1) :].mean())

    def upper_bound(self, signals: Sequence[Spectrum], shares: Array) -> float:
        """Return a bound of the largest length."""
        return MAXIMUM.upper_bound(signals, shares)

    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Return how far samples can miss the largest length, which is more than what they miss of a mean."""
        return MAXIMUM.sampling_bound(signals, shares, steps, finest)
