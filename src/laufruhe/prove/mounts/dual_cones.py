"""Multipliers of cone programs: projection on dual cones, which makes any multipliers prove a bound (E44)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from laufruhe.numerics.arrays import Array, Indices

# kinds of cones
ZERO, SIDES, LENGTH, MATRIX = "zero", "nonnegative", "second order", "semidefinite"


def in_dual_cones(multipliers: Array, cones: Sequence[tuple[str, int]]) -> Array:
    """Return multipliers in the dual cones, near given multipliers; `cones` are kinds and counts of rows."""
    parts = np.split(multipliers, np.cumsum([count for _, count in cones])[:-1])
    for k, (cone, count) in enumerate(cones):
        if cone == SIDES:
            parts[k] = np.maximum(parts[k], 0.0)
        elif cone == LENGTH:
            parts[k] = np.append(max(parts[k][0], float(np.linalg.norm(parts[k][1:]))), parts[k][1:])
        elif cone == MATRIX:
            values, vectors = np.linalg.eigh(matrix_of(parts[k], math.isqrt(2 * count)))
            parts[k] = column((vectors * np.maximum(values, 0.0)) @ vectors.T)
    return np.concatenate(parts)


@cache
def triangle(size: int) -> tuple[Indices, Indices, Array]:
    """Return rows and columns of the upper triangle, column by column, and the factors that preserve norms."""
    columns, rows = np.tril_indices(size)
    return rows, columns, np.where(rows == columns, 1.0, math.sqrt(2.0))


def column(matrices: Array) -> Array:
    """Return upper triangles column by column, scaled to preserve norms, shape (..., n (n + 1) / 2)."""
    i, j, factor = triangle(matrices.shape[-1])
    return np.asarray(matrices[..., i, j] * factor)


def matrix_of(entries: Array, size: int) -> Array:
    """Return the symmetric matrix, shape (size, size), from its entries in the order of `column`."""
    i, j, factor = triangle(size)
    matrix = np.zeros((size, size))
    matrix[i, j] = matrix[j, i] = entries / factor
    return matrix
