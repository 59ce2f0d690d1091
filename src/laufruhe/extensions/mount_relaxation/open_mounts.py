"""Open mounts of a box, linear in numbers s from -1 to 1 that all orders share (E42, E52).

An open stiffness along a fixed axis is one number. Where a mount may turn, its stiffness in the plane that turns is a
matrix of three numbers, in space one of six, between the least and the largest of its own. A place that may move along
an axis is one number more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.mount_relaxation.parameter_maps import (
    ParameterMaps,
    PlaceTerm,
    PlaneFrames,
    PlaneStiffness,
    SpringTerm,
)
from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.elastic_mounts import DynamicSprings
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.physics.rigid_body import carried, point_motion
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import DAMPING, LAG, LOSS, POSITION, STIFFNESS, TURNED
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.ranges import SLACK, limited_stiffness, number_ranges

# share of the largest turn that counts as none
ALIKE = 1e-12
# share of a square given to the arms of mounts whose places are open
STRETCH = 0.2


@dataclass(frozen=True, eq=False)
class OpenMounts:
    """The springs of all mounts of a box; springs of one place are separate.

    Attributes
    ----------
    root
        Transposed map from motion in coordinates in which the mass is one, shape (k, 6); k is 6 for all motions.
    motions
        G at the middle of the box in these coordinates, shape (springs, 3, k).
    middles, dampers
        Stiffness and damping at the middle, shape (springs, 3, 3).
    losses, lags
        Loss factors, and viscous damping over stiffness [s], shape (springs,).
    stands
        Number of the mount that each belongs to, shape (springs,).
    members
        Numbers of the mounts of the problem that every mount stands for, one or two that mirror each other.
    dynamic
        Further springs whose stiffness depends on frequency.
    decisions
        Decisions that every s follows.
    floors, ceilings
        Lower and upper bounds of the stiffness A by limits (E31, E43), within the tolerance of limits.
    bands
        Squares of angular frequencies that none stands between.
    minimum, maximum
        Lower and upper bounds of stiffness by the bounds of its numbers, shape (k, k).
    lossy, lagging, damping
        Lower bounds of loss, of damping by lag per frequency, and of viscous damping, shape (k, k).
    softest
        Least stiffness of every spring in any direction, shape (springs,).
    planes
        Number and stiffness of every plane in which mounts turn, by its key (E63).
    """

    root: Array
    motions: Array
    middles: Array
    dampers: Array
    losses: Array
    lags: Array
    stands: NDArray[np.intp]
    members: tuple[tuple[int, ...], ...]
    dynamic: DynamicSprings
    springs: tuple[SpringTerm, ...]
    places: tuple[PlaceTerm, ...]
    decisions: tuple[tuple[int, ...], ...]
    floors: tuple[Array, ...]
    ceilings: tuple[Array, ...]
    bands: tuple[tuple[float, float], ...]
    minimum: Array
    maximum: Array
    lossy: Array
    lagging: Array
    damping: Array
    softest: Array
    planes: Mapping[Any, tuple[int, PlaneStiffness]]

    @property
    def numbers(self) -> int:
        """Return the count of s."""
        return len(self.decisions)

    @property
    def size(self) -> int:
        """Return k."""
        return len(self.root)

    @cached_property
    def lowest(self) -> float:
        """Return a lower bound of the eigenvalues of A."""
        return max(float(np.linalg.eigvalsh(each)[0]) for each in (self.minimum + self.at_rest, *self.floors))

    @cached_property
    def highest(self) -> float:
        """Return an upper bound of the eigenvalues of A."""
        return min(float(np.linalg.eigvalsh(each)[-1]) for each in (self.maximum + self.at_rest, *self.ceilings))

    @property
    def times(self) -> Array:
        """Return the ratio of motion and force of every mount to those of one of its members."""
        return np.sqrt([len(own) for own in self.members])

    @cached_property
    def straight(self) -> list[int | None]:
        """Return the open number that every s spans; None where s is one of a matrix."""
        along = {j for spring in self.springs if spring.axes.shape[1] < 3 for j, _ in spring.terms}
        along |= {place.number for place in self.places}
        return [own[0] if j in along else None for j, own in enumerate(self.decisions)]

    @property
    def turns(self) -> Array:
        """Return turns of the block per motion, shape (3, k)."""
        return np.asarray(self.root.T[3:])

    @cached_property
    def still(self) -> Array:
        """Return the motions that move mounts alike wherever these stand, as columns, shape (k, n)."""
        turns = np.concatenate([np.zeros((1, self.size)), *(place.aside @ self.turns for place in self.places)])
        _, sizes, across = np.linalg.svd(turns)
        return np.asarray(across[np.count_nonzero(sizes > ALIKE * max(float(sizes[0]), ALIKE)) :].T)

    @cached_property
    def middle(self) -> Array:
        """Return A where every s is zero, shape (k, k)."""
        return np.asarray(sum(carried(g, k) for g, k in zip(self.motions, self.middles, strict=True)) + self.at_rest)

    @property
    def at_rest(self) -> Array:
        """Return the static part of A of springs that depend on frequency, shape (k, k)."""
        rows = self.dynamic.rows @ self.root.T
        return np.asarray(rows.T @ np.diag([law.static for law in self.dynamic.laws]) @ rows).reshape(
            self.size, self.size
        )

    def turning(self, omega: float) -> NDArray[np.complex128]:
        """Return 1 + i (eta + W lag) of every spring; 1 at rest."""
        return np.asarray(1.0 + 1j * (self.losses * (omega > 0.0) + omega * self.lags), dtype=np.complex128)

    def lost(self, omega: float) -> Array:
        """Return the lower bound of loss, shape (k, k)."""
        return self.lossy + omega * self.lagging + omega * self.damping

    @property
    def mounts(self) -> int:
        """Return the count of mounts."""
        return len(self.members)

    @property
    def products(self) -> int:
        """Return the count of complex products in every order."""
        return sum(len(s.axes.T) for s in self.springs) + sum(place.products for place in self.places)

    @cached_property
    def slopes(self) -> Array:
        """Return the slopes of A by every s without places, shape (numbers, k, k)."""
        out = np.zeros((self.numbers, self.size, self.size))
        for spring in self.springs:
            arms = spring.axes.T @ self.motions[spring.mount]
            for j, matrix in spring.terms:
                out[j] += spring.elastic * carried(arms, matrix)
        return out


def is_lifted(problem: Problem) -> bool:
    """Return whether only numbers that loads are affine in, stiffness, places and inclinations of mounts are open."""
    mounts = problem.mount_decisions
    others = [d for d in problem.decisions if d not in mounts and not d.is_affine]
    if not mounts or others:
        return False
    low, high = number_ranges(problem)
    moved, turned = (np.any(low[:, part] < high[:, part], axis=1) for part in (POSITION, TURNED))
    still = all(np.all(low[:, part] == high[:, part]) for part in (LOSS, DAMPING, LAG))
    springs = every_spring(mounting_in(problem.engine).mounts)
    dynamic = np.array([bool(spring.dynamic) for _, spring in springs])
    # what depends on frequency does not follow these numbers
    nonlinear = dynamic & (moved | turned)
    return still and not np.any(nonlinear) and bool(np.all(low[:, STIFFNESS] >= 0.0))


def open_mounts(problem: Problem, lower: Array, upper: Array, framed: PlaneFrames | None = None) -> OpenMounts:
    """Return the mounts of a problem that `is_lifted`, its open numbers between bounds."""
    mounting, maps = mounting_in(problem.engine), ParameterMaps(problem, lower, upper, framed)
    root = mass_root(mounting.block)
    count, centre = len(maps.low), np.array(mounting.block.centre_of_gravity)
    motions = np.array([point_motion(NUMBERS, maps.middle(m)[POSITION] - centre) @ root.T for m in range(count)])
    springs = [maps.springs(m) for m in range(count)]
    places = maps.places()
    floors, ceilings, bands = limited_stiffness(problem, root)
    # bounds by the ranges of numbers
    low, high, lossy, lagging, damping = (np.zeros((6, 6)) for _ in range(5))
    for m, motion in enumerate(motions):
        moved = sum(abs(reach) for place in places for k, reach in place.mounts if k == m)
        minimum, maximum = maps.bounds(m, STIFFNESS)
        high += (1.0 + STRETCH * (moved > 0.0)) * carried(motion, maximum)
        if moved > 0.0:
            size = float(np.linalg.norm(maximum, 2)) * moved**2
            high += (1.0 + 1.0 / STRETCH) * size * (root[:, 3:] @ root[:, 3:].T)
        else:
            own = carried(motion, minimum)
            low += own
            lossy += float(maps.low[m, LOSS]) * own
            lagging += float(maps.low[m, LAG]) * own
            damping += carried(motion, maps.bounds(m, DAMPING)[0])
    stands = [k for k, _ in every_spring(mounting.mounts)]
    return OpenMounts(
        root, motions, np.array([total for total, _, _ in springs]), np.array([total for _, total, _ in springs]),
        maps.low[:, LOSS], maps.low[:, LAG], np.array(stands, dtype=np.intp), tuple((k,) for k in sorted({*stands})),
        mounting.dynamic, tuple(s for *_, own in springs for s in own), places, maps.numbers.decisions,
        tuple((1.0 - 2.0 * SLACK) * floor for floor in floors),
        tuple((1.0 + SLACK) ** 2 * ceiling for ceiling in ceilings),
        tuple(bands), low, high, lossy, lagging, damping, maps.low[:, STIFFNESS].min(axis=1), maps.planes,
    )  # fmt: skip
