"""Measures of mount forces that engineers read (M4, M5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import lengths


@dataclass(frozen=True)
class CycleMeasures:
    """Mean, maximum and root mean square over the cycle of a force's magnitude [N]."""

    mean: float
    max: float
    rms: float

    def times(self, factor: float) -> CycleMeasures:
        """Return the measures in another unit."""
        return CycleMeasures(factor * self.mean, factor * self.max, factor * self.rms)


def cycle_measures(samples: Array) -> CycleMeasures:
    """Return mean, maximum and rms of |F(phi)| from samples (n, components) (M4; Hasselgruber, Figs. 10-28)."""
    size = lengths(samples)
    return CycleMeasures(float(size.mean()), float(size.max()), float(np.sqrt(np.mean(size**2))))


def turning_parts(lateral: complex, vertical: complex) -> tuple[float, float]:
    """Return the amplitudes of the parts of z + i y that turn with the crank, as e^{ix}, and against it (C4, C8)."""
    return 0.5 * float(abs(vertical + 1j * lateral)), 0.5 * float(abs(vertical - 1j * lateral))
