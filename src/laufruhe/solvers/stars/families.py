"""Even stars of every bank angle and split pin that a problem allows (S6, S7)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.firing_model import FiringModel, slot_space
from laufruhe.load_models.star_model import StarModel
from laufruhe.machine.firing import even_patterns, firing_lattice, order_slots
from laufruhe.machine.layouts import Layout, even_throws
from laufruhe.physics.crank_stars import Stars
from laufruhe.physics.star_space import StarSpace
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing


@dataclass(frozen=True, eq=False)
class Family:
    """Even stars of one bank angle and split pin."""

    geometry: tuple[float | None, float | None]
    layout: Layout
    space: StarSpace
    fixed: tuple[int, ...] | None = None

    @property
    def size(self) -> int:
        """Stars, images counted."""
        return 1 if self.fixed is not None else self.space.size

    @property
    def first(self) -> tuple[int, ...]:
        """One of the stars."""
        return self.space.first if self.fixed is None else self.fixed

    def candidate(self, phasing: Phasing, steps: Sequence[int], left_out: tuple[str, ...] = ()) -> Candidate:
        """The design of a star, with the first of its firing orders."""
        return phasing.star(steps, self.space.phases, self.geometry, left_out)

    def steps_of(self, star: Sequence[int]) -> tuple[int, ...] | None:
        """Steps of the throws of one of its stars; None of a firing order."""
        return tuple(map(int, star))

    def told(self, phasing: Phasing, candidate: Candidate) -> Phasing:
        """What is open of one of its stars: the firing order, where it is."""
        del candidate
        return phasing

    def model(self, phasing: Phasing, space: StarSpace | None = None) -> StarModel:
        """Rows of every star, of those of another space where one is given."""
        return StarModel(phasing, space or self.space, self.geometry, self.fixed)

    @property
    def stars(self) -> Stars:
        """Every star, one of each set of images."""
        if self.fixed is not None:
            return np.array([self.fixed], dtype=np.uint8)
        return np.concatenate(list(self.space.blocks()))


class FiringFamily(Family):
    """Firing orders of cylinders that have a throw each: a star for every one (V9)."""

    def candidate(self, phasing: Phasing, steps: Sequence[int], left_out: tuple[str, ...] = ()) -> Candidate:
        """The design of a firing order."""
        return phasing.fired(steps, self.geometry, left_out)

    def steps_of(self, star: Sequence[int]) -> None:
        """Its steps are slots of the cycle."""
        del star

    def told(self, phasing: Phasing, candidate: Candidate) -> Phasing:
        """Nothing: its firing order is the design's own."""
        return replace(phasing, firing_order=candidate.firing_order)

    def model(self, phasing: Phasing, space: StarSpace | None = None) -> StarModel:
        """Rows of every firing order."""
        return FiringModel(phasing, space or self.space, self.geometry, self.fixed)


def families_of(phasing: Phasing, by_firing: bool = False) -> tuple[tuple[Family, ...], str]:
    """Stars that fire evenly for every geometry allowed; and why there are none.

    Parameters
    ----------
    by_firing
        Whether firing orders of one star are told apart, so that each of them is a design.
    """
    found, reason = [], "no bank angle and split pin within the bounds let the firing be even"
    for geometry in phasing.geometries:
        layout = phasing.layout(*geometry)
        try:
            patterns = even_patterns(phasing.cycle, layout)
            fixed = _of_order(phasing, layout)
        except ModelError as error:
            reason = str(error)
            continue
        steps = firing_lattice(phasing.cycle, phasing.cylinders).steps
        if phasing.steps is not None and phasing.steps != steps:
            throws = len(layout.throw_positions)
            reason = (
                f"phasing.phases = {phasing.steps} conflicts with {throws} throws: "
                + (
                    f"{phasing.steps} phases are more than {throws} throws can take, and "
                    if phasing.steps > throws
                    else ""
                )
                + f"even firing stands on {steps}; leave phases out, or allow uneven intervals"
            )
            continue
        if by_firing:
            found.append(_by_firing(phasing, geometry, layout))
        else:
            found.append(Family(geometry, layout, StarSpace(steps, patterns, layout.throw_positions), fixed))
    return tuple(found), reason


def _by_firing(phasing: Phasing, geometry: tuple[float | None, float | None], layout: Layout) -> Family:
    fixed = None if phasing.firing_order is None else order_slots(phasing.firing_order)
    return FiringFamily(geometry, layout, slot_space(phasing.cylinders, layout.throw_positions), fixed)


def _of_order(phasing: Phasing, layout: Layout) -> tuple[int, ...] | None:
    if phasing.firing_order is None:
        return None
    throws = even_throws(phasing.cycle, layout, phasing.firing_order)
    steps = firing_lattice(phasing.cycle, phasing.cylinders).steps
    return tuple(round((angle - throws[0]) / math.tau * steps) % steps for angle in throws)
