"""A box of throws as mixtures of a few angles of every arc: the program that proposes multipliers (S27)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.machine.firing_windows import FiringWindow
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import NORMS, Grid
from laufruhe.problem.decision import Decision, domains_of
from laufruhe.problem.sets import Interval
from laufruhe.solvers.throws.riders import BoxColumns

# angles of an arc that a program mixes, by how many angles are open beside throws, at most of these and of throws; and
# how far two of them may be for the highest order that is told apart [rad]
_FEWEST, _MOST_SHARED, _MOST, _APART = 3, (1, 5, 3), (12, 6, 5), 0.6
# of the heaviest order, that one counts for nothing in how many angles an arc needs
_FAINT = 0.02


@dataclass(frozen=True, eq=False)
class Program:
    """Norms of one firing window, rows affine in unbalances, waves of the throws, and the throws.

    Attributes
    ----------
    rows
        Columns: those of unbalances, then of every throw the cosines and sines of all waves and theta, then the angles
        that are open beside throws.
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
    """Throws of a box as mixtures of a few angles: the program that proposes multipliers.

    Angles that are open beside throws are mixed first, and for each of theirs every throw by itself.
    """

    def __init__(self, program: Program, columns: BoxColumns, lower: Array, upper: Array, orders: Array) -> None:
        self.unbalances, self._orders = columns.matrix.shape[1], orders
        throws, beside = len(program.weights), orders.shape[1] - 1
        rows, self._weights = program.heavy, program.weights[:, : len(orders)]
        heavy = self._weights > _FAINT * self._weights.max()
        width, most = upper - lower, (_MOST[beside],) * throws + (_MOST_SHARED[beside],) * beside
        told = [
            *(np.where(own, orders[:, 0], 0.0) for own in heavy),
            *np.where(heavy.any(axis=0), orders[:, 1:].T, 0.0),
        ]
        steps = [
            min(max(math.ceil(float(np.abs(own).max(initial=0.0)) * wide / _APART) + 1, _FEWEST), limit)
            if wide > 0.0
            else 1
            for own, wide, limit in zip(told, width, most, strict=True)
        ]
        every = [np.linspace(a, b, n) for a, b, n in zip(lower, upper, steps, strict=True)]
        self.angles, shared = every[:throws], list(product(*every[throws:]))
        self.shared = np.array(shared).reshape(len(shared), beside)
        places = np.concatenate([[0], np.cumsum([len(shared) - 1, *(len(shared) * (n - 1) for n in steps[:throws])])])
        self._places, self.size = self.unbalances + places, int(self.unbalances + places[-1])
        points = [self._points(own) for own in self.angles]
        extra = tuple((most, _widened(norm, self.size)) for most, norm in columns.limits)
        shares = [Decision(f"share {k}", "", Interval(0.0, 1.0), 0.0, ()) for k in range(self.size - self.unbalances)]
        self.problem = AffineProblem(
            tuple((weight, self._through(norm, columns.matrix, points)) for weight, norm in rows.terms),
            (
                *((most, self._through(norm, columns.matrix, points)) for most, norm in rows.limits),
                *extra,
                *self._ties(),
            ),
            domains_of([*(domain.decision for domain in columns.domains), *shares]),
            1,
        )

    def _points(self, own: Array) -> Array:
        """Waves and angles of a throw where it is mixed, shape (shared, angles, columns)."""
        turned = np.add.outer(self.shared @ self._orders[:, 1:].T, np.zeros(len(own))).swapaxes(1, 2)
        turned = turned + np.outer(own, self._orders[:, 0])
        at = np.broadcast_to(own[None, :, None], (*turned.shape[:2], 1))
        return np.concatenate([np.cos(turned), np.sin(turned), at], axis=2)

    def _ties(self) -> list[tuple[float, AffineNorm]]:
        """Shares of shared angles are no more than one, and those of a throw no more than that of its shared angles."""
        count, first = len(self.shared), self._places[0]
        slopes, constants = [np.zeros((0, self.size))], [np.zeros(0)]
        if count > 1:
            slopes.append(np.zeros((1, self.size)))
            slopes[-1][0, first : first + count - 1] = -1.0
            constants.append(np.ones(1))
        for at, own in zip(self._places[1:], self.angles, strict=False):
            if len(own) == 1:
                continue
            slope = np.zeros((count, self.size))
            slope[0, first : first + count - 1] = -1.0
            slope[np.arange(1, count), first + np.arange(count - 1)] = 1.0
            for b in range(count):
                slope[b, at + b * (len(own) - 1) : at + (b + 1) * (len(own) - 1)] = -1.0
            slopes.append(slope)
            constants.append(np.arange(count) == 0)
        slope, constant = np.concatenate(slopes), np.concatenate(constants)
        if not len(slope):
            return []
        # each is left between 0 and 1, counted from the middle
        grid = Grid(np.ones(len(slope)), len(slope))
        return [(0.5, AffineNorm(NORMS["maximum"], constant[:, None] - 0.5, slope[:, None], grid))]

    def middle(self, x: Array) -> tuple[Array, Array]:
        """Mean angle of every mixture [rad], and how far it is from standing there."""
        count, first = len(self.shared), self._places[0]
        shares = x[first : first + count - 1]
        shares = np.concatenate([[1.0 - shares.sum()], shares])
        mean = shares @ self.shared
        turned = np.exp(1j * self.shared @ self._orders[:, 1:].T)
        middle, spread, alone = [], [], np.zeros((self.shared.shape[1], len(self._orders)))
        for s in range(len(mean)):
            own = np.exp(1j * np.outer(self.shared[:, s], self._orders[:, 1 + s]))
            alone[s] = np.abs(shares @ own - np.exp(1j * mean[s] * self._orders[:, 1 + s]))
        for at, own, weights in zip(self._places[1:], self.angles, self._weights, strict=False):
            each = x[at : at + count * (len(own) - 1)].reshape(count, len(own) - 1)
            each = np.concatenate([(shares - each.sum(axis=1))[:, None], each], axis=1)
            at_mean = float((each @ own).sum())
            waves = np.exp(1j * np.outer(own, self._orders[:, 0]))
            apart = ((each @ waves) * turned).sum(axis=0) - (shares @ turned) * np.exp(
                1j * self._orders[:, 0] * at_mean
            )
            middle.append(at_mean)
            spread.append(float(np.linalg.norm(weights * np.abs(apart))))
        beside = [float(np.linalg.norm(self._weights * each)) for each in alone]
        return np.array([*middle, *mean]), np.array([*spread, *beside])

    def _through(self, norm: AffineNorm, matrix: Array, points: Sequence[Array]) -> AffineNorm:
        """A norm of rows in the columns of a box, and in shares of what is mixed."""
        k, d, n = norm.slope.shape
        flat, at = norm.slope.reshape(k * d, n), len(matrix)
        beside = flat[:, n - self.shared.shape[1] :] @ self.shared.T
        slopes = []
        for own in points:
            values = (flat[:, at : at + own.shape[2]] @ own.reshape(-1, own.shape[2]).T).reshape(k * d, *own.shape[:2])
            at += own.shape[2]
            beside += values[:, :, 0]
            slopes.append((values[:, :, 1:] - values[:, :, :1]).reshape(k * d, -1))
        constant = norm.constant.ravel() + beside[:, 0]
        slope = np.concatenate([flat[:, : len(matrix)] @ matrix, beside[:, 1:] - beside[:, :1], *slopes], axis=1)
        return AffineNorm(norm.norm, constant.reshape(k, d), slope.reshape(k, d, -1), norm.grid)


def _widened(norm: AffineNorm, columns: int) -> AffineNorm:
    slope = np.zeros((*norm.constant.shape, columns))
    slope[..., : norm.slope.shape[-1]] = norm.slope
    return replace(norm, slope=slope)
