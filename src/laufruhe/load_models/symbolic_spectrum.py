"""Spectra with CasADi expressions as coefficients (C8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.numerics.arrays import Array, Indices
from laufruhe.numerics.spectrum import base_of

# size below which an order is left out, relative to the largest order
MIN_SHARE = 1e-4


@dataclass(frozen=True, eq=False)
class SymbolicSpectrum:
    """Spectrum of a signal with n orders; real and imaginary parts are CasADi expressions, shape (d, n) each."""

    orders: Array
    real: Any
    imaginary: Any

    @cached_property
    def base(self) -> float:
        """Order of the common period of all orders."""
        return float(base_of(self.orders.tolist()))

    def sampled(self, steps: int) -> Any:
        """Return values at equal steps over the common period, shape (steps, d)."""
        cosine, sine = cosines_and_sines(self.orders.tolist(), self.base, steps)
        return (self.real @ cosine - self.imaginary @ sine).T

    def select(self, indices: Indices) -> SymbolicSpectrum:
        """Return the spectrum with the orders at these indices only."""
        columns = indices.tolist()
        return SymbolicSpectrum(self.orders[indices], self.real[:, columns], self.imaginary[:, columns])

    def mapped(self, matrix: Array) -> SymbolicSpectrum:
        """Return the spectrum with the components of all orders multiplied by a real matrix, shape (m, d)."""
        m = ca.DM(matrix.copy())
        return SymbolicSpectrum(self.orders, m @ self.real, m @ self.imaginary)


def cosines_and_sines(orders: Sequence[float], base: float, samples: int) -> tuple[Any, Any]:
    """Return cosines and sines of orders at equal steps over the period of order `base`, shape (n, samples) each."""
    angles = 2.0 * np.pi / base * np.arange(samples) / samples
    phases = np.outer(orders, angles)
    return ca.DM(np.cos(phases)), ca.DM(np.sin(phases))


def relevant_orders(sizes: Array, orders: Array) -> Indices:
    """Return the indices of orders that are not negligible in load or motion, from the size of each order's load."""
    # above resonance the motion is the load over the square of the frequency
    motions = sizes / np.maximum(orders, 1.0) ** 2
    has_load = sizes > MIN_SHARE * sizes.max(initial=0.0)
    return np.flatnonzero(has_load & (motions > MIN_SHARE * motions.max(initial=0.0)))
