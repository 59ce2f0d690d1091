"""Assemble second-order cone programs in sparse arrays, solve them by Clarabel and read the solution (P1, P2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.affine import AffineNorm, AffineProblem, typical_size
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import seconds_left
from laufruhe.numerics.norms import Cones, Grid, lengths
from laufruhe.problem.decision import Domain
from laufruhe.prove.certificate import Multipliers

TIGHT: Mapping[str, float] = {"tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10, "tol_feas": 1e-10}
"""First settings of the solver; at flat optima, decisions are accurate only if the gap is small."""
MINIMUM_SHARE = 1e-7
"""Multipliers of sums of terms below this share of their total are set to zero."""
MINIMUM_SECONDS = 0.05
"""Time allowed to a solve that starts after the time limit [s]."""


@dataclass(frozen=True, eq=False)
class ConicSolution:
    """Solution of a cone program, before the exact model checks it.

    Attributes
    ----------
    x
        Decision vector, shape (n,); None if the limits contradict each other.
    multipliers
        Dual rows of terms and limits.
    solver_seconds
        Time spent inside the cone solver [s].
    shares
        Multiplier of every sum of terms, if the largest of several is minimised; they add up to one. Else empty.
    prices
        Dual values of the program's rows in the unit of the objective, those of the equations first.
    by_newton
        True if Newton's method proved the optimum without a cone program.
    """

    x: Array | None
    multipliers: Multipliers
    solver_seconds: float
    shares: Array = field(default_factory=lambda: np.zeros(0))
    prices: Array = field(default_factory=lambda: np.zeros(0))
    by_newton: bool = False


@dataclass(frozen=True, eq=False)
class SparseMatrix:
    """Matrix in compressed sparse columns, as Clarabel reads it; importing `scipy.sparse` takes 0.1 s.

    Attributes
    ----------
    data, indices, indptr, shape
        Same as in `scipy.sparse.csc_array`, without duplicate entries, rows in ascending order.
    """

    data: Array
    indices: NDArray[np.int64]
    indptr: NDArray[np.int64]
    shape: tuple[int, int]
    has_canonical_format: ClassVar[bool] = True

    @classmethod
    def from_entries(
        cls, rows: NDArray[np.int64], columns: NDArray[np.int64], values: Array, shape: tuple[int, int]
    ) -> SparseMatrix:
        """Build a matrix of `shape` from its entries; entries with the same row and column add up."""
        nonzero = values != 0.0
        keys = (columns * shape[0] + rows)[nonzero]
        order = np.argsort(keys, kind="stable")
        keys, data = keys[order], values[nonzero][order]
        first = np.flatnonzero(np.diff(keys, prepend=-1))
        if len(first) < len(keys):
            keys, data = keys[first], np.add.reduceat(data, first)
        starts = np.searchsorted(keys, shape[0] * np.arange(shape[1] + 1))
        return cls(data, keys % max(shape[0], 1), starts, shape)


class ConeRows:
    """Rows A x + s = b of a cone program, with slacks s in a product of cones; A has `columns` columns."""

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self.entries: list[tuple[NDArray[np.int64], NDArray[np.int64], Array]] = []
        self.right: list[Array] = []
        self.cones: list[Any] = []
        self.count = 0

    def add(self, rows: Any, columns: Any, values: Any, right: Array) -> None:
        """Add a block of constraint rows to the matrix A and the right-hand side b.

        Parameters
        ----------
        rows, columns, values
            Entries of A, which broadcast against each other; row 0 is the first row of the block.
        right
            Part of b, shape (rows of the block,).
        """
        rows, columns, values = np.broadcast_arrays(rows, columns, values)
        self.entries.append((rows.ravel() + self.count, columns.ravel(), values.ravel()))
        self.right.append(right)
        self.count += len(right)


@dataclass(frozen=True, eq=False)
class RowBlock:
    """Columns and constraint rows of one norm in a cone program.

    Attributes
    ----------
    unit
        Unit in which the program measures the norm [SI].
    first
        First column of the epigraph variables.
    """

    norm: AffineNorm
    cones: Cones
    unit: float
    first: int

    @property
    def heads(self) -> slice:
        """Columns of the epigraph variables, each the head of a cone."""
        return slice(self.first, self.first + len(self.cones.value))

    @property
    def centres(self) -> NDArray[np.int64]:
        """Columns of free centres, one subtracted from each number of the norm, shape (k, d); (0, 0) if none."""
        if not self.cones.centred:
            return np.zeros((0, 0), dtype=int)
        k, d = self.norm.constant.shape
        signal = np.arange(k) // self.norm.grid.steps
        return np.asarray(self.heads.stop + signal[:, None] * d + np.arange(d))


def build_program(
    problem: AffineProblem, equations: tuple[Array, Array] | None
) -> tuple[list[RowBlock], list[int], ConeRows, Array]:  # fmt: skip
    """Assemble the cone program of a problem (P1), with additional equations A x = b, shapes (m, n) and (m,).

    Returns
    -------
    Blocks of the norms, the first row of each block, all rows, and the cost of every column.
    """
    import clarabel

    unit = typical_size(problem, [norm for _, norm in problem.terms])
    blocks: list[RowBlock] = []
    columns = problem.size
    for norm, size in [
        *((norm, unit) for _, norm in problem.terms),
        *((norm, typical_size(problem, [norm])) for _, norm in problem.limits),
    ]:
        blocks.append(RowBlock(norm, norm.norm.cones(norm.grid), size, columns))
        columns = int(blocks[-1].centres.max(initial=blocks[-1].heads.stop - 1)) + 1
    rows = ConeRows(columns)
    if equations is not None:
        matrix, right = equations
        rows.add(np.arange(len(right))[:, None], np.arange(problem.size), matrix * problem.units, right)
        rows.cones.append(clarabel.ZeroConeT(len(right)))
    for domain in problem.domains:
        _add_domain(rows, domain, float(problem.units[domain.start]))
    for (maximum, _), block in zip(problem.limits, blocks[len(problem.terms) :], strict=True):
        rows.add(0, np.arange(columns)[block.heads], block.cones.value, np.array([maximum / block.unit]))
        rows.cones.append(clarabel.NonnegativeConeT(1))
    for block in blocks:
        if block.cones.linear_rows is not None:
            row, heads, factors = block.cones.linear_rows
            rows.add(row, block.first + heads, factors, np.zeros(int(row.max()) + 1))
            rows.cones.append(clarabel.NonnegativeConeT(int(row.max()) + 1))
        if block.cones.squares is not None:
            # t_a^2 <= t_b t_c as |(t_b - t_c, 2 t_a)| <= t_b + t_c
            square, left_factor, right_factor = (block.first + heads for heads in block.cones.squares)
            top = 3 * np.arange(len(square))
            rows.add(
                np.concatenate([top, top, top + 1, top + 1, top + 2]),
                np.concatenate([left_factor, right_factor, left_factor, right_factor, square]),
                np.repeat([-1.0, -1.0, -1.0, 1.0, -2.0], len(square)),
                np.zeros(3 * len(square)),
            )
            rows.cones += [clarabel.SecondOrderConeT(3)] * len(square)
    starts = [_add_norm(rows, block, problem) for block in blocks]
    sums = np.zeros((max(problem.groups, default=0) + 1, rows.columns))
    for k, ((weight, _), block) in enumerate(zip(problem.terms, blocks, strict=False)):
        sums[problem.groups[k] if problem.groups else 0, block.heads] = weight * block.cones.value
    if not problem.groups:
        return blocks, starts, rows, np.asarray(sums[0])
    # one epigraph variable is above all sums, and is the cost
    group, column = np.nonzero(sums)
    indices = np.arange(len(sums))
    rows.add(
        np.concatenate([group, indices]),
        np.concatenate([column, np.full(len(sums), rows.columns)]),
        np.concatenate([sums[group, column], np.full(len(sums), -1.0)]),
        np.zeros(len(sums)),
    )
    rows.cones.append(clarabel.NonnegativeConeT(len(sums)))
    rows.columns += 1
    return blocks, starts, rows, np.append(np.zeros(rows.columns - 1), 1.0)


def _add_domain(rows: ConeRows, domain: Domain, unit: float) -> None:
    """Add the set of a decision, in the unit of its columns (P4)."""
    import clarabel

    upper, lower = domain.set.upper / unit, domain.set.lower / unit
    if domain.width == 1:
        rows.add([0, 1], domain.start, [1.0, -1.0], np.array([upper, -lower]))
        rows.cones.append(clarabel.NonnegativeConeT(2))
        return
    if len(domain.set.edges):
        (x1, y1), (x2, y2) = domain.set.edges
        columns = np.array([domain.start, domain.start + 1])
        rows.add([[0], [1]], columns, [[y1, -x1], [-y2, x2]], np.zeros(2))
        rows.cones.append(clarabel.NonnegativeConeT(2))
    rows.add([1, 2], [domain.start, domain.start + 1], -1.0, np.array([upper, 0.0, 0.0]))
    rows.cones.append(clarabel.SecondOrderConeT(3))


def _add_norm(rows: ConeRows, block: RowBlock, problem: AffineProblem) -> int:
    """Add the rows V0 + B x of a norm, with a cone for each, or a single cone for a root mean square.

    Return the index of the first row in the program.
    """
    import clarabel

    norm, cones = block.norm, block.cones
    k, d = norm.constant.shape
    slope, basis = norm.free_slope
    columns, units = np.arange(problem.size), problem.units
    if len(basis) < problem.size:
        # free columns basis x, in the unit of the block (P21)
        decisions, columns = columns, rows.columns + np.arange(len(basis))
        rows.columns += len(columns)
        values = np.concatenate([basis * units / block.unit, -np.eye(len(columns))], axis=1)
        rows.add(np.arange(len(columns))[:, None], np.append(decisions, columns), values, np.zeros(len(columns)))
        rows.cones.append(clarabel.ZeroConeT(len(columns)))
        units = np.full(len(columns), block.unit)
    start = rows.count
    slope = slope * (units / block.unit) * cones.factors[:, None, None]
    constant = norm.constant / block.unit * cones.factors[:, None]
    # rows of the program in the order of its cones: the head, then the numbers that it bounds
    width = k * d + 1 if cones.is_single else d + 1
    heads = np.arange(len(cones.head)) * width
    body = (1 + np.arange(k * d).reshape(k, d)) if cones.is_single else heads[:, None] + 1 + np.arange(d)
    right = np.zeros(width * len(heads))
    right[body] = constant
    positions = np.broadcast_to(body[:, :, None], slope.shape)
    centres = block.centres.ravel()
    rows.add(
        np.concatenate([heads, positions.ravel(), body.ravel()[: len(centres)]]),
        np.concatenate([block.first + cones.head, np.broadcast_to(columns, slope.shape).ravel(), centres]),
        np.concatenate([np.full(len(heads), -1.0), -slope.ravel(), np.ones(len(centres))]),
        right,
    )
    rows.cones += [clarabel.SecondOrderConeT(width)] * len(heads)
    return start


def run_clarabel(rows: ConeRows, cost: Array, options: Mapping[str, Any], quadratic: Array | None = None) -> Any:
    """Minimise cost . x + x' quadratic x / 2 subject to the constraint rows `rows`, by Clarabel.

    Parameters
    ----------
    cost
        Linear cost, shape (columns,).
    options
        Settings of Clarabel by name.
    quadratic
        Upper triangle of the quadratic cost, shape (columns, columns); zero if None.
    """
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    for name, value in options.items():
        setattr(settings, name, value)
    settings.time_limit = max(seconds_left(), MINIMUM_SECONDS)
    hessian = np.zeros((0, 0)) if quadratic is None else quadratic
    row, column = np.nonzero(hessian)
    squares = SparseMatrix.from_entries(row, column, hessian[row, column], (rows.columns, rows.columns))
    row, column, values = (np.concatenate([entry[k] for entry in rows.entries]) for k in range(3))
    matrix = SparseMatrix.from_entries(row, column, values, (rows.count, rows.columns))
    return clarabel.DefaultSolver(squares, cost, matrix, np.concatenate(rows.right), rows.cones, settings).solve()


def read_solution(problem: AffineProblem, blocks: list[RowBlock], starts: list[int], solution: Any) -> ConicSolution:
    """Read decisions, projected on their sets, and dual rows [SI] from a solution of Clarabel.

    Values that are not finite count as zero. See `build_program` for the blocks and the first row of each.
    """
    primal, duals = (
        np.nan_to_num(np.asarray(values, dtype=float), posinf=0.0, neginf=0.0) for values in (solution.x, solution.z)
    )
    x = project_on_sets(problem, primal[: problem.size] * problem.units)
    unit = blocks[0].unit if problem.terms else 1.0
    rows = []
    for block, start in zip(blocks, starts, strict=True):
        # mu Z of the rows (P2), in the unit of the objective
        k, d = block.norm.constant.shape
        if block.cones.is_single:
            z = -duals[start + 1 : start + 1 + k * d].reshape(k, d)
        else:
            z = -duals[start : start + k * (d + 1)].reshape(k, d + 1)[:, 1:]
        rows.append(np.asarray(z * block.cones.factors[:, None] * (unit / block.unit)))
    shares = np.zeros(0)
    if problem.groups:
        # the last rows of the program belong to the sums
        shares = np.maximum(duals[len(duals) - max(problem.groups) - 1 :], 0.0)
        shares = shares / shares.sum() if shares.any() else np.full(len(shares), 1.0 / len(shares))
        shares = np.where(shares > MINIMUM_SHARE, shares, 0.0)
        shares = shares / shares.sum()
    term_shares = [float(shares[group]) for group in problem.groups] or [1.0] * len(problem.terms)
    terms = tuple(
        z / (weight * share or 1.0) for z, (weight, _), share in zip(rows, problem.terms, term_shares, strict=False)
    )
    multipliers = Multipliers(terms, tuple(rows[len(terms) :]))
    return ConicSolution(x, multipliers, float(solution.solve_time), shares, unit * duals)


def project_on_sets(problem: AffineProblem, x: Array) -> Array:
    """Project every decision onto its set, in place; return x, shape (n,)."""
    for domain in problem.domains:
        x[domain.columns] = domain.project(x)
    return x


def rows_near(maximum: float, norm: AffineNorm, x: Array, share: float) -> NDArray[np.intp]:
    """Return indices of a norm's vectors (rows) whose length at x, shape (n,), exceeds `share` times `maximum` [SI]."""
    return np.flatnonzero(lengths(norm.rows(x)) > share * maximum)


def restrict_rows(norm: AffineNorm, rows: NDArray[np.intp]) -> AffineNorm:
    """Restrict a norm to the vectors (rows) with these indices."""
    return replace(
        norm, constant=norm.constant[rows], slope=norm.slope[rows], grid=Grid(norm.grid.weights[rows], len(rows))
    )
