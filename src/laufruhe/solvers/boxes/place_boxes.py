"""Places of unbalances in a box, as a cone program that leaves out nothing but how they share (P8).

The load of an unbalance U at a place r is linear in U and in U r. Where r lies in a box with
the corners r_c, it is the load of unbalances

    U_c = l_c U,    sum l_c = 1,    l_c >= 0,    r = sum l_c r_c                           (P8)

at the corners. That the U_c share one angle, and unbalances of one place their l_c, is left
out: a cone program, whose least value no design with its places in the box goes under. The
smaller the box, the less was left out. An unbalance that is given makes U r linear in r, and
nothing is left out at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Role, Rotor
from laufruhe.numerics.arrays import Array
from laufruhe.problem.channels import ADDED_MASS
from laufruhe.problem.decision import Decision, Kind, RotorDrive
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Interval, Set, Value
from laufruhe.solvers.conclusion import unbalances_of
from laufruhe.solvers.result import Result


class Relaxation:
    """Programs of the boxes of places of a problem.

    Parameters
    ----------
    problem
        Whose decisions are unbalances and places.
    share
        Of its tolerance, that a program may use up.
    """

    def __init__(self, problem: Problem, share: float) -> None:
        self.problem, self._tolerance = problem, share * problem.tolerance
        self.places = tuple(d for d in problem.decisions if d.kind is Kind.PLACE)
        self.unbalances = problem.unbalances
        self._least = [_least(decision.set) for decision in self.unbalances]
        # what each unbalance is when every decision is as small as it may be
        self._still = {rotor.name: rotor for rotor in problem.design(self._least, self.unbalances).rotors}
        self._placed: dict[str, list[int]] = {}
        for k, place in enumerate(self.places):
            for drive in place.place_drives:
                self._placed.setdefault(drive.rotor, []).append(k)

    def program(self, lower: Array, upper: Array) -> Problem:
        """Every unbalance whose place is open at the corners of its box."""
        rotors, decisions = self._given(lower, upper)
        limits: list[Limit] = []
        names = {name: [name] for name in self._placed}
        for decision, least in zip(self.unbalances, self._least, strict=True):
            axes = self._axes(decision)
            if not axes:
                decisions.append(replace(decision, start=least))
                continue
            parts: dict[str, list[Rotor]] = {drive.rotor: [] for drive in decision.rotor_drives}
            for c, corner in enumerate(_corners(lower, upper, axes)):
                drives = []
                for drive in decision.rotor_drives:
                    rotor = self._placed_at(drive.rotor, corner, f"{drive.rotor} | {decision.name} {c}")
                    parts[drive.rotor].append(rotor)
                    drives.append(replace(drive, rotor=rotor.name))
                own = Decision(_corner_name(decision, c), decision.unit, _from_zero(decision.set), 0.0, tuple(drives))
                decisions.append(own)
            first = decision.rotor_drives[0]
            for name, made in parts.items():
                rotors += made
                names.setdefault(name, [name]).extend(rotor.name for rotor in made)
            limits.append(_together(decision, first, parts[first.rotor]))
        kept = tuple(rotor for rotor in self._still.values() if rotor.name not in self._placed)
        problem = self.problem
        return replace(
            problem,
            engine=replace(problem.engine, rotors=(*kept, *rotors)),
            decisions=tuple(decisions),
            objective=tuple(replace(t, measure=_renamed(t.measure, names)) for t in problem.objective),
            limits=(*(replace(x, measure=_renamed(x.measure, names)) for x in problem.limits), *limits),
            tolerance=self._tolerance,
        )

    def _given(self, lower: Array, upper: Array) -> tuple[list[Rotor], list[Decision]]:
        """Unbalances that are there whatever is decided: their loads are linear in how far they are moved."""
        rotors: list[Rotor] = []
        drives: list[list[RotorDrive]] = [[] for _ in self.places]
        for name, axes in self._placed.items():
            unbalance = self._still[name].unbalance
            least = {k: float(lower[k]) for k in axes}
            rotors.append(self._placed_at(name, least, name))
            for k in axes if unbalance else ():
                for at, gain in ((0.0, -unbalance), (1.0, unbalance)):
                    end = self._placed_at(name, least | {k: least[k] + at}, f"{name} | {k} {at:g}")
                    # its mass is counted once, where it stands
                    rotors.append(replace(end, role=Role.THROW))
                    drives[k].append(RotorDrive(end.name, gain))
        decisions = [
            Decision(f"{place.name} | .place", place.unit, Interval(0.0, float(high - low)), 0.0, tuple(own))
            for place, low, high, own in zip(self.places, lower, upper, drives, strict=True)
            if own
        ]
        return rotors, decisions

    def _placed_at(self, name: str, places: dict[int, float], new: str) -> Rotor:
        """A rotor elsewhere, under a name of its own; without its unbalance unless it keeps its name."""
        still = self._still[name]
        where = list(still.place)
        for k, at in places.items():
            for drive in self.places[k].place_drives:
                if drive.rotor == name:
                    where[drive.axis] = at
        moved = replace(still.placed(*where), name=new)
        # its mass is counted where the sizes at all corners are, which needs a radius, any one
        return moved if new == name else replace(moved, unbalance=0.0j, radius=still.radius or 1.0)

    def placing(self, relaxed: Problem, result: Result, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Where the program puts each place, and how far apart what shares it."""
        found = dict(zip((d.name for d in relaxed.decisions), unbalances_of(relaxed, result), strict=True))
        # of every place what its unbalances are, and where, one pair of arrays for each that is decided apart
        votes: list[list[tuple[NDArray[np.complex128], Array]]] = [[] for _ in self.places]
        for k, place in enumerate(self.places):
            if f"{place.name} | .place" in found:
                still = sum(abs(self._still[drive.rotor].unbalance) for drive in place.place_drives)
                votes[k].append((np.array([still], complex), lower[[k]] + found[f"{place.name} | .place"].real))
        for decision in self.unbalances:
            axes = self._axes(decision)
            corners = _corners(lower, upper, axes) if axes else ()
            gain = sum(abs(drive.gain) for drive in decision.rotor_drives)
            sizes = np.array([gain * found[_corner_name(decision, c)] for c in range(len(corners))], complex)
            for k in axes:
                votes[k].append((sizes, np.array([corner[k] for corner in corners])))
        middle, spread = 0.5 * (lower + upper), np.zeros(len(lower))
        for k, own in enumerate(votes):
            total = sum(float(np.abs(sizes).sum()) for sizes, _ in own)
            if total > 0.0:
                middle[k] = np.clip(sum(np.abs(sizes) @ at for sizes, at in own) / total, lower[k], upper[k])
                spread[k] = sum(abs(sizes @ (at - middle[k])) for sizes, at in own) / total
        return middle, spread

    def _axes(self, decision: Decision) -> list[int]:
        """Places of what an unbalance drives."""
        return sorted({k for drive in decision.rotor_drives for k in self._placed.get(drive.rotor, ())})


