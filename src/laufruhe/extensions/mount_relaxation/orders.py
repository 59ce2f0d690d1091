"""What a norm of mount forces or travel is not under, by squares of single orders (E45, E54)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.extensions.mount_relaxation.bound import Cap
from laufruhe.extensions.mount_relaxation.columns import Columns
from laufruhe.extensions.mount_relaxation.lines import Felt, Line, in_parts, most_felt
from laufruhe.extensions.mount_relaxation.mirrored import mirrored_halves
from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
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

# share of the squares of the best design that orders left out have, and orders that are kept
LEFT_OUT, MOST_ORDERS = 1e-6, 12
# share of the strongest order that others may take of it before its shape is not relied upon
SMALL = 0.03
# what the cosine of an order shows of a mean
COSINE = 0.5
# share of a norm that may be left out with a half of the motions
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
        r at the middle of the unbalances, and what the reach of each column adds, shape (1 + columns, k) (E42).
    felt
        What the best design has of it, shape (mounts, 3).
    part
        Number of the motions that it is of: all, or those of a half (E57).
    """

    point: int
    place: int
    omega: float
    loads: ComplexArray
    felt: ComplexArray
    part: int


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
        """What counts of an order, of one of mounts that mirror each other, shape (mounts, 3, d)."""
        whole = line.deflections if self.is_travel else line.forces
        counted = [own[0] in self.mounts for own in line.members]
        return np.asarray(line.unit * whole[counted] * self.factors[:, None])

    def times(self, line: Line) -> Array:
        """How often each of these counts, shape (mounts,)."""
        return np.array([float(len(own)) for own in line.members if own[0] in self.mounts])

    def of_columns(self, fewer: Array) -> Asked:
        """With columns of unbalances that are sums of these, shape (fewer, columns)."""
        orders = (replace(o, loads=np.concatenate([o.loads[:1], fewer @ o.loads[1:]])) for o in self.orders)
        return replace(self, orders=tuple(orders))

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
            # of a mean every order has half of its amplitude at least
            factor, loss = (head.factor, head.loss) if head.whole else (COSINE, 0.0)
            times = math.sqrt(2.0) if head.whole else len(self.mounts)
            reach = times * (most / head.share + loss) / factor
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
    problem: Problem, measure: Measure, model: AffineModel, near: Evaluation, columns: tuple[Columns, Array],
    parts: Sequence[OpenMounts],
) -> Asked:  # fmt: skip
    """Orders of a measure, sorted by what the best design has of them.

    Parameters
    ----------
    columns
        Those of unbalances, and their middles.
    parts
        The mounts for all motions, and for both halves of them where there are such.
    """
    moved = moved_wrench(NUMBERS, mounting_in(problem.engine).block.centre_of_gravity)
    base = problem.engine.cycle.base_order
    signals = over(base, near.signals(measure.load))
    chosen = measure.places([mount.name for mount in problem.engine.mounts])
    shares, found = measure.shares(problem.points), []
    for p, (point, (bare, slopes)) in enumerate(zip(problem.points, model.wrenches(), strict=True)):
        if shares[p] == 0.0:
            continue
        felt = selected(measure, signals[p], near.engine).coefficients
        step, series = in_one_base([bare, *slopes], base)
        loads, whole = series @ moved.T, series.shape[1]
        loads[0] += np.einsum("q,qki->ki", columns[1], loads[1:])
        loads[1:] = np.einsum("cq,qki->cki", columns[0].of_domains, loads[1:])
        size = np.abs(loads @ parts[0].root.T).sum(axis=0).max(axis=1)
        numbers = np.asarray(float(step) * np.arange(whole), dtype=np.float64)
        alone = []
        for k in np.flatnonzero((size > NOTHING * size.max(initial=0.0)) & (numbers > 0.0) & measure.counted(numbers)):
            place = numbers[k] / float(signals[p].base)
            own = felt[round(place)] if round(place) < len(felt) else np.zeros_like(felt[0])
            alone.append(Order(p, round(place), float(numbers[k]) * point.speed, loads[:, k], own, 0))
        found += [alone] if alone else []
    orders = _of_parts(found, shares, parts, chosen, measure.norm.is_euclidean)
    orders.sort(key=lambda order: -float(np.linalg.norm(order.felt)))
    whole_cycle = all(signal.base == base for signal in signals)
    return Asked(
        measure, tuple(orders), tuple(chosen), np.array(measure.direction_weights or (1.0, 1.0, 1.0)), shares,
        near.samples if whole_cycle else 0,
        measure.norm.refinement > 1 and any(len(signal.bends) for signal in signals),
    )  # fmt: skip


