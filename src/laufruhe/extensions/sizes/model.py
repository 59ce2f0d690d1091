"""Measures as functions of sizes and unbalances: loads affine in masses and these, times factors of the sizes (Z12).

Four masses are what running gear adds: to what reciprocates, to what turns with the rod, to the inertia of the rod, and
to the throw. Loads are affine in them, and in unbalances, together at a given length of the rod: the exact model is
asked once without any, and once for each. The columns of a measure are the masses, then those of the unbalances.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from laufruhe.extensions.sizes.machine import ROD_LENGTH, RunningGear, Size, moving_of, resized
from laufruhe.extensions.sizes.pieces import Piece, plain
from laufruhe.load_models.affine import AffineNorm
from laufruhe.machine import Engine
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.decision import Decision, Kind, domains_of, ends_of, vector_of
from laufruhe.problem.evaluation import Evaluation, evaluate, over
from laufruhe.problem.measure import Measure, Rows, kinks_of, load_rows, mass_rows
from laufruhe.problem.problem import Problem

MASSES, MOST_KEPT = 4, 4096
FINE = 1440
"""Angles at the least between which the means of bounds are averaged."""
BETWEEN, MARGIN, SAME = 7, 0.02, 1e-9
"""Lengths of the rod at which bends are looked for, how much farther they are taken to move, and no move [rad]."""


class SizeModel:
    """A problem whose sizes are open.

    Parameters
    ----------
    problem
        Problem that leaves nothing open but sizes and unbalances, at an even speed of the crank.

    Attributes
    ----------
    sizes
        Decisions about sizes.
    domains
        Domains of the unbalances, in the columns behind the masses.
    averaged
        Whether rows of means are averaged about their angles, so that what bounds them bounds the whole cycle (P7).
    """

    averaged = False

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.sizes = tuple(d for d in problem.decisions if d.kind is Kind.SIZE)
        self.domains = domains_of(problem.unbalances)
        self.names = [size for d in self.sizes for size in d.keys(Kind.SIZE)]
        self.lower = np.array([d.lower for d in self.sizes])
        self.upper = np.array([d.upper for d in self.sizes])
        moving = self._moving = moving_of(problem.engine)
        self._sizes_given = moving.sizes
        self._engines, self._masses = dict[bytes, Engine](), dict[bytes, Array]()
        # of its sizes alone: one slider-crank, no rotors
        self._one_cylinder = replace(moving, parts=moving.parts[:1], rotors=())
        self._pieces: dict[float, dict[tuple[Measure, bool], tuple[Piece, ...]]] = {}
        self._evaluations: dict[float, list[Evaluation]] = {}

    def averaging(self) -> SizeModel:
        """Return the same with averaged rows of means, which never exceed the means of the cycle."""
        other = copy(self)
        other.averaged = True
        return other

    @property
    def moves_rod(self) -> bool:
        """Return whether the length of the rod is open, in which nothing is affine."""
        return ROD_LENGTH in self.names

    @property
    def rod_span(self) -> tuple[float, float]:
        """Least and largest length of the rod [m]."""
        if not self.moves_rod:
            return (self._sizes_given[ROD_LENGTH],) * 2
        k = self.names.index(ROD_LENGTH)
        return float(self.lower[k]), float(self.upper[k])

    def rod_length(self, x: Array) -> float:
        """Return the rod length of a design [m]."""
        return float(x[self.names.index(ROD_LENGTH)]) if self.moves_rod else self._sizes_given[ROD_LENGTH]

    def engine(self, x: Array) -> Engine:
        """Return the engine with sizes."""
        key = x.tobytes()
        if key not in self._engines:
            if len(self._engines) > MOST_KEPT:
                self._engines.clear()
            self._engines[key] = resized(self.problem.engine, self._sizes(x))
        return self._engines[key]

    def _sizes(self, x: Array) -> dict[Size, float]:
        return {**self._sizes_given, **dict(zip(self.names, x.tolist(), strict=True))}

    def masses(self, x: Array) -> Array:
        """Return the masses that the running gear adds, shape (4,)."""
        gear, key = self._moving.gear, x.tobytes()
        if gear is None or gear.density is None:
            return np.zeros(MASSES)
        if key not in self._masses:
            if len(self._masses) > MOST_KEPT:
                self._masses.clear()
            moved = self._one_cylinder.resized(self._sizes(x))
            self._masses[key] = np.array([*(moved.gear or gear).rod_masses(moved.parts[0]), moved.throw_unbalance])
        return self._masses[key]

    def with_masses(self, masses: Array) -> Engine:
        """Return the engine as given, with other masses of its running gear."""
        weightless = self._moving.bare
        return _heavier(replace(self.problem.engine, slider_cranks=weightless.parts, rotors=weightless.rotors), masses)

    def factors(self, piece: Piece, measure: Measure, engine: Engine) -> list[Array]:
        """Return the factors of the rows of a piece from the sizes of an engine."""
        return _factors(measure, engine, self.problem, piece.at)

    def value(self, measure: Measure, x: Array, unbalances: Array | None = None) -> float:
        """Return the value of a design [SI], with its unbalances as given or from columns."""
        engine = self.engine(x)
        if measure.channel.of_engine is not None:
            return measure.channel.of_engine(engine)
        columns = np.append(self.masses(x), self.start if unbalances is None else unbalances)
        pieces = self.pieces(measure, engine.slider_cranks[0].rod_length)
        return max(piece.value(self.factors(piece, measure, engine), columns) for piece in pieces)

    def _averages(self, measure: Measure) -> bool:
        return self.averaged and measure.norm.averages

    def _steps(self, measure: Measure) -> int:
        samples = self.problem.fidelity.samples
        return samples * (max(math.ceil(FINE / samples), 1) if self._averages(measure) else measure.norm.refinement)

    def pieces_over_length(self, measure: Measure) -> Callable[[float], tuple[Piece, ...]]:
        """Return a function from a length of the rod to the pieces of a measure, with the same rows at each."""
        length = self._sizes_given[ROD_LENGTH]
        if not measure.is_load:
            return lambda at: self._cut_up(measure, at)
        base = self.problem.engine.cycle.base_order
        signals = over(base, self._each_alone(length)[0].signals(measure.load))
        bends = kinks_of(measure, signals, self.problem.engine)
        return lambda at: self._cut_up(measure, at, bends)

    def fixed_rows(self, measure: Measure) -> list[Mask]:
        """Return masks of the rows of whole pieces past whose angles no bend moves with the length of the rod.

        Raises
        ------
        ValueError
            If a load has other bends at another length.
        """
        pieces = self.pieces_over_length(measure)(self._sizes_given[ROD_LENGTH])
        if not measure.is_load:
            return [np.ones(len(piece.affine.constant), dtype=bool) for piece in pieces]
        start, low, high = self._sizes_given[ROD_LENGTH], *self.rod_span
        lengths = [start, *np.linspace(low, high, BETWEEN)]
        base = self.problem.engine.cycle.base_order
        signals = [over(base, self._each_alone(float(at))[0].signals(measure.load)) for at in lengths]
        bends = kinks_of(measure, signals[0], self.problem.engine)
        steps = self._steps(measure)
        masks = [
            _unswept(
                [piece[k] for piece in signals], np.append(signals[0][k].period * np.arange(steps) / steps, bends[k]),
                signals[0][k].period / steps if self._averages(measure) else 0.0,
            )
            for k in range(len(self.problem.points))
        ]  # fmt: skip
        # of every operating point as many places with these angles
        counts = [len(piece.affine.constant) // len(piece.at) for piece in pieces]
        return [
            np.concatenate([np.resize(masks[k], count) for k, _, _ in piece.at])
            for piece, count in zip(pieces, counts, strict=True)
        ]

    def pieces(self, measure: Measure, rod_length: float | None = None) -> tuple[Piece, ...]:
        """Return the pieces of a measure at a length of the rod, by default the start's; their largest is its value."""
        length = self.problem.engine.slider_cranks[0].rod_length if rod_length is None else rod_length
        known, key = self._pieces.setdefault(length, {}), (measure, self._averages(measure))
        if key not in known:
            known[key] = self._cut_up(measure, length)
        return known[key]

    @cached_property
    def start(self) -> Array:
        """Columns of the unbalances as given."""
        return vector_of(self.domains)

    @cached_property
    def mass_corners(self) -> Array:
        """Masses at every corner of the bounds, shape (2, ..., 2, 4), one axis for each size."""
        corners = itertools.product(*zip(self.lower, self.upper, strict=True))
        return np.reshape([self.masses(np.array(sizes)) for sizes in corners], (*(2,) * len(self.lower), MASSES))

    @cached_property
    def mass_box(self) -> tuple[Array, Array]:
        """Least and most of the masses within the bounds: they go one way with each size."""
        masses = self.mass_corners.reshape(-1, MASSES)
        return masses.min(axis=0), masses.max(axis=0)

    def _each_alone(self, length: float) -> list[Evaluation]:
        """Return loads without masses of the running gear and unbalances, then with one unit of each column."""
        if length not in self._evaluations:
            problem, unbalances = self.problem, self.problem.unbalances
            moved = problem.design([0.0] * len(unbalances), unbalances)
            sizes = moving_of(moved).sizes
            moved = moved if length == sizes[ROD_LENGTH] else resized(moved, {**sizes, ROD_LENGTH: length})
            unweighed = moving_of(moved).bare
            weightless = replace(moved, slider_cranks=unweighed.parts, rotors=unweighed.rotors)
            engines = [weightless, *(_heavier(weightless, unit) for unit in np.eye(MASSES))]
            engines += [_moved(weightless, d, direction) for d in unbalances for direction in d.set.directions]
            self._evaluations[length] = [evaluate(problem, engine) for engine in engines]
        return self._evaluations[length]

    def _cut_up(self, measure: Measure, length: float, bends_at: Sequence[Array] | None = None) -> tuple[Piece, ...]:
        """Return pieces at a length, with all rows where the angles of bends are given."""
        evaluations, problem = self._each_alone(length), self.problem
        if not measure.is_load:
            masses = [mass_rows(measure, count.engine.rotors, count.engine.slider_cranks) for count in evaluations]
            return (Piece(_affine(masses), (), ()),)
        channel = measure.load
        base = problem.engine.cycle.base_order
        steps = self._steps(measure)
        signals: list[list[Spectrum]] = [over(base, count.signals(channel)) for count in evaluations]
        bends = kinks_of(measure, signals[0], problem.engine) if bends_at is None else bends_at
        if self._averages(measure):
            signals = [[signal.averaged(signal.period / steps) for signal in count] for count in signals]
        rows = [load_rows(measure, problem.points, signal, problem.engine, steps, bends) for signal in signals]
        affine_rows, count = _affine(rows), steps + len(bends[0])
        points = [k for k, share in enumerate(measure.shares(problem.points)) if share > 0.0]
        if not measure.norm.is_largest or len(affine_rows.constant) % (count * len(points)):
            every = tuple((k, None, count) for k in points)
            return (Piece(affine_rows, every, tuple(_factors(measure, evaluations[0].engine, problem, every))),)
        places = len(affine_rows.constant) // (count * len(points))
        pieces = []
        for n, (k, place) in enumerate(itertools.product(points, range(places))):
            signal = slice(n * count, (n + 1) * count)
            affine = replace(
                affine_rows, constant=affine_rows.constant[signal], slope=affine_rows.slope[signal], grid=plain(count)
            )
            at = ((k, place, count),)
            piece = Piece(affine, at, tuple(_factors(measure, evaluations[0].engine, problem, at)))
            scalar = bends_at is None and (not piece.given or piece.given[0].size == 1)
            if scalar:
                ends = zip(self.mass_box, ends_of(self.domains), strict=True)
                piece = piece.pruned(*(np.append(masses, columns) for masses, columns in ends))
            pieces.append(piece)
        return tuple(pieces)


