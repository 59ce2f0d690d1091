"""Least weighted sum of norms under limits, as a second-order cone program in arrays for Clarabel (P1).

Nothing is kept between two solves, so a result hangs on its own problem alone. Terms that nothing
open acts on, and limits that every design keeps, are no part of the program. Where the solver stops
without an answer it is asked again with other settings, and where none of these helps, for the best
it had: whatever it says is judged by the exact model, and bounds are taken from its dual rows anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.affine import FEASIBLE, AffineNorm, AffineProblem, reach
from laufruhe.numerics.budget import left
from laufruhe.numerics.norms import Grid, lengths
from laufruhe.problem.decision import Domain
from laufruhe.prove.certificate import Multipliers, excludes
from laufruhe.solvers.cone_rows import Block, Rows

Array = NDArray[np.float64]

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
LEAST_SHARE = 1e-7
"""Under which a sum is no part of the largest."""
SHORTEST = 0.05
"""Seconds that one attempt has where time is over."""


@dataclass(frozen=True, eq=False)
class ConicSolution:
    """What the cone solver returned; nothing in it is believed before it is evaluated.

    Attributes
    ----------
    x
        Decision vector; None where the limits cannot be met together.
    multipliers
        Dual rows of terms and limits.
    solver_seconds
        Spent inside the cone solver.
    iterations
        Of the interior-point method.
    shares
        Of every sum of terms in the largest of them, which add up to one; empty where there is one sum.
    """

    x: Array | None
    multipliers: Multipliers
    solver_seconds: float
    iterations: int
    shares: Array = field(default_factory=lambda: np.zeros(0))


def solve_cones(problem: AffineProblem, held: tuple[Array, Array] | None = None) -> ConicSolution:
    """Least weighted sum of norms under limits.

    Parameters
    ----------
    held
        A and b of A x = b, which the decision vector is to keep as well.
    """
    # of several sums those that nothing acts on may still be the largest
    acting = [k for k, (_, norm) in enumerate(problem.terms) if norm.slope.any() or problem.groups]
    binding = [k for k, limit in enumerate(problem.limits) if _may_bind(problem, *limit)]
    fewer = replace(
        problem, terms=tuple(problem.terms[k] for k in acting), limits=tuple(problem.limits[k] for k in binding)
    )
    found = _by_few_rows(fewer, held)
    terms, limits = ([np.zeros_like(norm.constant) for _, norm in of] for of in (problem.terms, problem.limits))
    for kept, rows, own in ((acting, terms, found.multipliers.terms), (binding, limits, found.multipliers.limits)):
        for k, z in zip(kept, own, strict=False):
            rows[k] = z
    return replace(found, multipliers=Multipliers(tuple(terms), tuple(limits)))


def _by_few_rows(problem: AffineProblem, held: tuple[Array, Array] | None) -> ConicSolution:
    """With those rows of limited peaks alone that come near their limit, more of them as long as others break it.

    A peak is a few angles of a thousand, and the rows left out have no price: what is proven holds for all.
    """
    peaks = [norm.norm.is_largest and len(norm.grid.weights) > FEW_ROWS for _, norm in problem.limits]
    kept = [
        np.union1d(0, _near(most, norm, problem.start, NEAR_LIMIT)) if peak else np.arange(len(norm.grid.weights))
        for peak, (most, norm) in zip(peaks, problem.limits, strict=True)
    ]
    for _ in range(ROUNDS if any(peaks) else 0):
        limits = [(maximum, _rows_of(norm, rows)) for (maximum, norm), rows in zip(problem.limits, kept, strict=True)]
        found = _solved(replace(problem, limits=tuple(limits)), held)
        whole = [np.zeros_like(norm.constant) for _, norm in problem.limits]
        for z, rows, own in zip(whole, kept, found.multipliers.limits, strict=False):
            z[rows] = own
        found = replace(found, multipliers=replace(found.multipliers, limits=tuple(whole)))
        if found.x is None:
            return found
        broken = [_near(maximum, norm, found.x, 1.0 + FEASIBLE) for maximum, norm in problem.limits]
        if all(np.isin(over, rows).all() for over, rows in zip(broken, kept, strict=True)):
            return found
        near = [_near(maximum, norm, found.x, NEAR_LIMIT) for maximum, norm in problem.limits]
        kept = [np.union1d(rows, more) if peak else rows for peak, rows, more in zip(peaks, kept, near, strict=True)]
    return _solved(problem, held)


def _near(maximum: float, norm: AffineNorm, x: Array, share: float) -> NDArray[np.intp]:
    """Rows that are longer than a share of a limit."""
    return np.flatnonzero(lengths(norm.rows(x)) > share * maximum)


def _rows_of(norm: AffineNorm, rows: NDArray[np.intp]) -> AffineNorm:
    """Some of its rows."""
    return replace(
        norm, constant=norm.constant[rows], slope=norm.slope[rows], grid=Grid(norm.grid.weights[rows], len(rows))
    )


def _may_bind(problem: AffineProblem, maximum: float, norm: AffineNorm) -> bool:
    """Whether some design may break a limit; a triangle of norms tells."""
    most = norm.norm.value(norm.grid, norm.constant)
    for column, scale in enumerate(problem.scales):
        most += scale * norm.norm.value(norm.grid, norm.slope[..., column])
    return most > maximum * (1.0 + FEASIBLE)


def _solved(problem: AffineProblem, held: tuple[Array, Array] | None) -> ConicSolution:
    """The first answer that the solver stands by; else the best of where it stopped."""
    blocks, starts, rows, cost = _program(problem, held)
    stopped: list[ConicSolution] = []
    for settings in ATTEMPTS:
        found = _told(rows, cost, settings)
        status = str(found.status)
        answer = _answer(problem, blocks, starts, found)
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
    blocks, starts, rows, _ = _program(part, None)
    units, n = part.units, part.size
    size = float(np.abs(gradient * units).max(initial=0.0)) or 1.0
    bent = curvature * np.outer(units, units) / size
    bent = bent + stay * float(np.trace(bent)) * np.eye(n)
    quadratic, cost = np.zeros((rows.columns, rows.columns)), np.zeros(rows.columns)
    quadratic[:n, :n], cost[:n] = np.triu(bent), gradient * units / size - bent @ (x / units)
    found = _told(rows, cost, {}, quadratic)
    if str(found.status) != "Solved":
        return None
    answer = _answer(part, blocks, starts, found)
    return None if answer.x is None else (answer.x, tuple(size * z for z in answer.multipliers.limits))


def _rank(problem: AffineProblem, x: Array | None) -> tuple[float, float]:
    """By what breaks limits least, then by what is least."""
    if x is None:
        return np.inf, np.inf
    excess = problem.excess(x)
    return excess if excess > FEASIBLE else 0.0, problem.objective(x)


def _program(
    problem: AffineProblem, held: tuple[Array, Array] | None
) -> tuple[list[Block], list[int], Rows, Array]:  # fmt: skip
    """Blocks of the norms, their first rows, all rows, and the cost of every column."""
    import clarabel

    unit = reach(problem, [norm for _, norm in problem.terms])
    blocks: list[Block] = []
    columns = problem.size
    for norm, size in [
        *((norm, unit) for _, norm in problem.terms),
        *((norm, reach(problem, [norm])) for _, norm in problem.limits),
    ]:
        blocks.append(Block(norm, norm.norm.cones(norm.grid), size, columns))
        columns = int(blocks[-1].centres.max(initial=blocks[-1].heads.stop - 1)) + 1
    rows = Rows(columns)
    if held is not None:
        matrix, right = held
        rows.add(np.arange(len(right))[:, None], np.arange(problem.size), matrix * problem.units, right)
        rows.cones.append(clarabel.ZeroConeT(len(right)))
    for domain in problem.domains:
        _add_domain(rows, domain, float(problem.units[domain.start]))
    for (maximum, _), block in zip(problem.limits, blocks[len(problem.terms) :], strict=True):
        rows.add(0, np.arange(columns)[block.heads], block.cones.value, np.array([maximum / block.unit]))
        rows.cones.append(clarabel.NonnegativeConeT(1))
    for block in blocks:
        if block.cones.under is not None:
            at, heads, factors = block.cones.under
            rows.add(at, block.first + heads, factors, np.zeros(int(at.max()) + 1))
            rows.cones.append(clarabel.NonnegativeConeT(int(at.max()) + 1))
    starts = [_add_norm(rows, block, problem) for block in blocks]
    return blocks, starts, rows, _cost(problem, blocks, rows)


def _cost(problem: AffineProblem, blocks: Sequence[Block], rows: Rows) -> Array:
    """Of every column; of several sums the cost is a last column that none of them exceeds."""
    import clarabel

    sums = np.zeros((max(problem.groups, default=0) + 1, rows.columns))
    for k, ((weight, _), block) in enumerate(zip(problem.terms, blocks, strict=False)):
        sums[problem.groups[k] if problem.groups else 0, block.heads] = weight * block.cones.value
    if not problem.groups:
        return np.asarray(sums[0])
    group, column = np.nonzero(sums)
    last = np.arange(len(sums))
    rows.add(
        np.concatenate([group, last]),
        np.concatenate([column, np.full(len(sums), rows.columns)]),
        np.concatenate([sums[group, column], np.full(len(sums), -1.0)]),
        np.zeros(len(sums)),
    )
    rows.cones.append(clarabel.NonnegativeConeT(len(sums)))
    rows.columns += 1
    cost = np.zeros(rows.columns)
    cost[-1] = 1.0
    return cost


def _told(rows: Rows, cost: Array, told: Mapping[str, Any], quadratic: Array | None = None) -> Any:
    import clarabel
    from scipy.sparse import csc_array

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    for name, value in told.items():
        setattr(settings, name, value)
    settings.time_limit = max(left(), SHORTEST)
    bent = csc_array((rows.columns, rows.columns)) if quadratic is None else csc_array(quadratic)
    right = np.concatenate(rows.right)
    return clarabel.DefaultSolver(bent, cost, rows.matrix(), right, rows.cones, settings).solve()


def _answer(problem: AffineProblem, blocks: list[Block], starts: list[int], found: Any) -> ConicSolution:
    """Decisions in their sets, and dual rows; zero where the solver has lost its numbers."""
    x = projected(problem, _numbers(found.x)[: problem.size] * problem.units)
    duals = _numbers(found.z)
    unit = blocks[0].unit if problem.terms else 1.0
    rows = [_dual_rows(block, duals, start, unit) for block, start in zip(blocks, starts, strict=True)]
    shares = np.ones(1)
    if problem.groups:
        # the last rows of the program are those of the sums
        shares = np.maximum(duals[len(duals) - max(problem.groups) - 1 :], 0.0)
        shares = shares / shares.sum() if shares.any() else np.full(len(shares), 1.0 / len(shares))
        shares = np.where(shares > LEAST_SHARE, shares, 0.0)
        shares = shares / shares.sum()
    of = [float(shares[group]) for group in problem.groups] or [1.0] * len(problem.terms)
    terms = tuple(z / (weight * share or 1.0) for z, (weight, _), share in zip(rows, problem.terms, of, strict=False))
    multipliers = Multipliers(terms, tuple(rows[len(terms) :]))
    own = shares if problem.groups else np.zeros(0)
    return ConicSolution(x, multipliers, float(found.solve_time), int(found.iterations), own)


def _numbers(values: Sequence[float]) -> Array:
    return np.asarray(np.nan_to_num(np.asarray(values, dtype=float), posinf=0.0, neginf=0.0))


def projected(problem: AffineProblem, x: Array) -> Array:
    """Every decision in its set."""
    for domain in problem.domains:
        x[domain.columns] = domain.project(x)
    return x


def _add_domain(rows: Rows, domain: Domain, unit: float) -> None:
    """The decision's own set, in units of a size (P4)."""
    import clarabel

    upper, lower = domain.set.upper / unit, domain.set.lower / unit
    if domain.width == 1:
        rows.add([0, 1], domain.start, [1.0, -1.0], np.array([upper, -lower]))
        rows.cones.append(clarabel.NonnegativeConeT(2))
        return
    if len(domain.set.edges):
        (ax, ay), (bx, by) = domain.set.edges
        across = np.array([domain.start, domain.start + 1])
        rows.add([[0], [1]], across, [[ay, -ax], [-by, bx]], np.zeros(2))
        rows.cones.append(clarabel.NonnegativeConeT(2))
    rows.add([1, 2], [domain.start, domain.start + 1], -1.0, np.array([upper, 0.0, 0.0]))
    rows.cones.append(clarabel.SecondOrderConeT(3))


