"""Frequency weightings of vibration and sound, as transfer functions of their analogue filters (Q5, Q6)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.polynomial.polynomial import polyval

from laufruhe.numerics.arrays import Array, ComplexArray

Section: TypeAlias = tuple[tuple[float, ...], tuple[float, ...]]
"""Numerator and denominator of a filter section: coefficients of the powers of s = i w, the lowest first."""
_BUTTERWORTH = math.sqrt(0.5)


@dataclass(frozen=True)
class Weighting:
    """Frequency weighting as a product of filter sections.

    Attributes
    ----------
    name, source
        Name in files, and standard that defines it.
    """

    name: str
    source: str
    sections: tuple[Section, ...]

    def at(self, frequencies: Array) -> ComplexArray:
        """Return the complex factors at frequencies [Hz], shape of `frequencies`."""
        s = 2j * math.pi * np.asarray(frequencies, dtype=float)
        factors = np.ones(s.shape, dtype=complex)
        for numerator, denominator in self.sections:
            factors *= polyval(s, numerator) / polyval(s, denominator)
        return factors


def _of_vibration(
    name: str, source: str, band: tuple[float, float], transition: tuple[float, float, float],
    step: tuple[float, float, float, float] | None = None,
) -> Weighting:  # fmt: skip
    """Return a weighting of ISO 8041 (Q5).

    Parameters
    ----------
    band
        Corner frequencies of high pass and low pass [Hz].
    transition
        Frequencies f3, f4 [Hz] and quality Q4 of the transition from acceleration to velocity.
    step
        Frequency f5 [Hz], quality Q5, f6 [Hz] and Q6 of the upward step; None without one.
    """
    w1, w2, (f3, f4, q4) = math.tau * band[0], math.tau * band[1], transition
    sections = [
        ((0.0, 0.0, 1.0), (w1**2, w1 / _BUTTERWORTH, 1.0)),
        ((w2**2,), (w2**2, w2 / _BUTTERWORTH, 1.0)),
        ((1.0, 1.0 / (math.tau * f3)), _resonant(f4, q4)),
    ]
    if step is not None:
        f5, q5, f6, q6 = step
        sections.append((tuple((f5 / f6) ** 2 * part for part in _resonant(f5, q5)), _resonant(f6, q6)))
    return Weighting(name, source, tuple(sections))


def _resonant(frequency: float, quality: float) -> tuple[float, float, float]:
    w = math.tau * frequency
    return 1.0, 1.0 / (quality * w), 1.0 / w**2


def _of_sound() -> Weighting:
    """Return the A-weighting of IEC 61672-1, with the gain that makes it one at 1 kHz (Q6)."""
    w1, w2, w3, w4 = (math.tau * f for f in (20.598997, 107.65265, 737.86223, 12194.217))
    sections = (
        ((0.0, 0.0, 1.0), (w1**2, 2.0 * w1, 1.0)),
        ((0.0, 1.0), (w2, 1.0)),
        ((0.0, 1.0), (w3, 1.0)),
        ((w4**2,), (w4**2, 2.0 * w4, 1.0)),
    )
    gain = 1.0 / float(np.abs(Weighting("", "", sections).at(np.array(1000.0))))
    return Weighting("A", "IEC 61672-1", (*sections, ((gain,), (1.0,))))


_BODY, _HAND = (0.4, 100.0), (10.0**0.8, 10.0**3.1)
WEIGHTINGS: Mapping[str, Weighting] = {
    weighting.name: weighting
    for weighting in (
        _of_vibration("Wk", "ISO 2631-1", _BODY, (12.5, 12.5, 0.63), (2.37, 0.91, 3.35, 0.91)),
        _of_vibration("Wd", "ISO 2631-1", _BODY, (2.0, 2.0, 0.63)),
        _of_vibration("Wh", "ISO 5349-1", _HAND, (100.0 / math.tau, 100.0 / math.tau, 0.64)),
        _of_sound(),
    )
}
"""Weightings by their names in files."""
