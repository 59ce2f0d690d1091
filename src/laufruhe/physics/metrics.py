"""Measures of mount forces that engineers read (M4-M6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.mixed_norms import lengths
from laufruhe.numerics.spectrum import Spectrum

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


def peak(spectrum: Spectrum, samples: int) -> float:
    """Largest magnitude over the cycle of one vector signal (n, components), between samples too (M6)."""
    values = lengths(spectrum.sample(samples))
    top = int(np.argmax(values))
    step = 2.0 * np.pi / float(spectrum.base) / samples
    centre, width = top * step, step
    for _ in range(4):
        angles = centre + np.linspace(-width, width, 17)
        near = lengths(spectrum.values(angles))
        centre, width = float(angles[int(np.argmax(near))]), width / 8.0
    return max(float(values[top]), float(near.max()))
