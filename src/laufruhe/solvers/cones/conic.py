"""Least weighted sum of norms under limits, as a second-order cone program in arrays for Clarabel (P1).

Nothing is kept between two solves, so a result hangs on its own problem alone. Terms that nothing
open acts on, and limits that every design keeps, are no part of the program, and limits of zero are
equations (P11). Where the solver stops without an answer it is asked again with other settings, and
where none of these helps, for the best it had: whatever it says is judged by the exact model, and
bounds are taken from its dual rows anew.
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
from laufruhe.solvers.cones.equations import equations_of
from laufruhe.solvers.cones.program import ConicSolution, answered, program_of, projected, told

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


def solve_cones(problem: AffineProblem, held: tuple[Array, Array] | None = None) -> ConicSolution:
    """Least weighted sum of norms under limits.

    Parameters
    ----------
    held
        A and b of A x = b, which the decision vector is to keep as well.
    """
    # of several sums those that nothing acts on may still be the largest
    acting = [k for k, (_, norm) in enumerate(problem.terms) if is_moved(norm) or problem.groups]
    binding = [k for k, limit in enumerate(problem.limits) if _may_bind(problem, *limit)]
    equal = [k for k in binding if problem.limits[k][0] == 0.0]
    equations = equations_of(problem, equal)
    if equations is not None:
        binding = [k for k in binding if k not in equal]
        held = equations.beside(held)
    # weights in units of the largest, for the tolerances of the solver are absolute
    size = max((problem.terms[k][0] for k in acting), default=0.0) or 1.0
    terms = tuple((weight / size, norm) for weight, norm in (problem.terms[k] for k in acting))
    found = _by_few_rows(replace(problem, terms=terms, limits=tuple(problem.limits[k] for k in binding)), held)
    found = replace(found, prices=size * found.prices)
    # of a term that nothing acts on its own rows tell all
    rows = [norm.subgradient(np.zeros(problem.size)) for _, norm in problem.terms]
    limits = [np.zeros_like(norm.constant) for _, norm in problem.limits]
    for k, z in zip(acting, found.multipliers.terms, strict=False):
        rows[k] = z
    for k, z in zip(binding, found.multipliers.limits, strict=False):
        limits[k] = size * z
    if equations is not None and found.x is not None:
        found = replace(found, x=equations.kept(problem, found.x))
        for k, z in zip(equal, equations.rows(found.prices), strict=True):
            limits[k] = z
    return replace(found, multipliers=Multipliers(tuple(rows), tuple(limits)))


def _by_few_rows(problem: AffineProblem, held: tuple[Array, Array] | None) -> ConicSolution:
    """With those rows of limited peaks alone that come near their limit, more of them as long as others break it.

    A peak is a few angles of a thousand, and the rows left out have no price: what is proven holds for all.
    """
    peaks = [norm.norm.is_largest and len(norm.grid.weights) > FEW_ROWS for _, norm in problem.limits]
    kept = [
        np.union1d(0, rows_near(most, norm, problem.start, NEAR_LIMIT)) if peak else np.arange(len(norm.grid.weights))
        for peak, (most, norm) in zip(peaks, problem.limits, strict=True)
    ]
    for _ in range(ROUNDS if any(peaks) else 0):
        limits = [(maximum, rows_of(norm, rows)) for (maximum, norm), rows in zip(problem.limits, kept, strict=True)]
        found = _solved(replace(problem, limits=tuple(limits)), held)
        whole = [np.zeros_like(norm.constant) for _, norm in problem.limits]
        for z, rows, own in zip(whole, kept, found.multipliers.limits, strict=False):
            z[rows] = own
        found = replace(found, multipliers=replace(found.multipliers, limits=tuple(whole)))
        if found.x is None:
            return found
        broken = [rows_near(maximum, norm, found.x, 1.0 + FEASIBLE) for maximum, norm in problem.limits]
        if all(np.isin(over, rows).all() for over, rows in zip(broken, kept, strict=True)):
            return found
        near = [rows_near(maximum, norm, found.x, NEAR_LIMIT) for maximum, norm in problem.limits]
        kept = [np.union1d(rows, more) if peak else rows for peak, rows, more in zip(peaks, kept, near, strict=True)]
    return _solved(problem, held)


def rows_near(maximum: float, norm: AffineNorm, x: Array, share: float) -> NDArray[np.intp]:
    """Rows that are longer than a share of a limit, or of a peak."""
    return np.flatnonzero(lengths(norm.rows(x)) > share * maximum)


def rows_of(norm: AffineNorm, rows: NDArray[np.intp]) -> AffineNorm:
    """Some of its rows."""
    return replace(
        norm, constant=norm.constant[rows], slope=norm.slope[rows], grid=Grid(norm.grid.weights[rows], len(rows))
    )


def _may_bind(problem: AffineProblem, maximum: float, norm: AffineNorm) -> bool:
    """Whether some design may break a limit; a triangle of norms tells."""
    most = norm.norm.value(norm.grid, norm.constant)
    for column, scale in enumerate(problem.scales):
        if most > maximum * (1.0 + FEASIBLE):
            return True
        most += scale * norm.norm.value(norm.grid, norm.slope[..., column])
    return most > maximum * (1.0 + FEASIBLE)


def _solved(problem: AffineProblem, held: tuple[Array, Array] | None) -> ConicSolution:
    """The first answer that the solver stands by; else the best of where it stopped."""
    blocks, starts, rows, cost = program_of(problem, held)
    if not rows.right:
        # nothing is open, and nothing forbids that
        return ConicSolution(problem.start, Multipliers((), ()), 0.0)
    stopped: list[ConicSolution] = []
    for settings in ATTEMPTS:
        found = told(rows, cost, settings)
        status = str(found.status)
        answer = answered(problem, blocks, starts, found)
        if "Infeasible" in status and excludes(problem, answer.multipliers.limits):
            return replace(answer, x=None)
        if "Solved" in status:
            return answer
        stopped.append(replace(answer, x=None) if "Infeasible" in status else answer)
    points = [answer for answer in stopped if answer.x is not None]
    points.append(replace(stopped[0], x=projected(problem, problem.start)))
    best = min(points, key=lambda answer: _rank(problem, answer.x))
    contradiction = len(points) <= len(stopped) and _rank(problem, best.x)[0] > 0.0
    return replace(best, x=None) if contradiction else best


def solve_quadratic(
    problem: AffineProblem, gradient: Array, curvature: Array, x: Array, stay: float
) -> tuple[Array, tuple[Array, ...]] | None:
    """Least gradient . (y - x) + (y - x)' curvature (y - x) / 2 within sets and limits (P10).

    A share `stay` of the curvature in all directions is added in each.

    Returns
    -------
    y, and the dual rows of the limits; None where the solver does not stand by its answer.
    """
    part = replace(problem, terms=(), groups=())
    blocks, starts, rows, _ = program_of(part, None)
    units, n = part.units, part.size
    size = float(np.abs(gradient * units).max(initial=0.0)) or 1.0
    bent = curvature * np.outer(units, units) / size
    bent = bent + stay * float(np.trace(bent)) * np.eye(n)
    quadratic, cost = np.zeros((rows.columns, rows.columns)), np.zeros(rows.columns)
    quadratic[:n, :n], cost[:n] = np.triu(bent), gradient * units / size - bent @ (x / units)
    found = told(rows, cost, {}, quadratic)
    if str(found.status) != "Solved":
        return None
    answer = answered(part, blocks, starts, found)
    return None if answer.x is None else (answer.x, tuple(size * z for z in answer.multipliers.limits))


def _rank(problem: AffineProblem, x: Array | None) -> tuple[float, float]:
    if x is None:
        return np.inf, np.inf
    excess = problem.excess(x)
    return excess if excess > FEASIBLE else 0.0, problem.objective(x)