def _of_parts(
    points: Sequence[Sequence[Order]], shares: Array, parts: Sequence[OpenMounts], chosen: Sequence[int], adds: bool
) -> list[Order]:
    """Orders of all points, their loads in the motions of a part (E57).

    Parameters
    ----------
    adds
        Whether squares of both halves of the motions add up. Otherwise that half of a point counts of which the best
        design has nearly all.
    """
    members = [own for own in parts[-1].members if set(own) <= set(chosen)]
    if len(parts) == 1 or sum(map(len, members)) < len(chosen):
        return [replace(order, loads=order.loads @ parts[0].root.T) for orders in points for order in orders]
    places = [tuple(list(chosen).index(k) for k in own) for own in members]
    halves = [[mirrored_halves(order.felt, places) for order in orders] for orders in points]
    sizes = [_sizes(*pair) * shares[pair[0][0].point] for pair in zip(points, halves, strict=True)]
    aside, found = ASIDE * sum(size[0] for size in sizes), []
    for own, orders, size in zip(halves, points, sizes, strict=True):
        least = size[0] - size[1:].max() <= aside
        kept = [1, 2] if adds else [1 + int(np.argmax(size[1:]))] if least else [0]
        for order, half in zip(orders, own, strict=True):
            for k in kept:
                loads, felt = order.loads @ parts[k].root.T, (order.felt, *half)[k]
                if np.abs(loads).max() > NOTHING * np.abs(order.loads @ parts[0].root.T).max():
                    found.append(replace(order, loads=loads, felt=felt, part=k))
    return found


