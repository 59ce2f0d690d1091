"""Linear lower bounds of norms of mount forces and travel over boxes (E38), and of transmissibility (E40).

Transmissibility is the ratio of mount forces to those on rigid mounts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import OperatingPoint
from laufruhe.numerics.arrays import Array, Indices, Mask
from laufruhe.numerics.spectrum import orders_equal
from laufruhe.problem import channels
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_response import BoxModel, LoadedOrders
from laufruhe.prove.mounts.box_series import Expansion, LinearResponse

RATIOS = frozenset({channels.TRANSMISSIBILITY})
PARTS = ("value", "slopes", "remainder", "scores")
# halvings of the interval that contains the bound of a transmissibility
HALVINGS = 45


@dataclass(frozen=True, eq=False)
class LinearBound:
    """Lower bound value + slopes . s - remainder of a measure on boxes (E38).

    s_j runs from -1 to 1 as open number j runs from its lower to its upper bound in a box.

    Attributes
    ----------
    value, remainder
        Value at the centre, and largest fall of the measure below value + slopes . s, shape (boxes,).
    slopes
        Shape (boxes, n).
    scores
        Branching scores of the open numbers, mostly their parts of the remainder, shape (boxes, n). The side with the
        largest score is halved.
    """

    value: Array
    slopes: Array
    remainder: Array
    scores: Array

    @property
    def minimum(self) -> Array:
        """Least value over every box, shape (boxes,)."""
        return np.asarray(self.value - self.remainder - np.abs(self.slopes).sum(axis=-1))

    def where(self, mask: Mask) -> LinearBound:
        """Return the bound on the boxes of a mask, shape (boxes,), and zero on the others."""
        masks = (mask, mask[:, None], mask, mask[:, None])
        parts = (np.where(keep, getattr(self, part), 0.0) for part, keep in zip(PARTS, masks, strict=True))
        return LinearBound(*parts)

    def better_of(self, other: LinearBound) -> LinearBound:
        """Return for every box this bound or the other one, whichever has the larger minimum."""
        return choose([self, other], np.where(self.minimum >= other.minimum, 0, 1))


def choose(bounds: Sequence[LinearBound], numbers: Indices) -> LinearBound:
    """Return for every box one of the bounds; `numbers` has its index for each box, shape (boxes,)."""
    parts = (np.array([getattr(bound, part) for bound in bounds]) for part in PARTS)
    return LinearBound(*(part[numbers, np.arange(len(numbers))] for part in parts))


def zero_bound(lower: Array) -> LinearBound:
    """Return zero as the lower bound of a norm on every box; `lower` has the shape (boxes, n)."""
    return LinearBound(np.zeros(len(lower)), np.zeros_like(lower), np.zeros(len(lower)), np.zeros_like(lower))


def lower_bound_of_norm(
    model: BoxModel, measure: Measure, loaded_orders: LoadedOrders, expansion: Expansion
) -> LinearBound:
    """Return a linear lower bound of a norm of mount forces or travel on every box, from the series of motion (E38)."""
    rows, factors = counted_rows(model.problem, measure)
    response = model.linear_response(loaded_orders, expansion, measure.channel, rows, factors)
    return norm_under(model.problem, measure, response, loaded_orders)


def norm_under(
    problem: Problem, measure: Measure, response: LinearResponse, loaded_orders: LoadedOrders
) -> LinearBound:
    """Return a linear lower bound of a norm of mount forces or travel on every box (E38).

    `response` has the forces or travel of the counted mounts, r = 3 mounts components, for every loaded order.
    """
    share, weights = measure.shares(problem.points), line_weights(problem, measure, loaded_orders)
    if measure.norm.is_euclidean:
        return root_under(response, weights)
    points = [p for p in np.flatnonzero(share > 0.0) if np.any(loaded_orders.points == p)]
    by_point = [_sampled(measure, response, loaded_orders, int(p)) for p in points]
    if not by_point:
        return zero_bound(np.zeros((len(response.slopes), response.slopes.shape[2])))
    if not measure.norm.sums_lengths:
        largest = choose(by_point, np.argmax([bound.value for bound in by_point], axis=0))
        # the largest length is at least the root mean square, and the largest distance of two rows at least that of all
        # distances, whose mean square is twice that of the rows about their mean
        squares = 2.0 * weights * (loaded_orders.orders > 0.0) if measure.norm.is_diameter else weights
        return largest if measure.norm.is_largest_mean else largest.better_of(root_under(response, squares))
    value, slopes = (
        sum(share[p] * getattr(bound, part) for p, bound in zip(points, by_point, strict=True))
        for part in ("value", "slopes")
    )
    remainder, scores = root_of(weights, response.remainder), root_of(weights, response.scores)
    return LinearBound(np.asarray(value), np.asarray(slopes), remainder, scores)


def counted_rows(problem: Problem, measure: Measure) -> tuple[Indices, Array]:
    """Return the indices of the mount components that a measure counts, and its weights on them, shape (r,) each."""
    chosen = measure.places([mount.name for mount in problem.engine.mounts])
    rows = np.array([3 * k + axis for k in chosen for axis in range(3)], dtype=np.intp)
    return rows, np.tile(np.array(measure.direction_weights or (1.0, 1.0, 1.0)), len(chosen))


def line_weights(problem: Problem, measure: Measure, loaded_orders: LoadedOrders) -> Array:
    """Return the weight of each squared order in the mean over cycle, mounts and operating points, shape (orders,)."""
    chosen = measure.places([mount.name for mount in problem.engine.mounts])
    share = measure.shares(problem.points)
    return np.asarray(share[loaded_orders.points] * np.where(loaded_orders.orders > 0.0, 0.5, 1.0) / len(chosen))


def _sampled(measure: Measure, response: LinearResponse, loaded_orders: LoadedOrders, p: int) -> LinearBound:
    """Return a linear lower bound on boxes of a mean, maximum or peak to peak over samples of operating point p."""
    indices = np.flatnonzero(loaded_orders.points == p)
    value, slopes = response.value[:, indices], response.slopes[:, indices]
    remainder, scores = response.remainder[:, indices], response.scores[:, indices]
    factors = loaded_orders.phases(indices)
    boxes, samples, mounts = len(value), len(factors), value.shape[-1] // 3
    # rows by direction, then mount; real and imaginary parts count as separate orders
    waves = np.hstack([factors.real, -factors.imag])
    parts = value.reshape(boxes, len(indices), mounts, 3).swapaxes(2, 3).reshape(boxes, len(indices), -1)
    rows = np.matmul(waves, np.concatenate([parts.real, parts.imag], axis=1)).reshape(boxes, samples, 3, mounts)
    if measure.norm.sums_lengths or measure.norm.is_largest_mean:
        size = _lengths(rows)
        # a mean of lengths is at most their root mean square
        squares = np.where(loaded_orders.orders[indices] > 0.0, 0.5, 1.0) / mounts
        rests = root_of(squares, remainder), root_of(squares, scores)
        by_mount, share = slopes.reshape(*slopes.shape[:3], mounts, 3), 1.0 / (samples * mounts)

        def pair_with(length: Array) -> LinearBound:
            dual = rows / np.where(length > 0.0, length, 1.0)[:, :, None]
            duals = np.matmul(waves.T, dual.reshape(boxes, samples, -1)).reshape(boxes, 2, len(indices), 3, mounts)
            slope = np.einsum("bkxm,bknmx->bn", duals[:, 0], by_mount.real)
            slope = share * (slope + np.einsum("bkxm,bknmx->bn", duals[:, 1], by_mount.imag))
            value = share * (size**2 / np.where(length > 0.0, length, 1.0)).sum(axis=(1, 2))
            return LinearBound(value, slope, *rests)

        # where the sum of squares is least, rows of equal weight have no slope
        maximum = np.broadcast_to(size.max(axis=(1, 2), keepdims=True), size.shape)
        return pair_with(size).better_of(pair_with(maximum))
    # a maximum is the length of a row, and a peak to peak the distance of two rows
    box, first, times = np.arange(boxes), np.zeros((boxes, 3, mounts)), 1.0
    if measure.norm.is_diameter:
        start = _lengths(rows - rows.mean(axis=1, keepdims=True)).argmax(axis=1)
        first = rows[box[:, None], start, :, np.arange(mounts)].swapaxes(1, 2)
        times = 2.0
    distance = _lengths(rows - first[:, None])
    t, mount = np.divmod(distance.reshape(boxes, -1).argmax(axis=1), mounts)
    length = distance[box, t, mount]
    along = (rows[box, t, :, mount] - first[box, :, mount]) / np.where(length > 0.0, length, 1.0)[:, None]
    mount_slopes = slopes.reshape(*slopes.shape[:3], mounts, 3)[box, :, :, mount]
    phases = factors[t] if times == 1.0 else factors[t] - factors[start[box, mount]]
    slope = np.einsum("bk,bkna,ba->bn", phases, mount_slopes, along).real
    return LinearBound(length, slope, times * remainder.sum(axis=1), times * scores.sum(axis=1))


def _lengths(rows: Array) -> Array:
    # (boxes, samples, 3, mounts) to (boxes, samples, mounts)
    x, y, z = rows[:, :, 0], rows[:, :, 1], rows[:, :, 2]
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def root_under(response: LinearResponse, weights: Array) -> LinearBound:
    """Return a linear lower bound of the root of a sum of squares over orders with `weights`, shape (orders,).

    Orders whose series may diverge count as zero in value and slopes.
    """
    is_finite = np.isfinite(response.remainder)
    value = np.where(is_finite[..., None], response.value, 0.0)
    slopes = np.where(is_finite[..., None, None], response.slopes, 0.0)
    size = np.sqrt(np.einsum("k,bkr->b", weights, np.abs(value) ** 2))
    slopes = np.einsum("k,bkr,bknr->bn", weights, value.conj(), slopes).real
    remainder = root_of(weights, np.where(is_finite, response.remainder, 0.0))
    return LinearBound(
        size, slopes / np.where(size > 0.0, size, 1.0)[:, None], remainder, root_of(weights, response.scores)
    )


def root_of(weights: Array, parts: Array) -> Array:
    """Return the root of a weighted sum of squared `parts` over orders, shape (boxes, orders, ...) to (boxes, ...)."""
    return np.asarray(np.sqrt(np.tensordot(parts**2, weights, axes=(1, 0))))


def is_ratio(measure: Measure) -> bool:
    """Return True if a measure is a transmissibility."""
    return measure.channel in RATIOS


def ratio_under(
    elastic: LinearResponse, rigid: LinearResponse, measure: Measure, points: Sequence[OperatingPoint],
    loaded_orders: LoadedOrders,
) -> tuple[Array, Array]:  # fmt: skip
    """Return lower bounds of a transmissibility on boxes, shape (boxes,), and branching scores, shape (boxes, n) (E40).

    The score of an open number is its part of the bound's error; the box is halved along the largest.

    Parameters
    ----------
    elastic, rigid
        Mount forces by order on elastic mounts, and on rigid mounts under the same loads.
    measure, points, loaded_orders
        Transmissibility, operating points of the problem, and orders of the forces. Each named order, or all orders
        above zero together, has a ratio at each point.
    """
    groups: list[Mask] = []
    for p in (p for p in np.unique(loaded_orders.points) if measure.includes_point(points[p])):
        moving = (loaded_orders.points == p) & (loaded_orders.orders > 0.0)
        orders = measure.orders
        groups += (
            [moving] if orders is None else [moving & orders_equal(loaded_orders.orders, order) for order in orders]
        )
    best, scores = np.zeros(len(elastic.value)), np.zeros(elastic.scores[:, 0].shape)
    for group in (group for group in groups if group.any()):
        weights = group.astype(float)
        top, bottom = root_under(elastic, weights), root_under(rigid, weights)
        square = np.einsum("k,bk->b", weights, np.linalg.norm(rigid.slopes, axis=-1).sum(axis=-1) ** 2)
        is_bounded = np.all(np.isfinite(rigid.remainder[:, group]), axis=1) & (bottom.value > 0.0)
        curvature = square / (2.0 * np.where(is_bounded, bottom.value, 1.0))
        over = bottom.value + (bottom.remainder + curvature)
        # largest ratio t with top - t bottom >= 0 all over the box
        minimum, high = np.zeros(len(best)), top.value / np.where(bottom.value > 0.0, bottom.value, 1.0)
        for _ in range(HALVINGS):
            t = 0.5 * (minimum + high)
            excess = top.value - top.remainder - t * over - np.abs(top.slopes - t[:, None] * bottom.slopes).sum(axis=1)
            minimum, high = np.where(excess >= 0.0, t, minimum), np.where(excess >= 0.0, high, t)
        best = np.maximum(best, np.where(is_bounded, minimum, 0.0))
        scores = np.maximum(scores, (top.scores + minimum[:, None] * bottom.scores) / bottom.value[:, None])
    return best, scores


# passes over the limits to find their multipliers
ROUNDS = 2


@dataclass(eq=False)
class LinearRelaxation:
    """Linear lower bounds of objective and limits on boxes, as functions of the position s in a box.

    s_j runs from -1 to 1 as open number j runs from its lower to its upper bound in the box.

    Attributes
    ----------
    value, slopes
        Lower bound of the objective: value + slopes . s, shapes (boxes,) and (boxes, open numbers).
    limits
        Lower bounds of relative violations of limits: pairs (value, slopes) in the same shapes.
    pulls
        Branching scores from each limit, shape (boxes, open numbers): the side with the largest score is halved.
    """

    value: Array
    slopes: Array
    limits: list[tuple[Array, Array]] = field(default_factory=list)
    pulls: list[Array] = field(default_factory=list)

    @classmethod
    def zero(cls, lower: Array) -> LinearRelaxation:
        """Return the relaxation with a zero objective and no limits; `lower` has the shape (boxes, open numbers)."""
        return cls(np.zeros(len(lower)), np.zeros_like(lower))

    def subset(self, indices: NDArray[np.intp]) -> LinearRelaxation:
        """Return the relaxation on the boxes at these indices."""
        limits = [(value[indices], slopes[indices]) for value, slopes in self.limits]
        pulls = [pull[indices] for pull in self.pulls]
        return LinearRelaxation(self.value[indices], self.slopes[indices], limits, pulls)

    def add(self, weight: float, minimum: LinearBound, left_out: float = 0.0) -> None:
        """Add the linear bound of a weighted objective term, or zero on boxes where that bound is not positive.

        The largest effect of omitted orders on the term is `left_out` [SI].
        """
        value = minimum.value - minimum.remainder - left_out
        is_positive = np.isfinite(value) & (value > 0.0)
        self.value = self.value + weight * np.where(is_positive, value, 0.0)
        self.slopes = self.slopes + weight * np.where(is_positive[:, None], minimum.slopes, 0.0)

    def add_limit(self, minimum: LinearBound, left_out: float, maximum: float) -> None:
        """Add a limit by the linear bound of its measure and the largest allowed value `maximum` [SI].

        The largest effect of omitted orders on the measure is `left_out` [SI].
        """
        unit = maximum or 1.0
        violation = (minimum.value - minimum.remainder - left_out - maximum) / unit
        is_finite = np.isfinite(violation) & np.all(np.isfinite(minimum.slopes), axis=1)
        slopes = np.where(is_finite[:, None], minimum.slopes / unit, 0.0)
        self.limits.append((np.where(is_finite, violation, -1.0), slopes))
        self.pulls.append(np.where(is_finite[:, None], np.nan_to_num(minimum.scores) / unit, 0.0))

    @property
    def violation(self) -> Array:
        """Lower bound, in each box, of the relative violation of the worst limit, shape (boxes,); -1 without limits.

        Every weighted mean of the limits is a lower bound (P4). The method starts with the most violated limit and
        mixes in the others one by one. The minimum of the mean over the box is concave in the weight of a limit, with
        kinks where a slope changes its sign. The kink with the largest bound is taken.
        """
        none = (np.full(len(self.value), -1.0), np.zeros_like(self.slopes))
        values, gradients = (np.array(parts) for parts in zip(*(self.limits or [none]), strict=True))
        boxes = np.arange(len(self.value))
        first = (values - np.abs(gradients).sum(axis=2)).argmax(axis=0)
        value, slope = values[first, boxes], gradients[first, boxes]
        bound = value - np.abs(slope).sum(axis=1)
        for limit, slopes in zip(values, gradients, strict=True) if len(values) > 1 else ():
            difference = slope - slopes
            shares = np.where(slope * slopes < 0.0, slope / np.where(difference != 0.0, difference, 1.0), 0.0)[
                ..., None
            ]
            mixed = (1.0 - shares) * slope[:, None] + shares * slopes[:, None]
            bounds = (
                (1.0 - shares[..., 0]) * value[:, None] + shares[..., 0] * limit[:, None] - np.abs(mixed).sum(axis=2)
            )
            best = bounds.argmax(axis=1)
            share = np.where(bounds[boxes, best] > bound, shares[boxes, best, 0], 0.0)
            value, slope = (1.0 - share) * value + share * limit, slope - share[:, None] * difference
            bound = np.maximum(bound, bounds[boxes, best])
        return np.asarray(bound)

    @property
    def pull(self) -> Array:
        """Largest branching score of each open number from any limit, shape (boxes, open numbers)."""
        return np.asarray(np.max([np.zeros_like(self.slopes), *self.pulls], axis=0))

    @property
    def minimum(self) -> Array:
        """Lower bound of the objective of feasible designs in each box, (boxes,); infinite where none is feasible.

        Multipliers of the limits (P4) are set one by one. The bound is piecewise linear in a multiplier, with kinks
        where a slope changes its sign. The kink with the largest bound is taken.
        """
        value, slopes = self.value, self.slopes
        bound, broken = value - np.abs(slopes).sum(axis=1), self.violation > 0.0
        for violation, gradient in self.limits * (ROUNDS if len(self.limits) > 1 else 1):
            prices = np.where(slopes * gradient < 0.0, -slopes / np.where(gradient != 0.0, gradient, 1.0), 0.0)
            loss = np.abs(slopes[:, None] + prices[:, :, None] * gradient[:, None]).sum(axis=2)
            bounds = value[:, None] + prices * violation[:, None] - loss
            best = bounds.argmax(axis=1)[:, None]
            highest = np.take_along_axis(bounds, best, axis=1)[:, 0]
            price = np.where(highest > bound, np.take_along_axis(prices, best, axis=1)[:, 0], 0.0)
            value = value + price * violation
            slopes = slopes + price[:, None] * gradient
            bound = np.maximum(bound, highest)
        return np.asarray(np.maximum(np.where(broken, np.inf, bound), 0.0))
