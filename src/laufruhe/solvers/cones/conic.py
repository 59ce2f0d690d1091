"""Minimise a weighted sum of norms under limits, as a second-order cone program for Clarabel (P1).

Every solve starts afresh, so a result depends on its problem alone. The program leaves out terms that no decision
changes, and limits that every design satisfies. Limits of zero become equations (P11). If Clarabel stops without a
solution, further settings are tried. If all fail, the best point that it reached is used: the exact model evaluates
that point, and bounds are computed from its dual rows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from laufruhe.load_models.affine import FEASIBLE, AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.prove.certificate import Multipliers, excludes, is_moved
from laufruhe.solvers.cones.cone_program import (
    TIGHT,
    ConicSolution,
    build_program,
    project_on_sets,
    read_solution,
    run_clarabel,
)
from laufruhe.solvers.cones.newton import newton_solution

SAME = 1e-10
"""Relative size under which singular values, and the residual of contradicting equations, count as zero."""
MAX_PROJECTIONS = 40
"""Largest number of alternate projections on the equations and on the sets of the decisions."""


@dataclass(frozen=True, eq=False)
class Equations:
    """Equations matrix x = right for limits of zero (P11), with rows that are orthonormal in units of the decisions.

    If a norm must be zero, its rows V0 + B x are zero, and its cone has no interior for the solver. Dual rows of a
    limit of zero cost nothing, so a bound may use those that improve it.

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


ATTEMPTS: tuple[Mapping[str, Any], ...] = (
    TIGHT,
    # limits that nearly contradict each other
    {},
    {**TIGHT, "equilibrate_enable": False},
    {"tol_gap_abs": 1e-6, "tol_gap_rel": 1e-6, "tol_feas": 1e-7, "max_iter": 500, "max_step_fraction": 0.9},
)
"""Settings of the solver, in the order of the attempts."""


def solve_cones(problem: AffineProblem, equations: tuple[Array, Array] | None = None) -> ConicSolution:
    """Minimise the weighted sum of norms under limits.

    Parameters
    ----------
    problem
        Terms, limits and sets of the decisions.
    equations
        A, shape (m, n), and b, shape (m,), of additional equations A x = b.
    """
    # a sum that no decision changes may still be the largest of several sums
    term_indices = [k for k, (_, norm) in enumerate(problem.terms) if is_moved(norm) or problem.groups]
    limit_indices = [k for k, limit in enumerate(problem.limits) if _may_bind(problem, *limit)]
    zero_limits = [k for k in limit_indices if problem.limits[k][0] == 0.0]
    zero_equations = equations_of(problem, zero_limits)
    if zero_equations is not None:
        limit_indices = [k for k in limit_indices if k not in zero_limits]
        matrix, right = equations or (np.zeros((0, problem.size)), np.zeros(0))
        equations = np.concatenate([zero_equations.matrix, matrix]), np.concatenate([zero_equations.right, right])
    # weights in units of the largest weight, because the tolerances of the solver are absolute
    weight_unit = max((problem.terms[k][0] for k in term_indices), default=0.0) or 1.0
    scaled = replace(
        problem,
        terms=tuple((problem.terms[k][0] / weight_unit, problem.terms[k][1]) for k in term_indices),
        limits=tuple(problem.limits[k] for k in limit_indices),
    )
    newton = newton_solution(scaled) if equations is None else None
    solution = _solve(scaled, equations) if newton is None else ConicSolution(*newton, 0.0, by_newton=True)
    solution = replace(solution, prices=weight_unit * solution.prices)
    # multipliers of a term that no decision changes are its subgradient
    rows = [norm.subgradient(np.zeros(problem.size)) for _, norm in problem.terms]
    limits = [np.zeros_like(norm.constant) for _, norm in problem.limits]
    for k, z in zip(term_indices, solution.multipliers.terms, strict=False):
        rows[k] = z
    for k, z in zip(limit_indices, solution.multipliers.limits, strict=False):
        limits[k] = weight_unit * z
    if zero_equations is not None and solution.x is not None:
        solution = replace(solution, x=zero_equations.project(problem, solution.x))
        for k, z in zip(zero_limits, zero_equations.dual_rows(solution.prices), strict=True):
            limits[k] = z
    return replace(solution, multipliers=Multipliers(tuple(rows), tuple(limits)))


def _may_bind(problem: AffineProblem, maximum: float, norm: AffineNorm) -> bool:
    # the triangle inequality bounds the norm of every design
    largest = norm.norm.value(norm.grid, norm.constant)
    for column, scale in enumerate(problem.scales):
        if largest > maximum * (1.0 + FEASIBLE):
            return True
        largest += scale * norm.norm.value(norm.grid, norm.slope[..., column])
    return largest > maximum * (1.0 + FEASIBLE)


def _solve(problem: AffineProblem, equations: tuple[Array, Array] | None) -> ConicSolution:
    """Return the first solution that Clarabel confirms, else the best point at which it stopped."""
    blocks, starts, rows, cost = build_program(problem, equations)
    if not rows.right:
        # no decision, and no limit that could be violated
        return ConicSolution(problem.start, Multipliers((), ()), 0.0)
    unconfirmed: list[ConicSolution] = []
    for settings in ATTEMPTS:
        raw = run_clarabel(rows, cost, settings)
        status = str(raw.status)
        solution = read_solution(problem, blocks, starts, raw)
        if "Infeasible" in status and excludes(problem, solution.multipliers.limits):
            return replace(solution, x=None)
        if "Solved" in status:
            return solution
        unconfirmed.append(replace(solution, x=None) if "Infeasible" in status else solution)

    def rank(solution: ConicSolution) -> tuple[float, float]:
        assert solution.x is not None
        violation = problem.violation(solution.x)
        return violation if violation > FEASIBLE else 0.0, problem.objective(solution.x)

    points = [solution for solution in unconfirmed if solution.x is not None]
    points.append(replace(unconfirmed[0], x=project_on_sets(problem, problem.start)))
    best = min(points, key=rank)
    is_contradiction = len(points) <= len(unconfirmed) and rank(best)[0] > 0.0
    return replace(best, x=None) if is_contradiction else best
