"""Lower bounds of a norm of mount forces or travel by squares of single orders (E45, E54)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
from laufruhe.extensions.mount_relaxation.program import QuadraticBound
from laufruhe.extensions.mount_relaxation.response import Response, ResponseBound, in_parts, response_bound
from laufruhe.extensions.mount_relaxation.symmetry_split import split_signal
from laufruhe.extensions.mount_relaxation.unbalance_basis import UnbalanceBasis
from laufruhe.load_models.affine import AffineModel
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.numerics.spectrum import in_one_base
from laufruhe.physics.rigid_body import moved_wrench
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation, over
from laufruhe.problem.measure import Measure, selected
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_response import is_travel

# share of the squares of the best design that omitted orders may have, and the most orders of one norm
OMITTED, MOST_ORDERS = 1e-6, 12
# share of the strongest order that others may take of it before its shape is not relied upon
SMALL = 0.03
# share of a mean that the cosine of an order shows
COSINE = 0.5
# share of a norm that may be omitted with one part of the motions
ASIDE = 0.005
NOTHING = 1e-13


@dataclass(frozen=True, eq=False)
class Order:
    """An order at an operating point.

    Attributes
    ----------
    point
        Number of the point.
    place
        The order in orders of the cycle.
    omega
        [rad/s].
    loads
        r at the middle of the unbalances, and its change by the reach of each column, shape (1 + columns, k) (E42).
    signal
        Of the best design, shape (mounts, 3).
    part
        Number of the motions that it is of: all, or those of one symmetry (E57).
    """

    point: int
    place: int
    omega: float
    loads: ComplexArray
    signal: ComplexArray
    part: int

    def in_basis(self, basis: Array) -> Order:
        """Return the order with columns of unbalances that are sums of its own, shape (fewer, columns)."""
        return replace(self, loads=np.concatenate([self.loads[:1], basis @ self.loads[1:]]))


@dataclass(frozen=True, eq=False)
class MeasureOrders:
    """A measure of forces or travel with its orders above zero, the strongest of every operating point first."""

    measure: Measure
    orders: tuple[Order, ...]
    mounts: tuple[int, ...]
    factors: Array
    shares: Array
    samples: int
    has_kinks: bool

    def signal(self, response: Response) -> ComplexArray:
        """Return the weighted force or travel of one mount of each group of mirror images, shape (mounts, 3, d)."""
        signals = response.deflections if self.is_travel else response.forces
        counted = [own[0] in self.mounts for own in response.members]
        return np.asarray(response.unit * signals[counted] * self.factors[:, None])

    def times(self, response: Response) -> Array:
        """Return how often each of these counts, shape (mounts,)."""
        return np.array([float(len(own)) for own in response.members if own[0] in self.mounts])

    def in_basis(self, basis: Array) -> MeasureOrders:
        """Return the measure with columns of unbalances that are sums of its own, shape (fewer, columns)."""
        return replace(self, orders=tuple(order.in_basis(basis) for order in self.orders))

    @property
    def is_travel(self) -> bool:
        """Return whether it is of travel."""
        return is_travel(self.measure.channel)

    @property
    def is_sampled_fully(self) -> bool:
        """Return whether every order has more than two samples, so that sums over samples are those over the cycle."""
        return 2 * max((order.place for order in self.orders), default=0) < self.samples

    def bound(self, order: Order, variable: EpigraphVariable, norm: float) -> ResponseBound:
        """Return the bound of the amplitudes of an order where the norm is not over a number."""
        if self.measure.norm.is_euclidean:
            reach = norm / math.sqrt(0.5 * self.shares[order.point] / len(self.mounts))
        else:
            # the longer half axis is at least the root of half the squares
            # of a mean every order has half of its amplitude at least
            factor, loss = (variable.factor, variable.loss) if variable.is_largest else (COSINE, 0.0)
            times = math.sqrt(2.0) if variable.is_largest else len(self.mounts)
            reach = times * (norm / variable.share + loss) / factor
        minimum = float(self.factors.min())
        return ResponseBound(self.mounts, reach / minimum if minimum > 0.0 else math.inf, self.is_travel)

    def largest_sum(self, order: Order, parts: Sequence[OpenMounts]) -> float:
        """Return an upper bound of the sum over mounts of an order for all designs."""
        bound = response_bound(parts[order.part], order.loads, order.omega, self.is_travel, self.mounts)
        return float(self.factors.max()) * bound

    @property
    def points(self) -> list[int]:
        """Return the operating points with a load."""
        return sorted({order.point for order in self.orders})


def measure_orders(
    problem: Problem, measure: Measure, model: AffineModel, near: Evaluation, basis: tuple[UnbalanceBasis, Array],
    parts: Sequence[OpenMounts],
) -> MeasureOrders:  # fmt: skip
    """Return the orders of a measure, sorted by their size in the best design.

    Parameters
    ----------
    near
        The best design.
    basis
        Columns of the unbalances, and their middles.
    parts
        The mounts for all motions, and for those of either symmetry if there is one.
    """
    moved = moved_wrench(NUMBERS, mounting_in(problem.engine).block.centre_of_gravity)
    base = problem.engine.cycle.base_order
    signals = over(base, near.signals(measure.load))
    chosen = measure.places([mount.name for mount in problem.engine.mounts])
    shares, points = measure.shares(problem.points), []
    for p, (point, (constant, slopes)) in enumerate(zip(problem.points, model.wrenches(), strict=True)):
        if shares[p] == 0.0:
            continue
        coefficients = selected(measure, signals[p], near.engine).coefficients
        step, series = in_one_base([constant, *slopes], base)
        loads = series @ moved.T
        loads[0] += np.einsum("q,qki->ki", basis[1], loads[1:])
        loads[1:] = np.einsum("cq,qki->cki", basis[0].of_domains, loads[1:])
        size = np.abs(loads @ parts[0].root.T).sum(axis=0).max(axis=1)
        numbers = np.asarray(float(step) * np.arange(series.shape[1]), dtype=np.float64)
        orders = []
        for k in np.flatnonzero((size > NOTHING * size.max(initial=0.0)) & (numbers > 0.0) & measure.counted(numbers)):
            place = round(numbers[k] / float(signals[p].base))
            signal = coefficients[place] if place < len(coefficients) else np.zeros_like(coefficients[0])
            orders.append(Order(p, place, float(numbers[k]) * point.speed, loads[:, k], signal, 0))
        points += [orders] if orders else []
    orders = _in_parts(points, shares, parts, chosen, measure.norm.is_euclidean)
    orders.sort(key=lambda order: -float(np.linalg.norm(order.signal)))
    has_one_base = all(signal.base == base for signal in signals)
    return MeasureOrders(
        measure, tuple(orders), tuple(chosen), np.array(measure.direction_weights or (1.0, 1.0, 1.0)), shares,
        near.samples if has_one_base else 0,
        measure.norm.refinement > 1 and any(len(signal.bends) for signal in signals),
    )  # fmt: skip


def _in_parts(
    points: Sequence[Sequence[Order]], shares: Array, parts: Sequence[OpenMounts], chosen: Sequence[int], adds: bool
) -> list[Order]:
    """Return the orders of all points, their loads in the motions of a part (E57).

    Parameters
    ----------
    adds
        Whether squares of both symmetries add up. Otherwise one of them counts, if the best design has nearly all of
        a point in it.
    """
    members = [own for own in parts[-1].members if set(own) <= set(chosen)]
    if len(parts) == 1 or sum(map(len, members)) < len(chosen):
        return [replace(order, loads=order.loads @ parts[0].root.T) for orders in points for order in orders]
    places = [tuple(list(chosen).index(k) for k in own) for own in members]
    halves = [[split_signal(order.signal, places) for order in orders] for orders in points]
    sizes = []
    for orders, pairs in zip(points, halves, strict=True):
        # of the strongest order the sum of lengths of all, and of both symmetries
        k = max(range(len(orders)), key=lambda k: float(np.linalg.norm(orders[k].signal)))
        size = np.array([np.linalg.norm(each, axis=1).sum() for each in (orders[k].signal, *pairs[k])])
        sizes.append(size * shares[orders[0].point])
    omitted, split = ASIDE * sum(size[0] for size in sizes), []
    for pairs, orders, size in zip(halves, points, sizes, strict=True):
        is_one = size[0] - size[1:].max() <= omitted
        counted = [1, 2] if adds else [1 + int(np.argmax(size[1:]))] if is_one else [0]
        for order, pair in zip(orders, pairs, strict=True):
            for k in counted:
                loads, signal = order.loads @ parts[k].root.T, (order.signal, *pair)[k]
                if np.abs(loads).max() > NOTHING * np.abs(order.loads @ parts[0].root.T).max():
                    split.append(replace(order, loads=loads, signal=signal, part=k))
    return split


@dataclass(frozen=True, eq=False)
class EpigraphVariable:
    """Part of a norm: at least the root of a variable with quadratic bounds, times a unit, less a loss.

    Attributes
    ----------
    orders
        That the quadratic bounds are of.
    share
        Of the norm.
    unit
        Of the root: about its value in the best design.
    is_largest
        Whether every mount by itself is bounded, and not their mean.
    multiples, phases
        Of a mean the odd multiples of its order, and samples to a turn of it (E58).
    """

    orders: tuple[Order, ...]
    share: float
    unit: float
    loss: float
    is_largest: bool
    factor: float
    multiples: tuple[tuple[Order, int], ...] = ()
    phases: int = 0

    def root_bound(self, norm: float) -> float:
        """Return an upper bound of the root where the norm is not over a number: of a mean by its cosine."""
        return norm * self.factor / COSINE if self.multiples else norm + self.loss

    @property
    def multiple_weights(self) -> list[float]:
        """Return the share of every odd multiple that an average over samples with signs takes off the root."""
        return [2.0 / self.phases / math.sin(k * math.pi / self.phases) for _, k in self.multiples]

    def quadratic_bounds(
        self, number: int, query: MeasureOrders, responses: Sequence[Response], at: Sequence[int]
    ) -> list[QuadraticBound]:
        """Return the bounds of variable `number` by the responses of its orders, whose numbers are `at`."""
        norm, mounts = query.measure.norm, len(query.mounts)
        signals = [query.signal(response) * (self.factor / self.unit) for response in responses]
        if norm.is_euclidean:
            rows = []
            for k, order, response, signal in zip(at, self.orders, responses, signals, strict=True):
                times = np.sqrt(0.5 * query.shares[order.point] / mounts * query.times(response))
                rows.append((k, in_parts(signal * times[:, None, None])[:, None]))
            return [QuadraticBound(number, tuple(rows))]
        if self.is_largest:
            return [
                QuadraticBound(number, ((k, np.stack([mount.real, mount.imag], axis=1)),))
                for k, signal in zip(at, signals, strict=True)
                for mount in signal
            ]
        bounds = []
        for k, response, signal in zip(at, responses, signals, strict=True):
            stacked = np.concatenate(
                [in_parts(mount * n) for mount, n in zip(signal, query.times(response), strict=True)]
            )
            bounds.append(QuadraticBound(number, ((k, stacked[None] / mounts),), (6,) * len(signal)))
        return bounds

    def lengths(
        self, query: MeasureOrders, responses: Sequence[Response], at: Sequence[int]
    ) -> tuple[tuple[int, Array], ...]:
        """Return vectors whose lengths add up to the root of a mean by one order, in its unit (E58)."""
        vectors = []
        for k, response in zip(at, responses, strict=True):
            signal = query.signal(response) * (self.factor / self.unit / len(query.mounts))
            times = query.times(response)
            vectors.append((k, np.array([in_parts(mount * n) for mount, n in zip(signal, times, strict=True)])))
        return tuple(vectors)


def epigraph_variables(query: MeasureOrders, parts: Sequence[OpenMounts]) -> list[EpigraphVariable]:
    """Return the variables that bound a norm from below: one, or one for every operating point (E45)."""
    norm = query.measure.norm
    if norm.is_euclidean:
        return [_of_squares(query)] if query.orders else []
    strongest = [_strongest(query, p, parts) for p in query.points]
    if norm.sums_lengths:
        return strongest
    if not strongest:
        return []
    unit = max(variable.unit for variable in strongest)
    loss, factor = max(variable.loss for variable in strongest), min(variable.factor for variable in strongest)
    orders = tuple(order for variable in strongest for order in variable.orders)
    return [EpigraphVariable(orders, 1.0, unit, loss, not norm.is_largest_mean, factor)]


def _of_squares(query: MeasureOrders) -> EpigraphVariable:
    weights = np.array([query.shares[order.point] for order in query.orders]) * (0.5 / len(query.mounts))
    size = weights * np.array([np.sum(np.abs(order.signal) ** 2) for order in query.orders])
    rank = np.argsort(-size, kind="stable")
    rest = 1.0 - np.cumsum(size[rank]) / max(float(size.sum()), 1e-300)
    retained = rank[: min(int(np.argmax(rest <= OMITTED)) + 1, MOST_ORDERS)]
    orders = tuple(query.orders[k] for k in retained)
    return EpigraphVariable(orders, 1.0, math.sqrt(float(size.sum())) or 1.0, 0.0, True, 1.0)


def _strongest(query: MeasureOrders, p: int, parts: Sequence[OpenMounts]) -> EpigraphVariable:
    """Return the variable of the strongest order of an operating point in a norm of lengths (E45, E58).

    Averaged over half turns of the order, with signs, all but its odd multiples vanish; averaged with its own
    cosine, these do as well.
    """
    order, *others = [order for order in query.orders if order.point == p]
    norm, lengths = query.measure.norm, np.linalg.norm(order.signal, axis=1)
    odd = [other for other in others if other.place % (2 * order.place) == order.place]
    phases = query.samples // math.gcd(query.samples, order.place) if query.samples else 0
    is_square_wave = bool(phases) and query.samples % (2 * order.place) == 0 and not query.has_kinks
    if norm.sums_lengths:
        # by a square wave in so many samples, its odd multiples taken off; else by its cosine
        size = float(lengths.mean())
        factor = 2.0 / phases / math.tan(math.pi / phases) if is_square_wave else COSINE
        multiples = tuple((other, other.place // order.place) for other in odd) if is_square_wave else ()
        share = float(query.shares[p])
        return EpigraphVariable(
            (order,), share, factor * size or 1.0, 0.0, False, factor, multiples, phases if is_square_wave else 0
        )
    mean, swing = norm.is_largest_mean, 2.0 if norm.is_diameter else 1.0
    loss = sum(
        query.largest_sum(other, parts)
        # of a square wave that is sampled
        * (2.0 / phases / math.sin(math.pi * (other.place // order.place) / phases) if mean and is_square_wave else 1.0)
        for other in odd
    )
    loss /= len(query.mounts) if mean else 1
    if mean:
        factor = 2.0 / phases / math.tan(math.pi / phases) if is_square_wave else 0.5
        plain, size = 0.5, float(lengths.mean())
    else:
        fine = phases * norm.refinement
        factor, size = (swing * math.cos(math.pi / fine) if is_square_wave else 0.0), float(lengths.max())
        plain = swing * (phases * math.sin(math.pi / phases) / 4.0 if phases > 1 else math.sqrt(0.125))
    if not is_square_wave or (loss > SMALL * factor * size and not mean) or (factor * size - loss) < plain * size:
        factor, loss = plain, 0.0
    return EpigraphVariable((order,), float(query.shares[p]), factor * size or 1.0, loss * swing, not mean, factor)
