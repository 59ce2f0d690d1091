"""Programs over semidefinite cones, handed to the solver directly: what follows from its multipliers is judged."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from laufruhe.numerics.arrays import Array, Indices
from laufruhe.numerics.budget import passed


def solver_of(cost: Array, rows: Any, right: Array, cones: Sequence[Any], settings: Mapping[str, Any]) -> Any:
    """Clarabel's solver of least cost' x with right - rows x in the cones."""
    import clarabel

    told = clarabel.DefaultSettings()
    for name, value in settings.items():
        setattr(told, name, value)
    nothing = csc_array((len(cost), len(cost)))
    solver = clarabel.DefaultSolver(nothing, cost, rows, right, cones, told)
    # what it says where time is over proves what follows from it too
    solver.set_termination_callback(lambda _: passed())
    return solver


@cache
def triangle(size: int) -> tuple[Indices, Indices, Array]:
    """Places of the upper triangle column by column, and the factors that keep lengths."""
    columns, rows = np.tril_indices(size)
    return rows, columns, np.where(rows == columns, 1.0, math.sqrt(2.0))


def column(matrices: Array) -> Array:
    """The upper triangles column by column, so that lengths are kept, shape (..., n (n + 1) / 2)."""
    i, j, factor = triangle(matrices.shape[-1])
    return np.asarray(matrices[..., i, j] * factor)


def matrix_of(entries: Array, size: int) -> Array:
    """From such a triangle, shape (size, size)."""
    i, j, factor = triangle(size)
    matrix = np.zeros((size, size))
    matrix[i, j] = matrix[j, i] = entries / factor
    return matrix
