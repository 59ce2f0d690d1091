"""Measures as functions of sizes and unbalances: loads affine in masses and unbalances, times factors of sizes (Z12).

The running gear adds four masses: to the reciprocating mass, to the rotating mass of the rod, to the inertia of the
rod, and to the throw. At a fixed rod length, loads are jointly affine in these masses and the unbalances. So the exact
model is evaluated once without any of them, and once for each. The columns of a measure are the masses, then the
unbalances.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from laufruhe.extensions.sizes.machine import ROD_LENGTH, RunningGear, Size, moving_gear, resized
from laufruhe.load_models.affine import AffineNorm
from laufruhe.machine import Engine
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.numerics.norms import Grid
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.decision import Kind, decision_vector, domains_of
from laufruhe.problem.evaluation import Evaluation, evaluate, with_common_base
from laufruhe.problem.measure import Measure, Rows, kinks_of, load_rows, mass_rows
from laufruhe.problem.problem import Problem

T = TypeVar("T")
# masses that sizes add, and most entries of a cache
MASSES, MAX_KEPT = 4, 4096
FINE = 1440
"""Fewest samples at which the means of bounds are averaged."""
BETWEEN, MARGIN, SAME = 7, 0.02, 1e-9
"""Rod lengths at which kinks are compared, relative margin of their movement, and movement that is none [rad]."""


@dataclass(frozen=True, eq=False)
class Piece:
    """Part of a measure: sampled load rows that have the same factors of sizes (from load to stress).

    Attributes
    ----------
    affine
        Norm affine in the columns; rows at the initial sizes.
    positions
        For each operating point, its index, its place (None for all places) and the count of rows.
    initial_factors
        Initial factors of each operating point, shape (places, 1 or d).
    """

    affine: AffineNorm
    positions: tuple[tuple[int, int | None, int], ...]
    initial_factors: tuple[Array, ...]

    def ratio(self, factors: Sequence[Array]) -> float | None:
        """Return the common ratio of size factors to their initial values; None if their ratios differ."""
        if not factors:
            return 1.0
        pairs = zip(factors, self.initial_factors, strict=True)
        ratios = np.concatenate([(factor / initial).ravel() for factor, initial in pairs])
        return float(ratios[0]) if np.all(ratios == ratios[0]) else None

    def scaled(self, factors: Sequence[Array]) -> AffineNorm:
        """Return the norm with the factors of other sizes."""
        ratios = self.ratios(factors)
        return replace(self.affine, constant=self.affine.constant * ratios, slope=self.affine.slope * ratios[..., None])

    def ratios(self, factors: Sequence[Array]) -> Array:
        """Return the ratio of factors at other sizes to the initial factors for each row, shape (k, 1 or d)."""
        parts = zip(factors, self.initial_factors, self.positions, strict=True)
        return np.concatenate([np.repeat(factor / initial, rows, axis=0) for factor, initial, (_, _, rows) in parts])

    def value(self, factors: Sequence[Array], columns: Array) -> float:
        """Return the value of the norm with other factors at `columns`."""
        ratio = self.ratio(factors)
        return self.scaled(factors).value(columns) if ratio is None else ratio * self.affine.value(columns)


def plain(rows: int) -> Grid:
    """Return the grid of equally weighted rows."""
    return Grid(np.full(rows, 1.0 / max(rows, 1)), rows)


class SizeModel:
    """Problem with open sizes and unbalances alone, at an even crank speed.

    Attributes
    ----------
    sizes
        Decisions about sizes.
    domains
        Domains of the unbalances, in the columns after the masses.
    lower, upper
        Bounds of the sizes [m], shape (sizes,).
    averaged
        True if rows of means are averaged about their samples, so that they bound the mean over the cycle (P7).
    """

    averaged = False

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.sizes = tuple(d for d in problem.decisions if d.kind is Kind.SIZE)
        self.domains = domains_of(problem.unbalances)
        self.names = [size for d in self.sizes for size in d.keys(Kind.SIZE)]
        self.lower = np.array([d.lower for d in self.sizes])
        self.upper = np.array([d.upper for d in self.sizes])
        gear = self._moving = moving_gear(problem.engine)
        self._sizes_given = gear.sizes
        self._engines, self._masses = dict[bytes, Engine](), dict[bytes, Array]()
        # one slider-crank without rotors has all sizes
        self._one_cylinder = replace(gear, parts=gear.parts[:1], rotors=())
        self._pieces: dict[float, dict[tuple[Measure, bool], tuple[Piece, ...]]] = {}
        self._evaluations: dict[float, list[Evaluation]] = {}

    def averaging(self) -> SizeModel:
        """Return the model with averaged rows of means, which never exceed the means over the cycle."""
        model = copy(self)
        model.averaged = True
        return model

    @property
    def moves_rod(self) -> bool:
        """True if the rod length is open; loads are not affine in the rod length."""
        return ROD_LENGTH in self.names

    @property
    def rod_span(self) -> tuple[float, float]:
        """Smallest and largest rod length [m]."""
        if not self.moves_rod:
            return (self._sizes_given[ROD_LENGTH],) * 2
        k = self.names.index(ROD_LENGTH)
        return float(self.lower[k]), float(self.upper[k])

    def rod_length(self, x: Array) -> float:
        """Return the rod length [m] for sizes `x`."""
        return float(x[self.names.index(ROD_LENGTH)]) if self.moves_rod else self._sizes_given[ROD_LENGTH]

    def engine(self, x: Array) -> Engine:
        """Return the engine with sizes `x`, shape (sizes,)."""
        return _cached(self._engines, x, lambda: resized(self.problem.engine, self._sizes(x)))

    def engine_at(self, x: Array, monotonicity: Array) -> Engine:
        """Return the engine with sizes `x`, or the initial one if all entries of `monotonicity` are zero.

        Both have the shape (sizes,).
        """
        return self.engine(x) if np.any(monotonicity) else self.problem.engine

    def _sizes(self, x: Array) -> dict[Size, float]:
        return {**self._sizes_given, **dict(zip(self.names, x.tolist(), strict=True))}

    def masses(self, x: Array) -> Array:
        """Return what the running gear adds for sizes `x`: three masses of a rod, and an unbalance, shape (4,)."""
        gear = self._moving.gear
        if gear is None or gear.density is None:
            return np.zeros(MASSES)

        def masses_of_gear() -> Array:
            cylinder = self._one_cylinder.resized(self._sizes(x))
            return np.array([*(cylinder.gear or gear).rod_masses(cylinder.parts[0]), cylinder.throw_unbalance])

        return _cached(self._masses, x, masses_of_gear)

    def factors(
        self, positions: Sequence[tuple[int, int | None, int]], measure: Measure, engine: Engine
    ) -> list[Array]:
        """Return factors from load to stress, which depend on sizes, for some places of a measure.

        Each has the shape (places, 1 or d); the list is empty without such factors.
        """
        if not positions:
            return []
        chosen_places, rows = measure.places(measure.load.places(engine)), []
        for k, place, _ in positions:
            factors = measure.load.factors_of(engine, self.problem.points[k])
            if factors is None:
                return []
            rows.append(factors[chosen_places] if place is None else factors[chosen_places][place : place + 1])
        return rows

    def value(self, measure: Measure, x: Array, unbalances: Array | None = None) -> float:
        """Return the value of a measure [SI] for sizes `x`, with the initial unbalances or columns of unbalances."""
        engine = self.engine(x)
        if measure.channel.size_value is not None:
            return measure.channel.size_value(engine)
        columns = np.append(self.masses(x), self.start if unbalances is None else unbalances)
        pieces = self.pieces(measure, engine.slider_cranks[0].rod_length)
        return max(piece.value(self.factors(piece.positions, measure, engine), columns) for piece in pieces)

    def _averages(self, measure: Measure) -> bool:
        return self.averaged and measure.norm.averages

    def _steps(self, measure: Measure) -> int:
        samples = self.problem.fidelity.samples
        return samples * (max(math.ceil(FINE / samples), 1) if self._averages(measure) else measure.norm.refinement)

    def pieces_over_length(self, measure: Measure) -> Callable[[float], tuple[Piece, ...]]:
        """Return a function from a rod length [m] to the load rows of a measure, in pieces with common size factors.

        The rows are the same at each length.
        """
        length = self._sizes_given[ROD_LENGTH]
        if not measure.is_load:
            return lambda rod_length: self._new_pieces(measure, rod_length)
        base = self.problem.engine.cycle.base_order
        signals = with_common_base(base, self._unit_evaluations(length)[0].signals(measure.load))
        kinks = kinks_of(measure, signals, self.problem.engine)
        return lambda rod_length: self._new_pieces(measure, rod_length, kinks)

    def fixed_rows(self, measure: Measure) -> list[Mask]:
        """Return masks of the load rows at angles that no kink (jump of slope) passes as the rod length changes.

        There is one mask for each piece of the measure.
        """
        pieces = self.pieces_over_length(measure)(self._sizes_given[ROD_LENGTH])
        if not measure.is_load:
            return [np.ones(len(piece.affine.constant), dtype=bool) for piece in pieces]
        start, low, high = self._sizes_given[ROD_LENGTH], *self.rod_span
        lengths = [start, *np.linspace(low, high, BETWEEN)]
        base = self.problem.engine.cycle.base_order
        signals = [
            with_common_base(base, self._unit_evaluations(float(length_at))[0].signals(measure.load))
            for length_at in lengths
        ]
        kinks = kinks_of(measure, signals[0], self.problem.engine)
        steps = self._steps(measure)
        masks = [
            _without_moving_kinks(
                [piece[k] for piece in signals], np.append(signals[0][k].period * np.arange(steps) / steps, kinks[k]),
                signals[0][k].period / steps if self._averages(measure) else 0.0,
            )
            for k in range(len(self.problem.points))
        ]  # fmt: skip
        # each operating point has the same samples at all its places
        counts = [len(piece.affine.constant) // len(piece.positions) for piece in pieces]
        return [
            np.concatenate([np.resize(masks[k], count) for k, _, _ in piece.positions])
            for piece, count in zip(pieces, counts, strict=True)
        ]

    def pieces(self, measure: Measure, rod_length: float | None = None) -> tuple[Piece, ...]:
        """Return a measure as pieces (load rows with common size factors) at a rod length; the largest is its value."""
        length = self.problem.engine.slider_cranks[0].rod_length if rod_length is None else rod_length
        cache, key = self._pieces.setdefault(length, {}), (measure, self._averages(measure))
        if key not in cache:
            cache[key] = self._new_pieces(measure, length)
        return cache[key]

    @cached_property
    def start(self) -> Array:
        """Columns of the initial unbalances."""
        return decision_vector(self.domains)

    @cached_property
    def mass_corners(self) -> Array:
        """Masses at each vertex of the bounds, shape (2, ..., 2, 4), one axis for each size."""
        corners = itertools.product(*zip(self.lower, self.upper, strict=True))
        return np.reshape([self.masses(np.array(sizes)) for sizes in corners], (*(2,) * len(self.lower), MASSES))

    @cached_property
    def mass_box(self) -> tuple[Array, Array]:
        """Smallest and largest masses within the bounds, shape (4,) each; they are monotonic in each size."""
        masses = self.mass_corners.reshape(-1, MASSES)
        return masses.min(axis=0), masses.max(axis=0)

    def _unit_evaluations(self, length: float) -> list[Evaluation]:
        """Return evaluations at a rod length [m]: without open masses and unbalances, then with one unit of each."""
        if length not in self._evaluations:
            problem, unbalances = self.problem, self.problem.unbalances
            engine = problem.design([0.0] * len(unbalances), unbalances)
            sizes = moving_gear(engine).sizes
            if length != sizes[ROD_LENGTH]:
                engine = resized(engine, {**sizes, ROD_LENGTH: length})
            bare_gear = moving_gear(engine).bare
            weightless = replace(engine, slider_cranks=bare_gear.parts, rotors=bare_gear.rotors)
            engines = [weightless, *(_with_masses(weightless, unit) for unit in np.eye(MASSES))]
            for decision, direction in ((d, direction) for d in unbalances for direction in d.set.directions):
                changes = {drive.rotor: drive.of(direction) for drive in decision.rotor_drives}
                rotors = (replace(r, unbalance=r.unbalance + changes.get(r.name, 0.0)) for r in weightless.rotors)
                engines.append(replace(weightless, rotors=tuple(rotors)))
            self._evaluations[length] = [evaluate(problem, engine) for engine in engines]
        return self._evaluations[length]

    def _new_pieces(
        self, measure: Measure, length: float, kinks_at: Sequence[Array] | None = None
    ) -> tuple[Piece, ...]:
        """Return the pieces of a measure at a rod length [m]."""
        evaluations, problem = self._unit_evaluations(length), self.problem
        if not measure.is_load:
            masses = [mass_rows(measure, unit.engine.rotors, unit.engine.slider_cranks) for unit in evaluations]
            return (Piece(_affine(masses), (), ()),)
        channel = measure.load
        base = problem.engine.cycle.base_order
        steps = self._steps(measure)
        signals: list[list[Spectrum]] = [with_common_base(base, unit.signals(channel)) for unit in evaluations]
        kinks = kinks_of(measure, signals[0], problem.engine) if kinks_at is None else kinks_at
        if self._averages(measure):
            signals = [[signal.averaged(signal.period / steps) for signal in unit_signals] for unit_signals in signals]
        rows = [load_rows(measure, problem.points, signal, problem.engine, steps, kinks) for signal in signals]
        affine_rows, count, weightless = _affine(rows), steps + len(kinks[0]), evaluations[0].engine
        points = [k for k, share in enumerate(measure.shares(problem.points)) if share > 0.0]
        if not measure.norm.is_largest or len(affine_rows.constant) % (count * len(points)):
            all_points = tuple((k, None, count) for k in points)
            return (Piece(affine_rows, all_points, tuple(self.factors(all_points, measure, weightless))),)
        places = len(affine_rows.constant) // (count * len(points))
        pieces = []
        for n, (k, place) in enumerate(itertools.product(points, range(places))):
            signal = slice(n * count, (n + 1) * count)
            affine = replace(
                affine_rows, constant=affine_rows.constant[signal], slope=affine_rows.slope[signal], grid=plain(count)
            )
            position = ((k, place, count),)
            pieces.append(Piece(affine, position, tuple(self.factors(position, measure, weightless))))
        return tuple(pieces)


def _without_moving_kinks(signals: Sequence[Spectrum], angles: Array, margin: float) -> Mask:
    """Return the mask of crank angles that no kink of a load comes nearer than `margin` [rad] at any rod length."""
    period = signals[0].period
    kinks = [np.zeros(0) if signal.kinks is None else signal.kinks.angles for signal in signals]
    if len({len(signal) for signal in kinks}) > 1:
        raise ValueError(
            "the number of kinks (jumps of the slope) of a load over the crank angle differs between rod lengths"
        )
    # a kink at zero may also appear at the period
    positions = np.array([np.sort(np.mod(signal + SAME, period)) - SAME for signal in kinks])
    low, high = positions.min(axis=0, initial=period), positions.max(axis=0, initial=-period)
    reach = MARGIN * (high - low) + margin
    is_moved = high - low > 2.0 * SAME
    is_passed = (angles[:, None] > (low - reach)[is_moved]) & (angles[:, None] < (high + reach)[is_moved])
    return np.asarray(~is_passed.any(axis=1))


def _with_masses(engine: Engine, masses: Array) -> Engine:
    parts = tuple(
        replace(
            part, reciprocating_mass=part.reciprocating_mass + masses[0],
            rotating_mass=part.rotating_mass + masses[1],
            rod_inertia_deficit=part.rod_inertia_deficit + masses[2],
        )
        for part in engine.slider_cranks
    )  # fmt: skip
    gear = engine.extra(RunningGear)
    directions = dict(gear.throws) if gear else {}
    rotors = (
        replace(rotor, unbalance=rotor.unbalance + masses[3] * directions.get(rotor.name, 0.0))
        for rotor in engine.rotors
    )
    return replace(engine, slider_cranks=parts, rotors=tuple(rotors))


def _affine(rows: Sequence[Rows]) -> AffineNorm:
    slopes = [unit.vectors - rows[0].vectors for unit in rows[1:]]
    return AffineNorm(rows[0].norm, rows[0].vectors, np.stack(slopes, axis=-1), rows[0].grid)


def _cached(cache: dict[bytes, T], x: Array, build: Callable[[], T]) -> T:
    key = x.tobytes()
    if key not in cache:
        if len(cache) > MAX_KEPT:
            cache.clear()
        cache[key] = build()
    return cache[key]
