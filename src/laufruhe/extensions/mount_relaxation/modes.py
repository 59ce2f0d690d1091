"""Natural modes required by limits of decoupling (E56).

Let v be an eigenvector of the stiffness matrix A, A v = l v. A motion of the block has this natural mode of its own if
a' v b' v >= s |v|^2. Here a and b are displacement and momentum of the motion (E7); s is its least share of kinetic
energy. Scaled to b' v = 1, these v are a ball: v = V (1, w) with |w| <= 1. For a fixed v the designs with this mode are
a convex set, because A(s) v = l v is linear in the shared numbers s_j and in l. So boxes are divided over w as well as
over the mounts. On a box the moments Z = (1, w)(1, w)', Z_j = s_j Z stand for all designs,

    V^-1 (A_c V Z + sum H_j V Z_j) = l Z,    symmetric, between least and largest square, Z + Z_j, Z - Z_j >= 0   (E56)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
from laufruhe.numerics.arrays import Array
from laufruhe.problem.channels import DECOUPLING, motion_indices
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.ranges import SLACK

# smallest squared radius of the ball of modes, over the squared length of its centre
NO_SIZE = 1e-8
LIMITS_OF_SHARES = frozenset({DECOUPLING})


@dataclass(frozen=True, eq=False)
class ModeConstraints:
    """Constraints on the moments Z_0 = Z, Z_1 ... of a natural mode on a box (E56).

    Attributes
    ----------
    matrices
        Tensors T with sum of T_m Z_m positive semidefinite, shape (1 + numbers, p, p, d, d) each.
    sides
        Matrices C with sum of <C_m, Z_m> >= 0, shape (n, 1 + numbers, d, d).
    equal
        Matrices C with sum of <C_m, Z_m> = 0, shape (n, 1 + numbers, d, d).
    """

    matrices: tuple[Array, ...]
    sides: Array
    equal: Array


def mode_bases(problem: Problem, mounts: OpenMounts) -> tuple[Array, ...]:
    """Return, for each motion with a limit of decoupling, the basis V of its possible modes, shape (6, 6) each.

    The result is () if positions of mounts are open.
    """
    if mounts.places:
        return ()
    shares: dict[int, float] = {}
    for limit in problem.mount_limits:
        if limit.measure.channel in LIMITS_OF_SHARES and limit.minimum > 0.0:
            for motion in motion_indices(limit.measure):
                shares[motion] = max(shares.get(motion, 0.0), limit.minimum * (1.0 - SLACK))
    return tuple(mode_basis(mounts.root, motion, share) for motion, share in shares.items())


def mode_basis(root: Array, motion: int, share: float) -> Array:
    """Return a basis V, shape (6, 6), of the modes v with at least a share s of their energy in one motion.

    These modes form the ball |v - a / 2 s| <= |a| / 2 s, b' v = 1.

    Parameters
    ----------
    root
        Transposed map from motion in coordinates of unit mass, shape (6, 6).
    motion
        Index of the motion with displacement a and momentum b.
    share
        Least share s of the kinetic energy of a mode in this motion.
    """
    displacement, momentum = root[:, motion], np.linalg.inv(root)[motion]
    length = float(momentum @ momentum)
    middle = displacement / (2.0 * share) + momentum * (1.0 - 0.5 / share) / length
    squared_radius = float(displacement @ displacement) / (4.0 * share**2) - (1.0 - 0.5 / share) ** 2 / length
    null_space = np.linalg.svd(momentum[None])[2][1:].T
    # a radius of zero would make V singular
    radius = math.sqrt(max(squared_radius, NO_SIZE * float(middle @ middle)))
    return np.column_stack([middle, radius * null_space])


def mode_constraints(mounts: OpenMounts, basis: Array, lower: Array, upper: Array) -> ModeConstraints:
    """Return the constraints that a mode V (1, w) fits the mounts of a box, for `lower` <= w <= `upper`, (5,) each."""
    inverse, count, d = np.linalg.inv(basis), mounts.numbers, 6
    unit = float(np.linalg.norm(mounts.middle, 2))
    stiffness = inverse @ (np.array([mounts.middle, *mounts.slopes]) / unit) @ basis
    # coefficients of Z in the entries (a, b) of V^-1 A V Z
    entry = np.einsum("max,by->mabxy", stiffness, np.eye(d))
    entry = 0.5 * (entry + entry.transpose(0, 1, 2, 4, 3))
    identity = np.einsum("ax,by->abxy", np.eye(d), np.eye(d))
    identity = 0.5 * (identity + identity.transpose(0, 1, 3, 2))
    square = 0.5 * (entry + entry.transpose(0, 2, 1, 3, 4))
    tensors = np.array([square, -square])
    tensors[0, 0] -= max(mounts.lowest, 0.0) / unit * identity
    tensors[1, 0] += mounts.highest / unit * identity
    rows, columns = np.triu_indices(d, 1)
    equal = (entry - entry.transpose(0, 2, 1, 3, 4))[:, rows, columns].transpose(1, 0, 2, 3)
    ranges = [np.diag([1.0, *-np.ones(d - 1)])]
    for k, (low, high) in enumerate(zip(lower, upper, strict=True), 1):
        matrix = np.zeros((d, d))
        matrix[0, 0], matrix[0, k], matrix[k, k] = -low * high, 0.5 * (low + high), -1.0
        matrix[k, 0] = matrix[0, k]
        ranges.append(matrix)
    # each side for Z + Z_j and Z - Z_j; a box without width has no Z_j that implies the side for Z
    units = np.eye(1 + count)
    pairs = [units[0] + sign * unit for unit in units[1:] for sign in (1.0, -1.0)] or [units[0]]
    sides = np.array([np.multiply.outer(pair, matrix) for matrix in ranges for pair in pairs])
    return ModeConstraints(tuple(tensors), sides, equal)
