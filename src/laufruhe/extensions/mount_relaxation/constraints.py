"""Constraints on the moments of an order that each design of a box satisfies (E43, E52, E53).

The moment matrix M of an order stands for (1, v)(1, v)', where v are the unbalances and the products of E42. Let y be a
motion or deflection, and let a matrix P(s), affine in the shared numbers s, be positive semidefinite. Then so is

    [1 V]' P(s) [1 V],    V = [Re y, Im y]                                              (E43)

with the unit matrix 1. Where P y is affine in v this is affine in s and M.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
from laufruhe.extensions.mount_relaxation.parameter_maps import PlaceTerm, SpringTerm
from laufruhe.extensions.mount_relaxation.response import Response, product
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.problem.channels import DECOUPLING, motion_indices
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.ranges import SLACK

ROUNDING = 1e-13
"""Relative slack of constraints, for the rounding of terms that cancel."""


@dataclass(frozen=True, eq=False)
class MomentConstraint:
    """Positive semidefinite matrix, affine in the shared numbers s and the moment matrix M of one order.

    Attributes
    ----------
    order
        Index of the order in the program.
    constant
        Matrix at s = 0 and M = 0, shape (p, p).
    slopes
        Slopes by s, shape (numbers, p, p).
    moments
        Coefficients of M in each entry, shape (p, p, d, d).
    """

    order: int
    constant: Array
    slopes: Array
    moments: Array

    @property
    def size(self) -> int:
        """Count p of rows of the matrix."""
        return len(self.moments)


def moment_constraints(mounts: OpenMounts, response: Response) -> list[MomentConstraint]:
    """Return all constraints on the moments (products of motion and open numbers) of one order, with order index 0."""
    numbers, constraints = mounts.numbers, list[MomentConstraint]()
    for spring, (deflection, force) in zip(mounts.springs, response.springs, strict=True):
        constraints += _spring_constraints(numbers, spring, deflection, force)
    for place, (loads, shifted) in zip(mounts.places, response.places, strict=True):
        constraints += _place_constraints(numbers, place, loads, shifted)
    unit, unturned_motions = mounts.highest, mounts.unturned_motions
    # stiffness A less a floor, and a ceiling less A; where places are open, only in motions without turns about them
    for sign, matrix in [*((1.0, floor) for floor in mounts.floors), *((-1.0, ceiling) for ceiling in mounts.ceilings)]:
        image = sign * (response.carried - matrix @ response.motion) / unit
        constant, slopes = sign * (mounts.middle - matrix) / unit, sign * mounts.slopes / unit
        constraint = product_constraint(constant, slopes, response.motion, image)
        constraints.append(_restricted(constraint, unturned_motions) if mounts.places else constraint)
    # (A - a)(A - b) is semidefinite if no eigenvalue lies between a and b; (A - a)(b - A), if all do (E53)
    minimum = max(mounts.lowest, 0.0)
    pairs = [(response.carried - a * response.motion, response.carried - b * response.motion) for a, b in mounts.bands]
    pairs.append((response.carried - minimum * response.motion, unit * response.motion - response.carried))
    size = (unit * float(np.linalg.norm(response.motion))) ** 2
    return constraints + [_of_moments(numbers, product(*pair)[None, None], size) for pair in pairs]


def _spring_constraints(
    numbers: int, spring: SpringTerm, deflection: ComplexArray, force: ComplexArray
) -> list[MomentConstraint]:
    """Return the constraints on an open spring: its stiffness and its force lie between bounds (E53).

    Deflection u and force t, the product of stiffness and u, have coefficients of (1, v), shape (b, d) each (E42).
    """
    slopes = spring.slopes(numbers) / spring.size
    constraints = [
        product_constraint(
            constant / spring.size, sign * slopes, deflection, (constant @ deflection + sign * force) / spring.size
        )
        for constant, sign in spring.sides
    ]
    for below, above in spring.spans:
        first, second = (below @ deflection + force) / spring.size, (above @ deflection - force) / spring.size
        if len(deflection) > 1:
            moments = product(first, second)[None, None]
        else:
            # products of real and imaginary parts, pair by pair
            rows = [np.concatenate([part.real, part.imag]) for part in (first, second)]
            moments = _symmetrised(np.einsum("ax,by->abxy", *rows))
        size = float(np.linalg.norm(first) * np.linalg.norm(second))
        constraints.append(_of_moments(numbers, moments, size))
    return constraints


def _symmetrised(products: Array) -> Array:
    products = products + products.transpose(1, 0, 2, 3)
    return np.asarray(0.25 * (products + products.transpose(0, 1, 3, 2)))


def _of_moments(numbers: int, moments: Array, scale: float) -> MomentConstraint:
    count, size = len(moments), float(np.abs(moments).max()) or 1.0
    slack = min(ROUNDING * scale / size, 1.0) * np.eye(count)
    return MomentConstraint(0, slack, np.zeros((numbers, count, count)), moments / size)


def product_constraint(constant: Array, slopes: Array, y: ComplexArray, image: ComplexArray) -> MomentConstraint:
    """Return the constraint E43 on a motion and its product with a positive semidefinite matrix P.

    P = constant + sum s_j slopes_j in the open numbers s.

    Parameters
    ----------
    constant, slopes
        Shapes (p, p) and (numbers, p, p).
    y, image
        Coefficients of (1, v) in the motion or deflection y and in P y, shape (p, d) each.
    """
    p, d = y.shape
    size = float(np.abs(y).max()) or 1.0
    parts = [(part(y) / size, part(image) / size) for part in (np.real, np.imag)]
    moments = np.zeros((p + 2, p + 2, d, d))
    for k, (first, first_image) in enumerate(parts):
        moments[:p, p + k, 0] += 0.5 * first_image
        moments[:p, p + k, :, 0] += 0.5 * first_image
        moments[p + k, :p] = moments[:p, p + k]
        for column, (second, second_image) in enumerate(parts):
            products = first.T @ second_image + second.T @ first_image
            moments[p + k, p + column] = 0.25 * (products + products.T)
    return MomentConstraint(0, _padded(constant, 2), _padded(slopes, 2), moments)


def _place_constraints(
    numbers: int, place: PlaceTerm, loads: ComplexArray, shifted: ComplexArray
) -> list[MomentConstraint]:
    """Return the constraints on an open mount position: its number s lies between -1 and 1 (E52).

    The turns and moments `loads`, which s multiplies, border 1 + s and 1 - s; `shifted` are their products with s.
    """
    size = np.abs(loads).max(axis=1, keepdims=True)
    size = np.where(size > 0.0, size, 1.0)
    plain, products = (np.concatenate([part.real, part.imag]) for part in (loads / size, shifted / size))
    count, d = plain.shape
    constraints = []
    for sign in (1.0, -1.0):
        slopes = np.zeros((numbers, 1, 1))
        slopes[place.number] = sign
        border = plain + sign * products
        moments = np.zeros((1 + count, 1 + count, d, d))
        moments[0, 1:, 0] += 0.5 * border
        moments[0, 1:, :, 0] += 0.5 * border
        moments[1:, 0] = moments[0, 1:]
        moments[1:, 1:] = _symmetrised(np.einsum("ax,by->abxy", plain, border))
        constraints.append(MomentConstraint(0, _padded(np.eye(1), count), _padded(slopes, count), moments))
    squares = [np.einsum("ax,by->abxy", part, part) for part in (plain, products)]
    difference = squares[0] - squares[1]
    scale = float(np.square(plain).sum() + np.square(products).sum())
    return [*constraints, _of_moments(numbers, 0.5 * (difference + difference.transpose(0, 1, 3, 2)), scale)]


def _restricted(constraint: MomentConstraint, motions: Array) -> MomentConstraint:
    basis = np.zeros((constraint.size, motions.shape[1] + 2))
    basis[: len(motions), :-2], basis[-2:, -2:] = motions, np.eye(2)
    moments = np.einsum("ax,abij,by->xyij", basis, constraint.moments, basis, optimize=True)
    return MomentConstraint(
        constraint.order, basis.T @ constraint.constant @ basis, basis.T @ constraint.slopes @ basis, moments
    )


def _padded(matrices: Array, count: int) -> Array:
    return np.pad(matrices, [(0, 0)] * (matrices.ndim - 2) + [(0, count)] * 2)


# smallest squared radius of the ball of modes, over the squared length of its centre
NO_SIZE = 1e-8
LIMITS_OF_SHARES = frozenset({DECOUPLING})


@dataclass(frozen=True, eq=False)
class ModeConstraints:
    """Constraints on the moments Z_0 = Z, Z_1 ... of a natural mode on a box (E56).

    Let v be an eigenvector of the stiffness matrix A, A v = l v. A motion of the block has this natural mode of its own
    if a' v b' v >= s |v|^2. Here a and b are displacement and momentum of the motion (E7); s is its least share of
    kinetic energy. Scaled to b' v = 1, these v are a ball: v = V (1, w) with |w| <= 1. For a fixed v the designs with
    this mode are a convex set, because A(s) v = l v is linear in the shared numbers s_j and in l. So boxes are divided
    over w as well as over the mounts. The moments Z = (1, w)(1, w)', Z_j = s_j Z of all designs on a box have

        V^-1 (A_c V Z + sum H_j V Z_j) = l Z,   symmetric, between least and largest square, Z + Z_j, Z - Z_j >= 0

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
