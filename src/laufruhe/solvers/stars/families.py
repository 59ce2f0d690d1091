"""List the even crank stars of every bank angle and split pin that a problem allows (S6, S7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.star_model import FiringModel, StarModel
from laufruhe.machine.firing import even_patterns, firing_lattice, order_slots, star_steps
from laufruhe.machine.layouts import Layout, even_throws
from laufruhe.physics.crank_stars import Stars, StarSpace
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing


@dataclass(frozen=True, eq=False)
class Family:
    """Even crank stars of one bank angle and split pin, or firing orders of cylinders with one throw each (V9).

    Attributes
    ----------
    geometry
        Bank angle and split pin angle [rad]; None if the layout has none.
    fixed
        Steps of the throws of the only star if the firing order is fixed, else None.
    is_of_orders
        True if every firing order is a design; the steps of its star are slots of the cycle.
    """

    geometry: tuple[float | None, float | None]
    layout: Layout
    space: StarSpace
    fixed: tuple[int, ...] | None = None
    is_of_orders: bool = False

    @property
    def size(self) -> int:
        """Number of crank stars, including mirror images."""
        return 1 if self.fixed is not None else self.space.size

    @property
    def first(self) -> tuple[int, ...]:
        """Steps of the throws of the first crank star."""
        return self.space.first if self.fixed is None else self.fixed

    @property
    def stars(self) -> Stars:
        """Steps of all crank stars, one of each set of mirror images, shape (n, throws)."""
        if self.fixed is not None:
            return np.array([self.fixed], dtype=np.uint8)
        return np.concatenate(list(self.space.blocks()))

    def candidate(self, phasing: Phasing, steps: Sequence[int], left_out: tuple[str, ...] = ()) -> Candidate:
        """Return the candidate of a crank star without the shafts `left_out`, with the first of its firing orders."""
        if self.is_of_orders:
            return phasing.fired(steps, self.geometry, left_out)
        return phasing.star(steps, self.space.phases, self.geometry, left_out)

    def model(self, phasing: Phasing, space: StarSpace | None = None) -> StarModel:
        """Return the model of all crank stars of the family, or of those in `space`."""
        kind = FiringModel if self.is_of_orders else StarModel
        return kind(phasing, space or self.space, self.geometry, self.fixed)


def families_of(phasing: Phasing, by_firing: bool = False) -> tuple[tuple[Family, ...], str]:
    """Return the evenly firing crank stars as families, one for each bank and split pin angle allowed.

    The second result is the reason if there are none, else empty. `by_firing` is True if loads depend on the firing
    order; then every firing order is a design.
    """
    families, reason = [], "no bank angle and split pin within the bounds allow even firing"
    lattice = firing_lattice(phasing.cycle, phasing.cylinders)
    order = phasing.firing_order
    for geometry in phasing.geometries:
        layout = phasing.layout(*geometry)
        fixed = None
        try:
            patterns = even_patterns(phasing.cycle, layout)
            if order is not None:
                fixed = star_steps(layout, even_throws(phasing.cycle, layout, order), lattice.steps)
        except ModelError as error:
            reason = str(error)
            continue
        if phasing.steps is not None and phasing.steps != lattice.steps:
            count = len(layout.throw_positions)
            too_many = f"{phasing.steps} phases are more than {count} throws can use, and "
            reason = (
                f"phasing.phases = {phasing.steps} conflicts with {count} throws: "
                + too_many * (phasing.steps > count)
                + f"even firing needs {lattice.steps}; remove phases, or allow uneven intervals"
            )
            continue
        space = StarSpace(lattice.steps, patterns, layout.throw_positions)
        family = Family(geometry, layout, space, fixed)
        if by_firing:
            # cylinder 1 has slot 0
            slots = StarSpace(phasing.cylinders, ((1,) * phasing.cylinders,), layout.throw_positions)
            family = replace(family, space=slots, fixed=order and order_slots(order), is_of_orders=True)
        families.append(family)
    return tuple(families), reason