def _add_norm(rows: Rows, block: Block, problem: AffineProblem) -> int:
    """V0 + B x in a cone a row, or in one cone for a root mean square; returns the first row."""
    import clarabel

    norm, cones, start = block.norm, block.cones, rows.count
    k, d = norm.constant.shape
    slope = norm.slope * (problem.units / block.unit) * cones.factors[:, None, None]
    constant = norm.constant / block.unit * cones.factors[:, None]
    # rows of the program in the order of its cones: a head, then what is under it
    width = k * d + 1 if cones.whole else d + 1
    heads = np.arange(len(cones.head)) * width
    under = (1 + np.arange(k * d).reshape(k, d)) if cones.whole else heads[:, None] + 1 + np.arange(d)
    right = np.zeros(width * len(heads))
    right[under] = constant
    places = np.broadcast_to(under[:, :, None], slope.shape)
    across = np.broadcast_to(np.arange(problem.size), slope.shape)
    centres = block.centres.ravel()
    rows.add(
        np.concatenate([heads, places.ravel(), under.ravel()[: len(centres)]]),
        np.concatenate([block.first + cones.head, across.ravel(), centres]),
        np.concatenate([np.full(len(heads), -1.0), -slope.ravel(), np.ones(len(centres))]),
        right,
    )
    rows.cones += [clarabel.SecondOrderConeT(width)] * len(heads)
    return start


def _dual_rows(block: Block, duals: Array, start: int, objective_unit: float) -> Array:
    """mu Z of the rows [SI] (P2), in the objective's own unit."""
    k, d = block.norm.constant.shape
    if block.cones.whole:
        z = -duals[start + 1 : start + 1 + k * d].reshape(k, d)
    else:
        z = -duals[start : start + k * (d + 1)].reshape(k, d + 1)[:, 1:]
    return np.asarray(z * block.cones.factors[:, None] * (objective_unit / block.unit))
