"""Bound boxes of throw angles by cone programs (S26-S28).

In a box, the waves e^{i h theta} of every throw are a mixture of those at a few angles, in a second-order cone program.
With its dual rows, the bound is a sum of one function of the angle per throw. The minimum of this sum over the box is
a lower bound. The functions also cut off angles that cannot be better than the best design. Open bank and split pin
angles, which all throws have in common, are called shared angles.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.affine import MAX_NUMBERS, AffineNorm, AffineProblem
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

# width of a side that is not divided any more [rad]
NARROWEST = 1e-9
# number of multipliers to try on other boxes
_MAX_PROOFS = 8
# number of angles of an arc in a mixture: smallest; largest for shared angles and for throws, by the number of shared
# angles; and the largest phase between two angles in the highest order that counts [rad]
_MIN_STEPS, _MAX_SHARED_STEPS, _MAX_STEPS, _STEP = 3, (1, 5, 3), (12, 6, 5), 0.6
# relative size of an order that does not count for the number of angles of an arc
_NEGLIGIBLE = 0.02


@dataclass(frozen=True, eq=False)
class ThrowProgram:
    """Norms of one firing window, with rows affine in unbalances, waves e^{i h theta} of the throws, and throws.

    Attributes
    ----------
    rows
        Norms with all columns: unbalances; for every throw the cosines and sines of all waves, then theta; and the
        shared angles.
    names
        Names of the limits; empty for the firing intervals.
    order_sizes
        Size of every throw's orders in objective and limits, shape (throws, orders).
    """

    window: FiringWindow
    rows: AffineProblem
    names: tuple[str, ...]
    order_sizes: Array


@dataclass(frozen=True, eq=False)
class ThrowBox:
    """Box of throws and shared angles, with a lower bound of the objective.

    Attributes
    ----------
    lower, upper
        Bounds of throws, then of shared angles (open bank and split pin angle) [rad].
    bound
        Lower bound of the objective in the box [SI].
    middle
        Mean angles of the mixtures [rad].
    spread
        Distance of every mixture from the waves at its mean angle, weighted by the sizes of the orders.
    """

    program: ThrowProgram
    lower: Array
    upper: Array
    bound: float
    middle: Array
    spread: Array

    @property
    def is_exact(self) -> bool:
        """True if every side is too narrow to divide."""
        return bool(np.all(self.upper - self.lower <= NARROWEST))


class ThrowPrograms:
    """Cone programs of boxes of throws, with the names of limits that boxes without a design violate (`conflict`).

    `samples` over the period are those of norms that are no sums of squares.
    """

    def __init__(self, waves: ThrowWaves, riders: Riders, firing: FiringBounds, samples: int) -> None:
        self.waves, self._riders, self._firing = waves, riders, firing
        problem = waves.problem
        self._terms = [
            (t.weight, compress(waves.norm(t.measure, waves.samples(t.measure, samples)))) for t in problem.objective
        ]
        self._limits = [
            (x, compress(waves.norm(x.measure, waves.samples(x.measure, samples))))
            for x in problem.limits
            if math.isfinite(x.maximum)
        ]
        norms = [norm for _, norm in (*self._terms, *self._limits)]
        count = 2 * sum(norm.waves[0].size * waves.throws for norm in norms)
        if count > MAX_NUMBERS:
            raise ModelError(f"the program has {1e-6 * count:.0f} million numbers, too many for memory")
        if not all(np.isfinite(norm.waves).all() and np.isfinite(norm.fixed.constant).all() for norm in norms):
            raise ModelError("a load on an undamped resonance has no finite response")
        # orders with a function of the angle; for higher orders, which are negligible, only their size counts
        sizes = np.zeros(len(waves.orders))
        for norm in norms:
            by_order = np.sqrt(np.square(np.abs(norm.waves)).sum(axis=(0, 2, 3)))
            sizes += by_order / (float(by_order.max()) or 1.0)
        self._order_count = int(np.flatnonzero(sizes > waves.min_arc_share * sizes.max()).max(initial=0)) + 1
        self._by_laps: dict[tuple[int, ...], ThrowProgram] = {}
        self._proofs: list[Multipliers] = []
        self.conflict: set[str] = set()

    @property
    def truncation(self) -> float:
        """Largest part of the objective that the truncated orders may have [SI]."""
        return sum(weight * norm.left_out for weight, norm in self._terms)

    def program(self, window: FiringWindow) -> ThrowProgram:
        """Return objective and limits as norms of throw angles, for the whole turns and bounds of one firing window."""
        if window.laps not in self._by_laps:
            self._by_laps[window.laps] = self._with_laps(window)
        program = self._by_laps[window.laps]
        if not window.order:
            return replace(program, window=window)
        intervals = self._intervals(window)
        rows = replace(program.rows, limits=(*program.rows.limits, (1.0, intervals)))
        return replace(program, window=window, rows=rows, names=(*program.names, ""))

    def _with_laps(self, window: FiringWindow) -> ThrowProgram:
        """Return objective and limits for all firing orders with the same whole turns, for any firing intervals."""
        terms = tuple((weight, self._rows(norm, window.laps)) for weight, norm in self._terms)
        limits = tuple((limit.maximum + norm.left_out, self._rows(norm, window.laps)) for limit, norm in self._limits)
        count = len(self.waves.orders)
        order_sizes = np.zeros((self.waves.throws, count))
        for _, norm in (*terms, *limits):
            size = np.linalg.norm(norm.slope.reshape(norm.constant.size, -1), axis=0)
            by_order = self._columns_by_throw(size)
            by_order = np.hypot(by_order[:, :count], by_order[:, count : 2 * count])
            order_sizes += by_order / (float(by_order.max()) or 1.0)
        names = tuple(limit.name for limit, _ in self._limits)
        return ThrowProgram(window, AffineProblem(terms, limits, (), 1), names, order_sizes)

    def _columns_by_throw(self, columns: Array) -> Array:
        width = 2 * len(self.waves.orders) + 1
        return columns[self._riders.size :][: self.waves.throws * width].reshape(self.waves.throws, width)

    def _rows(self, norm: WaveNorm, laps: tuple[int, ...]) -> AffineNorm:
        """Return a norm of waves as an affine norm, for given whole turns (laps) of the cylinders."""
        orders, throws, fixed = self.waves.orders[:, 0], self.waves.throws, norm.fixed
        k, d = fixed.constant.shape
        turned_waves = np.zeros((throws, len(orders), k, d), complex)
        for part, wave in zip(self.waves.parts, norm.waves, strict=True):
            lap = 0 if part.cylinder is None else laps[part.cylinder]
            turned_waves[part.pin] += wave * np.exp(-1j * math.tau * lap * orders)[:, None, None]
        slope = np.zeros((k, d, throws, 2 * len(orders) + 1))
        slope[..., : len(orders)] = np.moveaxis(turned_waves.real, (0, 1), (2, 3))
        slope[..., len(orders) : -1] = -np.moveaxis(turned_waves.imag, (0, 1), (2, 3))
        shared = np.zeros((k, d, self.waves.orders.shape[1] - 1))
        all_slopes = np.concatenate([fixed.slope, slope.reshape(k, d, -1), shared], axis=-1)
        return AffineNorm(fixed.norm, fixed.constant, all_slopes, fixed.grid)

    def _intervals(self, window: FiringWindow) -> AffineNorm:
        """Return the firing intervals as a norm: at most 1 if all are within their bounds.

        Each interval counts by its deviation from the middle of its bounds, over half their range.
        """
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
        self, program: ThrowProgram, lower: Array, upper: Array, floor: float, cutoff: float,
        reuse_multipliers: bool = False,
    ) -> ThrowBox | FathomedPart:  # fmt: skip
        """Return a box shrunk to the angles where a design may be better than `cutoff`, with its lower bound.

        Parameters
        ----------
        lower, upper
            Bounds of throws and shared angles [rad].
        floor
            Known lower bound of the objective in the box [SI].
        cutoff
            Objective that a design must be below [SI].
        reuse_multipliers
            True to try multipliers of earlier boxes before a new program.

        Returns
        -------
        The box, or `FathomedPart` if it has no such design.
        """
        window_bounds = program.window.within(lower, upper)
        if window_bounds is None:
            return INFEASIBLE_PART
        lower, upper = window_bounds
        columns = self._riders.columns(*self.waves.throw_bounds(lower, upper))
        arc_box = ArcBox(self.waves.orders[: self._order_count], lower, upper)
        for proof in self._proofs if reuse_multipliers else ():
            value, _ = self._bound(program.rows, columns, proof, arc_box)
            if value - self.truncation >= cutoff or self._prove_infeasible(program, columns, proof, arc_box):
                self._store_proof(proof)
                return FathomedPart(cutoff)
        mixture = Mixture(program, columns, lower, upper, self.waves.orders)
        solution = solve_cones(mixture.problem)
        multipliers = solution.multipliers
        if solution.x is None:
            if self._prove_infeasible(program, columns, multipliers, arc_box):
                self._store_proof(multipliers)
                return INFEASIBLE_PART
            return ThrowBox(program, lower, upper, floor, 0.5 * (lower + upper), upper - lower)
        value, arcs = self._bound(program.rows, columns, multipliers, arc_box)
        value -= self.truncation
        if value >= cutoff:
            self._store_proof(multipliers)
            return FathomedPart(value)
        ends = arcs.cut(cutoff - value)
        if ends is None:
            return FathomedPart(cutoff)
        middle, spread = mixture.middle(solution.x)
        middle = np.clip(middle, *ends)
        return ThrowBox(program, *ends, max(value, floor), middle, spread)

    def parts(self, box: ThrowBox, cutoff: float) -> Iterator[ThrowBox | FathomedPart]:
        """Yield the two parts of a box of throws, divided at the mean angle of the mixture with the largest spread."""
        width = box.upper - box.lower
        spread = np.where(width > NARROWEST, box.spread, 0.0)
        side = int(np.argmax(spread if spread.any() else width))
        for half in halves(Box(box.lower, box.upper, side), float(box.middle[side])):
            yield self.box(box.program, *half, box.bound, cutoff)

    def _bound(
        self, rows: AffineProblem, columns: BoxColumns, multipliers: Multipliers, arc_box: ArcBox
    ) -> tuple[float, Arcs]:
        """Return the lower bound of the objective on a box by multipliers, and the minima over its angles (S27)."""
        count = len(rows.limits)
        lower_function = minorant(
            rows, Multipliers(multipliers.terms if rows.terms else (), multipliers.limits[:count])
        )
        value, gradient = lower_function.constant, lower_function.gradient[: self._riders.size] @ columns.matrix
        if columns.limits:
            ties = AffineProblem((), columns.limits, columns.domains, 1)
            tie_function = minorant(ties, Multipliers((), multipliers.limits[count : count + len(columns.limits)]))
            value, gradient = value + tie_function.constant, gradient + tie_function.gradient
        value += sum(domain.minimum(gradient) for domain in columns.domains)
        count, by_throw = len(self.waves.orders), self._columns_by_throw(lower_function.gradient)
        shared = lower_function.gradient[len(lower_function.gradient) - self.waves.orders.shape[1] + 1 :]
        arcs = arc_box.functions(by_throw[:, :count] - 1j * by_throw[:, count:-1], by_throw[:, -1], shared)
        return float(value + arcs.minimum), arcs

    def _prove_infeasible(
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

    def _store_proof(self, multipliers: Multipliers) -> None:
        self._proofs = [multipliers, *(proof for proof in self._proofs if proof is not multipliers)][:_MAX_PROOFS]


def compress(norm: WaveNorm) -> WaveNorm:
    """Return the same norm with fewer rows: root mean squares are reduced (S12), others lose zero components."""
    fixed = norm.fixed
    if not fixed.norm.is_euclidean:
        is_nonzero = np.flatnonzero(
            fixed.constant.any(axis=0) | fixed.slope.any(axis=(0, 2)) | norm.waves.any(axis=(0, 1, 2))
        )
        is_nonzero = is_nonzero if len(is_nonzero) else np.arange(1)
        reduced = replace(fixed, constant=fixed.constant[:, is_nonzero], slope=fixed.slope[:, is_nonzero])
        return WaveNorm(reduced, norm.waves[..., is_nonzero], norm.left_out)
    scaled = np.sqrt(fixed.grid.weights)[:, None]
    waves = norm.waves * scaled
    rows = compress_rows([fixed.constant * scaled, np.moveaxis(fixed.slope * scaled[..., None], -1, 0),
                       waves.real, waves.imag])  # fmt: skip
    if rows is None:
        return norm
    constant, slope, real, imaginary = rows
    reduced = AffineNorm(fixed.norm, constant, np.moveaxis(slope, 0, -1), Grid(np.ones(len(constant)), len(constant)))
    return WaveNorm(reduced, real + 1j * imaginary, norm.left_out)


class Mixture:
    """Cone program of a box in which every throw is a mixture of a few angles of its arc (S27).

    The shared angles have one mixture; for each of its points, every throw has its own mixture. The program proposes
    multipliers.

    Attributes
    ----------
    problem
        Cone program; its columns are unbalances, then shares of the angles.
    """

    def __init__(self, program: ThrowProgram, columns: BoxColumns, lower: Array, upper: Array, orders: Array) -> None:
        unbalances, self._orders = columns.matrix.shape[1], orders
        throws, shared_count = len(program.order_sizes), orders.shape[1] - 1
        rows, self._weights = program.rows, program.order_sizes
        is_significant = self._weights > _NEGLIGIBLE * self._weights.max()
        step_limits = (_MAX_STEPS[shared_count],) * throws + (_MAX_SHARED_STEPS[shared_count],) * shared_count
        side_orders = [
            *(np.where(row, orders[:, 0], 0.0) for row in is_significant),
            *np.where(is_significant.any(axis=0), orders[:, 1:].T, 0.0),
        ]
        steps = [
            min(max(math.ceil(float(np.abs(row).max(initial=0.0)) * width / _STEP) + 1, _MIN_STEPS), limit)
            if width > 0.0
            else 1
            for row, width, limit in zip(side_orders, upper - lower, step_limits, strict=True)
        ]
        side_angles = [np.linspace(a, b, n) for a, b, n in zip(lower, upper, steps, strict=True)]
        self._angles, shared = side_angles[:throws], list(product(*side_angles[throws:]))
        self._shared = np.array(shared).reshape(len(shared), shared_count)
        places = np.concatenate([[0], np.cumsum([len(shared) - 1, *(len(shared) * (n - 1) for n in steps[:throws])])])
        self._places, size = unbalances + places, int(unbalances + places[-1])
        shared_phases = (self._shared @ self._orders[:, 1:].T)[:, None]
        points = []
        for angles in self._angles:
            phases = shared_phases + np.outer(angles, self._orders[:, 0])
            theta = np.broadcast_to(angles[None, :, None], (*phases.shape[:2], 1))
            points.append(np.concatenate([np.cos(phases), np.sin(phases), theta], axis=2))
        ties = []
        for maximum, norm in columns.limits:
            slope = np.zeros((*norm.constant.shape, size))
            slope[..., : norm.slope.shape[-1]] = norm.slope
            ties.append((maximum, replace(norm, slope=slope)))
        shares = [Decision(f"share {k}", "", Interval(0.0, 1.0), 0.0, ()) for k in range(size - unbalances)]
        terms, limits = (
            tuple((number, self._through(norm, columns.matrix, points)) for number, norm in pairs)
            for pairs in (rows.terms, rows.limits)
        )
        domains = domains_of([*(domain.decision for domain in columns.domains), *shares])
        self.problem = AffineProblem(terms, (*limits, *ties, *self._share_limits(size)), domains, 1)

    def _through(self, norm: AffineNorm, matrix: Array, points: Sequence[Array]) -> AffineNorm:
        """Return a norm of the model's columns (waves, unbalances) as a norm of the box's columns (mixture weights)."""
        k, d, n = norm.slope.shape
        flat, first = norm.slope.reshape(k * d, n), len(matrix)
        shared = flat[:, n - self._shared.shape[1] :] @ self._shared.T
        slopes = []
        for waves in points:
            shape, width = waves.shape[:2], waves.shape[2]
            values = (flat[:, first : first + width] @ waves.reshape(-1, width).T).reshape(k * d, *shape)
            first += width
            shared += values[:, :, 0]
            slopes.append((values[:, :, 1:] - values[:, :, :1]).reshape(k * d, -1))
        constant = norm.constant.ravel() + shared[:, 0]
        slope = np.concatenate([flat[:, : len(matrix)] @ matrix, shared[:, 1:] - shared[:, :1], *slopes], axis=1)
        return AffineNorm(norm.norm, constant.reshape(k, d), slope.reshape(k, d, -1), norm.grid)

    def _share_limits(self, size: int) -> list[tuple[float, AffineNorm]]:
        """Return limits on the weights of a mixture of angles: a sum of 1, and of a throw's weights to its angle's."""
        count, first = len(self._shared), self._places[0]
        slopes, constants = [np.zeros((0, size))], [np.zeros(0)]
        if count > 1:
            slopes.append(np.zeros((1, size)))
            slopes[-1][0, first : first + count - 1] = -1.0
            constants.append(np.ones(1))
        for start, angles in zip(self._places[1:], self._angles, strict=False):
            if len(angles) == 1:
                continue
            slope = np.zeros((count, size))
            slope[0, first : first + count - 1] = -1.0
            slope[np.arange(1, count), first + np.arange(count - 1)] = 1.0
            for b in range(count):
                slope[b, start + b * (len(angles) - 1) : start + (b + 1) * (len(angles) - 1)] = -1.0
            slopes.append(slope)
            constants.append(np.arange(count) == 0)
        slope, constant = np.concatenate(slopes), np.concatenate(constants)
        if not len(slope):
            return []
        # the share of the first angle, which is what the other shares leave, lies between 0 and 1
        grid = Grid(np.ones(len(slope)), len(slope))
        return [(0.5, AffineNorm(NORMS["maximum"], constant[:, None] - 0.5, slope[:, None], grid))]

    def middle(self, x: Array) -> tuple[Array, Array]:
        """Return the mean angle of every mixture of angles [rad], and how far the mixture is from that angle.

        Both are from a solution `x` of the program, shape (columns,). The distance is that of the mixture's waves from
        those at the mean angle, weighted.
        """
        count, first = len(self._shared), self._places[0]
        shares = x[first : first + count - 1]
        shares = np.concatenate([[1.0 - shares.sum()], shares])
        mean = shares @ self._shared
        shared_waves = np.exp(1j * self._shared @ self._orders[:, 1:].T)
        middle, spread = [], []
        for start, angles, weights in zip(self._places[1:], self._angles, self._weights, strict=False):
            throw_shares = x[start : start + count * (len(angles) - 1)].reshape(count, len(angles) - 1)
            throw_shares = np.concatenate([(shares - throw_shares.sum(axis=1))[:, None], throw_shares], axis=1)
            angle = float((throw_shares @ angles).sum())
            waves = np.exp(1j * np.outer(angles, self._orders[:, 0]))
            wave_at_mean = (shares @ shared_waves) * np.exp(1j * self._orders[:, 0] * angle)
            difference = ((throw_shares @ waves) * shared_waves).sum(axis=0) - wave_at_mean
            middle.append(angle)
            spread.append(float(np.linalg.norm(weights * np.abs(difference))))
        for s in range(len(mean)):
            waves = np.exp(1j * np.outer(self._shared[:, s], self._orders[:, 1 + s]))
            difference = shares @ waves - np.exp(1j * mean[s] * self._orders[:, 1 + s])
            spread.append(float(np.linalg.norm(self._weights * np.abs(difference))))
        return np.array([*middle, *mean]), np.array(spread)
