"""Measures of mount forces that engineers read (M4, M5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.mixed_norms import lengths

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CycleMeasures:
    """Mean, maximum and root mean square over the cycle of a force's magnitude [N]."""

    mean: float
    max: float
    rms: float


def cycle_measures(samples: Array) -> CycleMeasures:
    """Of |F(phi)| from samples (n, components) at equal steps (M4; Hasselgruber, Figs. 10-28)."""
    size = lengths(samples)
    return CycleMeasures(float(size.mean()), float(size.max()), float(np.sqrt(np.mean(size**2))))


def order_amplitude(coefficient: NDArray[np.complex128]) -> Array:
    """Largest magnitude of a vector that turns on its ellipse, Re c e^{i h phi} (M5).

    Parameters
    ----------
    coefficient
        Shape (..., components).

    Returns
    -------
    Shape (...): the semi-major axis.
    """
    total = np.sum(np.abs(coefficient) ** 2, axis=-1)
    alternating = np.abs(np.sum(coefficient**2, axis=-1))
    return np.asarray(np.sqrt(0.5 * (total + alternating)))


def turning_parts(lateral: complex, vertical: complex) -> tuple[float, float]:
    """Amplitudes of the parts of z + i y that turn with the crank, as e^{ix}, and against it (C4, C8)."""
    return 0.5 * float(abs(vertical + 1j * lateral)), 0.5 * float(abs(vertical - 1j * lateral))
