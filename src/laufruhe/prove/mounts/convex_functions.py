"""Convex functions of mount stiffness, and bounds by their linear minorants (E16-E19).

The stiffness matrix K is linear in the stiffnesses x, and is called A in coordinates with unit mass. w is the
weight, and M the mass matrix. t or q is a turn about the torque-roll axis, and W or root(s) its angular frequency. For
any y, any V >= 0 with trace one, and any z with |z| <= 1,

    w' A^-1 w    >= 2 y' w - y' A(x) y          sag                                     (E16)
    lambda_max A >= <V, A(x)>                   highest natural frequency               (E17)
   -lambda_min A >= -<V, A(x)>                  lowest natural frequency                (E18)
    |A t / W2 - t| >= z' (A(x) t / W2 - t)      torque-roll residual                    (E19)
    |K q - s M q|  >= z' K(x) q - max s z' M q  the same in raw coordinates, s open     (E46)

with equality at the right y, V, z. The right sides are linear in x. A weighted sum of them, limits included, therefore
has a minimum over the box of x in closed form. It is a lower bound of the objective, however accurate the solver was.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.physics.mount_numbers import AxisResidual

CONTRADICTION = 1e-6
"""Relative violation from which limits contradict each other."""


class ConvexFunction(Protocol):
    """A convex function of the stiffnesses."""

    def value(self, x: Array) -> float:
        """Return the value at stiffnesses x, shape (n,)."""

    def minorant(self, x: Array, dual: Array | None) -> tuple[float, Array]:
        """Return constant and gradient of a linear lower bound, by a solver's dual array or else the tangent at x."""


@dataclass(frozen=True, eq=False)
class StiffnessMatrices:
    """Stiffness matrix A(x) = base + sum_j x_j slopes_j of stiffnesses x, shapes (6, 6) and (n, 6, 6) (E16)."""

    base: Array
    slopes: Array

    def at(self, x: Array) -> Array:
        """Return the stiffness matrix A(x), shape (6, 6)."""
        return np.asarray(self.base + np.tensordot(x, self.slopes, axes=1))

    def between(self, left: Array, right: Array) -> tuple[float, Array]:
        """Return constant and gradient of the linear function left' A(x) right, for vectors of shape (6,)."""
        return float(left @ self.base @ right), np.asarray(np.einsum("i,nij,j->n", left, self.slopes, right))


@dataclass(frozen=True, eq=False)
class LinearFunction:
    """Linear function constant + gradient . x."""

    constant: float
    gradient: Array

    def value(self, x: Array) -> float:
        """Return the value at x."""
        return self.constant + float(self.gradient @ x)

    def minorant(self, x: Array, dual: Array | None) -> tuple[float, Array]:  # noqa: ARG002
        """Return the function itself."""
        return self.constant, self.gradient


@dataclass(frozen=True, eq=False)
class Compliance:
    """Compliance w' A(x)^-1 w under a load w, times a factor: the sag if w is the weight (E16)."""

    matrices: StiffnessMatrices
    load: Array
    factor: float

    def value(self, x: Array) -> float:
        """Return the compliance at stiffnesses x; infinite if mounts leave a motion without stiffness."""
        matrix = self.matrices.at(x)
        if np.linalg.eigvalsh(matrix)[0] <= 0.0:
            return math.inf
        return self.factor * float(self.load @ np.linalg.solve(matrix, self.load))

    def minorant(self, x: Array, dual: Array | None) -> tuple[float, Array]:  # noqa: ARG002
        """Return the tangent at x (E16)."""
        y = np.asarray(np.linalg.solve(self.matrices.at(x), self.load), dtype=np.float64)
        constant, gradient = self.matrices.between(y, y)
        return self.factor * (2.0 * float(y @ self.load) - constant), -self.factor * gradient


