"""Cone programs for Clarabel, scaled, and solved as dual programs.

    minimum q'x   with   b - A x in K,   the matrices X_k of x positive semidefinite
    minimum b'z   with   A_o' z = -q_o,   q_k + A_k' z positive semidefinite for each X_k,   z in the dual of K

K is a product of cones. A_k are the columns of X_k, A_o all others: X_k and x_o are multipliers of the second program,
which stores the matrices X_k once. Both are scaled alike: rows and columns by the roots of their largest entries,
repeatedly (Ruiz, RAL-TR-2001-034), rows of one cone alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array, vstack

from laufruhe.numerics.arrays import Array, Indices
from laufruhe.numerics.budget import is_time_over
from laufruhe.prove.mounts.dual_cones import LENGTH, MATRIX, ZERO
from laufruhe.solvers.mounts.convex import clarabel_cone

# rounds of scaling, and the range of scales
_ROUNDS, _MIN_SCALE, _MAX_SCALE = 10, 1e-4, 1e4


class ConeSolver:
    """Solver of one cone program for any cost vector.

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
