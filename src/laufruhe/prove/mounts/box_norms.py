"""Norms of mount forces and travel over boxes of stiffness, bounded from below by linear functions (E38)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array, Indices, Mask
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_response import BoxModel, Lines
from laufruhe.prove.mounts.box_series import Answer, Expansion


@dataclass(frozen=True, eq=False)
class Under:
    """value + slopes . s - rest is nowhere above a quantity, s from -1 to 1 in each (E38).

    Attributes
    ----------
    value, rest
        Shape (boxes,).
    slopes, bends
        And what each side adds to the rest, (boxes, n).
    """

    value: Array
    slopes: Array
    rest: Array
    bends: Array

    @property
    def least(self) -> Array:
        """Over every box."""
        return np.asarray(self.value - self.rest - np.abs(self.slopes).sum(axis=-1))

    def where(self, known: Mask) -> Under:
        """Of some boxes; of the others nothing is known, and a length is not under zero."""
        one, many = known, known[:, None]
        parts = zip((self.value, self.slopes, self.rest, self.bends), (one, many, one, many), strict=True)
        return Under(*(np.where(which, part, 0.0) for part, which in parts))

    def or_else(self, other: Under) -> Under:
        """Of every box that which has the larger least."""
        better = self.least >= other.least
        mine, its = self.where(better), other.where(~better)
        return Under(mine.value + its.value, mine.slopes + its.slopes, mine.rest + its.rest, mine.bends + its.bends)


def nothing_under(lower: Array) -> Under:
    """Where nothing is known of a length."""
    return Under(np.zeros(len(lower)), np.zeros_like(lower), np.zeros(len(lower)), np.zeros_like(lower))


@dataclass(frozen=True, eq=False)
class Sampled:
    """Orders of operating points in the samples of one period.

    Attributes
    ----------
    points
        Operating point, shape (n,).
    places, orders
        Multiple of the lowest order of the period, and of crank speed, shape (n,).
    samples
        Steps over the period.
    """

    points: Indices
    places: Indices
    orders: Array
    samples: int

    @classmethod
    def of(cls, model: BoxModel, lines: Lines) -> Sampled:
        """Return orders over the cycle."""
        base = model.problem.engine.cycle.base_order
        steps = np.array([int(loads.wrench.base / base) for loads in model.evaluation.loads], dtype=np.intp)
        return cls(lines.points, lines.places * steps[lines.points], lines.orders, model.evaluation.samples)

    @property
    def is_full(self) -> bool:
        """Tell if every order has more than two samples, so that sums over samples are those over the period."""
        return bool(2 * self.places.max(initial=0) < self.samples)

    def turns(self, own: NDArray[np.intp]) -> NDArray[np.complex128]:
        """Return a phase a sample and order, shape (samples, own); orders beyond half the samples fold."""
        apart = int(np.gcd.reduce(self.places[own])) or 1
        apart = apart if self.samples % apart == 0 else 1
        places, samples = self.places[own] // apart, self.samples // apart
        return np.asarray(np.exp(2j * math.pi / samples * (np.outer(np.arange(samples), places) % samples)))


def under(model: BoxModel, quantity: Measure, lines: Lines, at: Expansion) -> Under:
    """A linear function under a norm of forces or travel, for every box (E38)."""
    rows, factors = counted_rows(model.problem, quantity)
    answer = model.answer(lines, at, quantity.channel, rows, factors)
    return norm_under(model.problem, quantity, answer, Sampled.of(model, lines))


def norm_under(problem: Problem, quantity: Measure, answer: Answer, lines: Sampled) -> Under:
    """Return a linear function under a norm of what these orders answer, for every box (E38)."""
    share, weights = quantity.shares(problem.points), line_weights(problem, quantity, lines)
    if quantity.norm.is_euclidean:
        return root_under(answer, weights)
    points = [p for p in np.flatnonzero(share > 0.0) if np.any(lines.points == p)]
    found = [_sampled(quantity, answer, lines, int(p)) for p in points]
    if not found:
        return nothing_under(np.zeros((len(answer.slopes), answer.slopes.shape[2])))
    if not quantity.norm.sums_lengths:
        best = np.argmax([each.value for each in found], axis=0)
        pick = np.arange(len(best))
        parts = (np.array([getattr(each, part) for each in found]) for part in ("value", "slopes", "rest", "bends"))
        largest = Under(*(part[best, pick] for part in parts))
        # the largest length is not under the root mean square, nor the largest distance of two rows under that of all
        # distances, whose mean square is twice that of the rows about their mean
        squares = 2.0 * weights * (lines.orders > 0.0) if quantity.norm.is_diameter else weights
        return largest if quantity.norm.is_largest_mean else largest.or_else(root_under(answer, squares))
    value, slopes = (
        sum(share[p] * getattr(each, part) for p, each in zip(points, found, strict=True))
        for part in ("value", "slopes")
    )
    rest, bends = root_of(weights, answer.rest), root_of(weights, answer.bends)
    return Under(np.asarray(value), np.asarray(slopes), rest, bends)


def counted_rows(problem: Problem, quantity: Measure) -> tuple[NDArray[np.intp], Array]:
    """Rows of the mounts that count, and the factors on them."""
    chosen = quantity.places([mount.name for mount in problem.engine.mounts])
    rows = np.array([3 * k + axis for k in chosen for axis in range(3)], dtype=np.intp)
    return rows, np.tile(np.array(quantity.direction_weights or (1.0, 1.0, 1.0)), len(chosen))


def line_weights(problem: Problem, quantity: Measure, lines: Sampled | Lines) -> Array:
    """What the square of every order counts in a mean over the cycle, the mounts and the operating points."""
    chosen = quantity.places([mount.name for mount in problem.engine.mounts])
    share = quantity.shares(problem.points)
    return np.asarray(share[lines.points] * np.where(lines.orders > 0.0, 0.5, 1.0) / len(chosen))


def _sampled(quantity: Measure, answer: Answer, lines: Sampled, p: int) -> Under:
    """Mean, maximum or peak to peak over the samples of one period at one operating point."""
    own = np.flatnonzero(lines.points == p)
    value, slopes, rest, bends = answer.value[:, own], answer.slopes[:, own], answer.rest[:, own], answer.bends[:, own]
    turns = lines.turns(own)
    boxes, samples, mounts = len(value), len(turns), value.shape[-1] // 3
    # the three directions of all mounts one after the other, and real and imaginary parts as orders of their own
    waves = np.hstack([turns.real, -turns.imag])
    parts = value.reshape(boxes, len(own), mounts, 3).swapaxes(2, 3).reshape(boxes, len(own), -1)
    rows = np.matmul(waves, np.concatenate([parts.real, parts.imag], axis=1)).reshape(boxes, samples, 3, mounts)
    if quantity.norm.sums_lengths or quantity.norm.is_largest_mean:
        size = _lengths(rows)
        # a mean of lengths is not over their root mean square
        squares = np.where(lines.orders[own] > 0.0, 0.5, 1.0) / mounts
        rests = root_of(squares, rest), root_of(squares, bends)
        there, share = slopes.reshape(*slopes.shape[:3], mounts, 3), 1.0 / (samples * mounts)

        def paired(length: Array) -> Under:
            dual = rows / np.where(length > 0.0, length, 1.0)[:, :, None]
            duals = np.matmul(waves.T, dual.reshape(boxes, samples, -1)).reshape(boxes, 2, len(own), 3, mounts)
            slope = np.einsum("bkxm,bknmx->bn", duals[:, 0], there.real)
            slope = share * (slope + np.einsum("bkxm,bknmx->bn", duals[:, 1], there.imag))
            value = share * (size**2 / np.where(length > 0.0, length, 1.0)).sum(axis=(1, 2))
            return Under(value, slope, *rests)

        # where squares are least the rows have no slope, and their directions may have one
        most = np.broadcast_to(size.max(axis=(1, 2), keepdims=True), size.shape)
        return paired(size).or_else(paired(most))
    # a signal reaches as far as its longest row; of a peak to peak as its row farthest from another
    box, first, times = np.arange(boxes), np.zeros((boxes, 3, mounts)), 1.0
    if quantity.norm.is_diameter:
        start = _lengths(rows - rows.mean(axis=1, keepdims=True)).argmax(axis=1)
        first = rows[box[:, None], start, :, np.arange(mounts)].swapaxes(1, 2)
        times = 2.0
    apart = _lengths(rows - first[:, None])
    t, mount = np.divmod(apart.reshape(boxes, -1).argmax(axis=1), mounts)
    length = apart[box, t, mount]
    along = (rows[box, t, :, mount] - first[box, :, mount]) / np.where(length > 0.0, length, 1.0)[:, None]
    there = slopes.reshape(*slopes.shape[:3], mounts, 3)[box, :, :, mount]
    phases = turns[t] if times == 1.0 else turns[t] - turns[start[box, mount]]
    slope = np.einsum("bk,bkna,ba->bn", phases, there, along).real
    return Under(length, slope, times * rest.sum(axis=1), times * bends.sum(axis=1))


def _lengths(rows: Array) -> Array:
    """Of vectors, (boxes, samples, 3, mounts) to (boxes, samples, mounts)."""
    x, y, z = rows[:, :, 0], rows[:, :, 1], rows[:, :, 2]
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def root_under(answer: Answer, weights: Array) -> Under:
    """Under the root of a weighted sum of squares; orders whose series need not end count as nothing."""
    known = np.isfinite(answer.rest)
    value, slopes = np.where(known[..., None], answer.value, 0.0), np.where(known[..., None, None], answer.slopes, 0.0)
    size = np.sqrt(np.einsum("k,bkr->b", weights, np.abs(value) ** 2))
    slopes = np.einsum("k,bkr,bknr->bn", weights, value.conj(), slopes).real
    rest = root_of(weights, np.where(known, answer.rest, 0.0))
    return Under(size, slopes / np.where(size > 0.0, size, 1.0)[:, None], rest, root_of(weights, answer.bends))


def root_of(weights: Array, parts: Array) -> Array:
    """Root of a weighted sum of squares over orders, (boxes, lines, ...) to (boxes, ...)."""
    return np.asarray(np.sqrt(np.tensordot(parts**2, weights, axes=(1, 0))))
