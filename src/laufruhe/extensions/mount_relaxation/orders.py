"""Lower bounds of a norm of mount forces or travel by quadratic bounds of single orders (E45, E54)."""

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
from laufruhe.numerics.spectrum import stacked_coefficients
from laufruhe.physics.rigid_body import moved_wrench
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation, with_common_base
from laufruhe.problem.measure import Measure, narrow_signal
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_response import is_travel

# largest share of squares in omitted orders, and most orders of one norm
OMITTED, MAX_ORDERS = 1e-6, 12
# largest loss to other orders, over the strongest order, at which the sampled bound of the order is used
MAX_LOSS = 0.03
# share of the amplitude of an order that a mean is at least, by an average weighted with the cosine of the order
COSINE = 0.5
# largest share of a norm that may be omitted with one symmetry of the motions
OMITTED_SYMMETRY = 0.005
ZERO_LEVEL = 1e-13


@dataclass(frozen=True, eq=False)
class Order:
    """Load and response of one order at an operating point.

    Attributes
    ----------
    point
        Number of the operating point.
    index
        Order as a multiple of the cycle's base order.
    omega
        Angular frequency [rad/s].
    loads
        r at the middle of the unbalances, and its change by the reach of each column, shape (1 + columns, k) (E42).
    signal
        Force or travel of the best design, shape (mounts, 3).
    part
        Motions of the load: 0 for all, 1 or 2 for one symmetry (E57).
    """

    point: int
    index: int
    omega: float
    loads: ComplexArray
    signal: ComplexArray
    part: int

    def in_basis(self, basis: Array) -> Order:
        """Return the order in another basis of the unbalances, `basis` of shape (fewer, columns)."""
        return replace(self, loads=np.concatenate([self.loads[:1], basis @ self.loads[1:]]))


@dataclass(frozen=True, eq=False)
class MeasureOrders:
    """Measure of force or travel with its orders above zero, sorted by size in the best design.

    Attributes
    ----------
    mounts
        Numbers of the mounts in the measure.
    factors
        Weights of the directions, shape (3,).
    shares
        Weights of the operating points, shape (points,).
    samples
        Samples per cycle; 0 if signals have several base orders.
    has_kinks
        True if the norm is refined near kinks of a signal.
    """

    measure: Measure
    orders: tuple[Order, ...]
    mounts: tuple[int, ...]
    factors: Array
    shares: Array
    samples: int
    has_kinks: bool

    def signal(self, response: Response) -> ComplexArray:
        """Return the weighted force or travel of one member of each mount, shape (mounts, 3, d)."""
        signals = response.deflections if self.is_travel else response.forces
        is_chosen = [numbers[0] in self.mounts for numbers in response.members]
        return np.asarray(response.unit * signals[is_chosen] * self.factors[:, None])

    def member_counts(self, response: Response) -> Array:
        """Return the count of members of each mount, shape (mounts,)."""
        return np.array([float(len(numbers)) for numbers in response.members if numbers[0] in self.mounts])

    def in_basis(self, basis: Array) -> MeasureOrders:
        """Return the measure in another basis of the unbalances, `basis` of shape (fewer, columns)."""
        return replace(self, orders=tuple(order.in_basis(basis) for order in self.orders))

    @property
    def is_travel(self) -> bool:
        """True for travel, False for force."""
        return is_travel(self.measure.channel)

    @property
    def is_sampled_fully(self) -> bool:
        """True if each order has more than two samples per period, so that sums over samples are exact."""
        return 2 * max((order.index for order in self.orders), default=0) < self.samples

    def bound(self, order: Order, variable: EpigraphVariable, norm: float) -> ResponseBound:
        """Return an upper bound of force or travel amplitudes in an order, over designs with a norm up to `norm`."""
        if self.measure.norm.is_euclidean:
            reach = norm / math.sqrt(0.5 * self.shares[order.point] / len(self.mounts))
        else:
            # the longer half axis of an ellipse is at least the root of half the squares; a mean is at least half the
            # amplitude of each order
            factor, loss = (variable.factor, variable.loss) if variable.is_largest else (COSINE, 0.0)
            times = math.sqrt(2.0) if variable.is_largest else len(self.mounts)
            reach = times * (norm / variable.share + loss) / factor
        minimum = float(self.factors.min())
        return ResponseBound(self.mounts, reach / minimum if minimum > 0.0 else math.inf, self.is_travel)

    def largest_sum(self, order: Order, parts: Sequence[OpenMounts]) -> float:
        """Return an upper bound of the sum over mounts of the amplitudes of an order, for all designs.

        `parts` are the mounts for all motions, or for each symmetry.
        """
        bound = response_bound(parts[order.part], order.loads, order.omega, self.is_travel, self.mounts)
        return float(self.factors.max()) * bound

    @property
    def points(self) -> list[int]:
        """Numbers of the operating points with a load."""
        return sorted({order.point for order in self.orders})


