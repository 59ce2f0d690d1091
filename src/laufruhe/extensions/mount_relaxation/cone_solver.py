"""Cone programs for Clarabel, scaled, and solved by their dual where their matrices are large.

    least q'x   with   b - A x in K,   the matrices X_k of x positive semidefinite
    least b'z   with   A_o' z = -q_o,   q_k + A_k' z positive semidefinite for every X_k,   z in the dual of K

A_k are the columns of X_k and A_o all others: X_k and x_o are multipliers of the second program. In the first program
an entry of X_k is a column and a row of the solver, in the second a row; rows of all other cones are variables and
rows of the second. The form is taken in which the larger matrices stand once. Both are scaled as the first one is:
rows and columns by the roots of their largest entries, repeatedly (Ruiz, RAL-TR-2001-034), those of a cone alike.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array, eye_array, vstack

from laufruhe.numerics.arrays import Array, Indices
from laufruhe.numerics.budget import passed

# rounds of the scaling, and the range of scales
_ROUNDS, _LEAST, _MOST = 10, 1e-4, 1e4


@dataclass(frozen=True, eq=False)
class Cone:
    """Rows of one cone.

    Attributes
    ----------
    kind
        The solver's cone; None where the rows are equations.
    has_one_scale
        Whether its rows are scaled alike.
    """

    size: int
    kind: Any
    has_one_scale: bool


class _ConeSolver:
    """Solver of one program for any cost.

    Parameters
    ----------
    rows, right
        A and b.
    cones
        K, row by row.
    matrices
        Columns of every X_k, of which there is one at least, and their cone.
    settings
        Of the solver.
    """

    def __init__(
        self, rows: Any, right: Array, cones: Sequence[Cone], matrices: Sequence[tuple[Indices, Any]],
        settings: Mapping[str, Any],
    ) -> None:  # fmt: skip
        self._settings = {**settings, "equilibrate_enable": False}
        self._row_scales, self._column_scales = _scales(rows, cones, matrices)
        self._scaled_rows = csc_array(diags_array(self._row_scales) @ rows @ diags_array(self._column_scales))
        self._right = self._row_scales * right
        self._entries = np.concatenate([columns for columns, _ in matrices])
        self._solver: Any = None

    def solve(self, cost: Array) -> tuple[Array, Array, float]:
        """Return x and z, whatever the solver says of them, and q'x; infinite where it takes that for unbounded."""
        scaled = self._column_scales * cost
        size = float(np.abs(scaled).max(initial=0.0))
        factor = float(np.clip(1.0 / size, _LEAST, _MOST)) if size > 0.0 else 1.0
        x, z, is_bounded = self._solve_scaled(factor * scaled)
        x = self._column_scales * x
        return x, self._row_scales * z / factor, float(cost @ x) if is_bounded else math.inf

    @abstractmethod
    def _solve_scaled(self, cost: Array) -> tuple[Array, Array, bool]:
        """Return scaled x and z, and whether there is a least value."""


class DualSolver(_ConeSolver):
    """Solve the dual."""

    def __init__(
        self, rows: Any, right: Array, cones: Sequence[Cone], matrices: Sequence[tuple[Indices, Any]],
        settings: Mapping[str, Any],
    ) -> None:  # fmt: skip
        super().__init__(rows, right, cones, matrices, settings)
        count, width = rows.shape
        free = width - len(self._entries)
        self._order = np.concatenate([np.setdiff1d(np.arange(width), self._entries), self._entries])
        self._signs = np.where(np.arange(width) < free, 1.0, -1.0)
        coned = np.flatnonzero(np.repeat([cone.kind is not None for cone in cones], [cone.size for cone in cones]))
        self._zeros = np.zeros(len(coned))
        transposed = diags_array(self._signs) @ self._scaled_rows[:, self._order].T
        self._rows = csc_array(vstack([transposed, -eye_array(count, format="csr")[coned]]))
        self._kinds = [
            _zero_cone(free),
            *(kind for _, kind in matrices),
            *(c.kind for c in cones if c.kind is not None),
        ]

    def _solve_scaled(self, cost: Array) -> tuple[Array, Array, bool]:
        import clarabel

        right = np.append(-self._signs * cost[self._order], self._zeros)
        if self._solver is None:
            self._solver = new_solver(self._right, self._rows, right, self._kinds, self._settings)
        else:
            self._solver.update(b=right)
        solution, status = self._solver.solve(), clarabel.SolverStatus
        x = np.empty(len(cost))
        x[self._order] = -self._signs * np.nan_to_num(np.array(solution.z))[: len(cost)]
        # the dual is infeasible where the program is unbounded
        is_bounded = solution.status not in (status.PrimalInfeasible, status.AlmostPrimalInfeasible)
        return x, np.nan_to_num(np.array(solution.x)), is_bounded