def _unswept(signals: Sequence[Spectrum], angles: Array, margin: float) -> Mask:
    """Return the mask of angles that no bend of a signal passes between lengths, nor comes as near as `margin`."""
    period = signals[0].period
    corners = [np.zeros(0) if signal.kinks is None else signal.kinks.angles for signal in signals]
    if len({len(signal) for signal in corners}) > 1:
        raise ValueError("a load has other bends at another length of the rod")
    # what stands at zero may be told as a whole period
    turned = np.array([np.sort(np.mod(signal + SAME, period)) - SAME for signal in corners])
    low, high = turned.min(axis=0, initial=period), turned.max(axis=0, initial=-period)
    wide = MARGIN * (high - low) + margin
    moved = high - low > 2.0 * SAME
    over = (angles[:, None] > (low - wide)[moved]) & (angles[:, None] < (high + wide)[moved])
    return np.asarray(~over.any(axis=1))


def _heavier(engine: Engine, masses: Array) -> Engine:
    parts = tuple(
        replace(
            part, reciprocating_mass=part.reciprocating_mass + masses[0],
            rotating_mass=part.rotating_mass + masses[1],
            rod_inertia_deficit=part.rod_inertia_deficit + masses[2],
        )
        for part in engine.slider_cranks
    )  # fmt: skip
    gear = engine.extra(RunningGear)
    ways = dict(gear.throws) if gear else {}
    rotors = (replace(r, unbalance=r.unbalance + masses[3] * ways.get(r.name, 0.0)) for r in engine.rotors)
    return replace(engine, slider_cranks=parts, rotors=tuple(rotors))


def _moved(engine: Engine, decision: Decision, direction: complex) -> Engine:
    by = {drive.rotor: drive.of(direction) for drive in decision.rotor_drives}
    rotors = (replace(r, unbalance=r.unbalance + by.get(r.name, 0.0)) for r in engine.rotors)
    return replace(engine, rotors=tuple(rotors))


def _affine(rows: Sequence[Rows]) -> AffineNorm:
    slopes = [one.vectors - rows[0].vectors for one in rows[1:]]
    return AffineNorm(rows[0].norm, rows[0].vectors, np.stack(slopes, axis=-1), rows[0].grid)


def _factors(
    measure: Measure, engine: Engine, problem: Problem, at: Sequence[tuple[int, int | None, int]]
) -> list[Array]:  # fmt: skip
    """Return factors by operating point, shape (places, 1 or d) each; none for a measure without places."""
    if not at:
        return []
    counted, rows = measure.places(measure.load.places(engine)), []
    for k, place, _ in at:
        factors = measure.load.factors_of(engine, problem.points[k])
        if factors is None:
            return []
        rows.append(factors[counted] if place is None else factors[counted][place : place + 1])
    return rows
