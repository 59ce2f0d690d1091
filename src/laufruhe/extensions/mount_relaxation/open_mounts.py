"""What of the mounts is open in a box, linear in numbers s from -1 to 1 that all orders share (E42, E52).

An open stiffness along a fixed axis is one number. Where a mount may turn, its stiffness in the plane that turns is a
matrix of three numbers, in space one of six, between the least and the largest of its own. A place that may move along
an axis is one number more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.mount_relaxation.opened import Framed, Opened, Place, Spring
from laufruhe.extensions.mount_relaxation.planes import Plane
from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.dynamic_springs import DynamicSprings
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.physics.rigid_body import carried, point_motion
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import DAMPING, LAG, LOSS, POSITION, STIFFNESS, TURNED
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.ranges import SLACK, limited_stiffness, number_ranges

# what turns count as none beside the largest
ALIKE = 1e-12
# share of a square that is spent on the arms of mounts whose places are open
STRETCH = 0.2


@dataclass(frozen=True, eq=False)
class OpenMounts:
    """The springs of all mounts of a box, those that are joined in one place each by itself.

    Attributes
    ----------
    root
        From motion in coordinates in which the mass is one, transposed, shape (k, 6); k is 6 where all motions count.
    motions
        G at the middle of the box in these coordinates, shape (springs, 3, k).
    middles, dampers
        Stiffness and damping at the middle, shape (springs, 3, 3).
    losses, lags
        Loss factors, and viscous damping over stiffness [s], shape (springs,).
    stands
        Number of the mount that each belongs to, shape (springs,).
    members
        Of every mount the numbers of those of the problem that it stands for, one or two that mirror each other.
    dynamic
        Further springs whose stiffness depends on frequency.
    keys
        Of every number the decisions that it follows.
    floors, ceilings
        Matrices that the stiffness A is not under and not over (E31, E43), less what a limit may be broken by.
    bands
        Squares of angular frequencies that none stands between.
    least, most
        What stiffness is not under and not over by the bounds of its numbers alone, shape (k, k).
    lossy, lagging, damping
        What loss is not under, damping that follows stiffness per frequency, and viscous damping, shape (k, k).
    softest
        Least stiffness of every spring in any direction, shape (springs,).
    planes
        Where mounts turn in a plane, by what these follow: their number, and what may be in them (E63).
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
    springs: tuple[Spring, ...]
    places: tuple[Place, ...]
    keys: tuple[tuple[int, ...], ...]
    floors: tuple[Array, ...]
    ceilings: tuple[Array, ...]
    bands: tuple[tuple[float, float], ...]
    least: Array
    most: Array
    lossy: Array
    lagging: Array
    damping: Array
    softest: Array
    planes: Mapping[Any, tuple[int, Plane]]

    @property
    def numbers(self) -> int:
        """How many s there are."""
        return len(self.keys)

    @property
    def size(self) -> int:
        """k."""
        return len(self.root)

    @property
    def lowest(self) -> float:
        """No eigenvalue of A is under it."""
        return max(float(np.linalg.eigvalsh(each)[0]) for each in (self.least + self.at_rest, *self.floors))

    @property
    def highest(self) -> float:
        """No eigenvalue of A is over it."""
        return min(float(np.linalg.eigvalsh(each)[-1]) for each in (self.most + self.at_rest, *self.ceilings))

    @property
    def times(self) -> Array:
        """By what motion and force of every mount are longer than those of one of its members."""
        return np.sqrt([len(own) for own in self.members])

    @property
    def straight(self) -> list[int | None]:
        """Of every s the open number that it goes through from end to end; none where it is one of a matrix."""
        along = {j for spring in self.springs if spring.axes.shape[1] < 3 for j, _ in spring.terms}
        along |= {place.number for place in self.places}
        return [own[0] if j in along else None for j, own in enumerate(self.keys)]

    @property
    def turns(self) -> Array:
        """Turns of the block per motion, shape (3, k)."""
        return np.asarray(self.root.T[3:])

    @property
    def still(self) -> Array:
        """Motions that move no mount by another way where its place is another, as columns, shape (k, n)."""
        turns = np.concatenate([np.zeros((1, self.size)), *(place.aside @ self.turns for place in self.places)])
        _, sizes, across = np.linalg.svd(turns)
        return np.asarray(across[np.count_nonzero(sizes > ALIKE * max(float(sizes[0]), ALIKE)) :].T)

    @property
    def middle(self) -> Array:
        """A where every s is zero, shape (k, k)."""
        return np.asarray(sum(carried(g, k) for g, k in zip(self.motions, self.middles, strict=True)) + self.at_rest)

    @property
    def at_rest(self) -> Array:
        """What springs whose stiffness depends on frequency have of A, shape (k, k)."""
        rows = self.dynamic.rows @ self.root.T
        return np.asarray(rows.T @ np.diag([law.static for law in self.dynamic.laws]) @ rows).reshape(
            self.size, self.size
        )

    def turning(self, omega: float) -> NDArray[np.complex128]:
        """1 + i (eta + W lag) of every spring; 1 at rest."""
        return np.asarray(1.0 + 1j * (self.losses * (omega > 0.0) + omega * self.lags), dtype=np.complex128)

    def lost(self, omega: float) -> Array:
        """What loss is not under, shape (k, k)."""
        return self.lossy + omega * self.lagging + omega * self.damping

    @property
    def mounts(self) -> int:
        """How many there are."""
        return len(self.members)

    @property
    def products(self) -> int:
        """Complex numbers that springs and places add to every order."""
        return sum(len(s.axes.T) for s in self.springs) + sum(place.products for place in self.places)

    @property
    def slopes(self) -> Array:
        """A by every s, places left out, shape (numbers, k, k)."""
        out = np.zeros((self.numbers, self.size, self.size))
        for spring in self.springs:
            arms = spring.axes.T @ self.motions[spring.mount]
            for j, matrix in spring.terms:
                out[j] += spring.elastic * carried(arms, matrix)
        return out


