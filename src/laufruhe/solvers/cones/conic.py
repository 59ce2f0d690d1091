"""Least weighted sum of norms under limits, as a second-order cone program for Clarabel (P1).

Nothing is kept between two solves, so a result depends on its own problem alone. Terms that nothing
open acts on, and limits that every design keeps, are no part of the program, and limits of zero are
equations (P11). Where the solver stops without an answer, further settings are tried, and then the best
point it had is taken: the exact model judges it, and bounds are taken from its dual rows anew.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.affine import FEASIBLE, AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid, lengths
from laufruhe.prove.certificate import Multipliers, excludes, is_moved
from laufruhe.solvers.cones.cone_program import (
    ConicSolution,
    build_program,
    project_on_sets,
    read_solution,
    run_clarabel,
)
from laufruhe.solvers.cones.equations import equations_of

# flat optima need a small gap before their decisions are digits one can build
TIGHT = {"tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10, "tol_feas": 1e-10}
ATTEMPTS: tuple[Mapping[str, Any], ...] = (
    TIGHT,
    # limits that all but contradict each other
    {},
    {**TIGHT, "equilibrate_enable": False},
    {"tol_gap_abs": 1e-6, "tol_gap_rel": 1e-6, "tol_feas": 1e-7, "max_iter": 500, "max_step_fraction": 0.9},
)
"""Settings of the solver, in the order in which they are tried."""
FEW_ROWS, ROUNDS, NEAR_LIMIT = 500, 6, 0.95
"""Rows of a peak that are all taken, how often rows are added, and the share of a limit from which they are."""


def solve_cones(problem: AffineProblem, equations: tuple[Array, Array] | None = None) -> ConicSolution:
    """Minimise the weighted sum of norms under limits.

    Parameters
    ----------
    equations
        A, shape (m, n), and b, shape (m,), of A x = b, which the decision vector is to keep as well.
    """
    # of several sums those that nothing acts on may still be the largest
    acting = [k for k, (_, norm) in enumerate(problem.terms) if is_moved(norm) or problem.groups]
    binding = [k for k, limit in enumerate(problem.limits) if _may_bind(problem, *limit)]
    equal = [k for k in binding if problem.limits[k][0] == 0.0]
    zeros = equations_of(problem, equal)
    if zeros is not None:
        binding = [k for k in binding if k not in equal]
        equations = zeros.joined_with(equations)
    # weights in units of the largest, for the tolerances of the solver are absolute
    size = max((problem.terms[k][0] for k in acting), default=0.0) or 1.0
    scaled = replace(
        problem,
        terms=tuple((problem.terms[k][0] / size, problem.terms[k][1]) for k in acting),
        limits=tuple(problem.limits[k] for k in binding),
    )
    solution = _solve_with_few_rows(scaled, equations)
    solution = replace(solution, prices=size * solution.prices)
    # of a term that nothing acts on its own rows are the multipliers
    rows = [norm.subgradient(np.zeros(problem.size)) for _, norm in problem.terms]
    limits = [np.zeros_like(norm.constant) for _, norm in problem.limits]
    for k, z in zip(acting, solution.multipliers.terms, strict=False):
        rows[k] = z
    for k, z in zip(binding, solution.multipliers.limits, strict=False):
        limits[k] = size * z
    if zeros is not None and solution.x is not None:
        solution = replace(solution, x=zeros.project(problem, solution.x))
        for k, z in zip(equal, zeros.dual_rows(solution.prices), strict=True):
            limits[k] = z
    return replace(solution, multipliers=Multipliers(tuple(rows), tuple(limits)))


def _may_bind(problem: AffineProblem, maximum: float, norm: AffineNorm) -> bool:
    # by the triangle inequality
    largest = norm.norm.value(norm.grid, norm.constant)
    for column, scale in enumerate(problem.scales):
        if largest > maximum * (1.0 + FEASIBLE):
            return True
        largest += scale * norm.norm.value(norm.grid, norm.slope[..., column])
    return largest > maximum * (1.0 + FEASIBLE)


def _solve_with_few_rows(problem: AffineProblem, equations: tuple[Array, Array] | None) -> ConicSolution:
    """Solve with those rows of limited peaks alone that come near their limit, and add rows that break it.

    A peak is a few angles of a thousand. Rows left out have no price, so what is proven holds for all rows.
    """
    peaks = [norm.norm.is_largest and len(norm.grid.weights) > FEW_ROWS for _, norm in problem.limits]
    chosen = [
        np.union1d(0, rows_near(maximum, norm, problem.start, NEAR_LIMIT))
        if peak
        else np.arange(len(norm.grid.weights))
        for peak, (maximum, norm) in zip(peaks, problem.limits, strict=True)
    ]
    for _ in range(ROUNDS if any(peaks) else 0):
        limits = [(maximum, rows_of(norm, rows)) for (maximum, norm), rows in zip(problem.limits, chosen, strict=True)]
        solution = _solve(replace(problem, limits=tuple(limits)), equations)
        limit_rows = [np.zeros_like(norm.constant) for _, norm in problem.limits]
        for z, rows, chosen_rows in zip(limit_rows, chosen, solution.multipliers.limits, strict=False):
            z[rows] = chosen_rows
        solution = replace(solution, multipliers=replace(solution.multipliers, limits=tuple(limit_rows)))
        if solution.x is None:
            return solution
        broken = [rows_near(maximum, norm, solution.x, 1.0 + FEASIBLE) for maximum, norm in problem.limits]
        if all(np.isin(over, rows).all() for over, rows in zip(broken, chosen, strict=True)):
            return solution
        near = [rows_near(maximum, norm, solution.x, NEAR_LIMIT) for maximum, norm in problem.limits]
        chosen = [
            np.union1d(rows, more) if peak else rows for peak, rows, more in zip(peaks, chosen, near, strict=True)
        ]
    return _solve(problem, equations)


def rows_near(maximum: float, norm: AffineNorm, x: Array, share: float) -> NDArray[np.intp]:
    """Return the numbers of rows that are longer at x than a share of a limit."""
    return np.flatnonzero(lengths(norm.rows(x)) > share * maximum)


def rows_of(norm: AffineNorm, rows: NDArray[np.intp]) -> AffineNorm:
    """Return the norm of some of its rows."""
    return replace(
        norm, constant=norm.constant[rows], slope=norm.slope[rows], grid=Grid(norm.grid.weights[rows], len(rows))
    )


def _solve(problem: AffineProblem, equations: tuple[Array, Array] | None) -> ConicSolution:
    """Return the first answer that the solver stands by, else the best point at which it stopped."""
    blocks, starts, rows, cost = build_program(problem, equations)
    if not rows.right:
        # nothing is open, and nothing forbids that
        return ConicSolution(problem.start, Multipliers((), ()), 0.0)
    stopped: list[ConicSolution] = []
    for settings in ATTEMPTS:
        raw = run_clarabel(rows, cost, settings)
        status = str(raw.status)
        answer = read_solution(problem, blocks, starts, raw)
        if "Infeasible" in status and excludes(problem, answer.multipliers.limits):
            return replace(answer, x=None)
        if "Solved" in status:
            return answer
        stopped.append(replace(answer, x=None) if "Infeasible" in status else answer)

    def rank(answer: ConicSolution) -> tuple[float, float]:
        assert answer.x is not None
        violation = problem.violation(answer.x)
        return violation if violation > FEASIBLE else 0.0, problem.objective(answer.x)

    points = [answer for answer in stopped if answer.x is not None]
    points.append(replace(stopped[0], x=project_on_sets(problem, problem.start)))
    best = min(points, key=rank)
    contradiction = len(points) <= len(stopped) and rank(best)[0] > 0.0
    return replace(best, x=None) if contradiction else best


def solve_quadratic(
    problem: AffineProblem, gradient: Array, curvature: Array, x: Array, damping: float
) -> tuple[Array, tuple[Array, ...]] | None:
    """Minimise gradient . (y - x) + (y - x)' curvature (y - x) / 2 within sets and limits (P10).

    Parameters
    ----------
    gradient, curvature, x
        Shapes (n,), (n, n) and (n,).
    damping
        Share of the curvature in all directions that is added in each.

    Returns
    -------
    y and the dual rows of the limits, or None where the solver does not stand by its answer.
    """
    part = replace(problem, terms=(), groups=())
    blocks, starts, rows, _ = build_program(part, None)
    units, n = part.units, part.size
    size = float(np.abs(gradient * units).max(initial=0.0)) or 1.0
    scaled = curvature * np.outer(units, units) / size
    scaled = scaled + damping * float(np.trace(scaled)) * np.eye(n)
    quadratic, cost = np.zeros((rows.columns, rows.columns)), np.zeros(rows.columns)
    quadratic[:n, :n], cost[:n] = np.triu(scaled), gradient * units / size - scaled @ (x / units)
    raw = run_clarabel(rows, cost, {}, quadratic)
    if str(raw.status) != "Solved":
        return None
    answer = read_solution(part, blocks, starts, raw)
    return None if answer.x is None else (answer.x, tuple(size * z for z in answer.multipliers.limits))
