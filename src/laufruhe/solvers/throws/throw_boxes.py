"""Boxes of throw angles, each bounded by a cone program over what its arcs may load (S26-S28).

In a box every throw's waves e^{i h theta} are a mixture of those at a few of its angles: a second-order cone program.
Its dual rows leave for every throw one function of its angle. The least value of that over the box bounds the box, and
cuts off the angles that cannot be better than the best design.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.affine import MOST_NUMBERS, AffineNorm, AffineProblem
from laufruhe.load_models.star_model import compress_rows
from laufruhe.load_models.throw_waves import ThrowWaves, WaveNorm
from laufruhe.machine.firing_windows import SLACK, FiringBounds, FiringWindow
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import NORMS, Grid
from laufruhe.problem.decision import Decision, domains_of
from laufruhe.problem.sets import Interval
from laufruhe.prove.branch_and_bound import INFEASIBLE_PART, Box, FathomedPart, halves
from laufruhe.prove.certificate import ROUNDING, Multipliers, minorant
from laufruhe.prove.throws.arcs import ArcBox, Arcs
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.throws.riding_weights import BoxColumns, Riders

# rounds in which one box shrinks, and the share of its sides that has to be left for another
_ROUNDS, _WORTH = 6, 0.8
# a side that is cut no more [rad]
NARROWEST = 1e-9
# multipliers that are tried on other boxes
_KNOWN = 8
# angles of an arc that a program mixes, by the number of shared angles: at least, at most of shared ones and of throws;
# and how far two of them may be apart for the highest order that counts [rad]
_FEWEST, _MOST_SHARED, _MOST, _APART = 3, (1, 5, 3), (12, 6, 5), 0.6
# share of the heaviest order under which one counts for nothing in how many angles an arc needs
_FAINT = 0.02


@dataclass(frozen=True, eq=False)
class ThrowProgram:
    """Norms of one firing window, rows affine in unbalances, waves of the throws, and the throws.

    Attributes
    ----------
    rows
        Columns: those of unbalances, then of every throw the cosines and sines of all waves and theta, then the shared
        angles.
    heavy
        The same without the columns of negligible orders, for the program that proposes multipliers.
    names
        Names of the limits; empty for the firing intervals.
    weights, pulls
        Sizes of every throw's orders in objective and limits, shape (throws, orders), and of the columns of unbalances.
    """

    window: FiringWindow
    rows: AffineProblem
    heavy: AffineProblem
    names: tuple[str, ...]
    weights: Array
    pulls: Array


@dataclass(frozen=True, eq=False)
class ThrowBox:
    """Throws and shared angles between bounds, and the lower bound of the objective there.

    Attributes
    ----------
    middle
        Angles at which the program puts the throws [rad].
    spread
        Distance of the mixture of every throw from standing at one angle, as it weighs.
    """

    program: ThrowProgram
    lower: Array
    upper: Array
    bound: float
    middle: Array
    spread: Array

    @property
    def is_exact(self) -> bool:
        """True if there is nothing left to cut."""
        return bool(np.all(self.upper - self.lower <= NARROWEST))


class ThrowPrograms:
    """Cone programs of boxes of throws.

    Parameters
    ----------
    waves
        Waves of the loads.
    riders
        Open unbalances on the throws.
    firing
        Bounds that firing has to keep.
    samples
        Steps over the period for norms that are no sums of squares.

    Attributes
    ----------
    conflict
        Limits that boxes without a design cannot keep.
    """

    def __init__(self, waves: ThrowWaves, riders: Riders, firing: FiringBounds, samples: int) -> None:
        self.waves, self._riders, self._firing = waves, riders, firing
        problem = waves.problem
        self._terms = [
            (t.weight, compressed(waves.norm(t.measure, waves.samples(t.measure, samples)))) for t in problem.objective
        ]
        self._limits = [
            (x, compressed(waves.norm(x.measure, waves.samples(x.measure, samples))))
            for x in problem.limits
            if math.isfinite(x.maximum)
        ]
        every = [norm for _, norm in (*self._terms, *self._limits)]
        count = 2 * sum(norm.waves[0].size * waves.throws for norm in every)
        if count > MOST_NUMBERS:
            raise ModelError(f"{1e-6 * count:.0f} million numbers at once")
        if not all(np.isfinite(norm.waves).all() and np.isfinite(norm.fixed.constant).all() for norm in every):
            raise ModelError("a load on an undamped resonance has no finite response")
        # how many orders are followed along an arc: of the rest, which is next to nothing, the size counts
        sizes = np.zeros(len(waves.orders))
        for norm in every:
            by_order = np.sqrt(np.square(np.abs(norm.waves)).sum(axis=(0, 2, 3)))
            sizes += by_order / (float(by_order.max()) or 1.0)
        self._followed = int(np.flatnonzero(sizes > waves.followed * sizes.max()).max(initial=0)) + 1
        self._by_laps: dict[tuple[int, ...], ThrowProgram] = {}
        self._proofs: list[Multipliers] = []
        self.conflict: set[str] = set()

    @property
    def left_out(self) -> float:
        """Share of the objective that the orders left out may have [SI]."""
        return sum(weight * norm.left_out for weight, norm in self._terms)

    def program(self, window: FiringWindow) -> ThrowProgram:
        """Return the program of one order of firing."""
        if window.laps not in self._by_laps:
            self._by_laps[window.laps] = self._with_laps(window)
        program = self._by_laps[window.laps]
        if not window.order:
            return replace(program, window=window)
        intervals = self._intervals(window)
        rows = replace(program.rows, limits=(*program.rows.limits, (1.0, intervals)))
        heavy = replace(program.heavy, limits=(*program.heavy.limits, (1.0, self._without_faint_orders(intervals))))
        return replace(program, window=window, rows=rows, heavy=heavy, names=(*program.names, ""))

    def _with_laps(self, window: FiringWindow) -> ThrowProgram:
        """Return the program of all orders of firing with the same whole turns, without limits on intervals."""
        terms = tuple((weight, self._rows(norm, window.laps)) for weight, norm in self._terms)
        limits = tuple((limit.maximum + norm.left_out, self._rows(norm, window.laps)) for limit, norm in self._limits)
        count = len(self.waves.orders)
        weights, pulls = np.zeros((self.waves.throws, count)), np.zeros(self._riders.size)
        for _, norm in (*terms, *limits):
            size = np.linalg.norm(norm.slope.reshape(norm.constant.size, -1), axis=0)
            by_order = self._columns_by_throw(size)
            by_order = np.hypot(by_order[:, :count], by_order[:, count : 2 * count])
            weights += by_order / (float(by_order.max()) or 1.0)
            pulls += size[: self._riders.size] / (float(by_order.max()) or 1.0)
        heavy = AffineProblem(
            tuple((weight, self._without_faint_orders(norm)) for weight, norm in terms),
            tuple((maximum, self._without_faint_orders(norm)) for maximum, norm in limits), (), 1,
        )  # fmt: skip
        names = tuple(limit.name for limit, _ in self._limits)
        return ThrowProgram(window, AffineProblem(terms, limits, (), 1), heavy, names, weights, pulls)

    def _without_faint_orders(self, norm: AffineNorm) -> AffineNorm:
        count, followed = len(self.waves.orders), np.arange(self._followed)
        of_throw = np.concatenate([followed, count + followed, [2 * count]])
        throws = self._riders.size + (2 * count + 1) * np.arange(self.waves.throws)
        shared = np.arange(throws[-1] + 2 * count + 1, norm.slope.shape[-1])
        columns = np.concatenate([np.arange(self._riders.size), np.add.outer(throws, of_throw).ravel(), shared])
        return replace(norm, slope=norm.slope[..., columns])

    def _columns_by_throw(self, columns: Array) -> Array:
        width = 2 * len(self.waves.orders) + 1
        return columns[self._riders.size :][: self.waves.throws * width].reshape(self.waves.throws, width)

    def _rows(self, norm: WaveNorm, laps: tuple[int, ...]) -> AffineNorm:
        """Return the rows of a norm with whole turns of its cylinders."""
        orders, throws, fixed = self.waves.orders[:, 0], self.waves.throws, norm.fixed
        k, d = fixed.constant.shape
        turned = np.zeros((throws, len(orders), k, d), complex)
        for part, wave in zip(self.waves.parts, norm.waves, strict=True):
            lap = 0 if part.cylinder is None else laps[part.cylinder]
            turned[part.pin] += wave * np.exp(-1j * math.tau * lap * orders)[:, None, None]
        slope = np.zeros((k, d, throws, 2 * len(orders) + 1))
        slope[..., : len(orders)] = np.moveaxis(turned.real, (0, 1), (2, 3))
        slope[..., len(orders) : -1] = -np.moveaxis(turned.imag, (0, 1), (2, 3))
        shared = np.zeros((k, d, self.waves.orders.shape[1] - 1))
        together = np.concatenate([fixed.slope, slope.reshape(k, d, -1), shared], axis=-1)
        return AffineNorm(fixed.norm, fixed.constant, together, fixed.grid)

    def _intervals(self, window: FiringWindow) -> AffineNorm:
        """Return firing intervals, counted from the middle of their bounds in halves of these."""
        matrix, constants = self._firing.rows(window)
        firing = self._firing
        maximum = min(firing.maximum, firing.cycle.angle - (len(constants) - 1) * firing.minimum)
        middle, half = 0.5 * (maximum + firing.minimum), max(0.5 * (maximum - firing.minimum), 0.0) + SLACK
        slope = np.zeros((len(constants), 1, self.waves.throws, 2 * len(self.waves.orders) + 1))
        slope[:, 0, :, -1] = matrix[:, : self.waves.throws] / half
        riders, shared = np.zeros((len(constants), 1, self._riders.size)), matrix[:, None, self.waves.throws :] / half
        return AffineNorm(
            NORMS["maximum"], (constants - middle)[:, None] / half,
            np.concatenate([riders, slope.reshape(len(constants), 1, -1), shared], axis=-1),
            Grid(np.ones(len(constants)), 1),
        )  # fmt: skip

    def box(
        self, program: ThrowProgram, lower: Array, upper: Array, floor: float, cut: float, is_new: bool = False
    ) -> ThrowBox | FathomedPart:
        """Bound a box, cut down to where a design may be better than `cut`; `FathomedPart` where none is.

        Parameters
        ----------
        lower, upper
            Bounds of throws and shared angles [rad].
        floor
            Bound that holds already.
        is_new
            Whether multipliers of other boxes are tried first.
        """
        result: ThrowBox | FathomedPart = INFEASIBLE_PART
        for _ in range(_ROUNDS):
            within = program.window.within(lower, upper)
            if within is None:
                return INFEASIBLE_PART
            lower, upper = within
            result = self._bounded(program, lower, upper, floor, cut, is_new)
            if isinstance(result, FathomedPart):
                return result
            if float(np.sum(result.upper - result.lower)) > _WORTH * float(np.sum(upper - lower)):
                return result
            lower, upper, floor = result.lower, result.upper, result.bound
        return result

    def parts(self, box: ThrowBox, cut: float) -> Iterator[ThrowBox | FathomedPart]:
        """Yield halves of a box, cut where its mixture is farthest from standing at one angle."""
        width = box.upper - box.lower
        spread = np.where(width > NARROWEST, box.spread, 0.0)
        side = int(np.argmax(spread if spread.any() else width))
        for half in halves(Box(box.lower, box.upper, side), float(box.middle[side])):
            yield self.box(box.program, *half, box.bound, cut)

    def _bounded(
        self, program: ThrowProgram, lower: Array, upper: Array, floor: float, cut: float, is_new: bool
    ) -> ThrowBox | FathomedPart:
        """Bound a box by one program."""
        columns = self._riders.columns(*self.waves.arcs(lower, upper))
        arc_box = ArcBox(self.waves.orders[: self._followed], lower, upper)
        for known in self._proofs if is_new else ():
            value, _ = self._bound(program.rows, columns, known, arc_box)
            if value - self.left_out >= cut or self._is_excluded(program, columns, known, arc_box):
                self._remember(known)
                return FathomedPart(cut)
        mixture = Mixture(program, columns, lower, upper, self.waves.orders[: self._followed])
        solution = solve_cones(mixture.problem)
        multipliers = solution.multipliers
        if solution.x is None:
            if self._is_excluded(program, columns, multipliers, arc_box):
                self._remember(multipliers)
                return INFEASIBLE_PART
            return ThrowBox(program, lower, upper, floor, 0.5 * (lower + upper), upper - lower)
        value, arcs = self._bound(program.rows, columns, multipliers, arc_box)
        value -= self.left_out
        if value >= cut:
            self._remember(multipliers)
            return FathomedPart(value)
        ends = arcs.cut(cut - value)
        if ends is None:
            return FathomedPart(cut)
        middle, spread = mixture.middle(solution.x)
        middle = np.clip(middle, *ends)
        at, _ = self.waves.arcs(middle, middle)
        for pin, column, distance in self._riders.spread(columns, solution.x[: mixture.unbalances], at):
            spread[pin] += float(program.pulls[column]) * distance
        return ThrowBox(program, *ends, max(value, floor), middle, spread)

    def _bound(
        self, rows: AffineProblem, columns: BoxColumns, multipliers: Multipliers, arc_box: ArcBox
    ) -> tuple[float, Arcs]:
        """Return the bound that multipliers give of a box, and the functions of its throws (S27)."""
        count = len(rows.limits)
        under = minorant(rows, Multipliers(multipliers.terms if rows.terms else (), multipliers.limits[:count]))
        value, pull = under.constant, under.gradient[: self._riders.size] @ columns.matrix
        if columns.limits:
            ties = AffineProblem((), columns.limits, columns.domains, 1)
            tied = minorant(ties, Multipliers((), multipliers.limits[count : count + len(columns.limits)]))
            value, pull = value + tied.constant, pull + tied.gradient
        value += sum(domain.minimum(pull) for domain in columns.domains)
        count, by_throw = len(self.waves.orders), self._columns_by_throw(under.gradient)
        shared = under.gradient[len(under.gradient) - self.waves.orders.shape[1] + 1 :]
        arcs = arc_box.functions(by_throw[:, :count] - 1j * by_throw[:, count:-1], by_throw[:, -1], shared)
        return float(value + arcs.minimum), arcs

    def _is_excluded(
        self, program: ThrowProgram, columns: BoxColumns, multipliers: Multipliers, arc_box: ArcBox
    ) -> bool:
        limits = replace(program.rows, terms=())
        value, _ = self._bound(limits, columns, multipliers, arc_box)
        prices = [norm.dual_norm(z) for (_, norm), z in zip(limits.limits, multipliers.limits, strict=False)]
        sizes = [
            maximum + float(np.abs(norm.constant).sum() + np.abs(norm.slope).sum()) for maximum, norm in limits.limits
        ]
        if value <= ROUNDING * sum(price * size for price, size in zip(prices, sizes, strict=True)):
            return False
        self.conflict |= {name for name, price in zip(program.names, prices, strict=True) if price > 0.0}
        return True

    def _remember(self, multipliers: Multipliers) -> None:
        self._proofs = [multipliers, *(other for other in self._proofs if other is not multipliers)][:_KNOWN]


def compressed(norm: WaveNorm) -> WaveNorm:
    """Return a root mean square in as few rows as there are columns (S12), other norms without idle components."""
    fixed = norm.fixed
    if not fixed.norm.is_euclidean:
        acts = np.flatnonzero(
            fixed.constant.any(axis=0) | fixed.slope.any(axis=(0, 2)) | norm.waves.any(axis=(0, 1, 2))
        )
        acts = acts if len(acts) else np.arange(1)
        fewer = replace(fixed, constant=fixed.constant[:, acts], slope=fixed.slope[:, acts])
        return WaveNorm(fewer, norm.waves[..., acts], norm.left_out)
    scaled = np.sqrt(fixed.grid.weights)[:, None]
    waves = norm.waves * scaled
    rows = compress_rows([fixed.constant * scaled, np.moveaxis(fixed.slope * scaled[..., None], -1, 0),
                       waves.real, waves.imag])  # fmt: skip
    if rows is None:
        return norm
    constant, slope, real, imaginary = rows
    fewer = AffineNorm(fixed.norm, constant, np.moveaxis(slope, 0, -1), Grid(np.ones(len(constant)), len(constant)))
    return WaveNorm(fewer, real + 1j * imaginary, norm.left_out)


class Mixture:
    """Throws of a box as mixtures of a few angles of every arc: the program that proposes multipliers (S27).

    Shared angles are mixed first, and for each of theirs every throw by itself.

    Attributes
    ----------
    problem
        The cone program; its columns are those of unbalances, then shares of the angles.
    unbalances
        Number of columns of unbalances.
    """

    def __init__(self, program: ThrowProgram, columns: BoxColumns, lower: Array, upper: Array, orders: Array) -> None:
        self.unbalances, self._orders = columns.matrix.shape[1], orders
        throws, shared_count = len(program.weights), orders.shape[1] - 1
        rows, self._weights = program.heavy, program.weights[:, : len(orders)]
        is_heavy = self._weights > _FAINT * self._weights.max()
        step_limits = (_MOST[shared_count],) * throws + (_MOST_SHARED[shared_count],) * shared_count
        side_orders = [
            *(np.where(row, orders[:, 0], 0.0) for row in is_heavy),
            *np.where(is_heavy.any(axis=0), orders[:, 1:].T, 0.0),
        ]
        steps = [
            min(max(math.ceil(float(np.abs(row).max(initial=0.0)) * width / _APART) + 1, _FEWEST), limit)
            if width > 0.0
            else 1
            for row, width, limit in zip(side_orders, upper - lower, step_limits, strict=True)
        ]
        every = [np.linspace(a, b, n) for a, b, n in zip(lower, upper, steps, strict=True)]
        self._angles, shared = every[:throws], list(product(*every[throws:]))
        self._shared = np.array(shared).reshape(len(shared), shared_count)
        places = np.concatenate([[0], np.cumsum([len(shared) - 1, *(len(shared) * (n - 1) for n in steps[:throws])])])
        self._places, size = self.unbalances + places, int(self.unbalances + places[-1])
        points = [self._wave_points(angles) for angles in self._angles]
        ties = []
        for maximum, norm in columns.limits:
            slope = np.zeros((*norm.constant.shape, size))
            slope[..., : norm.slope.shape[-1]] = norm.slope
            ties.append((maximum, replace(norm, slope=slope)))
        shares = [Decision(f"share {k}", "", Interval(0.0, 1.0), 0.0, ()) for k in range(size - self.unbalances)]
        terms, limits = (
            tuple((number, self._through(norm, columns.matrix, points)) for number, norm in pairs)
            for pairs in (rows.terms, rows.limits)
        )
        domains = domains_of([*(domain.decision for domain in columns.domains), *shares])
        self.problem = AffineProblem(terms, (*limits, *ties, *self._share_limits(size)), domains, 1)

    def _wave_points(self, angles: Array) -> Array:
        turned = np.add.outer(self._shared @ self._orders[:, 1:].T, np.zeros(len(angles))).swapaxes(1, 2)
        turned = turned + np.outer(angles, self._orders[:, 0])
        at = np.broadcast_to(angles[None, :, None], (*turned.shape[:2], 1))
        return np.concatenate([np.cos(turned), np.sin(turned), at], axis=2)

    def _through(self, norm: AffineNorm, matrix: Array, points: Sequence[Array]) -> AffineNorm:
        """Return a norm of rows in the columns of a box, and in shares of the angles."""
        k, d, n = norm.slope.shape
        flat, at = norm.slope.reshape(k * d, n), len(matrix)
        shared = flat[:, n - self._shared.shape[1] :] @ self._shared.T
        slopes = []
        for waves in points:
            shape, width = waves.shape[:2], waves.shape[2]
            values = (flat[:, at : at + width] @ waves.reshape(-1, width).T).reshape(k * d, *shape)
            at += width
            shared += values[:, :, 0]
            slopes.append((values[:, :, 1:] - values[:, :, :1]).reshape(k * d, -1))
        constant = norm.constant.ravel() + shared[:, 0]
        slope = np.concatenate([flat[:, : len(matrix)] @ matrix, shared[:, 1:] - shared[:, :1], *slopes], axis=1)
        return AffineNorm(norm.norm, constant.reshape(k, d), slope.reshape(k, d, -1), norm.grid)

    def _share_limits(self, size: int) -> list[tuple[float, AffineNorm]]:
        """Limit shares of shared angles to one, and those of a throw to that of its shared angles."""
        count, first = len(self._shared), self._places[0]
        slopes, constants = [np.zeros((0, size))], [np.zeros(0)]
        if count > 1:
            slopes.append(np.zeros((1, size)))
            slopes[-1][0, first : first + count - 1] = -1.0
            constants.append(np.ones(1))
        for at, angles in zip(self._places[1:], self._angles, strict=False):
            if len(angles) == 1:
                continue
            slope = np.zeros((count, size))
            slope[0, first : first + count - 1] = -1.0
            slope[np.arange(1, count), first + np.arange(count - 1)] = 1.0
            for b in range(count):
                slope[b, at + b * (len(angles) - 1) : at + (b + 1) * (len(angles) - 1)] = -1.0
            slopes.append(slope)
            constants.append(np.arange(count) == 0)
        slope, constant = np.concatenate(slopes), np.concatenate(constants)
        if not len(slope):
            return []
        # each is left between 0 and 1, counted from the middle
        grid = Grid(np.ones(len(slope)), len(slope))
        return [(0.5, AffineNorm(NORMS["maximum"], constant[:, None] - 0.5, slope[:, None], grid))]

    def middle(self, x: Array) -> tuple[Array, Array]:
        """Return the mean angle of every mixture [rad], and its distance from standing there."""
        count, first = len(self._shared), self._places[0]
        shares = x[first : first + count - 1]
        shares = np.concatenate([[1.0 - shares.sum()], shares])
        mean = shares @ self._shared
        turned = np.exp(1j * self._shared @ self._orders[:, 1:].T)
        middle, spread = [], []
        for at, angles, weights in zip(self._places[1:], self._angles, self._weights, strict=False):
            part = x[at : at + count * (len(angles) - 1)].reshape(count, len(angles) - 1)
            part = np.concatenate([(shares - part.sum(axis=1))[:, None], part], axis=1)
            at_mean = float((part @ angles).sum())
            waves = np.exp(1j * np.outer(angles, self._orders[:, 0]))
            wave_at_mean = (shares @ turned) * np.exp(1j * self._orders[:, 0] * at_mean)
            missing = ((part @ waves) * turned).sum(axis=0) - wave_at_mean
            middle.append(at_mean)
            spread.append(float(np.linalg.norm(weights * np.abs(missing))))
        for s in range(len(mean)):
            waves = np.exp(1j * np.outer(self._shared[:, s], self._orders[:, 1 + s]))
            missing = shares @ waves - np.exp(1j * mean[s] * self._orders[:, 1 + s])
            spread.append(float(np.linalg.norm(self._weights * np.abs(missing))))
        return np.array([*middle, *mean]), np.array(spread)
