"""Even stars of every bank angle and split pin that a problem allows (S6, S7)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine.firing import even_patterns, firing_lattice, star_throws
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

    def throws(self, steps: Sequence[int]) -> tuple[float, ...]:
        """Angles of a star [rad] (C3)."""
        return star_throws(self.layout, steps, self.space.phases)

    def candidate(self, phasing: Phasing, steps: Sequence[int], left_out: tuple[str, ...] = ()) -> Candidate:
        """The design of a star, with the first of its firing orders."""
        return phasing.star(steps, self.space.phases, self.geometry, left_out)

    @property
    def stars(self) -> Stars:
        """Every star, one of each set of images."""
        if self.fixed is not None:
            return np.array([self.fixed], dtype=np.uint8)
        return np.concatenate(list(self.space.blocks()))


def families_of(phasing: Phasing) -> tuple[tuple[Family, ...], str]:
    """Stars that fire evenly for every geometry allowed; and why there are none."""
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
        found.append(Family(geometry, layout, StarSpace(steps, patterns, layout.throw_positions), fixed))
    return tuple(found), reason


def _of_order(phasing: Phasing, layout: Layout) -> tuple[int, ...] | None:
    if phasing.firing_order is None:
        return None
    throws = even_throws(phasing.cycle, layout, phasing.firing_order)
    steps = firing_lattice(phasing.cycle, phasing.cylinders).steps
    return tuple(round((angle - throws[0]) / math.tau * steps) % steps for angle in throws)