def measure_orders(
    problem: Problem, measure: Measure, model: AffineModel, reference: Evaluation, basis: UnbalanceBasis,
    parts: Sequence[OpenMounts],
) -> MeasureOrders:  # fmt: skip
    """Return the orders of load of a measure with their wrenches, sorted by their size in the best design.

    Parameters
    ----------
    reference
        The best design.
    basis
        Basis of the unbalances, to which `loads` of the orders refer.
    parts
        Mounts for all motions; if they are symmetric, then for symmetric and for antisymmetric motions.
    """
    wrench_map = moved_wrench(NUMBERS, mounting_in(problem.engine).block.centre_of_gravity)
    base = problem.engine.cycle.base_order
    signals = with_common_base(base, reference.signals(measure.load))
    chosen = measure.places([mount.name for mount in problem.engine.mounts])
    shares, points = measure.shares(problem.points), []
    for p, (point, (constant, slopes)) in enumerate(zip(problem.points, model.wrenches(), strict=True)):
        if shares[p] == 0.0:
            continue
        coefficients = narrow_signal(measure, signals[p], reference.engine).coefficients
        step, series = stacked_coefficients([constant, *slopes], base)
        loads = series @ wrench_map.T
        loads[0] += np.einsum("q,qki->ki", basis.middles, loads[1:])
        loads[1:] = np.einsum("cq,qki->cki", basis.domain_map, loads[1:])
        size = np.abs(loads @ parts[0].root.T).sum(axis=0).max(axis=1)
        numbers = np.asarray(float(step) * np.arange(series.shape[1]), dtype=np.float64)
        orders = []
        for k in np.flatnonzero(
            (size > ZERO_LEVEL * size.max(initial=0.0)) & (numbers > 0.0) & measure.counted(numbers)
        ):
            index = round(numbers[k] / float(signals[p].base))
            signal = coefficients[index] if index < len(coefficients) else np.zeros_like(coefficients[0])
            orders.append(Order(p, index, float(numbers[k]) * point.speed, loads[:, k], signal, 0))
        points += [orders] if orders else []
    orders = _in_parts(points, shares, parts, chosen, measure.norm.is_euclidean)
    orders.sort(key=lambda order: -float(np.linalg.norm(order.signal)))
    has_one_base = all(signal.base == base for signal in signals)
    return MeasureOrders(
        measure, tuple(orders), tuple(chosen), np.array(measure.direction_weights or (1.0, 1.0, 1.0)), shares,
        reference.samples if has_one_base else 0,
        measure.norm.refinement > 1 and any(len(signal.kink_angles) for signal in signals),
    )  # fmt: skip


