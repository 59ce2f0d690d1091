"""Lower bounds of polynomials over a box: the smallest Bernstein coefficient is a lower bound (N6)."""

from __future__ import annotations

import itertools
from functools import lru_cache

import numpy as np

from laufruhe.numerics.arrays import Array

# coefficients of (1 - t) and t times 1, s and s^2, s = 2 t - 1, in the basis (1 - t)^3, 3 (1 - t)^2 t, 3 (1 - t) t^2,
# t^3: shape (4, ends, powers)
_TIMES = np.array(
    [
        [[1.0, -1.0, 1.0], [0.0, 0.0, 0.0]],
        [[2.0 / 3.0, 0.0, -2.0 / 3.0], [1.0 / 3.0, -1.0 / 3.0, 1.0 / 3.0]],
        [[1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0], [2.0 / 3.0, 0.0, -2.0 / 3.0]],
        [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]],
    ]
)


def corners_of(count: int) -> Array:
    """Return the vertices of the box from -1 to 1 in each number, shape (2^n, n)."""
    return np.array(list(itertools.product((-1.0, 1.0), repeat=count))).reshape(-1, count)


@lru_cache(maxsize=8)
def mixed(count: int) -> Array:
    """Return the map from quadratics by (1, s, s s') at vertices to coefficients of their multilinear mixture.

    Its shape is (4^n, 2^n, 1 + n + n^2), and the coefficients are those of Bernstein polynomials.
    """
    unit = np.eye(count, dtype=int)
    powers = [np.zeros(count, dtype=int), *unit, *(first + second for first in unit for second in unit)]
    weights = np.ones((4,) * count + (2,) * count + (len(powers),))
    for j in range(count):
        shape = np.ones(2 * count + 1, dtype=int)
        shape[j], shape[count + j], shape[-1] = 4, 2, len(powers)
        weights = weights * np.stack([_TIMES[:, :, power[j]] for power in powers], axis=-1).reshape(shape)
    return weights.reshape(4**count, 2**count, len(powers))


@lru_cache(maxsize=8)
def coefficients(count: int) -> Array:
    """Return the map from one quadratic by (1, s, s s') to Bernstein coefficients, shape (4^n, 1 + n + n^2)."""
    return np.asarray(mixed(count).sum(axis=1))
