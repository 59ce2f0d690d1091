"""What a norm of mount forces or travel is not under, by squares of single orders (E34, E45, E54)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.load_models.affine import AffineModel
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.numerics.spectrum import common_base
from laufruhe.physics.rigid_body import moved_wrench
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation, over
from laufruhe.problem.measure import Measure, selected
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_response import is_travel
from laufruhe.prove.springs.bound import Cap
from laufruhe.prove.springs.lines import Felt, Line, in_parts, most_felt
from laufruhe.prove.springs.open_mounts import OpenMounts

# share of the squares of the best design that orders left out have, and orders that are kept
LEFT_OUT, MOST_ORDERS = 1e-6, 12
# share of the strongest order that others may take of it before its shape is not relied upon
SMALL = 0.03
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
        r at the middle of the unbalances, and what the reach of each column adds, shape (1 + columns, 6) (E42).
    felt
        What the best design has of it, shape (mounts, 3).
    """

    point: int
    place: int
    omega: float
    loads: ComplexArray
    felt: ComplexArray


@dataclass(frozen=True, eq=False)
class Asked:
    """A measure of forces or travel with its orders above zero, the strongest of every operating point first."""

    measure: Measure
    orders: tuple[Order, ...]
    mounts: tuple[int, ...]
    factors: Array
    shares: Array
    samples: int
    is_bent: bool

    def felt(self, line: Line) -> ComplexArray:
        """What counts of an order, shape (mounts, 3, d)."""
        whole = line.deflections if self.is_travel else line.forces
        return np.asarray(line.unit * whole[list(self.mounts)] * self.factors[:, None])

    @property
    def is_travel(self) -> bool:
        """Whether it is of travel."""
        return is_travel(self.measure.channel)

    @property
    def is_sampled_fully(self) -> bool:
        """Whether every order has more than two samples, so that sums over samples are those over the cycle."""
        return 2 * max((order.place for order in self.orders), default=0) < self.samples

    def at_most(self, order: Order, head: Head, most: float) -> Felt:
        """Of an order, where the norm is not over this."""
        if self.measure.norm.is_euclidean:
            reach = most / math.sqrt(0.5 * self.shares[order.point] / len(self.mounts))
        else:
            # the longer half axis is at least the root of half the squares
            times = math.sqrt(2.0) if head.whole else len(self.mounts)
            reach = times * (most / head.share + head.loss) / head.factor
        least = float(self.factors.min())
        return Felt(self.mounts, reach / least if least > 0.0 else math.inf, self.is_travel)

    @property
    def points(self) -> list[int]:
        """Operating points with a load."""
        return sorted({order.point for order in self.orders})

    def of_point(self, point: int) -> list[Order]:
        """Its orders, the strongest first."""
        return [order for order in self.orders if order.point == point]


