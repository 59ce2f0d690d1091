"""Least sum of squares of mount forces or travel on a box of stiffnesses, by a semidefinite relaxation (E43-E45).

Of every order a moment matrix M stands for (1, v)(1, v)', v the forces of the open springs (E42). The stiffnesses s
themselves are shared by all orders. Where a matrix P(s), linear in s, is nowhere indefinite, so is

    [1 V]' P(s) [1 V],    V = [Re y, Im y]                                              (E43)

and where P y is affine in v this is linear in s and M. P = 1 + s_i and 1 - s_i with y = u_i holds each spring between
its bounds; P = A(s) - L and U - A(s) are limits of stiffness. A solver proposes multipliers; the bound is what follows
from them by linear algebra (E44).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laufruhe.prove.quadratics import answered, column, triangle
from laufruhe.prove.spring_lines import Response, Springs

Array = NDArray[np.float64]

_SETTINGS = {"verbose": False, "tol_gap_rel": 1e-5, "tol_gap_abs": 1e-6, "tol_feas": 1e-7, "max_threads": 1}
# shifts that make a matrix convex, in parts of its largest eigenvalue
_SHIFTS = np.concatenate([[0.0], 10.0 ** np.arange(-14.0, 0.1, 0.25)])
_FLAT = 1e-13


@dataclass(frozen=True, eq=False)
class Limited:
    """P(s) = given + sum s_j slopes_j, nowhere indefinite for a design allowed, shapes (p, p) and (n, p, p)."""

    given: Array
    slopes: Array


@dataclass(frozen=True, eq=False)
class Held:
    """E43 of one order: a matrix that is linear in s and M, and must not be indefinite.

    Attributes
    ----------
    order
        Number of the order.
    limited
        P.
    moments
        What of M is in every entry, shape (p + 2, p + 2, d, d).
    """

    order: int
    limited: Limited
    moments: Array

    @property
    def size(self) -> int:
        """Rows."""
        return len(self.moments)

    def constant(self) -> Array:
        """What is neither in s nor in M, shape (p + 2, p + 2)."""
        return _bordered(self.limited.given)

    def slopes(self) -> Array:
        """By s, shape (n, p + 2, p + 2)."""
        return _bordered(self.limited.slopes)


def held(order: int, limited: Limited, seen: Array, pressed: Array) -> Held:
    """E43 from y and P y as functions of (1, v), shapes (2, p, d)."""
    p, d = seen.shape[1:]
    moments = np.zeros((p + 2, p + 2, d, d))
    for k in range(2):
        moments[:p, p + k, 0] += 0.5 * pressed[k]
        moments[:p, p + k, :, 0] += 0.5 * pressed[k]
        moments[p + k, :p] = moments[:p, p + k]
        for other in range(2):
            twice = seen[k].T @ pressed[other] + seen[other].T @ pressed[k]
            moments[p + k, p + other] = 0.25 * (twice + twice.T)
    return Held(order, limited, moments)


def spring_sides(order: int, springs: Springs, at: Response, numbers: int) -> list[Held]:
    """Every spring between its bounds."""
    found = []
    for i, j in enumerate(springs.decisions):
        seen = springs.arms[i : i + 1] @ at.motion
        share = at.shares[:, i : i + 1]
        size = float(np.abs(seen).max()) or 1.0
        for side in (1.0, -1.0):
            slopes = np.zeros((numbers, 1, 1))
            slopes[j] = side
            found.append(held(order, Limited(np.eye(1), slopes), seen / size, (seen + side * share) / size))
    return found


def stiffness_limit(order: int, springs: Springs, at: Response, limited: Limited, sign: float) -> Held:
    """A limit of stiffness, P = sign (A - L), with P y in the forces of the springs."""
    bent = np.einsum("ia,cid->cad", springs.arms * at.added[:, None], at.shares)
    return held(order, limited, at.motion, limited.given @ at.motion + sign * bent)


@dataclass(frozen=True, eq=False)
class Relaxed:
    """What came of a relaxation.

    Attributes
    ----------
    bound
        The sum of squares of no design of the box is under it.
    middle
        s of the relaxation, shape (n,).
    """

    bound: float
    middle: Array


def least_squares(
    orders: Sequence[tuple[float, Response]], limits: Sequence[Held], numbers: int, unit: float
) -> Relaxed:
    """Bound of sum w |felt|^2 over a box (E44).

    Parameters
    ----------
    orders
        w of every order, and its response.
    limits
        E43 of all orders.
    numbers
        Open numbers.
    unit
        What the sum is about [its own unit].
    """
    squares = [(w / unit) * np.einsum("cri,crj->ij", at.felt, at.felt) for w, at in orders]
    multipliers, middle = _proposed(squares, limits, numbers)
    bound = _follows(squares, [at.reach for _, at in orders], limits, multipliers, numbers)
    return Relaxed(max(unit * bound, 0.0), middle)


def _follows(
    squares: Sequence[Array],
    reaches: Sequence[float],
    limits: Sequence[Held],
    multipliers: Sequence[Array],
    numbers: int,
) -> float:
    """What multipliers prove: the least value of the sum less all that they price (E44)."""
    left, slopes, bound = [square.copy() for square in squares], np.zeros(numbers), 0.0
    for limit, found in zip(limits, multipliers, strict=True):
        values, vectors = np.linalg.eigh(found)
        price = (vectors * np.maximum(values, 0.0)) @ vectors.T
        bound -= float(np.sum(price * limit.constant()))
        slopes -= np.einsum("ab,nab->n", price, limit.slopes())
        left[limit.order] -= np.einsum("ab,abij->ij", price, limit.moments)
    return bound - float(np.abs(slopes).sum()) + sum(_least(m, r) for m, r in zip(left, reaches, strict=True))


def _least(matrix: Array, reach: float) -> float:
    """Least of (1, v) matrix (1, v)' over |v|^2 at most `reach`: a shift that makes it convex takes its share off."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T)[1:, 1:])
    along = (vectors.T @ (0.5 * (matrix + matrix.T))[1:, 0]) ** 2
    top, best = float(np.abs(values).max(initial=0.0)), -math.inf
    for shift in _SHIFTS * top:
        if values[0] + shift > _FLAT * top and (shift == 0.0 or reach < math.inf):
            lost = shift * reach if shift else 0.0
            best = max(best, float(matrix[0, 0] - np.sum(along / (values + shift))) - lost)
    return best


