"""Relax open positions to a problem whose unbalances stand at the vertices of a box (P8).

The load of an unbalance U at a position r is linear in U and in U r. If r lies in a box, it is a
mixture of the vertices r_c with weights l_c. Then the load is that of the unbalances

    U_c = l_c U,    sum l_c = 1,    l_c >= 0,    r = sum l_c r_c                           (P8)

at the vertices. The relaxation drops two conditions: all U_c have one angle, and unbalances at one
position have the same l_c. So its optimum is a lower bound of all designs with positions in the
box. If U is fixed, U r is linear in r, and the relaxation is exact.

The two bearings next to a load share it, so their forces have a kink if a position passes a
bearing (B4). Planes of bearings inside a box are vertices too (P20). All other decisions stay
open: the relaxation is a problem without open positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.open_positions.channels import ShaftChannel
from laufruhe.machine import Role, Rotor
from laufruhe.numerics.arrays import Array
from laufruhe.problem.channels import ADDED_MASS
from laufruhe.problem.decision import Decision, Kind, RotorDrive, real_bounds
from laufruhe.problem.dependence import Dependence, dependence
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Interval, Set, Value
from laufruhe.solvers.conclusion import unbalance_values, values_of
from laufruhe.solvers.result import Result

AXIAL = 0
"""Index of the axial coordinate of a position."""
UNUSED = 1e-6
"""Unbalance at a vertex that counts as zero, relative to the largest."""


class Relaxation:
    """Relaxations of a problem over boxes of rotor positions; each is solved to the share `share` of its tolerance."""

    def __init__(self, problem: Problem, share: float) -> None:
        self._tolerance = share * problem.tolerance
        # the relaxation ignores limits on distances
        limits = tuple(limit for limit in problem.limits if not isinstance(limit.measure.channel, ShaftChannel))
        self.problem = problem = problem.changed(limits=limits)
        self.places = tuple(d for d in problem.decisions if d.kind is Kind.PLACE)
        self.other_decisions = tuple(d for d in problem.decisions if d.kind is not Kind.PLACE)
        self.unbalances = problem.unbalances
        self._smallest = [_smallest(decision.set) for decision in self.unbalances]
        # engine whose rotors have the smallest unbalances that their bounds allow
        self._base = problem.design(self._smallest, self.unbalances)
        self._rotors = {rotor.name: rotor for rotor in self._base.rotors}
        self._placed: dict[str, list[int]] = {}
        for k, place in enumerate(self.places):
            for drive in place.place_drives:
                self._placed.setdefault(drive.rotor, []).append(k)
        # positions of inner supports [m]
        self._kinks = [np.zeros(0) for _ in self.places]
        if any(dependence(m.channel, Kind.PLACE, problem) is Dependence.KINKED for m in problem.measures):
            for k, place in enumerate(self.places):
                shafts = {self._rotors[drive.rotor].shaft.name for drive in place.place_drives if drive.axis == AXIAL}
                supports = (problem.engine.supports.get(shaft, ()) for shaft in shafts)
                self._kinks[k] = np.unique([x for positions in supports for x in positions[1:-1]])

    def _nodes(self, lower: Array, upper: Array) -> list[Array]:
        sides = zip(self._kinks, lower, upper, strict=True)
        return [np.array([low, *kinks[(kinks > low) & (kinks < high)], high]) for kinks, low, high in sides]

    def program(self, lower: Array, upper: Array) -> Problem:
        """Return the relaxation over a box of positions [m]: unbalances at its vertices replace the open positions."""
        nodes = self._nodes(lower, upper)
        rotors, decisions = self._fixed_unbalances(nodes)
        limits: list[Limit] = []
        names = {name: [name] for name in self._placed}
        smallest = dict(zip((decision.name for decision in self.unbalances), self._smallest, strict=True))
        for decision in self.other_decisions:
            axes = self._axes(decision)
            if not axes:
                decisions.append(replace(decision, start=smallest.get(decision.name, decision.start)))
                continue
            parts: dict[str, list[Rotor]] = {drive.rotor: [] for drive in decision.rotor_drives}
            for c, vertex in enumerate(_vertices(nodes, axes)):
                drives = []
                for drive in decision.rotor_drives:
                    rotor = self._placed_at(drive.rotor, vertex, f"{drive.rotor} | {decision.name} {c}")
                    parts[drive.rotor].append(rotor)
                    drives.append(replace(drive, rotor=rotor.name))
                name = _vertex_name(decision, c)
                decisions.append(Decision(name, decision.unit, _from_zero(decision.set), 0.0, tuple(drives)))
            for rotor_name, copies in parts.items():
                rotors += copies
                names.setdefault(rotor_name, [rotor_name]).extend(rotor.name for rotor in copies)
            # limit the sum of the unbalances over all vertices
            first = decision.rotor_drives[0]
            copies = parts[first.rotor]
            maximum = _from_zero(decision.set).scale * abs(first.gain) / (copies[0].radius or 1.0)
            sum_of_parts = Measure(ADDED_MASS, rotors=tuple(part.name for part in copies))
            limits.append(Limit(decision.name, sum_of_parts, maximum))
        fixed_rotors = tuple(rotor for rotor in self._rotors.values() if rotor.name not in self._placed)
        problem = self.problem
        return replace(
            problem,
            engine=replace(self._base, rotors=(*fixed_rotors, *rotors)),
            decisions=tuple(decisions),
            objective=tuple(replace(t, measure=_renamed(t.measure, names)) for t in problem.objective),
            limits=(*(replace(x, measure=_renamed(x.measure, names)) for x in problem.limits), *limits),
            tolerance=self._tolerance,
        )

    def _fixed_unbalances(self, nodes: Sequence[Array]) -> tuple[list[Rotor], list[Decision]]:
        """Return rotors and decisions that stand for fixed unbalances with an open position.

        Their loads are linear in the position within a cell.

        A cell is the range of a position between neighbouring bounds or inner bearings of the box. Each decision is
        the fraction of a cell that lies behind the position. The relaxation drops the condition that a whole cell lies
        behind the position before it enters the next.
        """
        rotors: list[Rotor] = []
        decisions: list[Decision] = []
        drives: dict[str, list[RotorDrive]] = {}
        for name, axes in self._placed.items():
            unbalance = self._rotors[name].unbalance
            first = {k: float(nodes[k][0]) for k in axes}
            rotors.append(self._placed_at(name, first, name))
            for k in axes if unbalance else ():
                for c, (low, high) in enumerate(pairwise(nodes[k])):
                    if high == low:
                        continue
                    for side, gain in ((low, -unbalance), (high, unbalance)):
                        end = self._placed_at(name, first | {k: float(side)}, f"{name} | {k} {c} {gain:g}")
                        # other roles would count the mass of the rotor again
                        rotors.append(replace(end, role=Role.THROW))
                        drives.setdefault(_cell_name(self.places[k], c), []).append(RotorDrive(end.name, gain))
        for place, coordinates in zip(self.places, nodes, strict=True):
            names = [_cell_name(place, c) for c in range(len(coordinates) - 1)]
            decisions += [Decision(n, "", Interval(0.0, 1.0), 0.0, tuple(drives[n])) for n in names if n in drives]
        return rotors, decisions

    def _placed_at(self, name: str, places: dict[int, float], new_name: str) -> Rotor:
        # a rotor under a new name has no unbalance
        rotor = self._rotors[name]
        place = list(rotor.place)
        for k, coordinate in places.items():
            for drive in self.places[k].place_drives:
                if drive.rotor == name:
                    place[drive.axis] = coordinate
        placed = replace(rotor.placed(*place), name=new_name)
        # the limit on the sum over all vertices needs a radius, of any size
        return placed if new_name == name else replace(placed, unbalance=0.0j, radius=rotor.radius or 1.0)

    def recover_places(self, relaxed: Problem, result: Result, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return mean positions of the unbalances of a relaxed solution, and their spread [m], shape (places,) each."""
        unbalances = dict(zip((d.name for d in relaxed.unbalances), unbalance_values(relaxed, result), strict=True))
        # unbalances and their coordinates along each position, a pair of arrays per decision
        moments: list[list[tuple[NDArray[np.complex128], Array]]] = [[] for _ in self.places]
        nodes = self._nodes(lower, upper)
        for k, (place, coordinates) in enumerate(zip(self.places, nodes, strict=True)):
            shares = [unbalances.get(_cell_name(place, c), 0.0) for c in range(len(coordinates) - 1)]
            if _cell_name(place, 0) in unbalances:
                size = sum(abs(self._rotors[drive.rotor].unbalance) for drive in place.place_drives)
                moments[k].append((np.array(-size * np.diff([1.0, *shares, 0.0]), complex), coordinates))
        for decision in self.unbalances:
            axes = self._axes(decision)
            vertices = _vertices(nodes, axes) if axes else ()
            gain = sum(abs(drive.gain) for drive in decision.rotor_drives)
            sizes = np.array([gain * unbalances[_vertex_name(decision, c)] for c in range(len(vertices))], complex)
            for k in axes:
                moments[k].append((sizes, np.array([vertex[k] for vertex in vertices])))
        middle, spread = 0.5 * (lower + upper), np.zeros(len(lower))
        for k, pairs in enumerate(moments):
            total = sum(float(np.abs(sizes).sum()) for sizes, _ in pairs)
            if total > 0.0:
                middle[k] = np.clip(sum(np.abs(sizes) @ x for sizes, x in pairs) / total, lower[k], upper[k])
                spread[k] = sum(_spread(sizes, x, float(middle[k]), self._kinks[k]) for sizes, x in pairs) / total
        return middle, spread

    def values(self, relaxed: Problem, result: Result, middle: Array) -> tuple[Value, ...]:
        """Return values of all decisions of the problem from a relaxed solution, with the positions `middle` [m]."""
        relaxed_values = dict(zip((d.name for d in relaxed.decisions), values_of(relaxed, result), strict=True))
        values: dict[str, Value] = {place.name: float(x) for place, x in zip(self.places, middle, strict=True)}
        for decision in self.other_decisions:
            names = [_vertex_name(decision, c) for c in range(len(relaxed.decisions))] if self._axes(decision) else ()
            # unbalances are sums over the vertices
            parts = [relaxed_values[name] for name in names if name in relaxed_values]
            values[decision.name] = sum(parts) if parts else relaxed_values[decision.name]
        return tuple(values[decision.name] for decision in self.problem.decisions)

    def _axes(self, decision: Decision) -> list[int]:
        return sorted({k for drive in decision.rotor_drives for k in self._placed.get(drive.rotor, ())})


