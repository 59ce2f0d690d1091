"""The cone program of an affine problem as arrays, straight to Clarabel (P1).

For studies, which solve thousands of small programs: `solvers.conic` states the same
program in cvxpy, whose compiling takes as long as the solving. Nothing is kept between
two solves, so a point's result hangs on that point alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import SolverError
from laufruhe.load_models.affine import AffineNorm, AffineProblem, reach
from laufruhe.numerics.norms import Cones
from laufruhe.problem.decision import Domain
from laufruhe.prove.certificate import Multipliers

Array = NDArray[np.float64]

# flat optima need a small gap before their decisions are digits one can build
TIGHT = {"tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10, "tol_feas": 1e-10}


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


def solve_direct(problem: AffineProblem) -> ConicSolution:
    """Least weighted sum of norms under limits.

    Raises
    ------
    SolverError
        If the solver stops without telling optimal from infeasible.
    """
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
    for domain in problem.domains:
        _add_domain(rows, domain, float(problem.units[domain.start]))
    for (maximum, _), block in zip(problem.limits, blocks[len(problem.terms) :], strict=True):
        rows.add(0, np.arange(columns)[block.heads], block.cones.value, np.array([maximum / block.unit]))
        rows.cones.append(clarabel.NonnegativeConeT(1))
    starts = [_add_norm(rows, block, problem) for block in blocks]
    cost = np.zeros(columns)
    for (weight, _), block in zip(problem.terms, blocks, strict=False):
        cost[block.heads] = weight * block.cones.value
    found = _solved(rows, cost, TIGHT)
    if not _is_told(found):
        # limits that all but contradict each other
        found = _solved(rows, cost, {})
    return _answer(problem, blocks, starts, found)


def _is_told(found: Any) -> bool:
    return any(word in str(found.status) for word in ("Solved", "PrimalInfeasible"))


def _solved(rows: _Rows, cost: Array, tolerances: Mapping[str, float]) -> Any:
    import clarabel
    from scipy.sparse import csc_array

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    for name, tolerance in tolerances.items():
        setattr(settings, name, tolerance)
    nothing = csc_array((rows.columns, rows.columns))
    right = np.concatenate(rows.right)
    return clarabel.DefaultSolver(nothing, cost, rows.matrix(), right, rows.cones, settings).solve()


def _answer(problem: AffineProblem, blocks: list[_Block], starts: list[int], found: Any) -> ConicSolution:
    status, seconds, iterations = str(found.status), float(found.solve_time), int(found.iterations)
    if "PrimalInfeasible" in status:
        return ConicSolution(None, Multipliers((), ()), seconds, iterations)
    if not _is_told(found):
        raise SolverError(f"the cone solver stopped with status '{status}'")
    x = np.asarray(found.x)[: problem.size] * problem.units
    for domain in problem.domains:
        x[domain.columns] = domain.project(x)
    duals = np.asarray(found.z)
    unit = blocks[0].unit if problem.terms else 1.0
    rows = [_dual_rows(block, duals, start, unit) for block, start in zip(blocks, starts, strict=True)]
    terms = tuple(z / weight for z, (weight, _) in zip(rows, problem.terms, strict=False))
    return ConicSolution(x, Multipliers(terms, tuple(rows[len(terms) :])), seconds, iterations)


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
