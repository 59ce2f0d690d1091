"""Statement of the relaxation (E43-E45, E52-E54) as a cone program; any multipliers of it prove valid bounds (E44).

For a program min q' x with b - A x in cones K, any z in the dual cones gives q' x >= (q + A' z)' x - b' z. Every design
has variables x within known bounds and moments of known size, so that the right side has a minimum in closed form.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array, eye_array, vstack

from laufruhe.extensions.mount_relaxation.constraints import ModeConstraints, MomentConstraint
from laufruhe.extensions.mount_relaxation.program import (
    QuadraticBound,
    RootTerm,
    SdpProgram,
    least_in_ball,
)
from laufruhe.numerics.arrays import Array, Indices
from laufruhe.numerics.budget import is_time_over
from laufruhe.prove.mounts.dual_cones import (
    LENGTH,
    MATRIX,
    SIDES,
    ZERO,
    column,
    in_dual_cones,
    matrix_of,
    triangle,
)
from laufruhe.solvers.mounts.convex import clarabel_cone

# rounds of scaling, and the range of scales
_ROUNDS, _MIN_SCALE, _MAX_SCALE = 10, 1e-4, 1e4


class ConeSolver:
    """Solver of one cone program for any cost vector; Clarabel solves its dual.

        minimum q'x   with   b - A x in K,   the matrices X_k of x positive semidefinite
        minimum b'z   with   A_o' z = -q_o,   q_k + A_k' z positive semidefinite for each X_k,   z in the dual of K

    K is a product of cones. A_k are the columns of X_k, A_o all others: X_k and x_o are multipliers of the second
    program, which stores the matrices X_k once. Both are scaled alike: rows and columns by the roots of their largest
    entries, repeatedly (Ruiz, RAL-TR-2001-034), rows of one cone alike.

    Parameters
    ----------
    rows, right
        A, shape (m, n), and b, shape (m,).
    cones
        K: kind and count of rows of each cone. All rows of a length or of a matrix have one scale.
    matrices
        Columns of each X_k; at least one.
    settings
        Settings of Clarabel.
    """

    def __init__(
        self, rows: Any, right: Array, cones: Sequence[tuple[str, int]], matrices: Sequence[Indices],
        settings: Mapping[str, Any],
    ) -> None:  # fmt: skip
        self._settings = {**settings, "equilibrate_enable": False}
        self._row_scales, self._column_scales = _scales(rows, cones, matrices)
        scaled_rows = csc_array(diags_array(self._row_scales) @ rows @ diags_array(self._column_scales))
        self._right = self._row_scales * right
        entries, (count, width) = np.concatenate(matrices), rows.shape
        free_count = width - len(entries)
        self._order = np.concatenate([np.setdiff1d(np.arange(width), entries), entries])
        self._signs = np.where(np.arange(width) < free_count, 1.0, -1.0)
        inequality_rows = np.flatnonzero(np.repeat([kind != ZERO for kind, _ in cones], [size for _, size in cones]))
        transposed = diags_array(self._signs) @ scaled_rows[:, self._order].T
        added: Any = -eye_array(count, format="csr")[inequality_rows]
        self._rows = csc_array(vstack([transposed, added]))
        kinds = [(ZERO, free_count), *((MATRIX, len(columns)) for columns in matrices)]
        kinds += [cone for cone in cones if cone[0] != ZERO]
        self._cones = [clarabel_cone(*cone) for cone in kinds]
        self._zeros = np.zeros(added.shape[0])
        self._solver: Any = None

    def solve(self, cost: Array) -> tuple[Array, Array]:
        """Return the solver's point x and multipliers z for a cost, whatever its status; certificates check them."""
        scaled = self._column_scales * cost
        size = float(np.abs(scaled).max(initial=0.0))
        factor = float(np.clip(1.0 / size, _MIN_SCALE, _MAX_SCALE)) if size > 0.0 else 1.0
        scaled = factor * scaled
        vectors = {"q": self._right, "b": np.append(-self._signs * scaled[self._order], self._zeros)}
        if self._solver is None:
            self._solver = new_solver(vectors["q"], self._rows, vectors["b"], self._cones, self._settings)
        else:
            self._solver.update(**vectors)
        solution = self._solver.solve()
        z, x = (np.nan_to_num(np.array(values)) for values in (solution.x, solution.z))
        entries = np.empty(len(cost))
        entries[self._order] = -self._signs * x[: len(cost)]
        return self._column_scales * entries, self._row_scales * z / factor