def is_lifted(problem: Problem) -> bool:
    """Whether all that is open is what loads are affine in, and stiffness, places and inclinations of mounts."""
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


def open_mounts(problem: Problem, lower: Array, upper: Array, framed: Framed | None = None) -> OpenMounts:
    """The mounts of a problem that `is_lifted`, its open numbers between these."""
    mounting, opened = mounting_in(problem.engine), Opened(problem, lower, upper, framed)
    root = mass_root(mounting.block)
    count, centre = len(opened.low), np.array(mounting.block.centre_of_gravity)
    motions = np.array([point_motion(NUMBERS, opened.middle(m)[POSITION] - centre) @ root.T for m in range(count)])
    found = [opened.springs(m) for m in range(count)]
    places = opened.places()
    floors, ceilings, bands = limited_stiffness(problem, root)
    floors = [(1.0 - 2.0 * SLACK) * floor for floor in floors]
    ceilings = [(1.0 + SLACK) ** 2 * ceiling for ceiling in ceilings]
    low, high, lossy, lagging, damping = _least_and_most(opened, motions, places, root)
    stands = [k for k, _ in every_spring(mounting.mounts)]
    members = tuple((k,) for k in sorted({*stands}))
    return OpenMounts(
        root, motions, np.array([total for total, _, _ in found]), np.array([total for _, total, _ in found]),
        opened.low[:, LOSS], opened.low[:, LAG], np.array(stands, dtype=np.intp), members,
        mounting.dynamic, tuple(s for *_, own in found for s in own), places, opened.numbers.keys, tuple(floors),
        tuple(ceilings), tuple(bands), low, high, lossy, lagging, damping,
        opened.low[:, STIFFNESS].min(axis=1), opened.planes,
    )  # fmt: skip


def _least_and_most(
    opened: Opened, motions: Array, places: Sequence[Place], root: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """What stiffness is not under and not over, and what loss, lag and damping are not under, shape (6, 6) each."""
    low, high, lossy, lagging, damping = (np.zeros((6, 6)) for _ in range(5))
    for m, motion in enumerate(motions):
        moved = sum(abs(reach) for place in places for k, reach in place.mounts if k == m)
        least, most = opened.least_and_most(m, STIFFNESS)
        high += (1.0 + STRETCH * (moved > 0.0)) * carried(motion, most)
        if moved > 0.0:
            size = float(np.linalg.norm(most, 2)) * moved**2
            high += (1.0 + 1.0 / STRETCH) * size * (root[:, 3:] @ root[:, 3:].T)
        else:
            own = carried(motion, least)
            low += own
            lossy += float(opened.low[m, LOSS]) * own
            lagging += float(opened.low[m, LAG]) * own
            damping += carried(motion, opened.least_and_most(m, DAMPING)[0])
    return low, high, lossy, lagging, damping