def _in_parts(
    points: Sequence[Sequence[Order]],
    shares: Array,
    parts: Sequence[OpenMounts],
    chosen: Sequence[int],
    adds_squares: bool,
) -> list[Order]:
    """Return the orders of all operating points, with loads split into symmetric and antisymmetric motions (E57).

    Parameters
    ----------
    adds_squares
        True if squares of both symmetries add up. Otherwise one symmetry is used if it has nearly all of the point
        in the best design.
    """
    members = [numbers for numbers in parts[-1].members if set(numbers) <= set(chosen)]
    if len(parts) == 1 or sum(map(len, members)) < len(chosen):
        return [replace(order, loads=order.loads @ parts[0].root.T) for orders in points for order in orders]
    places = [tuple(list(chosen).index(k) for k in numbers) for numbers in members]
    splits = [[split_signal(order.signal, places) for order in orders] for orders in points]
    sizes = []
    for orders, symmetries in zip(points, splits, strict=True):
        # sums of lengths in the strongest order: all motions, then both symmetries
        k = max(range(len(orders)), key=lambda k: float(np.linalg.norm(orders[k].signal)))
        size = np.array(
            [np.linalg.norm(part_signal, axis=1).sum() for part_signal in (orders[k].signal, *symmetries[k])]
        )
        sizes.append(size * shares[orders[0].point])
    omitted, split = OMITTED_SYMMETRY * sum(size[0] for size in sizes), []
    for symmetries, orders, size in zip(splits, points, sizes, strict=True):
        is_one_symmetric = size[0] - size[1:].max() <= omitted
        symmetries_used = [1, 2] if adds_squares else [1 + int(np.argmax(size[1:]))] if is_one_symmetric else [0]
        for order, symmetry_signals in zip(orders, symmetries, strict=True):
            for k in symmetries_used:
                loads, signal = order.loads @ parts[k].root.T, (order.signal, *symmetry_signals)[k]
                if np.abs(loads).max() > ZERO_LEVEL * np.abs(order.loads @ parts[0].root.T).max():
                    split.append(replace(order, loads=loads, signal=signal, part=k))
    return split


