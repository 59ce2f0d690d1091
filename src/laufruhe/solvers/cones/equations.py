"""Limits of zero as equations between the decisions, kept to the last digit (P11).

Where the sum of all loads of a kind is to vanish, V0 + B x = 0, no cone has an interior that a solver could go
through. The rows of such limits are reduced to as many equations as there are directions in which they act. Dual rows
of a limit of zero cost nothing, so a bound may take those that level it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.load_models.affine import AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.prove.certificate import Multipliers
from laufruhe.solvers.cones.cone_program import project_on_sets

SAME = 1e-10
"""Share of what the decisions do, or of what is to vanish, under which there is nothing."""
MOST_PROJECTIONS = 40


@dataclass(frozen=True, eq=False)
class Equations:
    """matrix x = right, with rows that are orthonormal in units of the decisions.

    Attributes
    ----------
    dual
        Matrix of every limit that makes its dual rows from multipliers of the equations, shape (k d, equations).
    shapes
        Shapes (k, d) of the rows of every limit.
    """

    matrix: Array
    right: Array
    units: Array
    dual: tuple[Array, ...]
    shapes: tuple[tuple[int, ...], ...]

    def joined_with(self, others: tuple[Array, Array] | None) -> tuple[Array, Array]:
        """Return matrix and right side of these equations, followed by others."""
        if others is None:
            return self.matrix, self.right
        return np.concatenate([self.matrix, others[0]]), np.concatenate([self.right, others[1]])

    def project(self, problem: AffineProblem, x: Array) -> Array:
        """Return decisions near x that keep the equations and lie in their sets."""
        for _ in range(MOST_PROJECTIONS):
            missing = self.right - self.matrix @ x
            x = x + self.units**2 * (missing @ self.matrix)
            inside = project_on_sets(problem, x.copy())
            if np.array_equal(inside, x):
                break
            x = inside
        return x

    def dual_rows(self, prices: Array) -> list[Array]:
        """Return dual rows of every limit from the multipliers of the equations."""
        multipliers = prices[: len(self.right)]
        return [(matrix @ multipliers).reshape(shape) for matrix, shape in zip(self.dual, self.shapes, strict=True)]


def equations_of(problem: AffineProblem, limits: Sequence[int]) -> Equations | None:
    """Return the equations of limits of zero, given by number; None if there are none, or they contradict."""
    norms = [problem.limits[k][1] for k in limits]
    if not norms:
        return None
    units = problem.units
    slopes = [norm.slope.reshape(-1, problem.size) * units for norm in norms]
    sizes = [max(float(np.abs(norm.constant).max(initial=0.0)), float(np.abs(slope).max(initial=0.0)), 1e-300)
             for norm, slope in zip(norms, slopes, strict=True)]  # fmt: skip
    stacked = np.concatenate([slope / size for slope, size in zip(slopes, sizes, strict=True)])
    constant = np.concatenate([norm.constant.ravel() / size for norm, size in zip(norms, sizes, strict=True)])
    left, values, right = np.linalg.svd(stacked, full_matrices=False)
    acting = values > SAME * values[0]
    left, values, right = left[:, acting], values[acting], right[acting]
    along = left.T @ constant
    if np.linalg.norm(constant - left @ along) > SAME * np.linalg.norm(constant):
        return None
    dual = np.split(left / values, np.cumsum([len(slope) for slope in slopes])[:-1])
    return Equations(
        right / units, -along / values, units, tuple(matrix / size for matrix, size in zip(dual, sizes, strict=True)),
        tuple(norm.constant.shape for norm in norms),
    )  # fmt: skip


def refine_multipliers(coarse: AffineProblem, fine: AffineProblem, multipliers: Multipliers) -> Multipliers:
    """Replace dual rows of limits of zero by those of a finer grid that have the same slope."""
    equal = [k for k, (maximum, _) in enumerate(coarse.limits) if maximum == 0.0]
    equations = equations_of(fine, equal)
    if equations is None:
        return multipliers
    slope = sum((coarse.limits[k][1].pulled(multipliers.limits[k]) for k in equal), np.zeros(coarse.size))
    rows = equations.dual_rows(equations.matrix @ (equations.units**2 * slope))
    limits = list(multipliers.limits)
    for k, z in zip(equal, rows, strict=True):
        limits[k] = z
    return Multipliers(multipliers.terms, tuple(limits))
