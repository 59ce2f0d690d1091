"""Bounds of what sizes can reach, on boxes of them (Z12).

In a box every factor of a load is least at one corner, for it goes one way with each size; the masses lie between those
of two corners, for so do they. A norm of rows that are affine in the masses is nowhere under <Z, V>, Z its subgradient
at any masses: its least value over that interval bounds the norm. Over lengths of the rod <Z, V> is a short
series (Z13). Sides of a box on which a limit is broken everywhere, or nothing is better than a design known, are cut
off; what is left is halved.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from laufruhe.load_models.affine import AffineNorm
from laufruhe.load_models.rod_series import TERMS, RodSeries, rod_series
from laufruhe.load_models.sized_model import MASSES, Piece, SizeModel
from laufruhe.machine import Engine
from laufruhe.numerics.arrays import Array
from laufruhe.problem.measure import Limit, Measure
from laufruhe.prove.best_first import Box, Divided, Halving, halves, widest

Ways: TypeAlias = Array

MOST_BOXES = 3000
# a limit counts as broken beyond so much of it; halvings of a side that is cut, rounds of that, and bounds of a load
SLACK, HALVINGS, ROUNDS, MOST_TOUCHED = 1e-9, 10, 3, 200


class _Reach(NamedTuple):
    """Least and most of the masses, and of the length of the rod, on a box."""

    low: Array
    high: Array
    rod: tuple[float, float]

    @property
    def middle(self) -> tuple[Array, float]:
        """Masses and length."""
        return 0.5 * (self.low + self.high), 0.5 * (self.rod[0] + self.rod[1])


class _Bundle:
    """Affine functions of the masses that a norm is nowhere under, as many as were asked for (P4)."""

    def __init__(self, piece: Piece, affine: AffineNorm | None = None) -> None:
        self.piece, self.affine = piece, piece.affine if affine is None else affine
        self.constants, self.slopes = np.zeros(0), np.zeros((0, MASSES))

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.constants)

    def touch(self, masses: Array, _: float) -> None:
        """One more that the norm meets at these masses."""
        z = self.affine.subgradient(masses)
        self.constants = np.append(self.constants, float(np.vdot(z, self.affine.constant)))
        self.slopes = np.vstack([self.slopes, self.affine.pulled(z)])

    def scaled(self, factors: Sequence[Array]) -> _Bundle:
        """Of other factors of its rows, which nothing has been asked of yet."""
        return _Bundle(self.piece, self.piece.scaled(factors))

    def least(self, reach: _Reach) -> float:
        """On a box."""
        ends = np.where(self.slopes > 0.0, self.slopes * reach.low, self.slopes * reach.high).sum(axis=1)
        return max(float((self.constants + ends).max(initial=0.0)), 0.0)


class _RodBundle:
    """The same over lengths of the rod: of each function the series of what it is at any length (Z13)."""

    def __init__(self, series: RodSeries) -> None:
        self.piece, self.series = series.piece, series
        self.nodes = np.zeros((0, TERMS, 1 + MASSES))

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.nodes)

    def touch(self, masses: Array, length: float) -> None:
        """One more that the norm meets at these masses and this length."""
        z = self.series.at(length).subgradient(masses)
        self.nodes = np.concatenate([self.nodes, self.series.pulled(z)[None]])

    def scaled(self, factors: Sequence[Array]) -> _RodBundle:
        """Of other factors of its rows."""
        return _RodBundle(self.series.scaled(factors))

    def least(self, reach: _Reach) -> float:
        """Its first two terms at the ends of the box, what the others can take from them, and the rest."""
        terms = np.einsum("mn,tnj->mtj", self.series.terms(*reach.rod), self.nodes)
        most = np.maximum(np.abs(reach.low), np.abs(reach.high))
        further = np.abs(terms[2:]).sum(axis=0) @ np.append(1.0, most)
        found = np.full(self.count, math.inf)
        for end in (-1.0, 1.0):
            at = terms[0] + end * terms[1]
            slopes = at[:, 1:]
            ends = np.where(slopes > 0.0, slopes * reach.low, slopes * reach.high).sum(axis=1)
            found = np.minimum(found, at[:, 0] + ends)
        rest = float(self.series.rest @ np.append(1.0, most))
        return max(float((found - further).max(initial=0.0)) - rest, 0.0)


@dataclass(frozen=True, eq=False)
class _Number:
    """A measure, or less than nothing of it, as boxes see it.

    Attributes
    ----------
    sense
        1, or -1 where it is to be large.
    ways
        For each size whether its factors grow with it (1) or fall (-1).
    pieces
        Of a load, each with what bounds it.
    """

    measure: Measure
    sense: float
    ways: Ways
    pieces: tuple[_Bundle | _RodBundle, ...] = ()


class SizeBoxes:
    """What no design in a box goes under.

    Raises
    ------
    ValueError
        If a measure does not go one way with a size, or a bend of a load moves with the length of the rod.
    """

    def __init__(self, model: SizeModel) -> None:
        self.model, problem = model, model.problem
        # for each size whether masses grow with it or fall
        self._light = self._ways(lambda x: np.abs(self.model.masses(x)))
        self.terms = [(term.weight, self._number(term.measure, 1.0)) for term in problem.objective]
        self.limits: list[tuple[float, _Number, Limit]] = []
        for limit in problem.limits:
            for edge, sense in ((limit.maximum, 1.0), (limit.minimum, -1.0)):
                if math.isfinite(edge):
                    most = sense * edge + SLACK * abs(edge)
                    self.limits.append((most, self._number(limit.measure, sense), limit))
        self.touch(model.lower, model.upper)

    def _number(self, measure: Measure, sense: float) -> _Number:
        if measure.channel.of_engine is not None:
            return _Number(measure, sense, self._ways(lambda x: np.array([sense * self.model.value(measure, x)])))
        if not measure.norm.of_row_lengths or measure.norm.joins_points or sense < 0.0:
            raise ValueError(f"{measure.name} is not bounded on boxes of sizes")
        pieces = self.model.pieces(measure)

        def factors(x: Array) -> Array:
            engine = self.model.engine(x)
            found = [each.ravel() for piece in pieces for each in self.model.factors(piece, measure, engine)]
            return np.concatenate(found) if found else np.zeros(1)

        if not self.model.moves_rod:
            return _Number(measure, sense, self._ways(factors), tuple(map(_Bundle, pieces)))
        start = self.model.problem.engine.slider_cranks[0].rod_length
        series = rod_series(self.model.whole_pieces(measure), start, *self.model.rod_span)
        return _Number(measure, sense, self._ways(factors), tuple(map(_RodBundle, series)))

    def _ways(self, numbers: Callable[[Array], Array]) -> Ways:
        """Of numbers that go one way with each size: which way each of them takes all of them, zero where none."""
        lower, upper = self.model.lower, self.model.upper
        ways = np.zeros(len(lower))
        for start in (lower, upper):
            for k in range(len(lower)):
                ends = [np.where(np.arange(len(lower)) == k, edge, start) for edge in (lower, upper)]
                change = numbers(ends[1]) - numbers(ends[0])
                rises, falls = bool(np.any(change > 0.0)), bool(np.any(change < 0.0))
                way = float(rises) - float(falls)
                if (rises and falls) or way * ways[k] < 0.0:
                    raise ValueError(f"a measure does not go one way with {self.model.problem.decisions[k].name}")
                ways[k] = way or ways[k]
        return ways

    def keeping(self, limits: Sequence[Limit]) -> SizeBoxes:
        """The same with some of the limits alone, and nothing wanted."""
        other = copy.copy(self)
        other.terms, other.limits = [], [each for each in self.limits if each[2] in limits]
        return other

    def reach(self, lower: Array, upper: Array) -> _Reach:
        """Of a box."""
        ends = (self.model.masses(corner(way * self._light, lower, upper)) for way in (1.0, -1.0))
        light, heavy = ends
        rod = self.model.rod_length(lower), self.model.rod_length(upper)
        return _Reach(np.minimum(light, heavy), np.maximum(light, heavy), rod)

    def touch(self, lower: Array, upper: Array) -> None:
        """Bounds that loads meet at masses of a box."""
        reach = self.reach(lower, upper)
        middle, length = reach.middle
        for number in (*(number for _, number in self.terms), *(number for _, number, _ in self.limits)):
            for bundle in number.pieces:
                for masses in (reach.low, middle) if bundle.count < MOST_TOUCHED else ():
                    bundle.touch(masses, length)

    def least(self, number: _Number, lower: Array, upper: Array, reach: _Reach) -> float:
        """Of a measure on a box."""
        at = corner(number.ways, lower, upper)
        if not number.pieces:
            return number.sense * self.model.value(number.measure, at)
        engine = self.model.engine(at) if np.any(number.ways) else self.model.problem.engine
        return max(self._piece(bundle, number.measure, engine, reach) for bundle in number.pieces)

    def _piece(self, bundle: _Bundle | _RodBundle, measure: Measure, engine: Engine, reach: _Reach) -> float:
        factors = self.model.factors(bundle.piece, measure, engine)
        ratio = bundle.piece.ratio(factors)
        if ratio is not None:
            return ratio * bundle.least(reach)
        own = bundle.scaled(factors)
        own.touch(*reach.middle)
        return own.least(reach)

    def objective(self, lower: Array, upper: Array) -> float:
        """Least on a box."""
        reach = self.reach(lower, upper)
        return sum(weight * self.least(number, lower, upper, reach) for weight, number in self.terms)

    def breaks(self, lower: Array, upper: Array, k: int | None = None, way: float = 0.0) -> bool:
        """Whether a limit is broken all over a box; of those limits that go one way with size k, where that is told."""
        reach = self.reach(lower, upper)
        return any(
            self.least(number, lower, upper, reach) > most
            for most, number, _ in self.limits
            if k is None or number.ways[k] == way
        )

    def cut(self, lower: Array, upper: Array, enough: float) -> tuple[Array, Array, float] | None:
        """A box without sides that hold no better design, and its least objective; None where nothing is left."""
        self.touch(lower, upper)
        if self.breaks(lower, upper) or self.objective(lower, upper) >= enough:
            return None
        for _ in range(ROUNDS):
            before = (upper - lower).sum()
            for k in range(len(lower)):
                lower, upper = self._shaved(lower, upper, k, enough)
            if (upper - lower).sum() > 0.9 * before:
                break
        bound = self.objective(lower, upper)
        return None if bound >= enough else (lower, upper, bound)

    def _shaved(self, lower: Array, upper: Array, k: int, enough: float) -> tuple[Array, Array]:
        """Without as much of the ends of one side as is shown to hold nothing."""
        here = np.arange(len(lower)) == k

        def low_empty(edge: float) -> bool:
            return self.breaks(lower, np.where(here, edge, upper), k, -1.0)

        first = _last_empty(low_empty, lower[k], upper[k])
        lower = np.where(here, first, lower)

        def high_empty(edge: float) -> bool:
            part = np.where(here, edge, lower), upper
            return self.objective(*part) >= enough or self.breaks(*part, k, 1.0)

        return lower, np.where(here, _last_empty(high_empty, upper[k], lower[k]), upper)


def _last_empty(empty: Callable[[float], bool], start: float, end: float) -> float:
    """How far from its start a side is shown to be empty, by halving."""
    done, far = start, end
    for _ in range(HALVINGS if start != end else 0):
        middle = 0.5 * (done + far)
        if empty(middle):
            done = middle
        elif done == start and abs(middle - start) < 0.02 * abs(end - start):
            break
        else:
            far = middle
    return done


def corner(ways: Ways, lower: Array, upper: Array) -> Array:
    """Where numbers that go these ways are least."""
    return np.where(ways >= 0.0, lower, upper)


class _Sizes(Halving):
    """Halves of the longest side, each cut."""

    what = "boxes of sizes"

    def __init__(self, boxes: SizeBoxes, value: float, room: float) -> None:
        super().__init__(value, room)
        self._boxes, self._whole = boxes, boxes.model.upper - boxes.model.lower

    def bounded(self, lower: Array, upper: Array) -> tuple[float, Box] | None:
        """A box without what is cut off."""
        kept = self._boxes.cut(lower, upper, self.enough)
        return None if kept is None else (kept[2], Box(*kept[:2], widest(*kept[:2], self._whole)))

    def halved(self, boxes: Sequence[Box]) -> list[tuple[float, Box] | None]:
        """Each half by itself."""
        return [self.bounded(*half) for box in boxes for half in halves(box)]


def divided_sizes(boxes: SizeBoxes, value: float, room: float, most: int = MOST_BOXES) -> Divided:
    """Halve boxes, the least first, until none may hold a design that is `room` better than `value` (Z12)."""
    division = _Sizes(boxes, value, room)
    return division.run(division.bounded(boxes.model.lower, boxes.model.upper), most)
