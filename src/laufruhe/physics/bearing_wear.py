"""Wear of a main bearing by the load of a cycle (B10)."""

from __future__ import annotations

import math

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray

SIDES = math.radians(60.0)
"""A load wears its bearing this far to either side."""


def wear_of(path: ComplexArray, angles: Array) -> Array:
    """Return the load of every direction over the cycle as a share of the largest (B10).

    Parameters
    ----------
    path
        Force on the bearing at equal steps of the cycle [N], shape (n,), in the plane across the crank axis (C4).
    angles
        Directions [rad], shape (k,).

    Returns
    -------
    Shares from 0 to 1, shape (k,); zero where nothing loads the bearing.
    """
    apart = np.abs(np.angle(np.exp(1j * (np.angle(path)[:, None] - angles))))
    total = (np.abs(path)[:, None] * (apart <= SIDES)).sum(axis=0)
    return np.asarray(total / (total.max() or 1.0))