def without_places(problem: Problem) -> Problem:
    """Return the relaxation of a problem over all positions (P8, P20)."""
    relaxation = Relaxation(problem, 1.0)
    return relaxation.program(*real_bounds(relaxation.places))


def _vertices(nodes: Sequence[Array], axes: Sequence[int]) -> tuple[dict[int, float], ...]:
    return tuple(dict(zip(axes, map(float, vertex), strict=True)) for vertex in product(*(nodes[k] for k in axes)))


def _spread(sizes: NDArray[np.complex128], x: Array, middle: float, kinks: Array) -> float:
    # moment of the unbalances about the middle
    weights = np.abs(sizes)
    occupied = x[weights > UNUSED * weights.max(initial=0.0)]
    if occupied.size and ((kinks > occupied.min()) & (kinks < occupied.max())).any():
        # no single position has the load of unbalances on both sides of a kink
        return float(weights @ np.abs(x - middle))
    return float(abs(sizes @ (x - middle)))


def _cell_name(place: Decision, cell: int) -> str:
    return f"{place.name} | {cell}.place"


def _vertex_name(decision: Decision, vertex: int) -> str:
    stem, key = decision.name.rsplit(".", 1)
    return f"{stem} | {vertex}.{key}"


def _smallest(values: Set) -> Value:
    if isinstance(values, Interval):
        return min(max(values.lower, 0.0), values.upper) * values.directions[0]
    return 0.0j


def _from_zero(values: Set) -> Set:
    # bounds of the difference to the smallest unbalance
    if isinstance(values, Interval):
        smallest = min(max(values.lower, 0.0), values.upper)
        return replace(values, lower=min(values.lower - smallest, 0.0), upper=max(values.upper - smallest, 0.0))
    return values


def _renamed(measure: Measure, names: dict[str, list[str]]) -> Measure:
    if measure.rotors is None:
        return measure
    return replace(measure, rotors=tuple(part for name in measure.rotors for part in names.get(name, [name])))
