"""Frequency-dependent springs of a mounting: stiffness beyond that at rest (E50, E51)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from laufruhe.machine.dynamic import Dynamic, FluidTrack
from laufruhe.machine.mount import Mount, every_spring
from laufruhe.numerics.arrays import Array, ComplexArray


@dataclass(frozen=True, eq=False)
class DynamicSprings:
    """Frequency-dependent springs of a mounting, along their own axes.

    Attributes
    ----------
    laws
        Of every one.
    rows
        Travel along its axis for each motion of the block, shape (n, 6).
    directions
        Of its force among those of the mounts, shape (3 mounts, n).
    """

    laws: tuple[Dynamic, ...]
    rows: Array
    directions: Array

    def __bool__(self) -> bool:
        return bool(self.laws)

    @property
    def has_law(self) -> bool:
        """True if all of them have equations in time; measured stiffness has none."""
        return all(isinstance(law, FluidTrack) for law in self.laws)

    def added(self, omegas: Array) -> ComplexArray:
        """Return the stiffness beyond that at rest, shape (frequencies, n) [N/m]."""
        found = [law.at(np.asarray(omegas, dtype=float)) - law.static for law in self.laws]
        return np.array(found, dtype=complex).reshape(len(self.laws), len(omegas)).T

    def impedance(self, omegas: Array, shapes: Any) -> ComplexArray:
        """Return the added impedance in coordinates of shapes (6, k), shape (frequencies, k, k)."""
        seen = self.rows @ shapes
        return np.asarray(np.einsum("wn,ni,nj->wij", self.added(omegas), seen, seen))

    def forces(self, omegas: Array, shapes: Any) -> ComplexArray:
        """Return the added mount forces per coordinate of shapes (6, k), shape (frequencies, 3 mounts, k)."""
        return np.asarray(np.einsum("wn,rn,nj->wrj", self.added(omegas), self.directions, self.rows @ shapes))


def dynamic_springs(mounts: Sequence[Mount], motions: Array) -> DynamicSprings:
    """Return the frequency-dependent springs of mounts with motions G, shape (mounts, 3, 6)."""
    found = [(place, spring, law) for place, spring in every_spring(mounts) for law in spring.dynamic]
    axes = np.array([spring.orientation[law.axis] for _, spring, law in found]).reshape(-1, 3)
    rows = np.array([axis @ motions[place] for axis, (place, _, _) in zip(axes, found, strict=True)]).reshape(-1, 6)
    directions = np.zeros((3 * len(mounts), len(found)))
    for n, (place, _, _) in enumerate(found):
        directions[3 * place : 3 * place + 3, n] = axes[n]
    return DynamicSprings(tuple(law for _, _, law in found), rows, directions)
