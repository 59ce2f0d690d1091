"""Problem with an open crank star as norms of load rows that are affine in the star and the decisions (S11).

Loads of throws add up. The rows of any star are the rows of one star, the origin, plus the change as each throw moves
to its step. The exact model computes the change of one throw at a time. Gas is evaluated at the origin only, because
even firing of equal cylinders gives the same roll moment in every order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.load_models.isolated_cylinders import isolate_cylinder, motored, only_gas_of
from laufruhe.machine.firing import even_patterns, firing_lattice, slot_order, slot_steps, star_throws
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid, Norm
from laufruhe.numerics.spectrum import Spectrum, common_base
from laufruhe.physics.crank_stars import Stars, StarSpace
from laufruhe.problem.channels import LoadChannel
from laufruhe.problem.decision import Domain
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure, Rows, kinks_of, load_rows
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem

# relative difference of slopes that counts as zero
_SAME_SLOPE = 1e-11
# relative rounding error of rows that cancel
_ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class StarNorm:
    """Norm N(V0 + sum_k D[k, p_k] + (B + sum_k E[k, p_k]) x) of the loads of crank stars.

    Throw k stands on step p_k, and x is the decision vector.

    Attributes
    ----------
    constant
        Load rows V0 of the origin star, shape (k, d).
    moves
        Change D of the rows when a throw moves to a step, shape (throws, steps, k, d).
    slope
        Derivative B of the rows of the origin star, shape (k, d, n).
    slope_moves
        Change E of the derivative, shape (throws, steps, k, d, n); None if unbalances act alike in all crank stars.
    """

    norm: Norm
    constant: Array
    moves: Array
    slope: Array
    slope_moves: Array | None
    grid: Grid

    def at(self, star: Sequence[int]) -> AffineNorm:
        """Return the norm as a function of the unbalances, for the crank star with these steps of its throws."""
        indices = np.arange(len(star)), np.asarray(star, dtype=np.intp)

        def total(first: Array, changes: Array) -> Array:
            # sums that are rounding errors become zero
            moves = changes[indices]
            sums = first + moves.sum(axis=0)
            largest = np.abs(moves).max(initial=0.0, axis=tuple(range(1, moves.ndim)))
            return np.where(np.abs(sums) <= _ROUNDING * (np.abs(first).max(initial=0.0) + largest.sum()), 0.0, sums)

        slope = self.slope if self.slope_moves is None else total(self.slope, self.slope_moves)
        return AffineNorm(self.norm, total(self.constant, self.moves), slope, self.grid)

    def with_steps(self, steps: Sequence[int]) -> StarNorm:
        """Return the norm with another list of steps: new step j is the present step `steps[j]`."""
        slope_moves = None if self.slope_moves is None else self.slope_moves[:, list(steps)]
        return replace(self, moves=self.moves[:, list(steps)], slope_moves=slope_moves)


@dataclass(frozen=True, eq=False)
class StarProblem:
    """Problem of all crank stars at one number of samples over the common period.

    `terms` are pairs (weight, norm) of the objective, and `limits` are pairs (maximum, norm).
    """

    terms: tuple[tuple[float, StarNorm], ...]
    limits: tuple[tuple[float, StarNorm], ...]
    domains: tuple[Domain, ...]
    samples: int

    @property
    def compressed(self) -> StarProblem:
        """Problem with the same objective and fewer rows in root mean squares (S12); see `compress_norm`."""
        terms, limits = (
            tuple((number, compress_norm(norm) if norm.norm.is_euclidean else norm) for number, norm in pairs)
            for pairs in (self.terms, self.limits)
        )
        return replace(self, terms=terms, limits=limits)

    def at(self, star: Sequence[int]) -> AffineProblem:
        """Return the problem of one crank star, given by the step of every throw."""
        terms = tuple((weight, norm.at(star)) for weight, norm in self.terms)
        limits = tuple((maximum, norm.at(star)) for maximum, norm in self.limits)
        return AffineProblem(terms, limits, self.domains, self.samples)


class StarModel:
    """Loads of the origin crank star, and of all stars that differ from it in one throw.

    Parameters
    ----------
    geometry
        Bank angle and split pin [rad]; None for one that the layout does not have.
    origin
        Step of every throw in the star from which moves are counted; the first star of the space if None.
    """

    def __init__(
        self,
        phasing: Phasing,
        space: StarSpace,
        geometry: tuple[float | None, float | None],
        origin: tuple[int, ...] | None = None,
    ) -> None:
        self.phasing, self.space, self.geometry = phasing, space, geometry
        self.layout: Layout = phasing.layout(*geometry)
        self._origin = space.first if origin is None else origin
        self.problem = with_upright_angles(phasing.problem_of(phasing.star(self._origin, space.phases, geometry)))
        self._full_model = AffineModel(self.problem, keep_all=True)
        self._origin_motored = self._motored(self._origin)
        self._one_moved = {
            (k, p): self._motored(tuple(p if j == k else step for j, step in enumerate(self._origin)))
            for k in range(1, space.throws)
            for p in range(space.phases)
            if p != self._origin[k]
        }
        self.base = common_base([model.base for model in self.models])
        for model in self.models:
            model.base, model.kink_model = self.base, self._full_model
        self.domains = self._full_model.domains
        self._cache: dict[tuple[int, bool], StarProblem] = {}

    @property
    def models(self) -> list[AffineModel]:
        """Load models of the stars whose loads determine those of all other stars."""
        return [self._full_model, self._origin_motored, *self._one_moved.values()]

    @property
    def samples(self) -> int:
        """Number of samples over one period of the loads that the fidelity of the problem asks for."""
        return self._full_model.full_samples

    def _motored(self, star: Sequence[int]) -> AffineModel:
        throws = star_throws(self.layout, star, self.space.phases)
        candidate = Candidate(throws, None, *self.geometry, without_gas=True)
        return AffineModel(with_upright_angles(self.phasing.problem_of(candidate)), keep_all=True)

    def at(self, samples: int, averaged: bool = False) -> StarProblem:
        """Return every measure as a function of crank star and unbalances, sampled over the period of the loads.

        Rows of means are averages over the step about each sample if `averaged` (P7).
        """
        averages_means = averaged and any(m.is_load and m.norm.averages for m in self.problem.measures)
        key = samples, averages_means
        if key not in self._cache:
            self._cache[key] = self._rows(samples, averages_means).compressed
        return self._cache[key]

    def _rows(self, samples: int, averaged: bool) -> StarProblem:
        problems = [model.at(samples, averaged) for model in self.models]
        terms, limits = (
            tuple((column[0][0], self._star_norm(*(norm for _, norm in column))) for column in zip(*pairs, strict=True))
            for pairs in ([problem.terms for problem in problems], [problem.limits for problem in problems])
        )
        return StarProblem(terms, limits, self.domains, samples)

    def _star_norm(self, complete: AffineNorm, origin: AffineNorm, *moved: AffineNorm) -> StarNorm:
        # norms of the models in the order of `models`
        def changes(first: Array, rows: Sequence[Array]) -> Array:
            total = np.zeros((self.space.throws, self.space.phases, *first.shape))
            for place, moved_rows in zip(self._one_moved, rows, strict=True):
                np.subtract(moved_rows, first, out=total[place])
            return total

        moves = changes(origin.constant, [norm.constant for norm in moved])
        # slopes mostly agree, which saves the memory for their changes
        negligible = _SAME_SLOPE * np.abs(origin.slope).max(initial=0.0)
        is_same = all(np.abs(norm.slope - origin.slope).max(initial=0.0) <= negligible for norm in moved)
        slope_moves = None if is_same else changes(origin.slope, [norm.slope for norm in moved])
        return StarNorm(complete.norm, complete.constant, moves, complete.slope, slope_moves, complete.grid)


def with_upright_angles(problem: Problem) -> Problem:
    """Return the problem with the angles of open unbalances counted from the vertical, and not from their throw.

    Only unbalances of free angle change: their set, a disc, is the same from every angle. Counted from the vertical,
    they cause the same load in every crank star.
    """
    decisions = []
    for decision in problem.decisions:
        drives = decision.rotor_drives
        if drives and decision.set.free_angle and drives[0].gain != 0.0:
            turn = drives[0].gain / abs(drives[0].gain)
            turn = turn.conjugate() if drives[0].mirrored else turn
            turned = tuple(
                replace(drive, gain=drive.gain * (turn if drive.mirrored else turn.conjugate())) for drive in drives
            )
            decision = replace(decision, drives=turned, start=decision.start * turn)
        decisions.append(decision)
    return replace(problem, decisions=tuple(decisions))


def compress_rows(parts: Sequence[Array]) -> list[Array] | None:
    """Return fewer load rows with the same length, for any sum of the arrays `parts`, shape (..., k, d) (S12).

    The result has the shape (..., m, 1). Its rows come from the factor R of a QR decomposition, because the factor Q
    keeps every length. The result is None if R would have no fewer rows than k d.
    """
    k, d = parts[0].shape[-2:]
    flat = [part.reshape(-1, k * d) for part in parts]
    matrix = np.concatenate(flat).T
    if len(matrix) <= matrix.shape[1]:
        return None
    small = np.asarray(np.linalg.qr(matrix, mode="r")).T
    split = np.split(small, np.cumsum([len(part) for part in flat])[:-1])
    return [rows.reshape(*part.shape[:-2], small.shape[1], 1) for rows, part in zip(split, parts, strict=True)]


def compress_norm(norm: StarNorm) -> StarNorm:
    """Return the same root mean square of loads with at most one row for each constant, throw move and slope (S12)."""
    root = np.sqrt(norm.grid.weights)[:, None]
    parts = [norm.constant * root, norm.moves * root, np.moveaxis(norm.slope * root[..., None], -1, 0)]
    if norm.slope_moves is not None:
        parts.append(np.moveaxis(norm.slope_moves * root[..., None], -1, 2))
    compressed = compress_rows(parts)
    if compressed is None:
        return norm
    constant, moves, slope = compressed[:3]
    slope_moves = None if norm.slope_moves is None else np.moveaxis(compressed[3], 2, -1)
    grid = Grid(np.ones(len(constant)), len(constant))
    return StarNorm(norm.norm, constant, moves, np.moveaxis(slope, 0, -1), slope_moves, grid)


# relative rounding error of squares of norms
_SQUARE_ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class PairTable:
    """Table of the square of one root mean square for all crank stars, a sum over pairs of throws (V9).

    Throw k stands on step p_k of the star and adds load rows m_k(p_k) to the rows V0. The square is

        |V0 + sum_k m_k(p_k)|^2 = c + sum_k L_k(p_k) + 2 sum_{k<l} m_k(p_k) . m_l(p_l).

    The tables of L and of the products have the same size for any number of orders, sections and operating points.

    Attributes
    ----------
    constant
        Square c of the load rows V0 without any throw.
    linear
        Summand L_k(p) of throw k on step p, shape (throws, steps).
    pairs
        Products 2 m_k(p) . m_l(q) of throw k on step p and throw l on step q, shape (throws, throws, steps, steps).
    rounding
        Largest rounding error of a square.
    """

    constant: float
    linear: Array
    pairs: Array
    rounding: float

    def squares(self, stars: Stars) -> Array:
        """Return the squared norm of each of n crank stars, shape (n,), from the step of every throw, (n, throws)."""
        steps, (throws, count) = stars.astype(np.intp), self.linear.shape
        total = np.full(len(stars), self.constant)
        for k in range(throws):
            total += self.linear[k, steps[:, k]]
            for earlier in range(k):
                total += self.pairs[earlier, k].reshape(-1)[steps[:, earlier] * count + steps[:, k]]
        return total


def pair_table(norm: StarNorm) -> PairTable:
    """Return a root mean square of loads as a table over pairs of throws, if only the crank star is open."""
    weights = np.sqrt(norm.grid.weights)[:, None]
    first = (norm.constant * weights).reshape(-1)
    throws, steps = norm.moves.shape[:2]
    moves = (norm.moves * weights).reshape(throws * steps, -1)
    gram = moves @ moves.T
    squares = np.diag(gram).reshape(throws, steps)
    linear = squares + 2.0 * (moves @ first).reshape(throws, steps)
    pairs = 2.0 * gram.reshape(throws, steps, throws, steps).transpose(0, 2, 1, 3)
    size = float(np.linalg.norm(first)) + float(np.sqrt(squares).max(axis=1).sum())
    return PairTable(float(first @ first), linear, np.ascontiguousarray(pairs), _SQUARE_ROUNDING * size**2)


@dataclass(frozen=True, eq=False)
class PairObjective:
    """Weighted sum of root mean squares, pairs (weight, table), under limits, pairs (maximum, table)."""

    terms: tuple[tuple[float, PairTable], ...]
    limits: tuple[tuple[float, PairTable], ...]

    @classmethod
    def from_problem(cls, problem: StarProblem) -> PairObjective:
        """Return the objective as tables over pairs of throws, for root mean squares and an open crank star alone."""
        terms, limits = (
            tuple((number, pair_table(norm)) for number, norm in pairs) for pairs in (problem.terms, problem.limits)
        )
        return cls(terms, limits)

    @property
    def tables(self) -> list[PairTable]:
        """Tables of the terms, then of the limits."""
        return [table for _, table in (*self.terms, *self.limits)]

    def values(self, _: StarSpace, stars: Stars) -> Array:
        """Return the objective of n crank stars, below their rounding errors; infinite for one that violates a limit.

        `stars` has the step of every throw, shape (n, throws).
        """
        total, squares = np.zeros(len(stars)), [table.squares(stars) for table in self.tables]
        for (weight, table), square in zip(self.terms, squares, strict=False):
            total += weight * np.sqrt(np.maximum(square - table.rounding, 0.0))
        for (maximum, table), square in zip(self.limits, squares[len(self.terms) :], strict=True):
            total[square > maximum**2 * (1.0 + 1e-9) + table.rounding] = np.inf
        return total

    def lower_bound(self, _: StarSpace) -> float:
        """Return a lower bound over all crank stars: zero."""
        return 0.0


class FiringModel(StarModel):
    """Loads of all firing orders: a crank star model whose steps are the slots of the cycle (V9, B8).

    If every cylinder has a throw of its own, a firing order assigns the cylinders to the slots of the cycle, and so
    fixes the crank star. Loads on bearings and torques in the crankshaft are sums over the cylinders.

    Loads that do not depend on the firing order are those of the crank star. To loads inside the crankcase, the load of
    every cylinder is added, later by its slot. The same holds for the gas of cylinders that differ.

    The parameters are those of `StarModel`: `space` has the allowed firing orders, as stars of slots. `origin` has the
    slot of every cylinder in the firing order from which changes are counted.
    """

    def __init__(
        self,
        phasing: Phasing,
        space: StarSpace,
        geometry: tuple[float | None, float | None],
        origin: tuple[int, ...] | None = None,
    ) -> None:
        layout, slots = phasing.layout(*geometry), space.first if origin is None else origin
        steps = firing_lattice(phasing.cycle, phasing.cylinders).steps
        cranks = StarSpace(steps, even_patterns(phasing.cycle, layout), layout.throw_positions)

        def without_inside(candidate: Candidate) -> Problem:
            problem = phasing.problem_of(candidate)
            objective = tuple(term for term in problem.objective if _is_of_star(term.measure))
            limits = tuple(limit for limit in problem.limits if _is_of_star(limit.measure))
            return replace(problem, objective=objective, limits=limits)

        star_phasing = replace(phasing, problem_of=without_inside, firing_order=slot_order(slots))
        super().__init__(star_phasing, cranks, geometry, slot_steps(phasing.cycle, slots))
        # loads that depend on the firing order have the period of the cycle
        self.base = phasing.cycle.base_order
        for model in self.models:
            model.base = self.base
        self.phasing, self.space = phasing, space
        self.problem = with_upright_angles(phasing.problem_of(phasing.fired(slots, geometry)))
        self._slots, self._origin_evaluation = slots, evaluate(self.problem)

    def _rows(self, samples: int, averaged: bool) -> StarProblem:
        stars, steps = super()._rows(samples, averaged), slot_steps(self.phasing.cycle, range(self.space.throws))
        # norms of the crank stars by slots, first of the terms and then of the limits
        star_norms = iter([norm.with_steps(steps) for _, norm in (*stars.terms, *stars.limits)])
        numbers = [(term.weight, term.measure) for term in self.problem.objective]
        numbers += [(limit.maximum, limit.measure) for limit in self.problem.load_limits]
        norms = [(number, self._norm(measure, samples, averaged, star_norms)) for number, measure in numbers]
        count = len(self.problem.objective)
        return StarProblem(tuple(norms[:count]), tuple(norms[count:]), self.domains, samples)

    def _norm(self, measure: Measure, samples: int, averaged: bool, star_norms: Iterator[StarNorm]) -> StarNorm:
        """Return a measure as a function of the firing order.

        `star_norms` yields the same measures as functions of the throw angles alone.
        """
        gas_differs = self.problem.gas_distinguishes_cylinders and measure.depends_on_gas
        if not measure.is_inside and not gas_differs:
            return next(star_norms)
        signals = [signal.with_base(self.base) for signal in self._origin_evaluation.signals(measure.load)]
        kinks, count = kinks_of(measure, signals, self.problem.engine), self.space.throws

        def rows(signals: Sequence[Spectrum]) -> Rows:
            if averaged and measure.norm.averages:
                signals = [signal.averaged(signal.period / samples) for signal in signals]
            return load_rows(measure, self.problem.points, signals, self.problem.engine, samples, kinks)

        origin = rows(signals)
        moves = np.zeros((count, count, *origin.vectors.shape))
        for k in range(1, count):
            first = self._loads_of_cylinder(measure.load, k)
            for slot in range(count):
                later = [signal.shift(Fraction(slot, count), slot * signal.period / count) for signal in first]
                moves[k, slot] = rows(later).vectors
            moves[k] -= moves[k, self._slots[k]].copy()
        if measure.load.depends_on_unbalances:
            star = next(star_norms)
            return replace(star, moves=star.moves + moves)
        slope = np.zeros((*origin.vectors.shape, sum(domain.width for domain in self.domains)))
        return StarNorm(measure.norm, origin.vectors, moves, slope, None, origin.grid)

    def _loads_of_cylinder(self, load: LoadChannel, k: int) -> list[Spectrum]:
        """Return the load spectrum of cylinder k alone, fired in slot 0, at every operating point.

        A load that depends on unbalances has only its gas part here; the rows of the crank star hold its inertia part.
        """
        engine = self.problem.engine
        part = engine.slider_cranks[k]
        first = replace(part, throw=part.throw + part.shaft.ratio * part.firing_angle, firing_angle=0.0)
        # the others keep their places, because the torque of a cylinder passes their journals
        isolated, problem = isolate_cylinder(engine, k, True, first), only_gas_of(self.problem, part.name)
        signals = evaluate(problem, isolated).signals(load)
        if load.depends_on_unbalances:
            without_gas = evaluate(motored(problem), isolated).signals(load)
            signals = [a + b.mapped(np.negative) for a, b in zip(signals, without_gas, strict=True)]
        return [signal.with_base(self.base) for signal in signals]


def _is_of_star(measure: Measure) -> bool:
    # loads that depend on the crank star at least in part
    return not measure.is_inside or measure.load.depends_on_unbalances
