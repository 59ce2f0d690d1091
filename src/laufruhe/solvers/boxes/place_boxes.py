"""Places of unbalances in a box, as a cone program that leaves out nothing but how they share (P8).

The load of an unbalance U at a place r is linear in U and in U r. Where r lies in a box with
the corners r_c, it is the load of unbalances

    U_c = l_c U,    sum l_c = 1,    l_c >= 0,    r = sum l_c r_c                           (P8)

at the corners. That the U_c share one angle, and unbalances of one place their l_c, is left
out: no design with its places in the box goes under the least value of the program. The
smaller the box, the less was left out. An unbalance that is given makes U r linear in r, and
nothing is left out at all.

The two bearings beside a load share it, so that their forces bend where the place passes a
bearing (B4). Planes of bearings between the ends of a box are corners too (P20). Whatever else
is open stays open: the program is a problem of its own, without open places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Role, Rotor
from laufruhe.numerics.arrays import Array
from laufruhe.problem.channels import ADDED_MASS
from laufruhe.problem.decision import Decision, Kind, RotorDrive, sides_of
from laufruhe.problem.dependence import Dependence, dependence
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Interval, Set, Value
from laufruhe.solvers.conclusion import unbalances_of, values_of
from laufruhe.solvers.result import Result

ALONG = 0
"""Axis of a place along its shaft."""
UNUSED = 1e-6
"""Share of the largest unbalance at the corners, under which one counts as none."""


class Relaxation:
    """Programs of the boxes of places of a problem.

    Parameters
    ----------
    problem
        With open places.
    share
        Of its tolerance, that a program may use up.
    """

    def __init__(self, problem: Problem, share: float) -> None:
        self._tolerance = share * problem.tolerance
        # what limits places alone is no limit of a program
        kept = tuple(limit for limit in problem.limits if not limit.measure.channel.is_placing)
        self.problem = problem = problem.changed(limits=kept)
        self.places = tuple(d for d in problem.decisions if d.kind is Kind.PLACE)
        self.others = tuple(d for d in problem.decisions if d.kind is not Kind.PLACE)
        self.unbalances = problem.unbalances
        self._least = [_least(decision.set) for decision in self.unbalances]
        # what each unbalance is when every decision is as small as it may be
        self._base = problem.design(self._least, self.unbalances)
        self._still = {rotor.name: rotor for rotor in self._base.rotors}
        self._placed: dict[str, list[int]] = {}
        for k, place in enumerate(self.places):
            for drive in place.place_drives:
                self._placed.setdefault(drive.rotor, []).append(k)
        self._bends = [self._bends_of(place) for place in self.places]

    def _bends_of(self, place: Decision) -> Array:
        """Return the places at which a bearing force bends [m]: all bearings of the shaft but the outermost."""
        asked = {dependence(measure.channel, Kind.PLACE, self.problem) for measure in self.problem.measures}
        if Dependence.BENT not in asked:
            return np.zeros(0)
        shafts = {self._still[drive.rotor].shaft for drive in place.place_drives if drive.axis == ALONG}
        return np.unique([
            x for shaft in shafts for x in sorted(b.x for b in self.problem.engine.bearings if b.shaft == shaft)[1:-1]
        ])  # fmt: skip

    def _nodes(self, lower: Array, upper: Array) -> list[Array]:
        """Return the coordinates of the corners along every side of a box [m]."""
        sides = zip(self._bends, lower, upper, strict=True)
        return [np.array([low, *bends[(bends > low) & (bends < high)], high]) for bends, low, high in sides]

    def program(self, lower: Array, upper: Array) -> Problem:
        """Return the problem with every unbalance whose place is open at the corners of its box, and nothing placed."""
        nodes = self._nodes(lower, upper)
        rotors, decisions = self._given(nodes)
        limits: list[Limit] = []
        names = {name: [name] for name in self._placed}
        least = dict(zip((decision.name for decision in self.unbalances), self._least, strict=True))
        for decision in self.others:
            axes = self._axes(decision)
            if not axes:
                decisions.append(replace(decision, start=least.get(decision.name, decision.start)))
                continue
            parts: dict[str, list[Rotor]] = {drive.rotor: [] for drive in decision.rotor_drives}
            for c, corner in enumerate(_corners(nodes, axes)):
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
            engine=replace(self._base, rotors=(*kept, *rotors)),
            decisions=tuple(decisions),
            objective=tuple(replace(t, measure=_renamed(t.measure, names)) for t in problem.objective),
            limits=(*(replace(x, measure=_renamed(x.measure, names)) for x in problem.limits), *limits),
            tolerance=self._tolerance,
        )

    def _given(self, nodes: Sequence[Array]) -> tuple[list[Rotor], list[Decision]]:
        """Unbalances that are there whatever is decided: their loads are linear in how far they are between corners.

        That a place reaches the end of a cell before it enters the next is left out.
        """
        rotors: list[Rotor] = []
        decisions: list[Decision] = []
        drives: dict[str, list[RotorDrive]] = {}
        for name, axes in self._placed.items():
            unbalance = self._still[name].unbalance
            first = {k: float(nodes[k][0]) for k in axes}
            rotors.append(self._placed_at(name, first, name))
            for k in axes if unbalance else ():
                for c, (low, high) in enumerate(pairwise(nodes[k])):
                    if high == low:
                        continue
                    for at, gain in ((low, -unbalance), (high, unbalance)):
                        end = self._placed_at(name, first | {k: float(at)}, f"{name} | {k} {c} {gain:g}")
                        # its mass is counted once, where it stands
                        rotors.append(replace(end, role=Role.THROW))
                        drives.setdefault(_cell_name(self.places[k], c), []).append(RotorDrive(end.name, gain))
        for place, own in zip(self.places, nodes, strict=True):
            names = [_cell_name(place, c) for c in range(len(own) - 1)]
            decisions += [Decision(n, "", Interval(0.0, 1.0), 0.0, tuple(drives[n])) for n in names if n in drives]
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
        found = dict(zip((d.name for d in relaxed.unbalances), unbalances_of(relaxed, result), strict=True))
        # of every place what its unbalances are, and where, one pair of arrays for each that is decided apart
        votes: list[list[tuple[NDArray[np.complex128], Array]]] = [[] for _ in self.places]
        nodes = self._nodes(lower, upper)
        for k, (place, own) in enumerate(zip(self.places, nodes, strict=True)):
            shares = [found.get(_cell_name(place, c), 0.0) for c in range(len(own) - 1)]
            if _cell_name(place, 0) in found:
                still = sum(abs(self._still[drive.rotor].unbalance) for drive in place.place_drives)
                votes[k].append((np.array(-still * np.diff([1.0, *shares, 0.0]), complex), own))
        for decision in self.unbalances:
            axes = self._axes(decision)
            corners = _corners(nodes, axes) if axes else ()
            gain = sum(abs(drive.gain) for drive in decision.rotor_drives)
            sizes = np.array([gain * found[_corner_name(decision, c)] for c in range(len(corners))], complex)
            for k in axes:
                votes[k].append((sizes, np.array([corner[k] for corner in corners])))
        middle, spread = 0.5 * (lower + upper), np.zeros(len(lower))
        for k, each in enumerate(votes):
            total = sum(float(np.abs(sizes).sum()) for sizes, _ in each)
            if total > 0.0:
                middle[k] = np.clip(sum(np.abs(sizes) @ at for sizes, at in each) / total, lower[k], upper[k])
                spread[k] = sum(_apart(sizes, at, float(middle[k]), self._bends[k]) for sizes, at in each) / total
        return middle, spread

    def values(self, relaxed: Problem, result: Result, middle: Array) -> tuple[Value, ...]:
        """Decisions about those of a program: places, what its corners have together, and what else it decides."""
        found = dict(zip((d.name for d in relaxed.decisions), values_of(relaxed, result), strict=True))
        own: dict[str, Value] = {place.name: float(x) for place, x in zip(self.places, middle, strict=True)}
        for decision in self.others:
            names = [_corner_name(decision, c) for c in range(len(relaxed.decisions))] if self._axes(decision) else ()
            parts = [found[name] for name in names if name in found]
            own[decision.name] = sum(parts) if parts else found[decision.name]
        return tuple(own[decision.name] for decision in self.problem.decisions)

    def _axes(self, decision: Decision) -> list[int]:
        """Places of what an unbalance drives."""
        return sorted({k for drive in decision.rotor_drives for k in self._placed.get(drive.rotor, ())})


def without_places(problem: Problem) -> Problem:
    """Return a problem without places that no design of one with open places goes under (P8, P20)."""
    relaxation = Relaxation(problem, 1.0)
    return relaxation.program(*sides_of(relaxation.places))


def _corners(nodes: Sequence[Array], axes: Sequence[int]) -> tuple[dict[int, float], ...]:
    """Corners of a box along some of its sides."""
    return tuple(dict(zip(axes, map(float, corner), strict=True)) for corner in product(*(nodes[k] for k in axes)))


def _apart(sizes: NDArray[np.complex128], at: Array, middle: float, bends: Array) -> float:
    """Return the distance by which unbalances pull a place from its middle [m], times their size."""
    weights = np.abs(sizes)
    used = at[weights > UNUSED * weights.max(initial=0.0)]
    if used.size and ((bends > used.min()) & (bends < used.max())).any():
        # on both sides of a bend no place does what they do together
        return float(weights @ np.abs(at - middle))
    return float(abs(sizes @ (at - middle)))


def _cell_name(place: Decision, cell: int) -> str:
    return f"{place.name} | {cell}.place"


def _corner_name(decision: Decision, corner: int) -> str:
    stem, key = decision.name.rsplit(".", 1)
    return f"{stem} | {corner}.{key}"


def _least(own: Set) -> Value:
    if isinstance(own, Interval):
        return min(max(own.lower, 0.0), own.upper) * own.directions[0]
    return 0.0j


def _from_zero(own: Set) -> Set:
    if isinstance(own, Interval):
        least = min(max(own.lower, 0.0), own.upper)
        return replace(own, lower=min(own.lower - least, 0.0), upper=max(own.upper - least, 0.0))
    return own


def _together(decision: Decision, drive: RotorDrive, parts: Sequence[Rotor]) -> Limit:
    radius = parts[0].radius or 1.0
    most = _from_zero(decision.set).scale * abs(drive.gain) / radius
    return Limit(decision.name, Measure(ADDED_MASS, rotors=tuple(part.name for part in parts)), most)


def _renamed(measure: Measure, names: dict[str, list[str]]) -> Measure:
    if measure.rotors is None:
        return measure
    return replace(measure, rotors=tuple(part for name in measure.rotors for part in names.get(name, [name])))
