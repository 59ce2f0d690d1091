"""Limits of zero as linear equations between the decisions, satisfied to rounding (P11).

If a norm must be zero, its rows V0 + B x are zero, and its cone has no interior for the solver. The rows of such
limits are reduced to independent equations. Dual rows of a limit of zero cost nothing, so a bound may use those that
improve it.
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
"""Relative size under which singular values, and the residual of contradicting equations, count as zero."""
MAX_PROJECTIONS = 40
"""Largest number of alternate projections on the equations and on the sets of the decisions."""


@dataclass(frozen=True, eq=False)
class Equations:
    """Equations matrix x = right, with rows that are orthonormal in units of the decisions.

    Attributes
    ----------
    matrix, right
        Shapes (m, n) and (m,).
    units
        Unit of every column of the decision vector, shape (n,).
    dual
        For every limit, the matrix from multipliers of the equations to its dual rows, shape (k d, m).
    shapes
        Shapes (k, d) of the rows of every limit.
    """

    matrix: Array
    right: Array
    units: Array
    dual: tuple[Array, ...]
    shapes: tuple[tuple[int, ...], ...]

    def project(self, problem: AffineProblem, x: Array) -> Array:
        """Return the decision vector x, shape (n,), moved to meet the equations and the sets of the decisions.

        It is projected on both alternately.
        """
        for _ in range(MAX_PROJECTIONS):
            residual = self.right - self.matrix @ x
            x = x + self.units**2 * (residual @ self.matrix)
            projection = project_on_sets(problem, x.copy())
            if np.array_equal(projection, x):
                break
            x = projection
        return x

    def dual_rows(self, prices: Array) -> list[Array]:
        """Return dual rows of every limit, shape (k, d), from dual values of the program, equations first."""
        multipliers = prices[: len(self.right)]
        return [(matrix @ multipliers).reshape(shape) for matrix, shape in zip(self.dual, self.shapes, strict=True)]


def equations_of(problem: AffineProblem, limits: Sequence[int]) -> Equations | None:
    """Return linear equations that hold where measures limited to zero vanish, from the indices of these limits.

    The result is None if there are no such limits, or if they contradict each other.
    """
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
    is_significant = values > SAME * values[0]
    left, values, right = left[:, is_significant], values[is_significant], right[is_significant]
    reduced = left.T @ constant
    if np.linalg.norm(constant - left @ reduced) > SAME * np.linalg.norm(constant):
        return None
    dual = np.split(left / values, np.cumsum([len(slope) for slope in slopes])[:-1])
    return Equations(
        right / units, -reduced / values, units, tuple(matrix / size for matrix, size in zip(dual, sizes, strict=True)),
        tuple(norm.constant.shape for norm in norms),
    )  # fmt: skip


def refine_multipliers(coarse: AffineProblem, fine: AffineProblem, multipliers: Multipliers) -> Multipliers:
    """Replace dual rows of limits of zero on a coarse grid by rows on a fine one with the same slope."""
    zero_limits = [k for k, (maximum, _) in enumerate(coarse.limits) if maximum == 0.0]
    equations = equations_of(fine, zero_limits)
    if equations is None:
        return multipliers
    slope = sum((coarse.limits[k][1].pullback(multipliers.limits[k]) for k in zero_limits), np.zeros(coarse.size))
    rows = equations.dual_rows(equations.matrix @ (equations.units**2 * slope))
    limits = dict(enumerate(multipliers.limits)) | dict(zip(zero_limits, rows, strict=True))
    return Multipliers(multipliers.terms, tuple(limits.values()))