def new_solver(cost: Array, rows: Any, right: Array, cones: Sequence[Any], settings: Mapping[str, Any]) -> Any:
    """Return a Clarabel solver of: minimise cost' x with right - rows x in the cones; it stops at the time budget."""
    import clarabel

    options = clarabel.DefaultSettings()
    for name, value in settings.items():
        setattr(options, name, value)
    no_squares = csc_array((len(cost), len(cost)))
    solver = clarabel.DefaultSolver(no_squares, cost, rows, right, cones, options)
    solver.set_termination_callback(lambda _: is_time_over())
    return solver


def _scales(rows: Any, cones: Sequence[tuple[str, int]], matrices: Sequence[Indices]) -> tuple[Array, Array]:
    """Return scales of rows, (m,), and columns, (n,), that make the program's numbers alike in size.

    Each entry of a matrix X_k counts as a row too.
    """
    count, width = rows.shape
    entries = np.concatenate(matrices)
    row = np.append(rows.row, count + np.arange(len(entries)))
    column = np.append(rows.col, entries)
    sizes = np.append(np.abs(rows.data), np.ones(len(entries)))
    scales = [np.ones(count + len(entries)), np.ones(width)]
    groups = []
    for indices in (row, column):
        order = np.argsort(indices, kind="stable")
        groups.append((order, *np.unique(indices[order], return_index=True)))
    for _ in range(_ROUNDS):
        scaled = scales[0][row] * sizes * scales[1][column]
        for k, (order, numbers, first) in enumerate(groups):
            largest = np.maximum.reduceat(scaled[order], first)
            scales[k] = scales[k].copy()
            scales[k][numbers] /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
            scales[k] = np.clip(scales[k], _MIN_SCALE, _MAX_SCALE)
    start, (row_scales, column_scales) = 0, scales
    for kind, size in (*cones, *((MATRIX, len(columns)) for columns in matrices)):
        if kind in (LENGTH, MATRIX):
            row_scales[start : start + size] = row_scales[start : start + size].mean()
        start += size
    column_scales[entries] = 1.0 / row_scales[count:]
    return row_scales[:count], column_scales


# small price of each square in the objective, which makes the remainder of the multipliers convex
SQUARE_PRICE = 3e-7
# (gap, feasibility) tolerances: of a bound, and of narrowing a box
FINE, ROUGH = (1e-5, 1e-7), (2e-2, 5e-6)
# no iterative refinement, but stronger regularisation and shorter steps: equally good bounds in less time
_SETTINGS = {
    "verbose": False,
    "tol_gap_abs": 1e-6,
    "max_threads": 1,
    "direct_solve_method": "faer",
    "presolve_enable": False,
    "chordal_decomposition_enable": False,
    "iterative_refinement_enable": False,
    "static_regularization_constant": 1e-7,
    "max_step_fraction": 0.95,
}


@dataclass(frozen=True, eq=False)
class Solution:
    """Proven bound, shared numbers s, moments of orders and of modes, and the solver's multipliers of all rows."""

    bound: float
    s: Array
    moments: Sequence[Array]
    modes: Sequence[Array]
    z: Array