@dataclass(frozen=True, eq=False)
class Eigenvalue:
    """Largest eigenvalue of sign A(x) (E17, E18): the highest one for sign 1, the negated lowest one for sign -1."""

    matrices: StiffnessMatrices
    sign: float

    def value(self, x: Array) -> float:
        """Return the value at x."""
        return float(np.linalg.eigvalsh(self.sign * self.matrices.at(x))[-1])

    def minorant(self, x: Array, dual: Array | None) -> tuple[float, Array]:
        """Return a linear lower bound of the eigenvalue function: sign <V, A(x)>, as constant and gradient.

        The matrix V comes from the solver's `dual` matrix, or else from the eigenvector at x.
        """
        _, vectors = np.linalg.eigh(self.sign * self.matrices.at(x))
        weights, columns = np.eye(6)[-1], vectors
        if dual is not None:
            values, columns = np.linalg.eigh(0.5 * (dual + dual.T))
            clipped = np.maximum(values, 0.0)
            weights = clipped / clipped.sum() if clipped.sum() > 0.0 else weights
        pairs = [self.matrices.between(v, v) for v in columns.T]
        constant = sum(w * c for w, (c, _) in zip(weights, pairs, strict=True))
        gradient = np.sum([w * g for w, (_, g) in zip(weights, pairs, strict=True)], axis=0)
        return self.sign * constant, self.sign * gradient


@dataclass(frozen=True, eq=False)
class Residual:
    """Torque-roll residual: distance of a turn about the torque-roll axis from a mode (E19, E46)."""

    matrices: StiffnessMatrices
    axis: AxisResidual

    def value(self, x: Array) -> float:
        """Return the value at x."""
        return float(np.linalg.norm(self.axis.rows(self.matrices.at(x))))

    def minorant(self, x: Array, dual: Array | None) -> tuple[float, Array]:
        """Return a linear lower bound of the residual's length, as constant and gradient.

        Its direction is the solver's `dual` vector, or else the residual at x.
        """
        z = self.axis.rows(self.matrices.at(x)) if dual is None else dual
        y, mass = self.axis.linear_bound(z / (float(np.linalg.norm(z)) or 1.0) if dual is None else z)
        constant, gradient = self.matrices.between(self.axis.left.T @ y, self.axis.right)
        return constant - mass, gradient


@dataclass(frozen=True, eq=False)
class ConvexLimit:
    """Limit function <= maximum, with the index and side of the problem's limit from which it comes."""

    function: ConvexFunction
    maximum: float
    source: int
    side: str = "at most"


@dataclass(frozen=True, eq=False)
class ConvexProgram:
    """Minimise a weighted sum of convex functions in a box, under limits on such functions."""

    matrices: StiffnessMatrices
    lower: Array
    upper: Array
    terms: tuple[tuple[float, ConvexFunction], ...]
    limits: tuple[ConvexLimit, ...]

    def objective(self, x: Array) -> float:
        """Return the weighted sum at x."""
        return sum(weight * term.value(x) for weight, term in self.terms)


@dataclass(frozen=True, eq=False)
class ConvexDuals:
    """Duals that a solver proposes: dual arrays of terms and limits, and multipliers (prices) of limits."""

    terms: tuple[Array | None, ...]
    prices: tuple[float, ...]
    limits: tuple[Array | None, ...]

    @classmethod
    def none(cls, program: ConvexProgram) -> ConvexDuals:
        """Return duals without a proposal: linear bounds are tangents at the design, and prices are zero."""
        limits = len(program.limits)
        return cls((None,) * len(program.terms), (0.0,) * limits, (None,) * limits)


def dual_bound(program: ConvexProgram, x: Array, duals: ConvexDuals) -> tuple[float, Array]:
    """Return a lower bound of the objective over all stiffnesses, and the gradient of the linear bound (E16-E19).

    The duals of a solver weight the linear bounds of terms and limits at stiffnesses x. Any duals give a valid
    bound.
    """
    constant, gradient = 0.0, np.zeros(len(x))
    for (weight, term), dual in zip(program.terms, duals.terms, strict=True):
        c, g = term.minorant(x, dual)
        constant, gradient = constant + weight * c, gradient + weight * g
    for limit, price, dual in zip(program.limits, duals.prices, duals.limits, strict=True):
        c, g = limit.function.minorant(x, dual)
        constant, gradient = constant + price * (c - limit.maximum), gradient + price * g
    minimum = np.minimum(gradient * program.lower, gradient * program.upper)
    return constant + float(minimum.sum()), gradient


def excludes(program: ConvexProgram, x: Array, duals: ConvexDuals) -> bool:
    """Return True if the duals of the limits prove that no stiffnesses in the box keep all limits."""
    proof, _ = dual_bound(replace(program, terms=()), x, replace(duals, terms=()))
    scale = sum(price * abs(limit.maximum) for limit, price in zip(program.limits, duals.prices, strict=True))
    return proof > CONTRADICTION * scale
