"""Open unbalances on throws between bounds, as columns of a cone program (S28).

An unbalance on a throw turns with it; such an unbalance is called a rider. An open size r >= 0 on a throw at theta has
the load r e^{i theta} times a gain. If theta lies on an arc, r e^{i theta} = sum_j q_j p_j, with p_j the corners of a
polygon around the arc and weights q_j >= 0 whose sum is r. A complex unbalance U becomes U e^{i m} plus a deviation,
with m the middle of the arc. The deviation is at most |U| times the distance of the arc from e^{i m}. A single rider
whose angle is free does not depend on its throw.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.affine import AffineNorm
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import NORMS, Grid
from laufruhe.problem.decision import Decision, Domain, RotorDrive, domains_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Interval, Sector, Set

# largest angle between two corners of a polygon around an arc [rad]
_SIDE = math.radians(60.0)


@dataclass(frozen=True, eq=False)
class BoxColumns:
    """Columns of the program of a box, and their map to the columns of the model.

    Attributes
    ----------
    domains
        Sets of the columns of the box.
    matrix
        Matrix from columns of the box to columns of the model, shape (columns of the model, columns of the box).
    limits
        Limits that couple the columns of one decision.
    """

    domains: tuple[Domain, ...]
    matrix: Array
    limits: tuple[tuple[float, AffineNorm], ...]


class _Rider(NamedTuple):
    """Unbalance on throw `pin`: U e^{i (theta - theta0)} times a gain, in two columns of the model from `column`."""

    column: int
    drive: RotorDrive
    pin: int


class _RiderGroup(NamedTuple):
    """A decision with riders; `fixed` are the columns of its unbalances on other rotors, if it has any."""

    decision: Decision
    riders: tuple[_Rider, ...]
    fixed: Domain | None


class Riders:
    """Open unbalances of a problem, with separate columns for every unbalance on a throw.

    Parameters
    ----------
    throw_of_rotor, throws
        Index of the throw of every rotor that turns with one, and angles of the throws of the engine [rad].

    Attributes
    ----------
    problem
        Problem in which every unbalance on a throw is a free complex number; its columns are those of the model.
    size
        Number of columns of the model.
    """

    def __init__(self, problem: Problem, throw_of_rotor: dict[str, int], throws: Sequence[float]) -> None:
        self._throws = throws
        on_throws = {
            d.name: drives for d in problem.unbalances
            if (drives := [drive for drive in d.rotor_drives if drive.rotor in throw_of_rotor and drive.gain])
        }  # fmt: skip
        free_decisions: list[Decision] = []
        for decision in problem.unbalances:
            if decision.name not in on_throws:
                free_decisions.append(decision)
                continue
            fixed_drives = tuple(drive for drive in decision.rotor_drives if drive.rotor not in throw_of_rotor)
            if fixed_drives:
                values = _shift_to_zero(decision.set)
                free_decisions.append(replace(decision, set=values, start=0.0, drives=fixed_drives))
            for drive in on_throws[decision.name]:
                name, unit_drive = f"{decision.name} | {drive.rotor}", replace(drive, gain=1.0 + 0.0j, mirrored=False)
                free_decisions.append(Decision(name, decision.unit, Sector(1.0), 0.0, (unit_drive,)))
        with_riders = [decision for decision in problem.unbalances if decision.name in on_throws]
        # reference value of every interval, so that the difference to it is not negative
        bases = [
            (x.upper if x.upper <= 0.0 else x.lower) * x.directions[0] if isinstance(x, Interval) else 0.0j
            for x in (decision.set for decision in with_riders)
        ]
        engine = problem.design(bases, with_riders) if with_riders else problem.engine
        self.problem = replace(problem, engine=engine, decisions=tuple(free_decisions), limits=problem.load_limits)
        by_name = {domain.decision.name: domain for domain in domains_of(self.problem.unbalances)}
        self.size = sum(domain.width for domain in by_name.values())

        def rider(decision: Decision, drive: RotorDrive) -> _Rider:
            return _Rider(by_name[f"{decision.name} | {drive.rotor}"].start, drive, throw_of_rotor[drive.rotor])

        self._other_domains = [by_name[d.name] for d in problem.unbalances if d.name not in on_throws]
        self._groups = [
            _RiderGroup(d, tuple(rider(d, drive) for drive in on_throws[d.name]), by_name.get(d.name))
            for d in with_riders
        ]

    def columns(self, lower: Array, upper: Array) -> BoxColumns:
        """Return the columns of a box of throws, from their bounds [rad], shape (throws,) each."""
        sets: list[Set] = []
        entries: dict[tuple[int, int], float] = {}
        couplings: list[tuple[float, list[tuple[int, float]]]] = []

        def add_columns(values: Set) -> int:
            sets.append(values)
            return sum(x.width for x in sets[:-1])

        def add_entry(column: int, rider: _Rider, value: complex) -> None:
            for k, part in enumerate((value.real, value.imag)):
                key = (rider.column + k, column)
                entries[key] = entries.get(key, 0.0) + part

        for domain in self._other_domains:
            first = add_columns(domain.decision.set)
            entries |= {(domain.start + k, first + k): 1.0 for k in range(domain.width)}
        for group in self._groups:
            values, fixed = _shift_to_zero(group.decision.set), group.fixed
            first = add_columns(values)
            if fixed is not None:
                entries |= {(fixed.start + k, first + k): 1.0 for k in range(values.width)}
            # an unbalance with a free angle does not depend on its throw
            is_free = values.width > 1 and values.free_angle and len(group.riders) == 1 and fixed is None
            for rider in group.riders:
                low, high = (float(end[rider.pin]) - self._throws[rider.pin] for end in (lower, upper))
                if isinstance(values, Interval):
                    corners = complex(rider.drive.of(values.directions[0])) * _polygon_around(low, high)
                    add_entry(first, rider, complex(corners[0]))
                    coupling = [(first, 1.0)]
                    for corner in corners[1:]:
                        column = add_columns(Interval(0.0, values.upper))
                        add_entry(column, rider, complex(corner - corners[0]))
                        coupling.append((column, -1.0))
                    if len(coupling) > 1 and values.upper > 0.0:
                        couplings.append((values.upper, coupling))
                    continue
                middle = 0.0 if is_free else 0.5 * (low + high)
                for k, direction in enumerate((1.0, 1.0j)):
                    add_entry(first + k, rider, complex(rider.drive.of(direction) * np.exp(1j * middle)))
                deviation = 0.0 if is_free else 2.0 * math.sin(min(0.25 * (high - low), 0.5 * math.pi))
                if deviation > 0.0:
                    start = add_columns(Sector(values.upper * abs(rider.drive.gain) * deviation))
                    add_entry(start, rider, 1.0)
                    add_entry(start + 1, rider, 1.0j)
        decisions = [Decision(f"{k}", "", values, 0.0, ()) for k, values in enumerate(sets)]
        matrix = np.zeros((self.size, sum(values.width for values in sets)))
        for key, value in entries.items():
            matrix[key] = value
        limits: tuple[tuple[float, AffineNorm], ...] = ()
        if couplings:
            # 0 <= r - sum q <= maximum, relative to the middle of this range
            slope = np.zeros((len(couplings), 1, matrix.shape[1]))
            for k, (maximum, coupling) in enumerate(couplings):
                for column, sign in coupling:
                    slope[k, 0, column] = sign / maximum
            grid = Grid(np.ones(len(slope)), len(slope))
            limits = ((0.5, AffineNorm(NORMS["maximum"], np.full((len(slope), 1), -0.5), slope, grid)),)
        return BoxColumns(domains_of(decisions), matrix, limits)


def _shift_to_zero(values: Set) -> Set:
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
