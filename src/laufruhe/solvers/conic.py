"""Least weighted sum of norms under limits, as a second-order cone program in arrays for Clarabel (P1).

Nothing is kept between two solves, so a result hangs on its own problem alone. Terms that nothing
open acts on, and limits that every design keeps, are no part of the program. Where the solver stops
without an answer it is asked again with other settings, and where none of these helps, for the best
it had: whatever it says is judged by the exact model, and bounds are taken from its dual rows anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.affine import FEASIBLE, AffineNorm, AffineProblem, reach
from laufruhe.numerics.budget import left
from laufruhe.numerics.norms import Cones, Grid, lengths
from laufruhe.problem.decision import Domain
from laufruhe.prove.certificate import Multipliers, excludes

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
    """

    x: Array | None
    multipliers: Multipliers
    solver_seconds: float
    iterations: int


@dataclass(frozen=True, eq=False)
class _Block:
    """One norm: its columns of heads and its rows in the program.

    Attributes
    ----------
    cones
        Its form.
    unit
        Rows are counted in it.
    first
        First column of its heads.
    """

    norm: AffineNorm
    cones: Cones
    unit: float
    first: int

    @property
    def heads(self) -> slice:
        """Columns of the heads."""
        return slice(self.first, self.first + len(self.cones.value))

    @property
    def centres(self) -> NDArray[np.int64]:
        """Column of the free vector that each number of the rows is counted from, shape (k, d); none, (0, 0)."""
        if not self.cones.centred:
            return np.zeros((0, 0), dtype=int)
        k, d = self.norm.constant.shape
        signal = np.arange(k) // self.norm.grid.steps
        return np.asarray(self.heads.stop + signal[:, None] * d + np.arange(d))


class _Rows:
    """A x + s = b, s in a product of cones: blocks of rows as they are added."""

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self.entries: list[tuple[NDArray[np.int64], NDArray[np.int64], Array]] = []
        self.right: list[Array] = []
        self.cones: list[Any] = []
        self.count = 0

    def add(self, rows: Any, columns: Any, values: Any, right: Array) -> None:
        """Entries, their rows counted from the block's first."""
        at, across, numbers = np.broadcast_arrays(rows, columns, values)
        self.entries.append((at.ravel() + self.count, across.ravel(), numbers.ravel()))
        self.right.append(right)
        self.count += len(right)

    def matrix(self) -> Any:
        from scipy.sparse import csc_array

        rows, columns, values = (np.concatenate([entry[k] for entry in self.entries]) for k in range(3))
        used = values != 0.0
        return csc_array((values[used], (rows[used], columns[used])), shape=(self.count, self.columns))


def solve_cones(problem: AffineProblem, held: tuple[Array, Array] | None = None) -> ConicSolution:
    """Least weighted sum of norms under limits.

    Parameters
    ----------
    held
        A and b of A x = b, which the decision vector is to keep as well.
    """
    acting = [k for k, (_, norm) in enumerate(problem.terms) if norm.slope.any()]
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


def _rank(problem: AffineProblem, x: Array | None) -> tuple[float, float]:
    """By what breaks limits least, then by what is least."""
    if x is None:
        return np.inf, np.inf
    excess = problem.excess(x)
    return excess if excess > FEASIBLE else 0.0, problem.objective(x)


def _program(
    problem: AffineProblem, held: tuple[Array, Array] | None
) -> tuple[list[_Block], list[int], _Rows, Array]:  # fmt: skip
    """Blocks of the norms, their first rows, all rows, and the cost of every column."""
    import clarabel

    unit = reach(problem, [norm for _, norm in problem.terms])
    blocks: list[_Block] = []
    columns = problem.size
    for norm, size in [
        *((norm, unit) for _, norm in problem.terms),
        *((norm, reach(problem, [norm])) for _, norm in problem.limits),
    ]:
        blocks.append(_Block(norm, norm.norm.cones(norm.grid), size, columns))
        columns = int(blocks[-1].centres.max(initial=blocks[-1].heads.stop - 1)) + 1
    rows = _Rows(columns)
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
    cost = np.zeros(columns)
    for (weight, _), block in zip(problem.terms, blocks, strict=False):
        cost[block.heads] = weight * block.cones.value
    return blocks, starts, rows, cost


def _told(rows: _Rows, cost: Array, told: Mapping[str, Any]) -> Any:
    import clarabel
    from scipy.sparse import csc_array

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    for name, value in told.items():
        setattr(settings, name, value)
    settings.time_limit = max(left(), SHORTEST)
    nothing = csc_array((rows.columns, rows.columns))
    right = np.concatenate(rows.right)
    return clarabel.DefaultSolver(nothing, cost, rows.matrix(), right, rows.cones, settings).solve()


def _answer(problem: AffineProblem, blocks: list[_Block], starts: list[int], found: Any) -> ConicSolution:
    """Decisions in their sets, and dual rows; zero where the solver has lost its numbers."""
    x = projected(problem, _numbers(found.x)[: problem.size] * problem.units)
    duals = _numbers(found.z)
    unit = blocks[0].unit if problem.terms else 1.0
    rows = [_dual_rows(block, duals, start, unit) for block, start in zip(blocks, starts, strict=True)]
    terms = tuple(z / weight for z, (weight, _) in zip(rows, problem.terms, strict=False))
    multipliers = Multipliers(terms, tuple(rows[len(terms) :]))
    return ConicSolution(x, multipliers, float(found.solve_time), int(found.iterations))


def _numbers(values: Sequence[float]) -> Array:
    return np.asarray(np.nan_to_num(np.asarray(values, dtype=float), posinf=0.0, neginf=0.0))


def projected(problem: AffineProblem, x: Array) -> Array:
    """Every decision in its set."""
    for domain in problem.domains:
        x[domain.columns] = domain.project(x)
    return x


def _add_domain(rows: _Rows, domain: Domain, unit: float) -> None:
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


def _add_norm(rows: _Rows, block: _Block, problem: AffineProblem) -> int:
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


def _dual_rows(block: _Block, duals: Array, start: int, objective_unit: float) -> Array:
    """mu Z of the rows [SI] (P2), in the objective's own unit."""
    k, d = block.norm.constant.shape
    if block.cones.whole:
        z = -duals[start + 1 : start + 1 + k * d].reshape(k, d)
    else:
        z = -duals[start : start + k * (d + 1)].reshape(k, d + 1)[:, 1:]
    return np.asarray(z * block.cones.factors[:, None] * (objective_unit / block.unit))
