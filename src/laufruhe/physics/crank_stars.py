"""Crank stars by the numbers that fix their balance: force and couple of every order (S1, S2).

A star puts every throw on one of P equal steps of a turn. Of identical throws it fixes
everything that inertia does to the block by two complex numbers an order,

    F_h = sum_k e^{i h theta_k}        C_h = sum_k x_k e^{i h theta_k},

so millions of stars are compared without a load being computed.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.turns import phasors

Stars = NDArray[np.uint8]

# rows of a table of joined throws: small enough for the second-level cache
_TABLE_ROWS = 300
_CHUNK = 1 << 15


def star_sums(stars: Stars, phases: int, places: Sequence[float], orders: Sequence[int]) -> NDArray[np.complex128]:
    """Return F_h and C_h of many stars (S1).

    Parameters
    ----------
    stars
        Shape (n, throws): step of every throw, 0 to phases - 1.
    phases
        Steps P that a turn is divided into.
    places
        Of the throws along x [any length].
    orders
        Orders h.

    Returns
    -------
    Shape (n, orders, 2): F_h, and C_h in the unit of the places.
    """
    tables, groups = _joined_tables(phases, places, orders)
    out = np.empty((len(stars), 4 * len(orders)))
    for start in range(0, len(stars), _CHUNK):
        block = stars[start : start + _CHUNK]
        total = out[start : start + _CHUNK]
        for number, (table, group) in enumerate(zip(tables, groups, strict=True)):
            index = block[:, group[0]].astype(np.intp)
            for column in group[1:]:
                index *= phases
                index += block[:, column]
            if number == 0:
                np.take(table, index, axis=0, out=total)
            else:
                total += table[index]
    return out.view(complex).reshape(len(stars), len(orders), 2)


def phase_waves(phases: int, orders: Sequence[int]) -> NDArray[np.complex128]:
    """Return e^{i h theta} of every step, shape (orders, phases), with the symmetries of the circle."""
    return phasors([Fraction(p, phases) for p in range(phases)], np.array(orders, dtype=np.int64))


def _joined_tables(
    phases: int, places: Sequence[float], orders: Sequence[int]
) -> tuple[list[Array], list[tuple[int, ...]]]:
    """Return tables of contributions of groups of throws, one row for each of their joint steps."""
    waves = phase_waves(phases, orders).T
    single = [np.stack([waves, x * waves], axis=-1).reshape(phases, -1).view(float) for x in places]
    width = 1
    while width < len(places) and phases ** (width + 1) <= _TABLE_ROWS:
        width += 1
    groups = [tuple(range(k, min(k + width, len(places)))) for k in range(0, len(places), width)]
    tables = []
    for group in groups:
        table = single[group[0]]
        for k in group[1:]:
            table = (table[:, None, :] + single[k][None, :, :]).reshape(len(table) * phases, -1)
        tables.append(np.ascontiguousarray(table))
    return tables, groups


def images(stars: Stars, phases: int, mirror: bool, reflect: bool) -> list[Stars]:
    """Return a star and its equals: front and back swapped, and turned the other way round (S2).

    Every image is turned so that its first throw stands at step 0.
    """
    whole = np.asarray(stars, dtype=np.int16)
    out = [whole]
    if mirror:
        out.append(whole[:, ::-1])
    if reflect:
        out += [-image for image in out]
    return [((image - image[:, :1]) % phases).astype(np.uint8) for image in out]


def canonical(stars: Stars, phases: int, mirror: bool, reflect: bool) -> Stars:
    """Return the first in dictionary order among a star's images, shape (n, throws) (S2)."""
    best, *others = images(stars, phases, mirror, reflect)
    for other in others:
        differs = best != other
        first = np.argmax(differs, axis=1)
        rows = np.arange(len(best))
        smaller = differs.any(axis=1) & (other[rows, first] < best[rows, first])
        best = np.where(smaller[:, None], other, best)
    return best