class PrimalSolver(_ConeSolver):
    """Solve the program as it is stated."""

    def __init__(
        self, rows: Any, right: Array, cones: Sequence[Cone], matrices: Sequence[tuple[Indices, Any]],
        settings: Mapping[str, Any],
    ) -> None:  # fmt: skip
        super().__init__(rows, right, cones, matrices, settings)
        count = len(self._entries)
        entries = coo_array((-np.ones(count), (np.arange(count), self._entries)), shape=(count, rows.shape[1]))
        self._rows = csc_array(vstack([self._scaled_rows, entries]))
        self._sides = np.append(self._right, np.zeros(count))
        self._kinds = [_zero_cone(cone.size) if cone.kind is None else cone.kind for cone in cones]
        self._kinds += [kind for _, kind in matrices]

    def _solve_scaled(self, cost: Array) -> tuple[Array, Array, bool]:
        import clarabel

        if self._solver is None:
            self._solver = new_solver(cost, self._rows, self._sides, self._kinds, self._settings)
        else:
            self._solver.update(q=cost)
        solution, status = self._solver.solve(), clarabel.SolverStatus
        x, z = (np.nan_to_num(np.array(each)) for each in (solution.x, solution.z))
        return x, z[: len(self._right)], solution.status not in (status.DualInfeasible, status.AlmostDualInfeasible)


def solver_for(
    rows: Any, right: Array, cones: Sequence[Cone], matrices: Sequence[tuple[Indices, Any]],
    settings: Mapping[str, Any],
) -> DualSolver | PrimalSolver:  # fmt: skip
    """Return the solver in which the larger ones stand once: the matrices X_k, or the cones of one scale."""
    of_matrices = sum(len(columns) ** 2 for columns, _ in matrices)
    of_cones = sum(cone.size**2 for cone in cones if cone.has_one_scale)
    solver = DualSolver if of_matrices >= of_cones else PrimalSolver
    return solver(rows, right, cones, matrices, settings)


def new_solver(cost: Array, rows: Any, right: Array, cones: Sequence[Any], settings: Mapping[str, Any]) -> Any:
    """Return Clarabel's solver of least cost' x with right - rows x in the cones; it stops when time is over."""
    import clarabel

    own = clarabel.DefaultSettings()
    for name, value in settings.items():
        setattr(own, name, value)
    no_squares = csc_array((len(cost), len(cost)))
    solver = clarabel.DefaultSolver(no_squares, cost, rows, right, cones, own)
    solver.set_termination_callback(lambda _: passed())
    return solver


def _zero_cone(size: int) -> Any:
    import clarabel

    return clarabel.ZeroConeT(size)


def _scales(rows: Any, cones: Sequence[Cone], matrices: Sequence[tuple[Indices, Any]]) -> tuple[Array, Array]:
    """Return scales of rows and columns, as if every entry of a matrix had a row too."""
    count, width = rows.shape
    entries = np.concatenate([columns for columns, _ in matrices])
    row = np.append(rows.row, count + np.arange(len(entries)))
    column = np.append(rows.col, entries)
    sizes = np.append(np.abs(rows.data), np.ones(len(entries)))
    scales = [np.ones(count + len(entries)), np.ones(width)]
    groups = []
    for place in (row, column):
        order = np.argsort(place, kind="stable")
        groups.append((order, *np.unique(place[order], return_index=True)))
    for _ in range(_ROUNDS):
        scaled = scales[0][row] * sizes * scales[1][column]
        for k, (order, there, first) in enumerate(groups):
            largest = np.maximum.reduceat(scaled[order], first)
            scales[k] = scales[k].copy()
            scales[k][there] /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
            scales[k] = np.clip(scales[k], _LEAST, _MOST)
    at, (along, across) = 0, scales
    blocks = [(cone.size, cone.has_one_scale) for cone in cones] + [(len(columns), True) for columns, _ in matrices]
    for size, has_one_scale in blocks:
        if has_one_scale:
            along[at : at + size] = along[at : at + size].mean()
        at += size
    across[entries] = 1.0 / along[count:]
    return along[:count], across


@cache
def triangle(size: int) -> tuple[Indices, Indices, Array]:
    """Return rows and columns of the upper triangle column by column, and the factors that keep lengths."""
    columns, rows = np.tril_indices(size)
    return rows, columns, np.where(rows == columns, 1.0, math.sqrt(2.0))


def column(matrices: Array) -> Array:
    """Return the upper triangles column by column, so that lengths are kept, shape (..., n (n + 1) / 2)."""
    i, j, factor = triangle(matrices.shape[-1])
    return np.asarray(matrices[..., i, j] * factor)


def matrix_of(entries: Array, size: int) -> Array:
    """Return the symmetric matrix of such a triangle, shape (size, size)."""
    i, j, factor = triangle(size)
    matrix = np.zeros((size, size))
    matrix[i, j] = matrix[j, i] = entries / factor
    return matrix
