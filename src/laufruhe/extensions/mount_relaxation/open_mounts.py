"""Open mounts of a box, linear in numbers s from -1 to 1 that all orders share (E42, E52).

An open stiffness along a fixed axis is one number s. The stiffness of a mount that may turn is a matrix between the
smallest and the largest of its stiffnesses: three numbers in a plane, six in space. A place that may move along an axis
is one more number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.mount_relaxation.parameter_maps import ParameterMaps, PlaceTerm, PlaneStiffness, SpringTerm
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

# relative size of a turn that counts as zero
ZERO_LEVEL = 1e-12
# weight in the bound |a + b|^2 <= (1 + STRETCH) |a|^2 + (1 + 1 / STRETCH) |b|^2, b the shift of an open place
STRETCH = 0.2


@dataclass(frozen=True, eq=False)
class OpenMounts:
    """Springs of all mounts of a box; several springs of one mount are separate.

    Attributes
    ----------
    root
        Transposed map from motion in coordinates of unit mass, shape (k, 6); k is 6 for all motions.
    motions
        Map G from these coordinates to deflection at the middle of the box, shape (springs, 3, k).
    middles, dampers
        Stiffness [N/m] and damping [N s/m] at the middle, shape (springs, 3, 3).
    losses, lags
        Loss factors, and viscous damping over stiffness [s], shape (springs,).
    spring_mounts
        Number of the mount of each spring, shape (springs,).
    members
        For each mount, the numbers of the problem's mounts that it represents: one, or two mirror images.
    dynamic
        Further springs with stiffness that depends on frequency.
    springs, places
        Open terms of springs and dampers, and open places.
    decisions
        For each shared number s, the indices of the open numbers that it follows.
    floors, ceilings
        Lower and upper bounds of the stiffness matrix A by limits (E31, E43), within the tolerance of limits.
    bands
        Ranges (a, b) of squared angular frequencies without a natural frequency.
    minimum, maximum
        Lower and upper bounds of A by the ranges of the open numbers, shape (k, k).
    loss_floor, lag_floor, damping
        Lower bounds of hysteretic loss, of damping by lag, and of viscous damping, shape (k, k).
    softest
        Smallest stiffness of each spring in any direction [N/m], shape (springs,).
    planes
        Number and stiffness of each plane in which mounts turn, by its key (E63).
    """

    root: Array
    motions: Array
    middles: Array
    dampers: Array
    losses: Array
    lags: Array
    spring_mounts: NDArray[np.intp]
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
    loss_floor: Array
    lag_floor: Array
    damping: Array
    softest: Array
    planes: Mapping[Any, tuple[int, PlaneStiffness]]

    @property
    def numbers(self) -> int:
        """Count of shared numbers s."""
        return len(self.decisions)

    @property
    def size(self) -> int:
        """Count k of coordinates of the motion."""
        return len(self.root)

    @cached_property
    def lowest(self) -> float:
        """Lower bound of the eigenvalues of the stiffness matrix A."""
        return max(float(np.linalg.eigvalsh(matrix)[0]) for matrix in (self.minimum + self.at_rest, *self.floors))

    @cached_property
    def highest(self) -> float:
        """Upper bound of the eigenvalues of the stiffness matrix A."""
        return min(float(np.linalg.eigvalsh(matrix)[-1]) for matrix in (self.maximum + self.at_rest, *self.ceilings))

    @property
    def symmetry_factors(self) -> Array:
        """Ratio of motion and force of each mount to those of one of its members, shape (mounts,)."""
        return np.sqrt([len(numbers) for numbers in self.members])

    @cached_property
    def single_decisions(self) -> list[int | None]:
        """Index of the open number that each s spans alone; None if s is an entry of a matrix."""
        single_numbers = {j for spring in self.springs if spring.axes.shape[1] < 3 for j, _ in spring.terms}
        single_numbers |= {place.number for place in self.places}
        return [indices[0] if j in single_numbers else None for j, indices in enumerate(self.decisions)]

    @property
    def turns(self) -> Array:
        """Turns of the block per motion, shape (3, k)."""
        return np.asarray(self.root.T[3:])

    @cached_property
    def unturned_motions(self) -> Array:
        """Motions that move all mounts alike at any of their open places, as columns, shape (k, n)."""
        turns = np.concatenate([np.zeros((1, self.size)), *(place.turn_axes @ self.turns for place in self.places)])
        _, sizes, directions = np.linalg.svd(turns)
        return np.asarray(directions[np.count_nonzero(sizes > ZERO_LEVEL * max(float(sizes[0]), ZERO_LEVEL)) :].T)

    @cached_property
    def middle(self) -> Array:
        """Stiffness matrix A at s = 0, the middle of the box, shape (k, k)."""
        return np.asarray(sum(carried(g, k) for g, k in zip(self.motions, self.middles, strict=True)) + self.at_rest)

    @property
    def at_rest(self) -> Array:
        """Static part of the stiffness matrix A of the block, from springs that depend on frequency, shape (k, k)."""
        rows = self.dynamic.rows @ self.root.T
        return np.asarray(rows.T @ np.diag([law.static for law in self.dynamic.laws]) @ rows).reshape(
            self.size, self.size
        )

    def stiffness_factors(self, omega: float) -> NDArray[np.complex128]:
        """Return 1 + i (eta + W lag) of each spring, shape (springs,)."""
        return np.asarray(1.0 + 1j * (self.losses + omega * self.lags), dtype=np.complex128)

    def loss_at(self, omega: float) -> Array:
        """Return a lower bound of the loss matrix at angular frequency `omega`, shape (k, k)."""
        return self.loss_floor + omega * self.lag_floor + omega * self.damping

    @property
    def mounts(self) -> int:
        """Count of mounts."""
        return len(self.members)

    @property
    def products(self) -> int:
        """Count of complex products in each order."""
        return sum(len(s.axes.T) for s in self.springs) + sum(place.products for place in self.places)

    @cached_property
    def slopes(self) -> Array:
        """Slopes of the stiffness matrix A by each number s, zero for places, shape (numbers, k, k)."""
        slopes = np.zeros((self.numbers, self.size, self.size))
        for spring in self.springs:
            arms = spring.axes.T @ self.motions[spring.mount]
            for j, matrix in spring.terms:
                slopes[j] += spring.elastic * carried(arms, matrix)
        return slopes


def is_lifted(problem: Problem) -> bool:
    """Return True if the relaxation can represent all open numbers of a problem.

    These are unbalances, in which loads are affine, and stiffness, positions or inclinations of mounts.
    """
    mounts = problem.mount_decisions
    unsupported = [decision for decision in problem.decisions if decision not in mounts and not decision.is_affine]
    if not mounts or unsupported:
        return False
    low, high = number_ranges(problem)
    moves, turns = (np.any(low[:, part] < high[:, part], axis=1) for part in (POSITION, TURNED))
    are_fixed = all(np.all(low[:, part] == high[:, part]) for part in (LOSS, DAMPING, LAG))
    springs = every_spring(mounting_in(problem.engine).mounts)
    dynamic = np.array([bool(spring.dynamic) for _, spring in springs])
    # springs that depend on frequency must neither move nor turn
    nonlinear = dynamic & (moves | turns)
    return are_fixed and not np.any(nonlinear) and bool(np.all(low[:, STIFFNESS] >= 0.0))


def open_mounts(
    problem: Problem, lower: Array, upper: Array, frames: Array | None = None, boxes: Mapping[Any, Array] | None = None
) -> OpenMounts:
    """Return matrices and bounds of the open mounts over a box; the problem must be `is_lifted`.

    Parameters
    ----------
    lower, upper, frames, boxes
        See `ParameterMaps`.
    """
    mounting, maps = mounting_in(problem.engine), ParameterMaps(problem, lower, upper, frames, boxes)
    root = mass_root(mounting.block)
    count, centre = len(maps.low), np.array(mounting.block.centre_of_gravity)
    motions = np.array([point_motion(NUMBERS, maps.middle(m)[POSITION] - centre) @ root.T for m in range(count)])
    springs = [maps.springs(m) for m in range(count)]
    places = maps.places()
    floors, ceilings, bands = limited_stiffness(problem, root)
    # bounds by the ranges of numbers
    low, high, loss_floor, lag_floor, damping = (np.zeros((6, 6)) for _ in range(5))
    for m, motion in enumerate(motions):
        reach_of_places = sum(abs(reach) for place in places for k, reach in place.mounts if k == m)
        minimum, maximum = maps.bounds(m, STIFFNESS)
        high += (1.0 + STRETCH * (reach_of_places > 0.0)) * carried(motion, maximum)
        if reach_of_places > 0.0:
            size = float(np.linalg.norm(maximum, 2)) * reach_of_places**2
            high += (1.0 + 1.0 / STRETCH) * size * (root[:, 3:] @ root[:, 3:].T)
        else:
            stiffness = carried(motion, minimum)
            low += stiffness
            loss_floor += float(maps.low[m, LOSS]) * stiffness
            lag_floor += float(maps.low[m, LAG]) * stiffness
            damping += carried(motion, maps.bounds(m, DAMPING)[0])
    spring_mounts = [k for k, _ in every_spring(mounting.mounts)]
    return OpenMounts(
        root, motions, np.array([total for total, _, _ in springs]), np.array([total for _, total, _ in springs]),
        maps.low[:, LOSS], maps.low[:, LAG], np.array(spring_mounts, dtype=np.intp),
        tuple((k,) for k in sorted({*spring_mounts})), mounting.dynamic,
        tuple(term for *_, terms in springs for term in terms), places, maps.decisions,
        tuple((1.0 - 2.0 * SLACK) * floor for floor in floors),
        tuple((1.0 + SLACK) ** 2 * ceiling for ceiling in ceilings),
        tuple(bands), low, high, loss_floor, lag_floor, damping, maps.low[:, STIFFNESS].min(axis=1), maps.planes,
    )  # fmt: skip
