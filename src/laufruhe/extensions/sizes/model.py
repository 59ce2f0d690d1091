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
from laufruhe.problem.measure import Measure, Rows, bends_of, load_rows, mass_rows
from laufruhe.problem.problem import Problem

MASSES, MOST_KEPT = 4, 4096
FINE = 1440
"""Angles at the least between which the means of bounds are averaged."""
BETWEEN, BESIDE, SAME = 7, 0.02, 1e-9
"""Lengths of the rod at which bends are looked for, how much farther they are taken to move, and no move [rad]."""


class SizeModel:
    """A problem whose sizes are open.

    Parameters
    ----------
    problem
        That leaves nothing open but sizes and unbalances, at an even speed of the crank.

    Attributes
    ----------
    sizes
        Decisions about sizes.
    domains
        Of the unbalances, in the columns behind the masses.
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
        given = self._moving = moving_of(problem.engine)
        self._given = given.sizes
        self._engines, self._masses = dict[bytes, Engine](), dict[bytes, Array]()
        # of its sizes alone: one slider-crank, no rotors
        self._bare = replace(given, parts=given.parts[:1], rotors=())
        self._pieces: dict[float, dict[tuple[Measure, bool], tuple[Piece, ...]]] = {}
        self._evaluations: dict[float, list[Evaluation]] = {}

    def averaging(self) -> SizeModel:
        """The same with rows of means that are never more than what they stand for."""
        other = copy(self)
        other.averaged = True
        return other

    @property
    def moves_rod(self) -> bool:
        """Whether the length of the rod is open, in which nothing is affine."""
        return ROD_LENGTH in self.names

    @property
    def rod_span(self) -> tuple[float, float]:
        """Least and largest length of the rod [m]."""
        if not self.moves_rod:
            return (self._given[ROD_LENGTH],) * 2
        k = self.names.index(ROD_LENGTH)
        return float(self.lower[k]), float(self.upper[k])

    def rod_length(self, x: Array) -> float:
        """In a design [m]."""
        return float(x[self.names.index(ROD_LENGTH)]) if self.moves_rod else self._given[ROD_LENGTH]

    def engine(self, x: Array) -> Engine:
        """With sizes."""
        key = x.tobytes()
        if key not in self._engines:
            if len(self._engines) > MOST_KEPT:
                self._engines.clear()
            self._engines[key] = resized(self.problem.engine, self._sizes(x))
        return self._engines[key]

    def _sizes(self, x: Array) -> dict[Size, float]:
        return {**self._given, **dict(zip(self.names, x.tolist(), strict=True))}

    def masses(self, x: Array) -> Array:
        """That the running gear adds, shape (4,)."""
        gear, key = self._moving.gear, x.tobytes()
        if gear is None or gear.density is None:
            return np.zeros(MASSES)
        if key not in self._masses:
            if len(self._masses) > MOST_KEPT:
                self._masses.clear()
            found = self._bare.resized(self._sizes(x))
            self._masses[key] = np.array([*(found.gear or gear).rod_masses(found.parts[0]), found.throw_unbalance])
        return self._masses[key]

    def with_masses(self, masses: Array) -> Engine:
        """The engine as given, with these in place of what its running gear adds."""
        bare = self._moving.bare
        return _heavier(replace(self.problem.engine, slider_cranks=bare.parts, rotors=bare.rotors), masses)

    def factors(self, piece: Piece, measure: Measure, engine: Engine) -> list[Array]:
        """Of the sizes of an engine, for the rows of a piece."""
        return _factors(measure, engine, self.problem, piece.at)

    def value(self, measure: Measure, x: Array, unbalances: Array | None = None) -> float:
        """Of a design [SI], its unbalances as given unless their columns are told."""
        engine = self.engine(x)
        if measure.channel.of_engine is not None:
            return measure.channel.of_engine(engine)
        columns = np.append(self.masses(x), self.start if unbalances is None else unbalances)
        pieces = self.pieces(measure, engine.slider_cranks[0].rod_length)
        return max(piece.value(self.factors(piece, measure, engine), columns) for piece in pieces)

    def _averages(self, measure: Measure) -> bool:
        return self.averaged and measure.norm.averages

    def _steps(self, measure: Measure) -> int:
        """Rows of a signal: as results are measured, and no few of them where means are averaged."""
        samples = self.problem.fidelity.samples
        return samples * (max(math.ceil(FINE / samples), 1) if self._averages(measure) else measure.norm.refinement)

    def whole_pieces(self, measure: Measure) -> Callable[[float], tuple[Piece, ...]]:
        """The pieces of a measure at any length of the rod, with the same rows at each."""
        length = self._given[ROD_LENGTH]
        if not measure.is_load:
            return lambda at: self._cut_up(measure, at)
        base = self.problem.engine.cycle.base_order
        own = over(base, self._each_alone(length)[0].signals(measure.load))
        bends = bends_of(measure, own, self.problem.engine)
        return lambda at: self._cut_up(measure, at, bends)

    def still_rows(self, measure: Measure) -> list[Mask]:
        """Of the whole pieces of a measure the rows past whose angles no bend moves with the length of the rod.

        Raises
        ------
        ValueError
            If a load has other bends at another length.
        """
        pieces = self.whole_pieces(measure)(self._given[ROD_LENGTH])
        if not measure.is_load:
            return [np.ones(len(own.affine.constant), dtype=bool) for own in pieces]
        given, low, high = self._given[ROD_LENGTH], *self.rod_span
        lengths = [given, *np.linspace(low, high, BETWEEN)]
        base = self.problem.engine.cycle.base_order
        found = [over(base, self._each_alone(float(each))[0].signals(measure.load)) for each in lengths]
        bends = bends_of(measure, found[0], self.problem.engine)
        steps = self._steps(measure)
        kept = [
            _unswept(
                [own[k] for own in found], np.append(found[0][k].period * np.arange(steps) / steps, bends[k]),
                found[0][k].period / steps if self._averages(measure) else 0.0,
            )
            for k in range(len(self.problem.points))
        ]  # fmt: skip
        # of every operating point as many places with these angles
        counts = [len(own.affine.constant) // len(own.at) for own in pieces]
        return [
            np.concatenate([np.resize(kept[k], count) for k, _, _ in own.at])
            for own, count in zip(pieces, counts, strict=True)
        ]

    def pieces(self, measure: Measure, rod_length: float | None = None) -> tuple[Piece, ...]:
        """A measure of loads at a length of the rod, that of the start unless told: the largest of these."""
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
    def _span(self) -> tuple[Array, Array]:
        """Least and most of every column within the bounds."""
        low, high = ends_of(self.domains)
        return np.append(self.mass_box[0], low), np.append(self.mass_box[1], high)

    @cached_property
    def mass_corners(self) -> Array:
        """Masses at every corner of the bounds, shape (2, ..., 2, 4), an axis for each size."""
        corners = itertools.product(*zip(self.lower, self.upper, strict=True))
        return np.reshape([self.masses(np.array(each)) for each in corners], (*(2,) * len(self.lower), MASSES))

    @cached_property
    def mass_box(self) -> tuple[Array, Array]:
        """Least and most of the masses within the bounds: they go one way with each size."""
        found = self.mass_corners.reshape(-1, MASSES)
        return found.min(axis=0), found.max(axis=0)

    def _each_alone(self, length: float) -> list[Evaluation]:
        """Loads without masses of the running gear and unbalances, and with one unit of each column."""
        if length not in self._evaluations:
            problem, unbalances = self.problem, self.problem.unbalances
            given = problem.design([0.0] * len(unbalances), unbalances)
            sizes = moving_of(given).sizes
            given = given if length == sizes[ROD_LENGTH] else resized(given, {**sizes, ROD_LENGTH: length})
            bare = moving_of(given).bare
            weightless = replace(given, slider_cranks=bare.parts, rotors=bare.rotors)
            engines = [weightless, *(_heavier(weightless, unit) for unit in np.eye(MASSES))]
            engines += [_moved(weightless, d, direction) for d in unbalances for direction in d.set.directions]
            self._evaluations[length] = [evaluate(problem, engine) for engine in engines]
        return self._evaluations[length]

    def _cut_up(self, measure: Measure, length: float, told: Sequence[Array] | None = None) -> tuple[Piece, ...]:
        """Pieces at a length, of all rows where the angles of bends are told."""
        found, problem = self._each_alone(length), self.problem
        if not measure.is_load:
            masses = [mass_rows(measure, each.engine.rotors, each.engine.slider_cranks) for each in found]
            return (Piece(_affine(masses), (), ()),)
        channel = measure.load
        base = problem.engine.cycle.base_order
        steps = self._steps(measure)
        signals: list[list[Spectrum]] = [over(base, each.signals(channel)) for each in found]
        bends = bends_of(measure, signals[0], problem.engine) if told is None else told
        if self._averages(measure):
            signals = [[own.averaged(own.period / steps) for own in each] for each in signals]
        rows = [load_rows(measure, problem.points, own, problem.engine, steps, bends) for own in signals]
        whole, each = _affine(rows), steps + len(bends[0])
        points = [k for k, share in enumerate(measure.shares(problem.points)) if share > 0.0]
        if not measure.norm.is_largest or len(whole.constant) % (each * len(points)):
            every = tuple((k, None, each) for k in points)
            return (Piece(whole, every, tuple(_factors(measure, found[0].engine, problem, every))),)
        places = len(whole.constant) // (each * len(points))
        pieces = []
        for n, (k, place) in enumerate(itertools.product(points, range(places))):
            own = slice(n * each, (n + 1) * each)
            affine = replace(whole, constant=whole.constant[own], slope=whole.slope[own], grid=plain(each))
            at = ((k, place, each),)
            piece = Piece(affine, at, tuple(_factors(measure, found[0].engine, problem, at)))
            scalar = told is None and (not piece.given or piece.given[0].size == 1)
            pieces.append(piece.pruned(*self._span) if scalar else piece)
        return tuple(pieces)


def _unswept(signals: Sequence[Spectrum], angles: Array, beside: float) -> Mask:
    """Angles that no bend of a signal at several lengths passes, nor comes as near as `beside`, on the way."""
    period = signals[0].period
    own = [np.zeros(0) if each.kinks is None else each.kinks.angles for each in signals]
    if len({len(each) for each in own}) > 1:
        raise ValueError("a load has other bends at another length of the rod")
    # what stands at zero may be told as a whole period
    turned = np.array([np.sort(np.mod(each + SAME, period)) - SAME for each in own])
    low, high = turned.min(axis=0, initial=period), turned.max(axis=0, initial=-period)
    wide = BESIDE * (high - low) + beside
    moved = high - low > 2.0 * SAME
    over = (angles[:, None] > (low - wide)[moved]) & (angles[:, None] < (high + wide)[moved])
    return np.asarray(~over.any(axis=1))


def _heavier(engine: Engine, masses: Array) -> Engine:
    """With these masses of the running gear beside its own."""
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
    slopes = [own.vectors - rows[0].vectors for own in rows[1:]]
    return AffineNorm(rows[0].norm, rows[0].vectors, np.stack(slopes, axis=-1), rows[0].grid)


def _factors(
    measure: Measure, engine: Engine, problem: Problem, at: Sequence[tuple[int, int | None, int]]
) -> list[Array]:  # fmt: skip
    """Of the places that count, shape (places, 1 or d), at every operating point; none of what stands nowhere."""
    if not at:
        return []
    counted, found = measure.places(measure.load.places(engine)), []
    for k, place, _ in at:
        factors = measure.load.factors_of(engine, problem.points[k])
        if factors is None:
            return []
        found.append(factors[counted] if place is None else factors[counted][place : place + 1])
    return found