@dataclass(frozen=True, eq=False)
class EpigraphVariable:
    """Lower bound of a norm: share * (unit * root of a variable - loss), the variable above quadratic bounds.

    Attributes
    ----------
    orders
        Orders of the quadratic bounds.
    share
        Weight in the norm.
    unit
        Unit of the root: about its value in the best design.
    loss
        Upper bound of the amount by which other orders may reduce the norm.
    is_largest
        True to bound each mount by itself, False for their mean.
    factor
        Factor of the order's amplitude in the root.
    multiples, phases
        For a mean, its orders at odd multiples with these multiples, and samples per period (E58).
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
        """Return an upper bound of the root over designs with a norm up to `norm`.

        With odd multiples, it follows from an average weighted with the cosine of the order.
        """
        return norm * self.factor / COSINE if self.multiples else norm + self.loss

    @property
    def multiple_weights(self) -> list[float]:
        """Weight of each odd multiple in a signed average over samples, which reduces the root."""
        return [2.0 / self.phases / math.sin(k * math.pi / self.phases) for _, k in self.multiples]

    def quadratic_bounds(
        self, number: int, query: MeasureOrders, responses: Sequence[Response], order_numbers: Sequence[int]
    ) -> list[QuadraticBound]:
        """Return the constraints that keep an epigraph variable above squares of the responses of its orders.

        `number` is the index of the variable; `order_numbers` are those of the orders.
        """
        norm, mounts = query.measure.norm, len(query.mounts)
        signals = [query.signal(response) * (self.factor / self.unit) for response in responses]
        if norm.is_euclidean:
            rows = []
            for k, order, response, signal in zip(order_numbers, self.orders, responses, signals, strict=True):
                times = np.sqrt(0.5 * query.shares[order.point] / mounts * query.member_counts(response))
                rows.append((k, in_parts(signal * times[:, None, None])[:, None]))
            return [QuadraticBound(number, tuple(rows))]
        if self.is_largest:
            return [
                QuadraticBound(number, ((k, np.stack([mount.real, mount.imag], axis=1)),))
                for k, signal in zip(order_numbers, signals, strict=True)
                for mount in signal
            ]
        bounds = []
        for k, response, signal in zip(order_numbers, responses, signals, strict=True):
            stacked = np.concatenate(
                [in_parts(mount * count) for mount, count in zip(signal, query.member_counts(response), strict=True)]
            )
            bounds.append(QuadraticBound(number, ((k, stacked[None] / mounts),), (6,) * len(signal)))
        return bounds

    def lengths(
        self, query: MeasureOrders, responses: Sequence[Response], order_numbers: Sequence[int]
    ) -> tuple[tuple[int, Array], ...]:
        """Return, by order number, vectors whose lengths add up to at most the root of a mean, in its unit (E58)."""
        vectors = []
        for k, response in zip(order_numbers, responses, strict=True):
            signal = query.signal(response) * (self.factor / self.unit / len(query.mounts))
            times = query.member_counts(response)
            vectors.append((k, np.array([in_parts(mount * count) for mount, count in zip(signal, times, strict=True)])))
        return tuple(vectors)


def epigraph_variables(query: MeasureOrders, parts: Sequence[OpenMounts]) -> list[EpigraphVariable]:
    """Return the variables whose minimum is a lower bound of a norm: one, or one for each operating point (E45).

    `parts` are those of `measure_orders`: mounts for all motions, or for each symmetry.
    """
    norm = query.measure.norm
    if not query.orders:
        return []
    if norm.is_euclidean:
        weights = np.array([query.shares[order.point] for order in query.orders]) * (0.5 / len(query.mounts))
        sizes = weights * np.array([np.sum(np.abs(order.signal) ** 2) for order in query.orders])
        by_size = np.argsort(-sizes, kind="stable")
        omitted = 1.0 - np.cumsum(sizes[by_size]) / max(float(sizes.sum()), 1e-300)
        retained = by_size[: min(int(np.argmax(omitted <= OMITTED)) + 1, MAX_ORDERS)]
        orders = tuple(query.orders[k] for k in retained)
        return [EpigraphVariable(orders, 1.0, math.sqrt(float(sizes.sum())) or 1.0, 0.0, True, 1.0)]
    strongest = [_strongest(query, p, parts) for p in query.points]
    if norm.sums_lengths:
        return strongest
    unit = max(variable.unit for variable in strongest)
    loss, factor = max(variable.loss for variable in strongest), min(variable.factor for variable in strongest)
    orders = tuple(order for variable in strongest for order in variable.orders)
    return [EpigraphVariable(orders, 1.0, unit, loss, not norm.is_largest_mean, factor)]


def _strongest(query: MeasureOrders, point: int, parts: Sequence[OpenMounts]) -> EpigraphVariable:
    """Return the variable that bounds a norm of lengths by the strongest order of an operating point (E45, E58).

    A signed average over half periods of the order contains only its odd multiples. An average weighted with its cosine
    contains the order alone.
    """
    order, *other_orders = [order for order in query.orders if order.point == point]
    norm, lengths = query.measure.norm, np.linalg.norm(order.signal, axis=1)
    odd_multiples = tuple(
        (other, other.index // order.index) for other in other_orders if other.index % (2 * order.index) == order.index
    )
    phases = query.samples // math.gcd(query.samples, order.index) if query.samples else 0
    is_square_wave = bool(phases) and query.samples % (2 * order.index) == 0 and not query.has_kinks
    # factor of a mean: by a sampled square wave, less odd multiples; otherwise by the cosine
    factor, size = 2.0 / phases / math.tan(math.pi / phases) if is_square_wave else COSINE, float(lengths.mean())
    if norm.sums_lengths:
        multiples, phases = (odd_multiples, phases) if is_square_wave else ((), 0)
        share = float(query.shares[point])
        return EpigraphVariable((order,), share, factor * size or 1.0, 0.0, False, factor, multiples, phases)
    mean, swing = norm.is_largest_mean, 2.0 if norm.is_diameter else 1.0
    loss = sum(
        # weight in the sampled square wave
        query.largest_sum(other, parts)
        * (2.0 / phases / math.sin(math.pi * k / phases) if mean and is_square_wave else 1.0)
        for other, k in odd_multiples
    )
    loss /= len(query.mounts) if mean else 1
    cosine_factor = COSINE
    if not mean:
        fine_phases = phases * norm.refinement
        factor, size = (swing * math.cos(math.pi / fine_phases) if is_square_wave else 0.0), float(lengths.max())
        cosine_factor = swing * (phases * math.sin(math.pi / phases) / 4.0 if phases > 1 else math.sqrt(0.125))
    if (
        not is_square_wave
        or (loss > MAX_LOSS * factor * size and not mean)
        or (factor * size - loss) < cosine_factor * size
    ):
        factor, loss = cosine_factor, 0.0
    return EpigraphVariable((order,), float(query.shares[point]), factor * size or 1.0, loss * swing, not mean, factor)