def _proposed(squares: Sequence[Array], limits: Sequence[Held], numbers: int) -> tuple[list[Array], Array]:
    """Multipliers of every limit, and s; whatever the solver says of them."""
    import clarabel
    from scipy.sparse import coo_array, csc_array, vstack

    ends = np.cumsum([numbers, *(len(triangle(len(square))[0]) for square in squares)])
    ones = coo_array((np.ones(len(squares)), (np.arange(len(squares)), ends[:-1])), shape=(len(squares), ends[-1]))
    sides = coo_array((np.ones(numbers), (np.arange(numbers),) * 2), shape=(numbers, ends[-1]))
    moments = coo_array(
        (-np.ones(ends[-1] - numbers), (np.arange(ends[-1] - numbers), np.arange(numbers, ends[-1]))),
        shape=(ends[-1] - numbers, ends[-1]),
    )
    rows, right = [ones, sides, -sides, moments], [np.ones(len(squares) + 2 * numbers), np.zeros(ends[-1] - numbers)]
    cones = [clarabel.ZeroConeT(len(squares)), clarabel.NonnegativeConeT(2 * numbers)]
    cones += [clarabel.PSDTriangleConeT(len(square)) for square in squares]
    for limit in limits:
        i, j, factor = triangle(limit.size)
        own = -column(limit.moments[i, j]) * factor[:, None]
        shared = -column(limit.slopes()).T
        columns = np.concatenate([np.arange(numbers), np.arange(*ends[limit.order : limit.order + 2])])
        block = np.concatenate([shared, own], axis=1)
        grid = np.broadcast_to(np.arange(len(i))[:, None], block.shape), np.broadcast_to(columns, block.shape)
        rows.append(coo_array((block.ravel(), tuple(g.ravel() for g in grid)), shape=(len(i), ends[-1])))
        right.append(column(limit.constant()))
        cones.append(clarabel.PSDTriangleConeT(limit.size))
    cost = np.concatenate([np.zeros(numbers), *map(column, squares)])
    found = answered(cost, csc_array(vstack(rows)), np.concatenate(right), cones, _SETTINGS)
    return _of_limits(np.nan_to_num(np.array(found.z)), limits), np.clip(np.nan_to_num(found.x[:numbers]), -1.0, 1.0)


def _of_limits(found: Array, limits: Sequence[Held]) -> list[Array]:
    """The multipliers of the limits, that come last."""
    lengths = [len(triangle(limit.size)[0]) for limit in limits]
    parts = np.split(found[len(found) - sum(lengths) :], np.cumsum(lengths)[:-1])
    out = []
    for part, limit in zip(parts, limits, strict=True):
        i, j, factor = triangle(limit.size)
        matrix = np.zeros((limit.size, limit.size))
        matrix[i, j] = matrix[j, i] = part / factor
        out.append(matrix)
    return out


def _bordered(matrices: Array) -> Array:
    """Two rows and columns of zeros more."""
    return np.pad(matrices, [(0, 0)] * (matrices.ndim - 2) + [(0, 2)] * 2)