def _corners(lower: Array, upper: Array, axes: Sequence[int]) -> tuple[dict[int, float], ...]:
    """Corners of a box along some of its sides."""
    sides = product(*((float(lower[k]), float(upper[k])) for k in axes))
    return tuple(dict(zip(axes, corner, strict=True)) for corner in sides)


def _corner_name(decision: Decision, corner: int) -> str:
    stem, key = decision.name.rsplit(".", 1)
    return f"{stem} | {corner}.{key}"


def _least(own: Set) -> Value:
    """The value of a decision that is nearest to nothing."""
    if isinstance(own, Interval):
        return min(max(own.lower, 0.0), own.upper) * own.directions[0]
    return 0.0j


def _from_zero(own: Set) -> Set:
    """What may be added to the least value, and any share of it."""
    if isinstance(own, Interval):
        least = min(max(own.lower, 0.0), own.upper)
        return replace(own, lower=min(own.lower - least, 0.0), upper=max(own.upper - least, 0.0))
    return own


def _together(decision: Decision, drive: RotorDrive, parts: Sequence[Rotor]) -> Limit:
    """All corners together are no larger than the unbalance may be."""
    radius = parts[0].radius or 1.0
    most = _from_zero(decision.set).scale * abs(drive.gain) / radius
    return Limit(decision.name, Measure(ADDED_MASS, rotors=tuple(part.name for part in parts)), most)


def _renamed(measure: Measure, names: dict[str, list[str]]) -> Measure:
    """A measure of named rotors, of all that stand for them."""
    if measure.rotors is None:
        return measure
    return replace(measure, rotors=tuple(part for name in measure.rotors for part in names.get(name, [name])))
