"""Constraints on the moments of an order that every design of a box satisfies (E43, E52, E53).

A matrix M stands for (1, v)(1, v)', v the products of E42 and the unbalances. Where a matrix P(s), linear in the shared
numbers s, is positive semidefinite, so is

    [1 V]' P(s) [1 V],    V = [Re y, Im y]                                              (E43)

and where P y is affine in v this is linear in s and M.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
from laufruhe.extensions.mount_relaxation.parameter_maps import PlaceTerm, SpringTerm
from laufruhe.extensions.mount_relaxation.response import Response, product
from laufruhe.numerics.arrays import Array, ComplexArray

ROUNDING = 1e-13
"""Share of terms that cancel, which is allowed for their rounding."""


@dataclass(frozen=True, eq=False)
class MomentConstraint:
    """A matrix that is linear in s and M, and positive semidefinite.

    Attributes
    ----------
    order
        Number of the order.
    constant
        Shape (p, p).
    slopes
        By s, shape (numbers, p, p).
    moments
        Coefficients of M in every entry, shape (p, p, d, d).
    """

    order: int
    constant: Array
    slopes: Array
    moments: Array

    @property
    def size(self) -> int:
        """Return p."""
        return len(self.moments)


def moment_constraints(mounts: OpenMounts, response: Response) -> list[MomentConstraint]:
    """Return all constraints of one order, numbered 0."""
    numbers, constraints = mounts.numbers, list[MomentConstraint]()
    for spring, (deflection, added) in zip(mounts.springs, response.springs, strict=True):
        constraints += _spring_constraints(numbers, spring, deflection, added)
    for place, (loads, moved) in zip(mounts.places, response.places, strict=True):
        constraints += _place_constraints(numbers, place, loads, moved)
    unit, still = mounts.highest, mounts.still
    # A - L and U - A; where places move, only in motions that these do not touch
    for sign, matrix in _stiffness_limits(mounts):
        pressed = sign * (response.carried - matrix @ response.motion) / unit
        constant, slopes = sign * (mounts.middle - matrix) / unit, sign * mounts.slopes / unit
        constraint = product_constraint(constant, slopes, response.motion, pressed)
        constraints.append(_restricted(constraint, still) if mounts.places else constraint)
    # (A - a)(A - b) is semidefinite where no eigenvalue is between, and so is (A - a)(b - A) where all are (E53)
    minimum = max(mounts.lowest, 0.0)
    pairs = [(response.carried - a * response.motion, response.carried - b * response.motion) for a, b in mounts.bands]
    pairs.append((response.carried - minimum * response.motion, unit * response.motion - response.carried))
    size = (unit * float(np.linalg.norm(response.motion))) ** 2
    return constraints + [_of_moments(numbers, product(*pair)[None, None], size) for pair in pairs]


def _spring_constraints(
    numbers: int, spring: SpringTerm, deflection: ComplexArray, added: ComplexArray
) -> list[MomentConstraint]:
    """Return that an open stiffness lies between its bounds, and so does its product (E53)."""
    slopes = spring.slopes(numbers) / spring.size
    constraints = [
        product_constraint(
            constant / spring.size, sign * slopes, deflection, (constant @ deflection + sign * added) / spring.size
        )
        for constant, sign in spring.sides
    ]
    for low, high in spring.spans:
        first, second = (low @ deflection + added) / spring.size, (high @ deflection - added) / spring.size
        if len(deflection) > 1:
            moments = product(first, second)[None, None]
        else:
            # real and imaginary parts each by each
            rows = [np.concatenate([each.real, each.imag]) for each in (first, second)]
            moments = _symmetrised(np.einsum("ax,by->abxy", *rows))
        size = float(np.linalg.norm(first) * np.linalg.norm(second))
        constraints.append(_of_moments(numbers, moments, size))
    return constraints


def _symmetrised(products: Array) -> Array:
    products = products + products.transpose(1, 0, 2, 3)
    return np.asarray(0.25 * (products + products.transpose(0, 1, 3, 2)))


def _of_moments(numbers: int, moments: Array, terms: float) -> MomentConstraint:
    count, size = len(moments), float(np.abs(moments).max()) or 1.0
    relaxed = min(ROUNDING * terms / size, 1.0) * np.eye(count)
    return MomentConstraint(0, relaxed, np.zeros((numbers, count, count)), moments / size)


def product_constraint(constant: Array, slopes: Array, y: ComplexArray, pressed: ComplexArray) -> MomentConstraint:
    """Return E43 of P = constant + sum s_j slopes_j.

    Parameters
    ----------
    y, pressed
        y and P y as functions of (1, v), shape (p, d) each.
    """
    p, d = y.shape
    size = float(np.abs(y).max()) or 1.0
    parts = [(part(y) / size, part(pressed) / size) for part in (np.real, np.imag)]
    moments = np.zeros((p + 2, p + 2, d, d))
    for k, (first, first_pressed) in enumerate(parts):
        moments[:p, p + k, 0] += 0.5 * first_pressed
        moments[:p, p + k, :, 0] += 0.5 * first_pressed
        moments[p + k, :p] = moments[:p, p + k]
        for other, (second, second_pressed) in enumerate(parts):
            twice = first.T @ second_pressed + second.T @ first_pressed
            moments[p + k, p + other] = 0.25 * (twice + twice.T)
    return MomentConstraint(0, _padded(constant, 2), _padded(slopes, 2), moments)


def _place_constraints(
    numbers: int, place: PlaceTerm, loads: ComplexArray, moved: ComplexArray
) -> list[MomentConstraint]:
    """Return 1 + s and 1 - s, bordered by all turns and moments that s multiplies (E52)."""
    size = np.abs(loads).max(axis=1, keepdims=True)
    size = np.where(size > 0.0, size, 1.0)
    plain, rows = (np.concatenate([each.real, each.imag]) for each in (loads / size, moved / size))
    count, d = plain.shape
    constraints = []
    for sign in (1.0, -1.0):
        slopes = np.zeros((numbers, 1, 1))
        slopes[place.number] = sign
        pressed = plain + sign * rows
        moments = np.zeros((1 + count, 1 + count, d, d))
        moments[0, 1:, 0] += 0.5 * pressed
        moments[0, 1:, :, 0] += 0.5 * pressed
        moments[1:, 0] = moments[0, 1:]
        moments[1:, 1:] = _symmetrised(np.einsum("ax,by->abxy", plain, pressed))
        constraints.append(MomentConstraint(0, _padded(np.eye(1), count), _padded(slopes, count), moments))
    squares = [np.einsum("ax,by->abxy", each, each) for each in (plain, rows)]
    left = squares[0] - squares[1]
    terms = float(np.square(plain).sum() + np.square(rows).sum())
    return [*constraints, _of_moments(numbers, 0.5 * (left + left.transpose(0, 1, 3, 2)), terms)]


def _stiffness_limits(mounts: OpenMounts) -> list[tuple[float, Array]]:
    return [*((1.0, floor) for floor in mounts.floors), *((-1.0, ceiling) for ceiling in mounts.ceilings)]


def stiffness_constraints(mounts: OpenMounts, size: int) -> list[MomentConstraint]:
    """Return A - L and U - A in motions of no order, with moments of a size that they do not depend on."""
    unit, still, constraints = mounts.highest, mounts.still, []
    for sign, matrix in _stiffness_limits(mounts):
        constant, slopes = (still.T @ part @ still / unit for part in (mounts.middle - matrix, mounts.slopes))
        none = np.zeros((len(constant), len(constant), size, size))
        constraints.append(MomentConstraint(0, sign * constant, sign * slopes, none))
    return constraints if still.size else []


def _restricted(constraint: MomentConstraint, motions: Array) -> MomentConstraint:
    basis = np.zeros((constraint.size, motions.shape[1] + 2))
    basis[: len(motions), :-2], basis[-2:, -2:] = motions, np.eye(2)
    moments = np.einsum("ax,abij,by->xyij", basis, constraint.moments, basis, optimize=True)
    return MomentConstraint(
        constraint.order, basis.T @ constraint.constant @ basis, basis.T @ constraint.slopes @ basis, moments
    )


def _padded(matrices: Array, count: int) -> Array:
    return np.pad(matrices, [(0, 0)] * (matrices.ndim - 2) + [(0, count)] * 2)
