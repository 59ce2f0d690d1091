"""Loads by order as expressions: real and imaginary parts of all orders side by side (C8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import base_of


@dataclass(frozen=True, eq=False)
class Lines:
    """Orders of a signal.

    Attributes
    ----------
    orders
        Shape (n,).
    real, imaginary
        Expressions of shape (d, n).
    """

    orders: Array
    real: Any
    imaginary: Any

    @property
    def base(self) -> float:
        """Lowest order of them: one period of it is enough."""
        return float(base_of(self.orders.tolist()))

    def sampled(self, steps: int) -> Any:
        """Values at equal steps of the period, shape (steps, d)."""
        cosine, sine = waves(self.orders.tolist(), self.base, steps)
        return (self.real @ cosine - self.imaginary @ sine).T

    def select(self, which: NDArray[np.intp]) -> Lines:
        """Some of the orders."""
        chosen = which.tolist()
        return Lines(self.orders[which], self.real[:, chosen], self.imaginary[:, chosen])

    def mapped(self, matrix: Array) -> Lines:
        """Multiply the components of all orders by a real matrix."""
        m = ca.DM(matrix.copy())
        return Lines(self.orders, m @ self.real, m @ self.imaginary)

    def map_orders(self, matrices: Sequence[NDArray[np.complex128]]) -> Lines:
        """Multiply the components of each order by its own complex matrix."""
        pairs = [(ca.DM(m.real.copy()), ca.DM(m.imag.copy())) for m in matrices]
        columns = [(self.real[:, k], self.imaginary[:, k]) for k in range(len(pairs))]
        real = [a @ x - b @ y for (a, b), (x, y) in zip(pairs, columns, strict=True)]
        imaginary = [a @ y + b @ x for (a, b), (x, y) in zip(pairs, columns, strict=True)]
        return Lines(self.orders, ca.horzcat(*real), ca.horzcat(*imaginary))


def summed(parts: Sequence[Lines]) -> Lines:
    """Signals added up, order by order."""
    orders = np.unique(np.concatenate([part.orders for part in parts]))
    real, imaginary = 0.0, 0.0
    for part in parts:
        places = ca.DM.zeros(len(part.orders), len(orders))
        for k, column in enumerate(np.searchsorted(orders, part.orders)):
            places[k, int(column)] = 1.0
        spread = ca.sparsify(places)
        real, imaginary = real + part.real @ spread, imaginary + part.imaginary @ spread
    return Lines(orders, real, imaginary)


def waves(orders: Sequence[float], base: float, samples: int) -> tuple[Any, Any]:
    """Cosines and sines of orders at equal steps over the period of `base`, shape (n, samples)."""
    angles = 2.0 * np.pi / base * np.arange(samples) / samples
    phases = np.outer(orders, angles)
    return ca.DM(np.cos(phases)), ca.DM(np.sin(phases))
