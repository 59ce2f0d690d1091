"""Largest torque that bounds a lead: the torque of the cycle without its mean, from above."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from laufruhe.extensions.phase_leads.bounds import largest_torque
from laufruhe.numerics.spectrum import Spectrum


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_largest_alternating_torque_is_bounded_closely(seed: int, sign: float) -> None:
    rng = np.random.default_rng(seed)
    orders = np.arange(9)
    waves = (rng.standard_normal(9) + 1j * rng.standard_normal(9)) / (1.0 + orders) ** 2
    # a mean of any size does not count
    waves[0] = 50.0 * rng.standard_normal()
    torque = Spectrum(Fraction(1, 2), sign * waves)
    angle = np.linspace(0.0, torque.period, 40_001)
    alternating = (torque.coefficients[1:] * np.exp(0.5j * np.outer(angle, orders[1:]))).real.sum(axis=1)
    largest = float(np.abs(alternating).max())
    assert largest * (1.0 - 1e-12) <= largest_torque(torque) <= 1.05 * largest
