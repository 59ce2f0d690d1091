"""Smallest enclosing balls of many sets of points at once."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np

from laufruhe.numerics.arrays import Array, Indices

SAME = 1e-13
"""Share of a radius by which a point may stand outside a ball that holds it."""
# what is added to products of points that coincide or lie in a line: a share of squares, and where these vanish
_FLAT, _NOTHING = 1e-15, 1e-290


@dataclass(frozen=True, eq=False)
class EnclosingBalls:
    """Smallest enclosing ball of each set.

    Attributes
    ----------
    radii
        Shape (sets,).
    centres
        Shape (sets, d).
    inside
        Points that hold a ball, some of them more than once, shape (sets, d + 1).
    shares
        Of these in the centre, shape (sets, d + 1); none is negative, and they add up to one.
    """

    radii: Array
    centres: Array
    inside: Indices
    shares: Array


def enclosing_balls(points: Array) -> EnclosingBalls:
    """Return the smallest enclosing balls of points, shape (sets, k, d).

    The farthest point joins those that hold a ball, and the ball of these few is found by trying every choice of them
    that has it. Radii grow with every round, so it ends.
    """
    sets, count, d = points.shape
    units = np.abs(points).max(axis=(1, 2), initial=0.0)
    scaled = points / np.where(units > 0.0, units, 1.0)[:, None, None]
    every = np.arange(sets)
    radii, shares = np.zeros(sets), np.zeros((sets, d + 1))
    shares[:, 0] = 1.0
    middle = 0.5 * (scaled.min(axis=1) + scaled.max(axis=1))
    inside = np.repeat(_squares(scaled, middle).argmax(axis=1)[:, None], d + 1, axis=1)
    centres = scaled[every, inside[:, 0]]
    left = every
    for _ in range(count):
        far = _squares(scaled[left], centres[left])
        farthest = far.argmax(axis=1)
        outside = np.sqrt(far[np.arange(len(left)), farthest]) > radii[left] * (1.0 + SAME)
        more = outside & (inside[left] != farthest[:, None]).all(axis=1)
        left, farthest = left[more], farthest[more]
        if not len(left):
            break
        few = np.concatenate([inside[left], farthest[:, None]], axis=1)
        chosen, radii[left], centres[left], shares[left] = _of_few(scaled[left[:, None], few])
        inside[left] = np.take_along_axis(few, chosen, axis=1)
    return EnclosingBalls(radii * units, centres * units[:, None], inside, shares)


def _squares(points: Array, centres: Array) -> Array:
    away = points - centres[:, None]
    return np.asarray(np.einsum("skd,skd->sk", away, away))


def _of_few(points: Array) -> tuple[Indices, Array, Array, Array]:
    """Return the ball of d + 2 points, the last of which is outside the ball of the others and so on its surface.

    Of the centres between some of them it is the one from which the farthest is nearest.
    """
    sets, count, d = points.shape
    chosen, shares = np.full((sets, d + 1), count - 1), np.zeros((sets, d + 1))
    radii, centres, left = np.full(sets, np.inf), np.zeros((sets, d)), np.arange(sets)
    done = np.zeros(sets, dtype=bool)
    for size in range(2, d + 2):
        choices = _choices(count, size)
        given = points[left]
        corners = given[:, choices]
        parts = np.maximum(_centre_shares(corners), 0.0)
        parts /= parts.sum(axis=2, keepdims=True)
        middles = np.einsum("sck,sckd->scd", parts, corners)
        away = given[:, None] - middles[:, :, None]
        apart = np.sqrt(np.einsum("sckd,sckd->sck", away, away))
        outside = apart.max(axis=2)
        best = outside.argmin(axis=1)
        row = np.arange(len(left))
        better = outside[row, best] < radii[left]
        now, best, row = left[better], best[better], row[better]
        radii[now], centres[now] = outside[row, best], middles[row, best]
        shares[now], chosen[now] = 0.0, count - 1
        shares[now, :size], chosen[now, :size] = parts[row, best], choices[best]
        # a ball whose own points are as far as any is the smallest
        own = apart[row[:, None], best[:, None], choices[best]].min(axis=1)
        done[now] = outside[row, best] <= own * (1.0 + SAME)
        left = np.flatnonzero(~done)
        if not len(left):
            break
    return chosen, radii, centres, shares


@cache
def _choices(count: int, size: int) -> Indices:
    choices = [(*first, count - 1) for first in itertools.combinations(range(count - 1), size - 1)]
    return np.array(choices)


def _centre_shares(points: Array) -> Array:
    apart = points[..., 1:, :] - points[..., :1, :]
    products = apart @ apart.swapaxes(-1, -2)
    squares = np.einsum("...kk->...k", products).copy()
    size = apart.shape[-2]
    products += (_FLAT * squares.sum(axis=-1) + _NOTHING)[..., None, None] * np.eye(size)
    shares = 0.5 * np.linalg.solve(products, squares[..., None])[..., 0]
    return np.concatenate([1.0 - shares.sum(axis=-1, keepdims=True), shares], axis=-1)