def _sizes(orders: Sequence[Order], halves: Sequence[tuple[ComplexArray, ComplexArray]]) -> Array:
    """Of the strongest order the sum of lengths of all, and of both halves."""
    k = max(range(len(orders)), key=lambda k: float(np.linalg.norm(orders[k].felt)))
    return np.array([np.linalg.norm(each, axis=1).sum() for each in (orders[k].felt, *halves[k])])


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
    beside, phases
        Of a mean the odd multiples of its order, and samples to a turn of it (E58).
    """

    orders: tuple[Order, ...]
    share: float
    unit: float
    loss: float
    whole: bool
    factor: float
    beside: tuple[tuple[Order, int], ...] = ()
    phases: int = 0

    def at_most(self, norm: float) -> float:
        """What the root is not over where the norm is not: of a mean with multiples beside it by its cosine."""
        return norm * self.factor / COSINE if self.beside else norm + self.loss

    def shifted(self, shift: int) -> tuple[float, list[float]]:
        """What an average over two samples so far apart leaves of the root, and what it takes of every multiple."""
        if not self.phases:
            return 1.0, []
        turn = math.pi / self.phases
        taken = [2.0 / self.phases / math.sin(k * turn) * abs(math.cos(k * shift * turn)) for _, k in self.beside]
        return math.cos(shift * turn), taken

    def caps(self, number: int, asked: Asked, lines: Sequence[Line], at: Sequence[int]) -> list[Cap]:
        """Over the lines of its orders, whose numbers are told."""
        norm, mounts = asked.measure.norm, len(asked.mounts)
        felt = [asked.felt(line) * (self.factor / self.unit) for line in lines]
        given = list(zip(self.orders, lines, strict=True))
        if norm.is_euclidean:
            times = [np.sqrt(0.5 * asked.shares[o.point] / mounts * asked.times(line)) for o, line in given]
            rows = tuple(
                (k, in_parts(each * own[:, None, None])[:, None]) for k, each, own in zip(at, felt, times, strict=True)
            )
            return [Cap(number, rows)]
        if self.whole:
            return [
                Cap(number, ((k, np.stack([mount.real, mount.imag], axis=1)),))
                for k, each in zip(at, felt, strict=True)
                for mount in each
            ]
        found = []
        for k, line, each in zip(at, lines, felt, strict=True):
            stacked = np.concatenate([in_parts(own * n) for own, n in zip(each, asked.times(line), strict=True)])
            found.append(Cap(number, ((k, stacked[None] / mounts),), (6,) * len(each)))
        return found


def lengths_of(head: Head, asked: Asked, lines: Sequence[Line], at: Sequence[int]) -> tuple[tuple[int, Array], ...]:
    """Vectors whose lengths add up to the root of a mean that is shown by one order, in its unit (E58)."""
    found = []
    for k, line in zip(at, lines, strict=True):
        felt = asked.felt(line) * (head.factor / head.unit / len(asked.mounts))
        found.append((k, np.array([in_parts(own * n) for own, n in zip(felt, asked.times(line), strict=True)])))
    return tuple(found)


def heads_of(asked: Asked, parts: Sequence[OpenMounts]) -> list[Head]:
    """What a norm is at least: one head, or one for every operating point, joined by their shares (E45)."""
    norm = asked.measure.norm
    if norm.is_euclidean:
        return [_root(asked)] if asked.orders else []
    strongest = [_strongest(asked, p, parts) for p in asked.points]
    if norm.sums_lengths:
        return strongest
    if not strongest:
        return []
    unit = max(head.unit for head in strongest)
    loss, factor = max(head.loss for head in strongest), min(head.factor for head in strongest)
    orders = tuple(order for head in strongest for order in head.orders)
    return [Head(orders, 1.0, unit, loss, not norm.is_largest_mean, factor)]


def _root(asked: Asked) -> Head:
    """The orders that make nearly all of the squares of the best design."""
    weights = np.array([asked.shares[order.point] for order in asked.orders]) * (0.5 / len(asked.mounts))
    size = weights * np.array([np.sum(np.abs(order.felt) ** 2) for order in asked.orders])
    rank = np.argsort(-size, kind="stable")
    left = 1.0 - np.cumsum(size[rank]) / max(float(size.sum()), 1e-300)
    kept = rank[: min(int(np.argmax(left <= LEFT_OUT)) + 1, MOST_ORDERS)]
    return Head(tuple(asked.orders[k] for k in kept), 1.0, math.sqrt(float(size.sum())) or 1.0, 0.0, True, 1.0)


def _strongest(asked: Asked, p: int, parts: Sequence[OpenMounts]) -> Head:
    """The strongest order of an operating point, and what it makes of a norm of lengths (E45).

    Averaged over half turns of the order, with signs, all but its odd multiples vanish; averaged with its own
    cosine, these do as well.
    """
    own = asked.of_point(p)
    order, norm = own[0], asked.measure.norm
    lengths, mean = np.linalg.norm(order.felt, axis=1), norm.sums_lengths or norm.is_largest_mean
    swing = 2.0 if norm.is_diameter else 1.0
    odd = [other for other in own[1:] if other.place % (2 * order.place) == order.place]
    phases = asked.samples // math.gcd(asked.samples, order.place) if asked.samples else 0
    stays = bool(phases) and asked.samples % (2 * order.place) == 0 and not asked.is_bent
    if norm.sums_lengths:
        return _mean(asked, order, odd, phases if stays else 0)
    loss = sum(
        most_of(asked, other, parts)
        # of a square wave that is sampled
        * (2.0 / phases / math.sin(math.pi * (other.place // order.place) / phases) if mean and stays else 1.0)
        for other in odd
    )
    loss /= len(asked.mounts) if mean else 1
    if mean:
        factor, size = (2.0 / phases / math.tan(math.pi / phases) if stays else 0.5), float(lengths.mean())
        plain = 0.5
    else:
        fine = phases * norm.refinement
        factor, size = (swing * math.cos(math.pi / fine) if stays else 0.0), float(lengths.max())
        plain = swing * (phases * math.sin(math.pi / phases) / 4.0 if phases > 1 else math.sqrt(0.125))
    if not stays or (loss > SMALL * factor * size and not mean) or (factor * size - loss) < plain * size:
        factor, loss = plain, 0.0
    return Head((order,), float(asked.shares[p]), factor * size or 1.0, loss * swing, not mean, factor)


def _mean(asked: Asked, order: Order, odd: Sequence[Order], phases: int) -> Head:
    """Of an order by a square wave in so many samples, its odd multiples beside it; else by its cosine (E45, E58)."""
    size = float(np.linalg.norm(order.felt, axis=1).mean())
    factor = 2.0 / phases / math.tan(math.pi / phases) if phases else COSINE
    beside = tuple((other, other.place // order.place) for other in odd) if phases else ()
    return Head((order,), float(asked.shares[order.point]), factor * size or 1.0, 0.0, False, factor, beside, phases)


def most_of(asked: Asked, order: Order, parts: Sequence[OpenMounts]) -> float:
    """What the sum over mounts of an order is not over for any design."""
    felt = most_felt(parts[order.part], order.loads, order.omega, asked.is_travel, asked.mounts)
    return float(asked.factors.max()) * felt