def asked(
    problem: Problem, measure: Measure, model: AffineModel, near: Evaluation, columns: tuple[Array, Array]
) -> Asked:
    """Orders of a measure, sorted by what the best design has of them.

    Parameters
    ----------
    columns
        Middles of the columns of unbalances, and their reaches about these.
    """
    mounting = mounting_in(problem.engine)
    root = np.linalg.inv(np.linalg.cholesky(mounting.block.mass_matrix))
    moved = root @ moved_wrench(NUMBERS, mounting.block.centre_of_gravity)
    base = problem.engine.cycle.base_order
    signals = over(base, near.signals(measure.load))
    chosen = measure.places([mount.name for mount in problem.engine.mounts])
    shares, orders = measure.shares(problem.points), []
    for p, (point, (bare, slopes)) in enumerate(zip(problem.points, model.wrenches(), strict=True)):
        if shares[p] == 0.0:
            continue
        felt, step = selected(measure, signals[p], near.engine).coefficients, common_base([base, bare.base])
        step = common_base([step, *(slope.base for slope in slopes)])
        parts = [spectrum.rebased(step).coefficients for spectrum in (bare, *slopes)]
        whole = max(map(len, parts))
        loads = np.array([np.pad(part, ((0, whole - len(part)), (0, 0))) for part in parts]) @ moved.T
        loads[0] += np.einsum("q,qki->ki", columns[0], loads[1:])
        loads[1:] *= columns[1][:, None, None]
        size = np.abs(loads).sum(axis=0).max(axis=1)
        numbers = np.asarray(float(step) * np.arange(whole), dtype=np.float64)
        for k in np.flatnonzero((size > NOTHING * size.max(initial=0.0)) & (numbers > 0.0) & measure.counted(numbers)):
            place = numbers[k] / float(signals[p].base)
            own = felt[round(place)] if round(place) < len(felt) else np.zeros_like(felt[0])
            orders.append(Order(p, round(place), float(numbers[k]) * point.speed, loads[:, k], own))
    orders.sort(key=lambda order: -float(np.linalg.norm(order.felt)))
    whole_cycle = all(signal.base == base for signal in signals)
    return Asked(
        measure, tuple(orders), tuple(chosen), np.array(measure.direction_weights or (1.0, 1.0, 1.0)), shares,
        near.samples if whole_cycle else 0,
        measure.norm.refinement > 1 and any(len(signal.bends) for signal in signals),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Head:
    """One part of a norm: at least the root of a number whose caps are known, times a unit, less a loss.

    Attributes
    ----------
    orders
        Whose lines the caps are of.
    share
        Of the norm.
    unit
        What the root is counted in: about what the best design has.
    """

    orders: tuple[Order, ...]
    share: float
    unit: float
    loss: float
    whole: bool
    factor: float

    def caps(self, number: int, asked: Asked, lines: Sequence[Line], at: Sequence[int]) -> list[Cap]:
        """Over the lines of its orders, whose numbers are told."""
        norm, mounts = asked.measure.norm, len(asked.mounts)
        felt = [asked.felt(line) * (self.factor / self.unit) for line in lines]
        if norm.is_euclidean:
            rows = tuple(
                (k, in_parts(each * math.sqrt(0.5 * asked.shares[order.point] / mounts))[:, None])
                for k, order, each in zip(at, self.orders, felt, strict=True)
            )
            return [Cap(number, rows)]
        if self.whole:
            return [
                Cap(number, ((k, np.stack([mount.real, mount.imag], axis=1)),))
                for k, each in zip(at, felt, strict=True)
                for mount in each
            ]
        stacked = [np.concatenate([in_parts(mount) for mount in each]) / mounts for each in felt]
        return [Cap(number, ((k, rows[None]),), (6,) * mounts) for k, rows in zip(at, stacked, strict=True)]


def heads_of(asked: Asked, mounts: OpenMounts) -> list[Head]:
    """What a norm is at least: one head, or one for every operating point, joined by their shares (E34, E45)."""
    norm = asked.measure.norm
    if norm.is_euclidean:
        return [_root(asked)] if asked.orders else []
    strongest = [_strongest(asked, p, mounts) for p in asked.points]
    if norm.sums_lengths and not norm.joins_points:
        return strongest
    if not strongest:
        return []
    unit = max(head.unit for head in strongest)
    loss, factor = max(head.loss for head in strongest), min(head.factor for head in strongest)
    orders = tuple(order for head in strongest for order in head.orders)
    return [Head(orders, 1.0, unit, loss, not norm.joins_points, factor)]


def _root(asked: Asked) -> Head:
    """The orders that make nearly all of the squares of the best design."""
    weights = np.array([asked.shares[order.point] for order in asked.orders]) * (0.5 / len(asked.mounts))
    size = weights * np.array([np.sum(np.abs(order.felt) ** 2) for order in asked.orders])
    rank = np.argsort(-size, kind="stable")
    left = 1.0 - np.cumsum(size[rank]) / max(float(size.sum()), 1e-300)
    kept = rank[: min(int(np.argmax(left <= LEFT_OUT)) + 1, MOST_ORDERS)]
    return Head(tuple(asked.orders[k] for k in kept), 1.0, math.sqrt(float(size.sum())) or 1.0, 0.0, True, 1.0)


def _strongest(asked: Asked, p: int, mounts: OpenMounts) -> Head:
    """The strongest order of an operating point, and what it makes of a norm of lengths (E45).

    Averaged over half turns of the order, with signs, all but its odd multiples vanish; averaged with its own
    cosine, these do as well.
    """
    own = asked.of_point(p)
    order, norm = own[0], asked.measure.norm
    lengths, mean = np.linalg.norm(order.felt, axis=1), norm.sums_lengths or norm.joins_points
    swing = 1.0 if norm.of_row_lengths or norm.joins_points else 2.0
    odd = [other for other in own[1:] if other.place % (2 * order.place) == order.place]
    phases = asked.samples // math.gcd(asked.samples, order.place) if asked.samples else 0
    stays = bool(phases) and asked.samples % (2 * order.place) == 0 and not asked.is_bent
    loss = sum(most_felt(mounts, other.loads, other.omega, asked.is_travel, asked.mounts) for other in odd)
    loss *= float(asked.factors.max()) / (len(asked.mounts) if mean else 1)
    if mean:
        factor, size = (2.0 / phases / math.tan(math.pi / phases) if stays else 0.5), float(lengths.mean())
        plain = 0.5
    else:
        fine = phases * norm.refinement
        factor, size = (swing * math.cos(math.pi / fine) if stays else 0.0), float(lengths.max())
        plain = swing * (phases * math.sin(math.pi / phases) / 4.0 if phases > 1 else math.sqrt(0.125))
    if not stays or loss > SMALL * factor * size or (factor * size - loss) < plain * size:
        factor, loss = plain, 0.0
    return Head((order,), float(asked.shares[p]), factor * size or 1.0, loss * swing, not mean, factor)
