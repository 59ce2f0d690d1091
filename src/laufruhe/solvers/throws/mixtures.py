"""A box of throws as mixtures of a few angles of every arc: the program that proposes multipliers (S27)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.machine.firing_windows import FiringWindow
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import MEAN, Grid
from laufruhe.problem.decision import Decision, domains_of
from laufruhe.problem.sets import Interval
from laufruhe.solvers.throws.riders import BoxColumns

# angles of an arc that a program mixes, and how far two of them may be for the highest order that is told apart [rad]
_FEWEST, _MOST, _APART = 3, 12, 0.6
# of the heaviest order, that one counts for nothing in how many angles an arc needs
_FAINT = 0.02


@dataclass(frozen=True, eq=False)
class Program:
    """Norms of one firing window, rows affine in unbalances, waves of the throws, and the throws.

    Attributes
    ----------
    rows
        Columns: those of unbalances, then of every throw cos(h theta), sin(h theta) of all orders, and theta.
    heavy
        The same without the columns of orders that are next to nothing, for who proposes multipliers.
    names
        Of the limits; empty for the firing intervals.
    weights, pulls
        Of every throw's orders in objective and limits, shape (throws, orders), and of the columns of unbalances.
    """

    window: FiringWindow
    rows: AffineProblem
    heavy: AffineProblem
    names: tuple[str, ...]
    weights: Array
    pulls: Array


class Mixed:
    """Throws of a box as mixtures of a few angles: the program that proposes multipliers."""

    def __init__(self, program: Program, columns: BoxColumns, lower: Array, upper: Array, orders: Array) -> None:
        self.unbalances = columns.matrix.shape[1]
        rows = program.heavy
        self._weights, self._orders = program.weights[:, : len(orders)], orders
        heavy = self._weights > _FAINT * self._weights.max()
        self.angles = []
        for p, (low, high) in enumerate(zip(lower, upper, strict=True)):
            reach = float(np.where(heavy[p], orders, 0.0).max()) * (high - low)
            steps = min(max(math.ceil(reach / _APART) + 1, _FEWEST), _MOST) if high > low else 1
            self.angles.append(np.linspace(low, high, steps))
        mixed = sum(len(own) - 1 for own in self.angles)
        ties, at = [], self.unbalances
        for own in self.angles:
            last = at + len(own) - 1
            if last > at:
                slope = np.zeros((last - at, 1, self.unbalances + mixed))
                slope[np.arange(last - at), 0, np.arange(at, last)] = 1.0
                ties.append((1.0, AffineNorm(MEAN, np.zeros((last - at, 1)), slope, Grid(np.ones(last - at), 1))))
            at = last
        turned = [np.outer(orders, own) for own in self.angles]
        points = [np.concatenate([np.cos(t), np.sin(t), own[None]]) for t, own in zip(turned, self.angles, strict=True)]
        extra = tuple((most, _widened(norm, self.unbalances + mixed)) for most, norm in columns.limits)
        shares = [Decision(f"share {k}", "", Interval(0.0, 1.0), 0.0, ()) for k in range(mixed)]
        self.problem = AffineProblem(
            tuple((weight, _through(norm, columns.matrix, points)) for weight, norm in rows.terms),
            (*((most, _through(norm, columns.matrix, points)) for most, norm in rows.limits), *extra, *ties),
            domains_of([*(domain.decision for domain in columns.domains), *shares]),
            1,
        )

    def middle(self, x: Array) -> tuple[Array, Array]:
        """Mean angle of every mixture [rad], and how far it is from a throw that stands there."""
        at, middle, spread = self.unbalances, [], []
        for own, weights in zip(self.angles, self._weights, strict=True):
            shares = x[at : at + len(own) - 1]
            at += len(own) - 1
            shares = np.concatenate([[1.0 - shares.sum()], shares])
            mean = float(shares @ own)
            apart = np.exp(1j * np.outer(self._orders, own)) @ shares - np.exp(1j * self._orders * mean)
            middle.append(mean)
            spread.append(float(np.linalg.norm(weights * np.abs(apart))))
        return np.array(middle), np.array(spread)


def _through(norm: AffineNorm, matrix: Array, points: Sequence[Array]) -> AffineNorm:
    """A norm of rows in the columns of a box, and in shares of the points that every throw mixes."""
    k, d, n = norm.slope.shape
    flat, at = norm.slope.reshape(k * d, n), len(matrix)
    constant, slopes = norm.constant.ravel().copy(), [flat[:, :at] @ matrix]
    for own in points:
        values = flat[:, at : at + len(own)] @ own
        at += len(own)
        constant += values[:, 0]
        slopes.append(values[:, 1:] - values[:, :1])
    return AffineNorm(norm.norm, constant.reshape(k, d), np.concatenate(slopes, axis=1).reshape(k, d, -1), norm.grid)


def _widened(norm: AffineNorm, columns: int) -> AffineNorm:
    slope = np.zeros((*norm.constant.shape, columns))
    slope[..., : norm.slope.shape[-1]] = norm.slope
    return replace(norm, slope=slope)
