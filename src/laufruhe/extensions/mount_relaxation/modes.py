"""Natural modes that limits ask for, beside the orders of a relaxation (E56).

A motion j has a mode of its own where some v with A v = l v has a' v b' v >= s |v|^2, a and b its parts of displacement
and of momentum (E7). Counted so that b' v = 1 that is a ball, v = V (1, w) with |w| <= 1, and for a given v all designs
that have it are convex: A(s) v = l v is linear in s and l. So boxes are divided over w as well as over the mounts. On
a box the moments Z = (1, w)(1, w)', Z_j = s_j Z stand for all designs,

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

OF_SHARES = frozenset({DECOUPLING})
"""Channels of the energy shares of motions in modes."""

# share of a middle that the square of the radius of a ball is at least
NO_SIZE = 1e-8


@dataclass(frozen=True, eq=False)
class Mode:
    """A mode of its own for a motion, with at least a share of its energy.

    Attributes
    ----------
    basis
        V: shapes v = V (1, w), |w| not over one, in coordinates in which the mass is one, shape (6, 6).
    """

    basis: Array


@dataclass(frozen=True, eq=False)
class Shapes:
    """What moments Z, Z_1 ... of a mode have to keep on a box.

    Attributes
    ----------
    matrices
        Tensors T: sum of T_m Z_m is nowhere indefinite, shape (1 + numbers, p, p, d, d) each.
    sides, equal
        Matrices C: sum of <C_m, Z_m> is not under zero, or is zero, shape (n, 1 + numbers, d, d).
    """

    matrices: tuple[Array, ...]
    sides: Array
    equal: Array


def modes_of(problem: Problem, mounts: OpenMounts) -> tuple[Mode, ...]:
    """By the limits of decoupling, the largest share of every motion; none where places of mounts are open."""
    found: dict[int, float] = {}
    for limit in problem.mount_limits:
        if limit.measure.channel in OF_SHARES and limit.minimum > 0.0:
            for motion in motion_indices(limit.measure):
                found[motion] = max(found.get(motion, 0.0), limit.minimum * (1.0 - SLACK))
    return () if mounts.places else tuple(mode_of(mounts.root, *each) for each in found.items())


def mode_of(root: Array, motion: int, share: float) -> Mode:
    """Of the ball |v - a / 2 s| <= |a| / 2 s the part with b' v = 1."""
    moved, momentum = root[:, motion], np.linalg.inv(root)[motion]
    length = float(momentum @ momentum)
    middle = moved / (2.0 * share) + momentum * (1.0 - 0.5 / share) / length
    reach = float(moved @ moved) / (4.0 * share**2) - (1.0 - 0.5 / share) ** 2 / length
    across = np.linalg.svd(momentum[None])[2][1:].T
    # a ball of no size would leave V singular
    size = math.sqrt(max(reach, NO_SIZE * float(middle @ middle)))
    return Mode(np.column_stack([middle, size * across]))


def shapes_of(mounts: OpenMounts, mode: Mode, lower: Array, upper: Array) -> Shapes:
    """Over a box of mounts and of w."""
    basis, count, d = mode.basis, mounts.numbers, 6
    inverse, unit = np.linalg.inv(basis), float(np.linalg.norm(mounts.middle, 2))
    parts = np.array([mounts.middle, *mounts.slopes]) / unit
    turned = inverse @ parts @ basis
    # of V^-1 A V Z the entries (a, b) by those of Z
    entry = np.einsum("max,by->mabxy", turned, np.eye(d))
    entry = 0.5 * (entry + entry.transpose(0, 1, 2, 4, 3))
    plain = np.einsum("ax,by->abxy", np.eye(d), np.eye(d))
    plain = 0.5 * (plain + plain.transpose(0, 1, 3, 2))
    square = 0.5 * (entry + entry.transpose(0, 2, 1, 3, 4))
    tensors = []
    for sign, edge in ((1.0, max(mounts.lowest, 0.0)), (-1.0, mounts.highest)):
        tensor = sign * square
        tensor[0] -= sign * edge / unit * plain
        tensors.append(tensor)
    rows, columns = np.triu_indices(d, 1)
    equal = (entry - entry.transpose(0, 2, 1, 3, 4))[:, rows, columns].transpose(1, 0, 2, 3)
    ranges = [np.diag([1.0, *-np.ones(d - 1)])]
    for k, (low, high) in enumerate(zip(lower, upper, strict=True), 1):
        matrix = np.zeros((d, d))
        matrix[0, 0], matrix[0, k], matrix[k, k] = -low * high, 0.5 * (low + high), -1.0
        matrix[k, 0] = matrix[0, k]
        ranges.append(matrix)
    sides = []
    for matrix in ranges:
        whole = np.zeros((1 + count, d, d))
        whole[0] = matrix
        if not count:
            # on a box of no width, where no Z_j says it
            sides.append(whole)
        for j in range(1, 1 + count):
            for sign in (1.0, -1.0):
                whole[j] = sign * matrix
                sides.append(whole.copy())
            whole[j] = 0.0
    return Shapes(tuple(tensors), np.array(sides), equal)
