"""Open unbalances that ride on throws between bounds, as columns of a cone program (S28).

What an open size r >= 0 loads on a throw is r e^{i theta} times a gain: with theta on an arc it lies in the cone
over the arc, r e^{i theta} = sum_j q_j p_j with q_j >= 0 and sum q_j = r, p_j the corners of a polygon around the
arc. A complex U is U e^{i m}, m the middle of the arc, and a rest no longer than |U| times what the arc
goes beyond m. One that rides alone and may take every angle is free of its throw.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.affine import AffineNorm
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import NORMS, Grid
from laufruhe.problem.decision import Decision, Domain, RotorDrive, domains_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Interval, Sector, Set, Value

# [rad], of an arc between two corners of its polygon
_SIDE = math.radians(60.0)


@dataclass(frozen=True, eq=False)
class BoxColumns:
    """Columns of a box's program, and what they are of those of the model.

    Attributes
    ----------
    domains
        Of the columns.
    matrix
        Shape (columns of the model, columns of the box).
    limits
        That tie the columns of one decision together.
    shared
        First column of every decision that riders share.
    """

    domains: tuple[Domain, ...]
    matrix: Array
    limits: tuple[tuple[float, AffineNorm], ...]
    shared: tuple[int, ...]


@dataclass(frozen=True)
class _Rider:
    """One unbalance on a throw: U e^{i (theta - theta0)} times a gain, in two columns of the model."""

    column: int
    drive: RotorDrive
    pin: int


@dataclass(frozen=True)
class _Ridden:
    """A decision with riders, and its own columns in the model where it drives what stands still."""

    decision: Decision
    riders: tuple[_Rider, ...]
    still: Domain | None


class Riders:
    """The open unbalances of a problem, those that ride on throws each by itself.

    Parameters
    ----------
    problem
        With throws where they stand in the engine.
    rides
        Throw that every rotor turns with.
    throws
        Their angles there [rad].

    Attributes
    ----------
    problem
        In which every unbalance that rides is free: its loads are those of the model's columns.
    """

    def __init__(self, problem: Problem, rides: dict[str, int], throws: Sequence[float]) -> None:
        self._throws = throws
        open_ = [d for d in problem.unbalances if _riding(d, rides)]
        bases: list[Value] = [_base(d.set) for d in open_]
        freed: list[Decision] = []
        for decision in problem.unbalances:
            if decision not in open_:
                freed.append(decision)
                continue
            still = tuple(drive for drive in decision.rotor_drives if drive.rotor not in rides)
            if still:
                freed.append(replace(decision, set=_from_base(decision.set), start=0.0, drives=still))
            for drive in _riding(decision, rides):
                plain = replace(drive, gain=1.0 + 0.0j, mirrored=False)
                freed.append(Decision(f"{decision.name} | {drive.rotor}", decision.unit, Sector(1.0), 0.0, (plain,)))
        engine = problem.design(bases, open_) if open_ else problem.engine
        self.problem = replace(problem, engine=engine, decisions=tuple(freed), limits=problem.load_limits)
        by_name = {domain.decision.name: domain for domain in domains_of(self.problem.unbalances)}
        self.size = sum(domain.width for domain in by_name.values())
        self._plain = [by_name[d.name] for d in problem.unbalances if d not in open_]
        self._ridden = [
            _Ridden(
                d,
                tuple(_Rider(by_name[f"{d.name} | {v.rotor}"].start, v, rides[v.rotor]) for v in _riding(d, rides)),
                by_name.get(d.name),
            )
            for d in open_
        ]

    def columns(self, lower: Array, upper: Array) -> BoxColumns:
        """Of a box of throws [rad]."""
        build = _Columns(self.size)
        for domain in self._plain:
            first = build.add(domain.decision.set)
            build.matrix[first, domain.start] = 1.0
            if domain.width > 1:
                build.matrix[first + 1, domain.start + 1] = 1.0
        for ridden in self._ridden:
            starts = [(rider, rider.pin, self._throws[rider.pin]) for rider in ridden.riders]
            turned = [(rider, float(lower[k]) - at, float(upper[k]) - at) for rider, k, at in starts]
            if isinstance(ridden.decision.set, Interval):
                build.sized(ridden, turned)
            else:
                build.turned(ridden, turned)
        return build.done()

    def spread(self, found: BoxColumns, y: Array, middle: Array) -> list[tuple[int, int, float]]:
        """How far every rider is from where its throw would take it: throw, column of the model, and distance."""
        x, out = found.matrix @ y, []
        for ridden, shared in zip(self._ridden, found.shared, strict=True):
            own = _from_base(ridden.decision.set)
            value = sum(complex(y[shared + k]) * direction for k, direction in enumerate(own.directions))
            for rider in ridden.riders:
                at = rider.drive.of(value) * np.exp(1j * (middle[rider.pin] - self._throws[rider.pin]))
                out.append((rider.pin, rider.column, abs(complex(x[rider.column], x[rider.column + 1]) - at)))
        return out


class _Columns:
    """Columns of a box as they are added, each a row of what it is in the model."""

    def __init__(self, size: int) -> None:
        self.sets: list[Set] = []
        self.matrix: dict[tuple[int, int], float] = {}
        self.count, self._size = 0, size
        self._ties: list[tuple[float, list[tuple[int, float]]]] = []
        self._shared: list[int] = []

    def add(self, own: Set) -> int:
        """First column of a set."""
        self.sets.append(own)
        self.count += own.width
        return self.count - own.width

    def _put(self, column: int, rider: _Rider, value: complex) -> None:
        for k, part in enumerate((value.real, value.imag)):
            key = (column, rider.column + k)
            self.matrix[key] = self.matrix.get(key, 0.0) + part

    def sized(self, ridden: _Ridden, turned: Sequence[tuple[_Rider, float, float]]) -> None:
        """A size that its riders share."""
        own = _from_base(ridden.decision.set)
        most = own.upper
        shared = self.add(own)
        self._shared.append(shared)
        if ridden.still is not None:
            self.matrix[shared, ridden.still.start] = 1.0
        for rider, low, high in turned:
            corners = complex(rider.drive.of(own.directions[0])) * _around(low, high)
            self._put(shared, rider, complex(corners[0]))
            tie = [(shared, 1.0)]
            for corner in corners[1:]:
                column = self.add(Interval(0.0, most))
                self._put(column, rider, complex(corner - corners[0]))
                tie.append((column, -1.0))
            if len(tie) > 1:
                self._ties.append((most, tie))

    def turned(self, ridden: _Ridden, turned: Sequence[tuple[_Rider, float, float]]) -> None:
        """A complex unbalance, with a rest for every rider."""
        own = ridden.decision.set
        shared = self.add(own)
        self._shared.append(shared)
        if ridden.still is not None:
            for k in range(own.width):
                self.matrix[shared + k, ridden.still.start + k] = 1.0
        free = own.width > 1 and own.free_angle and len(turned) == 1 and ridden.still is None
        for rider, low, high in turned:
            middle = 0.0 if free else 0.5 * (low + high)
            for k, direction in enumerate((1.0, 1.0j)):
                self._put(shared + k, rider, complex(rider.drive.of(direction) * np.exp(1j * middle)))
            beyond = 0.0 if free else 2.0 * math.sin(min(0.25 * (high - low), 0.5 * math.pi))
            if beyond > 0.0:
                rest = self.add(Sector(own.upper * abs(rider.drive.gain) * beyond))
                self._put(rest, rider, 1.0)
                self._put(rest + 1, rider, 1.0j)

    def done(self) -> BoxColumns:
        """All of them."""
        matrix = np.zeros((self._size, self.count))
        for (column, row), value in self.matrix.items():
            matrix[row, column] = value
        decisions = [Decision(f"{k}", "", own, 0.0, ()) for k, own in enumerate(self.sets)]
        limits: tuple[tuple[float, AffineNorm], ...] = ()
        ties = [(most, tie) for most, tie in self._ties if most > 0.0]
        if ties:
            # 0 <= r - sum q <= most, each counted from its middle
            slope = np.zeros((len(ties), 1, self.count))
            for k, (most, tie) in enumerate(ties):
                for column, sign in tie:
                    slope[k, 0, column] = sign / most
            grid = Grid(np.ones(len(ties)), len(ties))
            limits = ((0.5, AffineNorm(NORMS["maximum"], np.full((len(ties), 1), -0.5), slope, grid)),)
        return BoxColumns(domains_of(decisions), matrix, limits, tuple(self._shared))


def _riding(decision: Decision, rides: dict[str, int]) -> list[RotorDrive]:
    return [drive for drive in decision.rotor_drives if drive.rotor in rides and drive.acts]


def _base(own: Set) -> Value:
    """The value that the rest of an interval is counted from, so that none of it is negative."""
    if isinstance(own, Interval):
        return (own.upper if own.upper <= 0.0 else own.lower) * own.directions[0]
    return 0.0j


def _from_base(own: Set) -> Set:
    if not isinstance(own, Interval):
        return own
    turn = math.pi if own.upper <= 0.0 else 0.0
    return replace(own, lower=0.0, upper=own.upper - own.lower, angle=own.angle + turn)


def _around(low: float, high: float) -> NDArray[np.complex128]:
    """Corners of a polygon around an arc: its ends, and where tangents meet between them."""
    if high - low <= 0.0:
        return np.array([np.exp(1j * low)])
    parts = max(math.ceil((high - low) / _SIDE), 1)
    half = 0.5 * (high - low) / parts
    middles = low + half * (2.0 * np.arange(parts) + 1.0)
    return np.concatenate([np.exp(1j * np.array([low, high])), np.exp(1j * middles) / math.cos(half)])
