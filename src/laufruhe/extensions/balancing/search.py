"""Fewest holes and least residual unbalance of a plane, with proof: branch and bound over sets of places (U8, U9)."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from laufruhe.extensions.balancing.physics import Design, Plane
from laufruhe.numerics.arrays import Array, ComplexArray, Indices
from laufruhe.numerics.witness import check_bound, collected
from laufruhe.prove.branch_and_bound import GAP_SAFETY, BoundedParts, BranchAndBound, FathomedPart, OpenNode
from laufruhe.prove.witness import Witness

Places: TypeAlias = tuple[int, ...]
DIRECTIONS = np.exp(2j * math.pi * np.arange(64) / 64)
"""Directions along which the reach of a set of places is measured."""
WASTE = 0.1
"""Residual that counts as much as a unit of unbalance that holes change, if the residual is permitted."""
ROUNDING = 1e-13
"""Rounding error of a residual, relative to the sum of all changes."""
MAX_SWEEPS = 20


@dataclass(frozen=True)
class Count:
    """Least residual of a plane with one number of holes.

    Attributes
    ----------
    design
        Holes of the best design; None if no places take so many.
    value, bound
        Residual of the design, and lower bound of all designs with so many holes [kg m].
    proven
        True if the bound is within the gap of the value.
    """

    design: Design | None
    value: float
    bound: float
    proven: bool


@dataclass(frozen=True)
class PlaneResult:
    """Holes of a plane.

    Attributes
    ----------
    plane
        The plane.
    counts
        Least residuals with 0, 1, 2 ... holes.
    design
        Holes of the selected design.
    """

    plane: Plane
    counts: tuple[Count, ...]
    design: Design

    @property
    def residual(self) -> complex:
        """Unbalance after correction [kg m]."""
        return self.plane.residual(self.design)

    @property
    def is_met(self) -> bool:
        """True if the residual is permitted."""
        return self.plane.permitted is None or abs(self.residual) <= self.plane.permitted

    @property
    def is_fewest(self) -> bool:
        """True if fewer holes are proven to leave too much; if the residual is not met, any number of holes."""
        permitted = self.plane.permitted
        others = self.counts[: len(self.design)] if self.is_met else self.counts
        return permitted is not None and all(count.bound > permitted for count in others)

    @property
    def is_least(self) -> bool:
        """True if no design of the numbers of holes in `counts` is better than the selected one by the gap."""
        value = self.counts[len(self.design)].value
        return abs(self.residual) <= value and all(count.proven or count.bound >= value for count in self.counts)


def correct(plane: Plane, max_holes: int, is_fewest: bool, gap: float) -> PlaneResult:
    """Return the fewest holes that leave a permitted residual, or the least residual of at most `max_holes` holes.

    Of the designs with the fewest holes, exchanges of holes look for the one that wastes least.

    Parameters
    ----------
    plane
        Plane with places and holes.
    max_holes
        Largest number of holes.
    is_fewest
        True to stop at the first number of holes whose residual is permitted.
    gap
        Difference of two residuals that counts as none [kg m].
    """
    counts, permitted = list[Count](), plane.permitted
    for holes in range(min(max_holes, len(plane.angles)) + 1):
        count = least_residual(plane, holes, gap, counts[-1].design if counts else ())
        if permitted is not None and count.proven and count.bound <= permitted < count.value:
            # the gap decides nothing between too much and enough
            count = least_residual(plane, holes, 0.0, count.design)
        counts.append(count)
        is_met = permitted is not None and count.value <= permitted
        if (is_fewest and is_met) or count.value <= gap:
            break
    values = [count.value for count in counts]
    met = [k for k, value in enumerate(values) if is_fewest and permitted is not None and value <= permitted]
    # fewer holes are preferred to a residual that is better by less than the gap
    best = (met or [k for k, value in enumerate(values) if value <= min(values) + gap])[0]
    design = counts[best].design or ()
    thrifty = propose(plane, best, (), WASTE) if met else None
    if thrifty and permitted is not None and abs(plane.residual(thrifty)) <= permitted:
        design = min(design, thrifty, key=lambda one: plane.score(one, WASTE))
    return PlaneResult(plane, tuple(counts), design)


def least_residual(plane: Plane, holes: int, gap: float, start: Design | None = ()) -> Count:
    """Return the least residual of exactly so many holes, from a design with one hole less."""
    proposal = propose(plane, holes, start)
    value = math.inf if proposal is None else abs(plane.residual(proposal))
    witness = None if proposal is None else Witness(np.array([place for place, _ in proposal]), value)
    search = PlaceSets(plane, holes, gap, proposal, witness)
    with collected() as contradictions:
        bound = search.divide((0.0, None), sys.maxsize)
        check_bound("holes", bound, search.value)
    if contradictions:
        bound = 0.0
    # without any design both are infinite
    is_proven = search.complete and not search.value - bound > max(gap, 2.0 * search.rounding)
    return Count(search.design, search.value, bound, is_proven)


def propose(plane: Plane, holes: int, start: Design | None = (), waste: float = 0.0) -> Design | None:
    """Return a design of low score with so many holes, by exchanges of single holes; None if none was found."""
    if start is None or len(start) > holes:
        return None
    design = start
    while len(design) < holes:
        if (longer := _with_best_hole(plane, design, waste)) is None:
            return None
        design = longer
    for _ in range(MAX_SWEEPS):
        before = design
        for entry in before:
            exchanged = _with_best_hole(plane, tuple(other for other in design if other != entry), waste)
            if exchanged is not None and plane.score(exchanged, waste) < plane.score(design, waste):
                design = exchanged
        if design == before:
            break
    return design


def _with_best_hole(plane: Plane, design: Design, waste: float) -> Design | None:
    residual, best = plane.residual(design), (math.inf, (-1, -1))
    occupied = [place for place, _ in design]
    for place in set(range(len(plane.angles))) - set(occupied):
        sizes = np.abs(residual + plane.changes[place]) + waste * np.abs(plane.changes[place])
        for other, hole in design:
            sizes[plane.clashes(place, other)[:, hole]] = math.inf
        best = min(best, (float(sizes.min()), (place, int(sizes.argmin()))))
    return None if best[0] == math.inf else tuple(sorted((*design, best[1])))


class PlaceSets(BranchAndBound[Places | None]):
    """Search over sets of places with one hole each; the root, None, has all sets of one size (U8).

    Attributes
    ----------
    design
        Best design so far.
    rounding
        Rounding error of a residual [kg m].
    """

    what = "sets of places"
    reports_bounds = False

    def __init__(self, plane: Plane, holes: int, gap: float, design: Design | None, witness: Witness | None) -> None:
        self._plane, self._holes, self._gap, self.design, self.witness = plane, holes, gap, design, witness
        self.value = math.inf if design is None else abs(plane.residual(design))
        self.rounding = ROUNDING * (abs(plane.initial) + sum(float(np.abs(c).max()) for c in plane.changes))

    @property
    def cutoff(self) -> float:
        """Level [kg m] from which a set is not divided."""
        return self.value - GAP_SAFETY * self._gap

    def contains_witness(self, part: Places | None) -> bool:
        """Return True if the witness has its holes at these places."""
        return part is None or (self.witness is not None and tuple(self.witness.place.tolist()) == part)

    def is_fathomed(self, node: OpenNode[Places | None]) -> bool:
        """Return True if no design of the set is better than the best one by more than the gap."""
        return not node.bound < self.cutoff

    def branch(self, nodes: Sequence[OpenNode[Places | None]]) -> BoundedParts[Places | None]:
        """Yield all sets with their bounds, or the least residual of one set as its level."""
        for node in nodes:
            if node.part is None:
                yield from self._bounded_sets()
            else:
                yield FathomedPart(max(self._least_of(node.part), node.bound))

    def _bounded_sets(self) -> Iterator[tuple[float, Places]]:
        sets = [*combinations(range(len(self._plane.angles)), self._holes)]
        residual = self._plane.initial if self.design is None else self._plane.residual(self.design)
        directions = np.append(DIRECTIONS, residual / (abs(residual) or 1.0))
        bounds = set_bounds(self._plane, np.array(sets, dtype=np.intp).reshape(len(sets), self._holes), directions)
        yield from zip(np.maximum(bounds - self.rounding, 0.0).tolist(), sets, strict=True)

    def _least_of(self, places: Places) -> float:
        """Enumerate the holes of a set of places by halves, and return the least residual below the cutoff (U9)."""
        plane, half, level = self._plane, len(places) // 2, max(self.cutoff, 0.0)
        left, right = _choices(plane, places[:half]), _choices(plane, places[half:])
        pairs = [
            (i, j, clash) for i, j in np.ndindex(half, len(places) - half)
            if (clash := plane.clashes(places[i], places[half + j])).any()
        ]  # fmt: skip
        for i, j, clash in pairs:
            left, right = left[~clash.min(axis=1)[left[:, i]]], right[~clash.min(axis=0)[right[:, j]]]
        rows, count = np.arange(len(left) * bool(len(right))), 1
        tree = cKDTree(_points(_sums(plane, places[half:], right)))
        targets = _points(-(plane.initial + _sums(plane, places[:half], left)))
        while rows.size:
            answer = tree.query(targets[rows], list(range(1, count + 1)), distance_upper_bound=level)
            distances, nearest = np.array(answer[0]), np.minimum(answer[1], len(right) - 1)
            furthest = distances[:, -1].copy()
            for i, j, clash in pairs:
                distances[clash[left[rows, i, None], right[nearest, j]]] = math.inf
            row, k = np.unravel_index(distances.argmin(), distances.shape)
            if distances[row, k] < level:
                level = float(distances[row, k])
                chosen = (*left[rows[row]].tolist(), *right[nearest[row, k]].tolist())
                self.design = tuple(zip(places, chosen, strict=True))
                self.value = abs(plane.residual(self.design))
            # a row whose neighbours are nearer than the level, and clash, needs more of them
            rows, count = rows[furthest < level], 8 * count
        return level - self.rounding


def set_bounds(plane: Plane, sets: Indices, directions: ComplexArray = DIRECTIONS) -> Array:
    """Return lower bounds of the residual with one hole at each place of every set [kg m], shape (sets,) (U8).

    Any directions of unit length give a valid bound.
    """
    towards = np.conj(directions)[:, None]
    hulls = np.array([(towards * changes).real.min(axis=1) for changes in plane.changes])
    along = np.tile((towards[:, 0] * plane.initial).real, (len(sets), 1))
    for column in sets.T:
        along += hulls[column]
    bounds: Array = along.max(axis=1)
    return bounds


def _choices(plane: Plane, places: Places) -> Indices:
    # holes of all places without clashes, shape (choices, places)
    rows = np.zeros((1, 0), dtype=np.intp)
    for k, place in enumerate(places):
        count = len(plane.holes[place])
        rows = np.column_stack([np.repeat(rows, count, axis=0), np.tile(np.arange(count), len(rows))])
        for j in range(k):
            rows = rows[~plane.clashes(places[j], place)[rows[:, j], rows[:, k]]]
    return rows


def _sums(plane: Plane, places: Places, rows: Indices) -> ComplexArray:
    total = np.zeros(len(rows), dtype=complex)
    for k, place in enumerate(places):
        total += plane.changes[place][rows[:, k]]
    return total


def _points(values: ComplexArray) -> Array:
    return np.column_stack([values.real, values.imag])
