"""Distribution of a load to the main bearings: crankshaft cut in its journals, or one beam (B4, B6)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Bearing, Shaft
from laufruhe.numerics.arrays import Array


@lru_cache(maxsize=256)
def shares_of(bearings: tuple[Bearing, ...], places: tuple[tuple[Shaft, float], ...], crankshaft: str) -> Array:
    """Return the share of a load at each place that each bearing carries, shape (bearings, places) (B4, B6)."""
    shares = np.zeros((len(bearings), len(places)))
    for shaft in dict.fromkeys(bearing.shaft for bearing in bearings):
        rows = [k for k, bearing in enumerate(bearings) if bearing.shaft == shaft]
        columns = [k for k, (on, _) in enumerate(places) if on == shaft]
        found = SHARES[crankshaft]([bearings[k].x for k in rows], [places[k][1] for k in columns])
        shares[np.ix_(rows, columns)] = found
    shares.setflags(write=False)
    return shares


def lever_shares(bearings: Sequence[float], places: Sequence[float]) -> Array:
    """Return the shares by the lever rule, shape (bearings, places) (B4).

    A load beside all bearings hangs over: the two nearest carry it, the far one upwards.
    """
    order = np.argsort(bearings)
    x = np.asarray(bearings, dtype=float)[order]
    shares = np.zeros((len(x), len(places)))
    if not len(places):
        return shares
    if len(x) < 2:
        raise ModelError("a shaft that is loaded needs two main bearings at least; add one")
    columns = np.arange(len(places))
    first = np.clip(np.searchsorted(x, places, side="right") - 1, 0, len(x) - 2)
    far = (np.asarray(places) - x[first]) / (x[first + 1] - x[first])
    shares[first, columns], shares[first + 1, columns] = 1.0 - far, far
    return shares[np.argsort(order)]


def beam_shares(bearings: Sequence[float], places: Sequence[float]) -> Array:
    """Return the shares of a continuous uniform beam on rigid supports, as `lever_shares` (B6).

    Bending between bearings and loads is a cubic exactly, so that a beam element each is exact.
    """
    shares = lever_shares(bearings, places)
    if len(bearings) == 2:
        return shares
    x = np.unique([*bearings, *places])
    stiffness = np.zeros((2 * len(x), 2 * len(x)))
    for k, length in enumerate(np.diff(x) / np.ptp(x)):
        a, b, c = 12.0 / length**3, 6.0 / length**2, 2.0 / length
        element = [[a, b, -a, b], [b, 2 * c, -b, c], [-a, -b, a, -b], [b, c, -b, 2 * c]]
        stiffness[2 * k : 2 * k + 4, 2 * k : 2 * k + 4] += element
    held, loaded = 2 * np.searchsorted(x, bearings), 2 * np.searchsorted(x, places)
    free = np.setdiff1d(np.arange(2 * len(x)), held)
    moved = np.zeros((2 * len(x), len(held)))
    moved[held, np.arange(len(held))] = 1.0
    # what a support carries of a load is how far the beam comes down there as that support does (Maxwell, Betti)
    moved[free] = -np.linalg.solve(stiffness[np.ix_(free, free)], stiffness[np.ix_(free, held)])
    return np.asarray(moved[loaded].T)


SHARES = {"cut": lever_shares, "beam": beam_shares}
