"""Smallest enclosing balls of many sets of points at once."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np

from laufruhe.numerics.arrays import Array, Indices

SAME = 1e-13
"""Relative tolerance of a radius within which a point counts as inside."""
# regularisation of the linear system for points that coincide or are collinear: relative, and absolute
_FLAT, _TINY = 1e-15, 1e-290


@dataclass(frozen=True, eq=False)
class EnclosingBalls:
    """Smallest enclosing ball of each of several sets of points in d dimensions.

    Attributes
    ----------
    radii
        Radius of each ball, shape (sets,).
    centres
        Centre of each ball, shape (sets, d).
    support
        Indices of the support points of each ball, shape (sets, d + 1); fewer than d + 1 points are repeated.
    shares
        Weights of the support points whose mean is the centre, shape (sets, d + 1); not negative, with sum one.
    """

    radii: Array
    centres: Array
    support: Indices
    shares: Array


def enclosing_balls(points: Array) -> EnclosingBalls:
    """Return the smallest enclosing balls of sets of points, shape (sets, k, d).

    Each round adds the point farthest from the centre to the support points and takes the smallest ball of these, by
    enumeration. Radii grow with every round, so the loop ends.
    """
    sets, count, d = points.shape
    units = np.abs(points).max(axis=(1, 2), initial=0.0)
    scaled = points / np.where(units > 0.0, units, 1.0)[:, None, None]
    all_sets = np.arange(sets)
    radii, shares = np.zeros(sets), np.zeros((sets, d + 1))
    shares[:, 0] = 1.0
    middle = 0.5 * (scaled.min(axis=1) + scaled.max(axis=1))
    support = np.repeat(_squares(scaled, middle).argmax(axis=1)[:, None], d + 1, axis=1)
    centres = scaled[all_sets, support[:, 0]]
    active = all_sets
    for _ in range(count):
        squares = _squares(scaled[active], centres[active])
        farthest = squares.argmax(axis=1)
        outside = np.sqrt(squares[np.arange(len(active)), farthest]) > radii[active] * (1.0 + SAME)
        unsolved = outside & (support[active] != farthest[:, None]).all(axis=1)
        active, farthest = active[unsolved], farthest[unsolved]
        if not len(active):
            break
        candidates = np.concatenate([support[active], farthest[:, None]], axis=1)
        selection, radii[active], centres[active], shares[active] = _ball_of_candidates(
            scaled[active[:, None], candidates]
        )
        support[active] = np.take_along_axis(candidates, selection, axis=1)
    return EnclosingBalls(radii * units, centres * units[:, None], support, shares)


def _squares(points: Array, centres: Array) -> Array:
    offsets = points - centres[:, None]
    return np.asarray(np.einsum("skd,skd->sk", offsets, offsets))


def _ball_of_candidates(points: Array) -> tuple[Indices, Array, Array, Array]:
    """Return support indices, radii, centres and weights of the balls of d + 2 points, shape (sets, d + 2, d).

    The last point lies outside the ball of the others, so it is a support point. Among the circumcentres of all subsets
    with it, the centre is the one whose farthest point is nearest.
    """
    sets, count, d = points.shape
    support, shares = np.full((sets, d + 1), count - 1), np.zeros((sets, d + 1))
    radii, centres, active = np.full(sets, np.inf), np.zeros((sets, d)), np.arange(sets)
    done = np.zeros(sets, dtype=bool)
    for size in range(2, d + 2):
        choices = _choices(count, size)
        remaining = points[active]
        corners = remaining[:, choices]
        parts = np.maximum(_centre_shares(corners), 0.0)
        parts /= parts.sum(axis=2, keepdims=True)
        middles = np.einsum("sck,sckd->scd", parts, corners)
        offsets = remaining[:, None] - middles[:, :, None]
        distances = np.sqrt(np.einsum("sckd,sckd->sck", offsets, offsets))
        farthest = distances.max(axis=2)
        best = farthest.argmin(axis=1)
        row = np.arange(len(active))
        better = farthest[row, best] < radii[active]
        improved, best, row = active[better], best[better], row[better]
        radii[improved], centres[improved] = farthest[row, best], middles[row, best]
        shares[improved], support[improved] = 0.0, count - 1
        shares[improved, :size], support[improved, :size] = parts[row, best], choices[best]
        # a ball whose support points are as far as any point is the smallest
        support_distance = distances[row[:, None], best[:, None], choices[best]].min(axis=1)
        done[improved] = farthest[row, best] <= support_distance * (1.0 + SAME)
        active = np.flatnonzero(~done)
        if not len(active):
            break
    return support, radii, centres, shares


@cache
def _choices(count: int, size: int) -> Indices:
    choices = [(*first, count - 1) for first in itertools.combinations(range(count - 1), size - 1)]
    return np.array(choices)


def _centre_shares(points: Array) -> Array:
    edges = points[..., 1:, :] - points[..., :1, :]
    products = edges @ edges.swapaxes(-1, -2)
    squares = np.einsum("...kk->...k", products).copy()
    size = edges.shape[-2]
    products += (_FLAT * squares.sum(axis=-1) + _TINY)[..., None, None] * np.eye(size)
    shares = 0.5 * np.linalg.solve(products, squares[..., None])[..., 0]
    return np.concatenate([1.0 - shares.sum(axis=-1, keepdims=True), shares], axis=-1)
