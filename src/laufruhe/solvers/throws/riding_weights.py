"""Open unbalances that ride on throws between bounds, as columns of a cone program (S28).

An open size r >= 0 on a throw loads by r e^{i theta} times a gain: with theta on an arc it lies in the cone
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
from laufruhe.problem.sets import Interval, Sector, Set

# [rad], of an arc between two corners of its polygon
_SIDE = math.radians(60.0)


@dataclass(frozen=True, eq=False)
class BoxColumns:
    """Columns of a box's program, and those of the model that they stand for.

    Attributes
    ----------
    domains
        Sets of the columns.
    matrix
        Shape (columns of the model, columns of the box).
    limits
        Limits that tie the columns of one decision together.
    shared
        First column of every decision that riders share.
    """

    domains: tuple[Domain, ...]
    matrix: Array
    limits: tuple[tuple[float, AffineNorm], ...]
    shared: tuple[int, ...]


@dataclass(frozen=True)
class _Rider:
    """Unbalance on a throw: U e^{i (theta - theta0)} times a gain, in two columns of the model."""

    column: int
    drive: RotorDrive
    pin: int


@dataclass(frozen=True)
class _Ridden:
    """A decision with riders; `still` is its own domain in the model where it drives other rotors too."""

    decision: Decision
    riders: tuple[_Rider, ...]
    still: Domain | None


class Riders:
    """Open unbalances of a problem, those that ride on throws each by itself.

    Parameters
    ----------
    problem
        The problem with throws where they stand in the engine.
    rides
        Throw that every rotor turns with.
    throws
        Angles of the throws there [rad].

    Attributes
    ----------
    problem
        The problem in which every unbalance that rides is free: its loads are those of the model's columns.
    """

    def __init__(self, problem: Problem, rides: dict[str, int], throws: Sequence[float]) -> None:
        self._throws = throws
        on_throws = {
            d.name: own for d in problem.unbalances
            if (own := [drive for drive in d.rotor_drives if drive.rotor in rides and drive.acts])
        }  # fmt: skip
        freed: list[Decision] = []
        for decision in problem.unbalances:
            if decision.name not in on_throws:
                freed.append(decision)
                continue
            still = tuple(drive for drive in decision.rotor_drives if drive.rotor not in rides)
            if still:
                freed.append(replace(decision, set=_counted_from_zero(decision.set), start=0.0, drives=still))
            for drive in on_throws[decision.name]:
                plain = replace(drive, gain=1.0 + 0.0j, mirrored=False)
                freed.append(Decision(f"{decision.name} | {drive.rotor}", decision.unit, Sector(1.0), 0.0, (plain,)))
        ridden = [decision for decision in problem.unbalances if decision.name in on_throws]
        # values that the rest of an interval is counted from, so that none of it is negative
        bases = [
            (own.upper if own.upper <= 0.0 else own.lower) * own.directions[0] if isinstance(own, Interval) else 0.0j
            for own in (decision.set for decision in ridden)
        ]
        engine = problem.design(bases, ridden) if ridden else problem.engine
        self.problem = replace(problem, engine=engine, decisions=tuple(freed), limits=problem.load_limits)
        by_name = {domain.decision.name: domain for domain in domains_of(self.problem.unbalances)}
        self.size = sum(domain.width for domain in by_name.values())
        self._plain = [by_name[d.name] for d in problem.unbalances if d.name not in on_throws]
        self._ridden = [
            _Ridden(
                d,
                tuple(_Rider(by_name[f"{d.name} | {v.rotor}"].start, v, rides[v.rotor]) for v in on_throws[d.name]),
                by_name.get(d.name),
            )
            for d in ridden
        ]

    def columns(self, lower: Array, upper: Array) -> BoxColumns:
        """Return the columns of a box of throws [rad]."""
        sets: list[Set] = []
        entries: dict[tuple[int, int], float] = {}
        ties: list[tuple[float, list[tuple[int, float]]]] = []
        first_columns = []

        def add(values: Set) -> int:
            sets.append(values)
            return sum(other.width for other in sets[:-1])

        def put(column: int, rider: _Rider, value: complex) -> None:
            for k, part in enumerate((value.real, value.imag)):
                key = (rider.column + k, column)
                entries[key] = entries.get(key, 0.0) + part

        for domain in self._plain:
            first = add(domain.decision.set)
            entries |= {(domain.start + k, first + k): 1.0 for k in range(domain.width)}
        for ridden in self._ridden:
            values, still = _counted_from_zero(ridden.decision.set), ridden.still
            first = add(values)
            first_columns.append(first)
            if still is not None:
                entries |= {(still.start + k, first + k): 1.0 for k in range(values.width)}
            # an angle of its own frees a weight from its throw
            is_free = values.width > 1 and values.free_angle and len(ridden.riders) == 1 and still is None
            for rider in ridden.riders:
                low, high = (float(end[rider.pin]) - self._throws[rider.pin] for end in (lower, upper))
                if isinstance(values, Interval):
                    corners = complex(rider.drive.of(values.directions[0])) * _polygon_around(low, high)
                    put(first, rider, complex(corners[0]))
                    tie = [(first, 1.0)]
                    for corner in corners[1:]:
                        column = add(Interval(0.0, values.upper))
                        put(column, rider, complex(corner - corners[0]))
                        tie.append((column, -1.0))
                    if len(tie) > 1 and values.upper > 0.0:
                        ties.append((values.upper, tie))
                    continue
                middle = 0.0 if is_free else 0.5 * (low + high)
                for k, direction in enumerate((1.0, 1.0j)):
                    put(first + k, rider, complex(rider.drive.of(direction) * np.exp(1j * middle)))
                beyond = 0.0 if is_free else 2.0 * math.sin(min(0.25 * (high - low), 0.5 * math.pi))
                if beyond > 0.0:
                    rest = add(Sector(values.upper * abs(rider.drive.gain) * beyond))
                    put(rest, rider, 1.0)
                    put(rest + 1, rider, 1.0j)
        decisions = [Decision(f"{k}", "", values, 0.0, ()) for k, values in enumerate(sets)]
        matrix = np.zeros((self.size, sum(values.width for values in sets)))
        for key, value in entries.items():
            matrix[key] = value
        limits: tuple[tuple[float, AffineNorm], ...] = ()
        if ties:
            # 0 <= r - sum q <= most, each counted from its middle
            slope = np.zeros((len(ties), 1, matrix.shape[1]))
            for k, (maximum, tie) in enumerate(ties):
                for column, sign in tie:
                    slope[k, 0, column] = sign / maximum
            grid = Grid(np.ones(len(slope)), len(slope))
            limits = ((0.5, AffineNorm(NORMS["maximum"], np.full((len(slope), 1), -0.5), slope, grid)),)
        return BoxColumns(domains_of(decisions), matrix, limits, tuple(first_columns))

    def spread(self, columns: BoxColumns, y: Array, middle: Array) -> list[tuple[int, int, float]]:
        """Return how far every rider is from where its throw would take it: throw, column of the model, and distance.

        Parameters
        ----------
        y
            Values of the columns.
        middle
            Angles of the throws [rad].
        """
        x, out = columns.matrix @ y, []
        for ridden, shared in zip(self._ridden, columns.shared, strict=True):
            values = _counted_from_zero(ridden.decision.set)
            value = sum(complex(y[shared + k]) * direction for k, direction in enumerate(values.directions))
            for rider in ridden.riders:
                at = rider.drive.of(value) * np.exp(1j * (middle[rider.pin] - self._throws[rider.pin]))
                out.append((rider.pin, rider.column, abs(complex(x[rider.column], x[rider.column + 1]) - at)))
        return out


def _counted_from_zero(values: Set) -> Set:
    if not isinstance(values, Interval):
        return values
    turn = math.pi if values.upper <= 0.0 else 0.0
    return replace(values, lower=0.0, upper=values.upper - values.lower, angle=values.angle + turn)


def _polygon_around(low: float, high: float) -> NDArray[np.complex128]:
    if high - low <= 0.0:
        return np.array([np.exp(1j * low)])
    parts = max(math.ceil((high - low) / _SIDE), 1)
    half = 0.5 * (high - low) / parts
    middles = low + half * (2.0 * np.arange(parts) + 1.0)
    return np.concatenate([np.exp(1j * np.array([low, high])), np.exp(1j * middles) / math.cos(half)])