class ConeProgram:
    """Cone program of an `SdpProgram`, built up row by row of its cones.

    The variables are, in this order: epigraph variables, blocks of their quadratic bounds, roots and their lengths, s,
    and moments of each order and of each mode. `tolerances` are those of gap and feasibility.
    """

    def __init__(self, program: SdpProgram, tolerances: tuple[float, float] = FINE) -> None:
        self.program = program
        self._settings = {**_SETTINGS, **dict(zip(("tol_gap_rel", "tol_feas"), tolerances, strict=True))}
        self.rows: list[Any] = []
        self.right: list[Array] = []
        self.cones: list[tuple[str, int]] = []
        self._of_products: list[bool] = []
        blocks = [_entries(size) for quadratic in program.quadratics for size in quadratic.blocks]
        self.blocks = np.cumsum([len(program.prices), *blocks])
        counts = [1 + sum(len(rows) for _, rows in root.rows) for root in program.roots]
        self.roots = np.cumsum([self.blocks[-1], *counts])
        self.first = int(self.roots[-1])
        self.ends = np.cumsum([self.first + program.numbers, *map(_entries, program.sizes)])
        sizes = [(1 + program.numbers) * _entries(6) for _ in program.modes]
        self.modes = np.cumsum([int(self.ends[-1]), *sizes])
        self._add_links()
        self._add_linear()
        block_number = 0
        for quadratic in program.quadratics:
            self._add_quadratic(quadratic, block_number)
            block_number += len(quadratic.blocks)
        for constraint in program.constraints:
            self._add_constraint(constraint)
        for number, root in enumerate(program.roots):
            self._add_root(number, root)
        if program.limit < math.inf:
            columns = np.concatenate([self.roots[:-1], self.first + np.arange(program.numbers)])
            block = np.concatenate([[root.price for root in program.roots], program.slopes])[None]
            self._add(block, columns.astype(np.intp), SIDES, np.array([program.limit]))
        for number, mode in enumerate(program.modes):
            self._add_mode(number, mode)
        self._matrix = csc_array(vstack(self.rows))
        # bounds of all variables but moments; a trace bounds the entries of its blocks
        blocks_up = [np.full(sum(map(_entries, q.blocks)), program.uppers[q.variable]) for q in program.quadratics]
        roots_up = [np.full(count, root.upper) for root, count in zip(program.roots, counts, strict=True)]
        roots_low = [
            np.append(root.lower, np.zeros(count - 1)) for root, count in zip(program.roots, counts, strict=True)
        ]
        ones, none = np.ones(program.numbers), np.zeros(len(program.uppers))
        self._uppers = np.concatenate([program.uppers, *blocks_up, *roots_up, ones])
        self._lowers = np.concatenate([none, *(-part for part in blocks_up), *roots_low, -ones])

    def _add(
        self, block: Array, columns: Indices, cone: str, right: Array | None = None, of_product: bool = False
    ) -> None:
        row, place = np.nonzero(block)
        shape = len(block), int(self.modes[-1])
        self.rows.append(coo_array((block[row, place], (row, columns[place])), shape=shape))
        self.right.append(np.zeros(len(block)) if right is None else np.asarray(right, dtype=float))
        self.cones.append((cone, len(block)))
        self._of_products.append(of_product)

    def _add_mode(self, number: int, mode: ModeConstraints) -> None:
        """Add the rows of the constraints E56 of one natural mode."""
        numbers, entries = self.program.numbers, _entries(6)
        mode_columns = np.arange(self.modes[number], self.modes[number + 1])
        corners = mode_columns[::entries]
        self._add(np.ones((1, 1)), corners[:1], ZERO, right=np.ones(1))
        difference = np.concatenate([np.eye(numbers), -np.eye(numbers)], axis=1)
        columns = np.concatenate([corners[1:], self.first + np.arange(numbers)])
        self._add(difference, columns, ZERO, of_product=True)
        for matrices, cone in ((mode.equal, ZERO), (mode.sides, SIDES)):
            self._add(-column(matrices).reshape(len(matrices), -1), mode_columns, cone)
        for tensor in mode.matrices:
            i, j, factor = triangle(tensor.shape[1])
            rows = column(tensor[:, i, j]).transpose(1, 0, 2).reshape(len(i), -1) * factor[:, None]
            self._add(-rows, mode_columns, MATRIX)
        first = np.arange(entries)
        for k in range(1, 1 + numbers):
            for sign in (1.0, -1.0):
                rows = np.concatenate([-np.eye(entries), -sign * np.eye(entries)], axis=1)
                columns = np.concatenate([mode_columns[first], mode_columns[k * entries + first]])
                self._add(rows, columns, MATRIX, of_product=True)

    def _add_links(self) -> None:
        sizes = self.program.sizes
        self._add(np.eye(len(sizes)), np.asarray(self.ends[:-1]), ZERO, right=np.ones(len(sizes)))
        corner, count = self._corner(0), _entries(1 + self.program.columns) - 1
        for order in range(1, len(sizes) if count else 1):
            difference = np.concatenate([-np.eye(count), np.eye(count)], axis=1)
            self._add(difference, np.concatenate([corner[1:], self._corner(order)[1:]]), ZERO)

    def _corner(self, order: int) -> Indices:
        return np.asarray(self.ends[order] + np.arange(_entries(1 + self.program.columns)))

    def _moment(self, order: int) -> Indices:
        return np.arange(self.ends[order], self.ends[order + 1])

    def _add_linear(self) -> None:
        """Add the linear constraints: ranges of numbers s, sets of unbalances, bounds, block traces."""
        program, numbers = self.program, self.program.numbers
        for sign in (1.0, -1.0):
            self._add(sign * np.eye(numbers), self.first + np.arange(numbers), SIDES, np.ones(numbers))
        for matrix in program.sets:
            self._add(column(matrix)[None], self._corner(0), SIDES)
        self._add(np.eye(len(program.uppers)), np.arange(len(program.uppers)), SIDES, program.uppers)
        block_number = 0
        for quadratic in program.quadratics:
            if quadratic.blocks:
                span = np.arange(self.blocks[block_number], self.blocks[block_number + len(quadratic.blocks)])
                traces = np.concatenate([_diagonal(size) for size in quadratic.blocks])
                self._add(np.append(traces, -1.0)[None], np.append(span, quadratic.variable), SIDES)
            block_number += len(quadratic.blocks)

    def _add_quadratic(self, quadratic: QuadraticBound, block_number: int) -> None:
        """Add the rows of S - F(M) >= 0 (E54); the blocks of S are variables from block number `block_number` on."""
        i, j, factor = triangle(quadratic.size)
        columns, blocks = [], []
        for order, rows in quadratic.rows:
            products = np.einsum("pax,pay->axy", rows[:, i], rows[:, j])
            blocks.append(column(0.5 * (products + products.transpose(0, 2, 1))) * factor[:, None])
            columns.append(self._moment(order))
        if quadratic.blocks:
            entry_of = {pair: k for k, pair in enumerate(zip(i.tolist(), j.tolist(), strict=True))}
            for k, part in enumerate(quadratic.block_slices):
                block_rows, block_columns, factors = triangle(quadratic.blocks[k])
                block = np.zeros((len(i), len(factors)))
                for entry, (a, b) in enumerate(zip(block_rows + part.start, block_columns + part.start, strict=True)):
                    block[entry_of[int(a), int(b)], entry] = -1.0
                blocks.append(block)
                columns.append(np.arange(self.blocks[block_number + k], self.blocks[block_number + k + 1]))
        else:
            blocks.append(-column(np.eye(quadratic.size))[:, None])
            columns.append(np.array([quadratic.variable]))
        self._add(np.concatenate(blocks, axis=1), np.concatenate(columns), MATRIX)

    def _add_root(self, number: int, root: RootTerm) -> None:
        """Add the constraints of a root: it is above its chord and above the sum of its length variables (E58).

        Each length variable is above the length of its vector.
        """
        at, end = int(self.roots[number]), int(self.roots[number + 1])
        ends = np.array([number, at])
        self._add(np.array([[root.slope, -1.0]]), ends, SIDES, np.array([-root.offset]))
        sums = np.concatenate([[-1.0], np.ones(end - at - 1)])[None]
        self._add(sums, np.arange(at, end), SIDES)
        for order, rows in root.rows:
            for vector in rows:
                at, (count, size) = at + 1, vector.shape
                block = np.zeros((1 + count, 1 + size))
                block[0, 0], block[1:, 1:] = -1.0, -vector
                # columns of the first row of the moments
                first = self.ends[order] + np.cumsum(np.arange(size))
                # entries off the diagonal are scaled by the root of two
                block[1:, 2:] *= math.sqrt(0.5)
                self._add(block, np.concatenate([[at], first]), LENGTH)

    def _add_constraint(self, constraint: MomentConstraint) -> None:
        i, j, factor = triangle(constraint.size)
        moments = -column(constraint.moments[i, j]) * factor[:, None]
        columns = np.concatenate([self.first + np.arange(self.program.numbers), self._moment(constraint.order)])
        block = np.concatenate([-column(constraint.slopes).T.reshape(len(i), -1), moments], axis=1)
        self._add(block, columns, MATRIX, column(constraint.constant))

    def cost(self, objective: Array | None = None) -> Array:
        """Return the coefficients of an objective: that of the program, or as in `minimum`."""
        program, cost = self.program, np.zeros(int(self.modes[-1]))
        if objective is None:
            cost[: len(program.prices)] = program.prices
            cost[self.roots[:-1]] = [root.price for root in program.roots]
            objective = np.append(program.slopes, np.zeros(5 * len(program.modes)))
        cost[self.first : self.first + program.numbers] = objective[: program.numbers]
        for start, slope in zip(self.modes, objective[program.numbers :].reshape(-1, 5), strict=False):
            # entries (0, k) of a triangle, which are scaled by the root of two
            cost[start + np.cumsum(np.arange(1, 6))] = slope * math.sqrt(0.5)
        return cost

    def minimum(self, objective: Array) -> tuple[float, Array]:
        """Return the proven minimum of an objective, and the numbers s and mode coordinates w at the optimum.

        `objective` has the slopes by s, then by w of each mode, shape (numbers + 5 modes,).
        """
        solution = self.solve(self.cost(objective))
        return solution.bound, np.concatenate([solution.s, *(moments[0, 0, 1:] for moments in solution.modes)])

    def solve(self, cost: Array) -> Solution:
        """Return the proven minimum of the objective with coefficients `cost`, whatever the solver's status."""
        squares = np.zeros(len(cost))
        for order, size in enumerate(self.program.sizes):
            squares[self._moment(order)] = SQUARE_PRICE * _diagonal(size)
        x, z = self._solver.solve(cost - squares)
        moments = [matrix_of(x[self._moment(k)], size) for k, size in enumerate(self.program.sizes)]
        s = np.clip(x[self.first : self.first + self.program.numbers], -1.0, 1.0)
        return Solution(self.bound(cost, z), s, moments, self._mode_matrices(x), z)

    def bound(self, cost: Array, z: Array) -> float:
        """Return the lower bound of an objective that multipliers `z` of the rows prove, for any `z` (E44, E56)."""
        z = in_dual_cones(z, self.cones)
        remainder = cost + self._matrix.T @ z
        numbers = remainder[: len(self._uppers)]
        bound = float(np.minimum(numbers * self._lowers, numbers * self._uppers).sum() - np.concatenate(self.right) @ z)
        for order, (size, reach) in enumerate(zip(self.program.sizes, self.program.reaches, strict=True)):
            bound += least_in_ball(matrix_of(remainder[self._moment(order)], size), reach)
        for matrices in self._mode_matrices(remainder):
            # each s_j with its worse sign
            values, vectors = np.linalg.eigh(matrices[1:])
            worst = np.einsum("jab,jb,jcb->ac", vectors, np.abs(values), vectors)
            bound += least_in_ball(matrices[0] - worst, 1.0)
        return bound

    def mode_scores(self, solution: Solution) -> list[tuple[Array, Array]]:
        """Return branching scores of the numbers s, shape (numbers,), and of the coordinates w, (5,), by each mode.

        A score is the violation of products at the optimum, times its multipliers.
        """
        z = np.where(
            np.repeat(self._of_products, [size for _, size in self.cones]), 0.0, in_dual_cones(solution.z, self.cones)
        )
        scores = []
        for remainder, moments in zip(self._mode_matrices(self._matrix.T @ z), solution.modes, strict=True):
            violations = moments[1:] - solution.s[:, None, None] * moments[0]
            priced = np.abs(np.einsum("jab,jab->jb", remainder[1:], violations))
            corner = moments[0][0]
            squares = np.abs(np.einsum("ab,ab->b", remainder[0], moments[0] - np.outer(corner, corner)))
            scores.append((priced.sum(axis=1), np.asarray((priced.sum(axis=0) + squares)[1:])))
        return scores

    def _mode_matrices(self, x: Array) -> list[Array]:
        # matrices of Z and all Z_j by mode, shape (1 + numbers, 6, 6)
        shape = len(self.program.modes), 1 + self.program.numbers, _entries(6)
        return [np.array([matrix_of(part, 6) for part in parts]) for parts in x[self.modes[0] :].reshape(shape)]

    @cached_property
    def _solver(self) -> ConeSolver:
        moments = [self._moment(k) for k in range(len(self.program.sizes))]
        return ConeSolver(self._matrix.tocoo(), np.concatenate(self.right), self.cones, moments, self._settings)


def _entries(size: int) -> int:
    return size * (size + 1) // 2


def _diagonal(size: int) -> Array:
    i, j, _ = triangle(size)
    return np.where(i == j, 1.0, 0.0)
