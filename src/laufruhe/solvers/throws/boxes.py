"""Boxes of throw angles, each bounded by a cone program over what its arcs may load (S26-S28).

In a box every throw's waves e^{i h theta} are a mixture of those at a few of its angles: a second-order cone program.
Its dual rows leave of every throw one function of its angle, whose least value over the box bounds
what the box holds, and cuts off the angles that cannot be better than the best design.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.affine import MOST_NUMBERS, AffineNorm, AffineProblem
from laufruhe.load_models.star_model import in_few_rows
from laufruhe.load_models.throw_waves import ThrowWaves, WaveNorm
from laufruhe.machine.firing_windows import SLACK, FiringBounds, FiringWindow
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import NORMS, Grid
from laufruhe.prove.best_first import EMPTY, Box, Over, halves
from laufruhe.prove.certificate import ROUNDING, Multipliers, minorant
from laufruhe.prove.throws.arcs import ArcBox, Arcs
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.throws.mixtures import Mixed, Program
from laufruhe.solvers.throws.riders import BoxColumns, Riders

# rounds in which one box shrinks, and by how much of its sides it has to
_ROUNDS, _WORTH = 6, 0.8
# a side that is cut no more [rad]
NARROWEST = 1e-9
# multipliers that are tried on other boxes
_KNOWN = 8


@dataclass(frozen=True, eq=False)
class ThrowBox:
    """Throws, and angles that are open beside them, between bounds, and what bounds the objective there.

    Attributes
    ----------
    middle
        Where the program puts the throws [rad].
    spread
        How far the mixture of every throw is from standing at one angle, as it weighs.
    """

    program: Program
    lower: Array
    upper: Array
    bound: float
    middle: Array
    spread: Array

    @property
    def is_exact(self) -> bool:
        """Whether there is nothing left to cut."""
        return bool(np.all(self.upper - self.lower <= NARROWEST))


class ThrowPrograms:
    """Cone programs of boxes of throws.

    Parameters
    ----------
    waves
        Of the loads.
    riders
        Open unbalances on the throws.
    firing
        What firing has to keep.
    samples
        Steps over the period for norms that are no sums of squares.
    """

    def __init__(self, waves: ThrowWaves, riders: Riders, firing: FiringBounds, samples: int) -> None:
        self.waves, self._riders, self._firing = waves, riders, firing
        problem = waves.problem
        self._terms = [
            (t.weight, _small(waves.norm(t.measure, waves.samples(t.measure, samples)))) for t in problem.objective
        ]
        self._limits = [(x, _small(waves.norm(x.measure, waves.samples(x.measure, samples)))) for x in problem.limits
                        if math.isfinite(x.maximum)]  # fmt: skip
        sizes = [norm.waves[0].size * waves.throws for norm in (n for _, n in (*self._terms, *self._limits))]
        if 2 * sum(sizes) > MOST_NUMBERS:
            raise ModelError(f"{2e-6 * sum(sizes):.0f} million numbers at once")
        every = [norm for _, norm in (*self._terms, *self._limits)]
        if not all(np.isfinite(norm.waves).all() and np.isfinite(norm.fixed.constant).all() for norm in every):
            raise ModelError("a load on an undamped resonance has no finite response")
        self._low = self._told_apart()
        self._turned: dict[tuple[int, ...], Program] = {}
        self._proofs: list[Multipliers] = []
        self.told: set[str] = set()

    @property
    def left_out(self) -> float:
        """Of the objective, by the orders left out."""
        return sum(weight * norm.left_out for weight, norm in self._terms)

    def _told_apart(self) -> int:
        """How many orders are followed along an arc: the rest is next to nothing, and counted as its size."""
        sizes = np.zeros(len(self.waves.orders))
        for norm in (norm for _, norm in (*self._terms, *self._limits)):
            own = np.sqrt(np.square(np.abs(norm.waves)).sum(axis=(0, 2, 3)))
            sizes += own / (float(own.max()) or 1.0)
        return int(np.flatnonzero(sizes > self.waves.followed * sizes.max()).max(initial=0)) + 1

    def program(self, window: FiringWindow) -> Program:
        """Of one order of firing."""
        if window.laps not in self._turned:
            self._turned[window.laps] = self._with_laps(window)
        own = self._turned[window.laps]
        if not window.order:
            return replace(own, window=window)
        intervals = self._intervals(window)
        rows = replace(own.rows, limits=(*own.rows.limits, (1.0, intervals)))
        heavy = replace(own.heavy, limits=(*own.heavy.limits, (1.0, self._heavy(intervals))))
        return replace(own, window=window, rows=rows, heavy=heavy, names=(*own.names, ""))

    def _heavy(self, norm: AffineNorm) -> AffineNorm:
        """Without the columns of orders that are next to nothing."""
        count, kept = len(self.waves.orders), np.arange(self._low)
        own = np.concatenate([kept, count + kept, [2 * count]])
        throws = self._riders.size + (2 * count + 1) * np.arange(self.waves.throws)
        beside = np.arange(throws[-1] + 2 * count + 1, norm.slope.shape[-1])
        columns = np.concatenate([np.arange(self._riders.size), np.add.outer(throws, own).ravel(), beside])
        return replace(norm, slope=norm.slope[..., columns])

    def _with_laps(self, window: FiringWindow) -> Program:
        """Of all orders of firing that share whole turns, without what is asked of intervals."""
        laps = window.laps
        terms = tuple((weight, self._rows(norm, laps)) for weight, norm in self._terms)
        limits = tuple((limit.maximum + norm.left_out, self._rows(norm, laps)) for limit, norm in self._limits)
        count = len(self.waves.orders)
        weights, pulls = np.zeros((self.waves.throws, count)), np.zeros(self._riders.size)
        for _, norm in (*terms, *limits):
            size = np.linalg.norm(norm.slope.reshape(norm.constant.size, -1), axis=0)
            own = self._by_throw(size)
            own = np.hypot(own[:, :count], own[:, count : 2 * count])
            weights += own / (float(own.max()) or 1.0)
            pulls += size[: self._riders.size] / (float(own.max()) or 1.0)
        heavy = AffineProblem(
            tuple((weight, self._heavy(norm)) for weight, norm in terms),
            tuple((most, self._heavy(norm)) for most, norm in limits), (), 1,
        )  # fmt: skip
        names = tuple(limit.name for limit, _ in self._limits)
        return Program(window, AffineProblem(terms, limits, (), 1), heavy, names, weights, pulls)

    def _by_throw(self, columns: Array) -> Array:
        """Columns of the waves and the angle of every throw."""
        width = 2 * len(self.waves.orders) + 1
        return columns[self._riders.size :][: self.waves.throws * width].reshape(self.waves.throws, width)

    def _rows(self, norm: WaveNorm, laps: tuple[int, ...]) -> AffineNorm:
        """With whole turns, in columns."""
        orders, throws, fixed = self.waves.orders[:, 0], self.waves.throws, norm.fixed
        k, d = fixed.constant.shape
        whole = np.zeros((throws, len(orders), k, d), complex)
        for part, wave in zip(self.waves.parts, norm.waves, strict=True):
            lap = 0 if part.cylinder is None else laps[part.cylinder]
            whole[part.pin] += wave * np.exp(-1j * math.tau * lap * orders)[:, None, None]
        slope = np.zeros((k, d, throws, 2 * len(orders) + 1))
        slope[..., : len(orders)] = np.moveaxis(whole.real, (0, 1), (2, 3))
        slope[..., len(orders) : -1] = -np.moveaxis(whole.imag, (0, 1), (2, 3))
        beside = np.zeros((k, d, self.waves.orders.shape[1] - 1))
        together = np.concatenate([fixed.slope, slope.reshape(k, d, -1), beside], axis=-1)
        return AffineNorm(fixed.norm, fixed.constant, together, fixed.grid)

    def _intervals(self, window: FiringWindow) -> AffineNorm:
        """Firing intervals, counted from the middle of their bounds in halves of these."""
        matrix, constants = self._firing.rows(window)
        firing = self._firing
        most = min(firing.most, firing.cycle.angle - (len(constants) - 1) * firing.least)
        middle, half = 0.5 * (most + firing.least), max(0.5 * (most - firing.least), 0.0) + SLACK
        slope = np.zeros((len(constants), 1, self.waves.throws, 2 * len(self.waves.orders) + 1))
        slope[:, 0, :, -1] = matrix[:, : self.waves.throws] / half
        still, beside = np.zeros((len(constants), 1, self._riders.size)), matrix[:, None, self.waves.throws :] / half
        return AffineNorm(
            NORMS["maximum"], (constants - middle)[:, None] / half,
            np.concatenate([still, slope.reshape(len(constants), 1, -1), beside], axis=-1),
            Grid(np.ones(len(constants)), 1),
        )  # fmt: skip

    def box(
        self, program: Program, lower: Array, upper: Array, floor: float, cut: float, is_new: bool = False
    ) -> ThrowBox | Over:
        """The bound of a box, cut down to where a design may be better than `cut`; or that none is."""
        found: ThrowBox | Over = EMPTY
        for _ in range(_ROUNDS):
            within = program.window.within(lower, upper)
            if within is None:
                return EMPTY
            lower, upper = within
            found = self._bounded(program, lower, upper, floor, cut, is_new)
            if isinstance(found, Over) or float(np.sum(found.upper - found.lower)) > _WORTH * float(
                np.sum(upper - lower)
            ):
                return found
            lower, upper, floor = found.lower, found.upper, found.bound
        return found

    def _bounded(
        self, program: Program, lower: Array, upper: Array, floor: float, cut: float, is_new: bool
    ) -> ThrowBox | Over:
        """By one program."""
        columns = self._riders.columns(*self.waves.arcs(lower, upper))
        arcs_of = ArcBox(self.waves.orders[: self._low], lower, upper)
        if is_new and self._is_known(program, columns, arcs_of, cut):
            return Over(cut)
        mixed = Mixed(program, columns, lower, upper, self.waves.orders[: self._low])
        solution = solve_cones(mixed.problem)
        found = solution.multipliers
        if solution.x is None:
            if self._is_excluded(program, columns, found, arcs_of):
                self._remember(found)
                return EMPTY
            return ThrowBox(program, lower, upper, floor, 0.5 * (lower + upper), upper - lower)
        value, arcs = self._under(program.rows, columns, found, arcs_of)
        value -= self.left_out
        if value >= cut:
            self._remember(found)
            return Over(value)
        kept = arcs.kept(cut - value)
        if kept is None:
            return Over(cut)
        middle, spread = mixed.middle(solution.x)
        middle = np.clip(middle, *kept)
        at, _ = self.waves.arcs(middle, middle)
        for pin, column, distance in self._riders.spread(columns, solution.x[: mixed.unbalances], at):
            spread[pin] += float(program.pulls[column]) * distance
        return ThrowBox(program, *kept, max(value, floor), middle, spread)

    def parts(self, box: ThrowBox, cut: float) -> Iterator[ThrowBox | Over]:
        """A box cut where its mixture is farthest from standing at one angle."""
        width = box.upper - box.lower
        pulled = np.where(width > NARROWEST, box.spread, 0.0)
        side = int(np.argmax(pulled if pulled.any() else width))
        for half in halves(Box(box.lower, box.upper, side), float(box.middle[side])):
            yield self.box(box.program, *half, box.bound, cut)

    def _under(
        self, rows: AffineProblem, columns: BoxColumns, found: Multipliers, arcs_of: ArcBox
    ) -> tuple[float, Arcs]:
        """What these multipliers leave of the objective in a box, and of every throw (S27)."""
        count = len(rows.limits)
        under = minorant(rows, Multipliers(found.terms if rows.terms else (), found.limits[:count]))
        value, pull = under.constant, under.gradient[: self._riders.size] @ columns.matrix
        if columns.limits:
            ties = AffineProblem((), columns.limits, columns.domains, 1)
            tied = minorant(ties, Multipliers((), found.limits[count : count + len(columns.limits)]))
            value, pull = value + tied.constant, pull + tied.gradient
        value += sum(domain.least(pull) for domain in columns.domains)
        count, own = len(self.waves.orders), self._by_throw(under.gradient)
        beside = under.gradient[len(under.gradient) - self.waves.orders.shape[1] + 1 :]
        arcs = arcs_of.functions(own[:, :count] - 1j * own[:, count:-1], own[:, -1], beside)
        return float(value + arcs.least), arcs

    def _is_excluded(self, program: Program, columns: BoxColumns, found: Multipliers, arcs_of: ArcBox) -> bool:
        """Whether the limits' own multipliers show that no design in a box keeps all of them."""
        limits = replace(program.rows, terms=())
        value, _ = self._under(limits, columns, found, arcs_of)
        prices = [norm.dual_norm(z) for (_, norm), z in zip(limits.limits, found.limits, strict=False)]
        sizes = [most + float(np.abs(norm.constant).sum() + np.abs(norm.slope).sum()) for most, norm in limits.limits]
        if value <= ROUNDING * sum(price * size for price, size in zip(prices, sizes, strict=True)):
            return False
        self.told |= {name for name, price in zip(program.names, prices, strict=True) if price > 0.0}
        return True

    def _is_known(self, program: Program, columns: BoxColumns, arcs_of: ArcBox, cut: float) -> bool:
        for found in self._proofs:
            value, _ = self._under(program.rows, columns, found, arcs_of)
            if value - self.left_out >= cut or self._is_excluded(program, columns, found, arcs_of):
                self._remember(found)
                return True
        return False

    def _remember(self, found: Multipliers) -> None:
        self._proofs = [found, *(other for other in self._proofs if other is not found)][:_KNOWN]


def _small(norm: WaveNorm) -> WaveNorm:
    """The same root mean square in as few rows as there are columns (S12); others without what does not act."""
    fixed = norm.fixed
    if not fixed.norm.is_euclidean:
        acts = np.flatnonzero(
            fixed.constant.any(axis=0) | fixed.slope.any(axis=(0, 2)) | norm.waves.any(axis=(0, 1, 2))
        )
        acts = acts if len(acts) else np.arange(1)
        own = replace(fixed, constant=fixed.constant[:, acts], slope=fixed.slope[:, acts])
        return WaveNorm(own, norm.waves[..., acts], norm.left_out)
    scaled = np.sqrt(fixed.grid.weights)[:, None]
    waves = norm.waves * scaled
    few = in_few_rows([fixed.constant * scaled, np.moveaxis(fixed.slope * scaled[..., None], -1, 0),
                       waves.real, waves.imag])  # fmt: skip
    if few is None:
        return norm
    constant, slope, real, imaginary = few
    own = AffineNorm(fixed.norm, constant, np.moveaxis(slope, 0, -1), Grid(np.ones(len(constant)), len(constant)))
    return WaveNorm(own, real + 1j * imaginary, norm.left_out)
