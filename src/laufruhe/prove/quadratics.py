"""Quadratic functions and multipliers for bounds by them: a solver proposes, what follows holds anyhow (E32, E33)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array, Indices

# least curvature that is left to a sum of quadratic functions of size one
CONVEX_BY = 1e-9
_TIGHT = {"verbose": False, "tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}


@dataclass(frozen=True, eq=False)
class Quadratic:
    """v' H v + 2 b' v + c."""

    matrix: Array
    vector: Array
    constant: float

    def plus(self, other: Quadratic, factor: float) -> Quadratic:
        """The sum with a multiple of another."""
        return Quadratic(
            self.matrix + factor * other.matrix,
            self.vector + factor * other.vector,
            self.constant + factor * other.constant,
        )

    @property
    def least(self) -> float:
        """Over all v; minus infinity where it is not strictly convex."""
        values, vectors = np.linalg.eigh(0.5 * (self.matrix + self.matrix.T))
        if values[0] <= 1e-12 * abs(values[-1]):
            return -math.inf
        return self.constant - float(np.sum((vectors.T @ self.vector) ** 2 / values))


def covering(matrices: Sequence[Array], felt: Array) -> Array:
    """A matrix not under any of these, with about the least trace of its product with `felt`, shape (n, n) (E32)."""
    unit = max(float(np.trace(matrix)) for matrix in matrices)
    size = len(matrices[0])
    # of every entry of the upper triangle
    rows, columns = np.triu_indices(size)
    steps = np.zeros((len(rows), size, size))
    steps[np.arange(len(rows)), rows, columns] = steps[np.arange(len(rows)), columns, rows] = 1.0
    cost = np.einsum("kij,ij->k", steps, 0.5 * (felt + felt.T))
    entries = _least(cost, [(-matrix / unit, steps) for matrix in matrices])
    found = np.zeros((size, size)) if entries is None else unit * np.tensordot(entries, steps, 1)
    # whatever the solver returned, lifted until it covers
    lacking = max(float(np.linalg.eigvalsh(matrix - found)[-1]) for matrix in matrices)
    return np.asarray(found + (max(lacking, 0.0) + 1e-9 * unit) * np.eye(size))


def best_prices(objective: Quadratic, held: Sequence[Quadratic]) -> Array:
    """Multipliers with which the limits bound the objective best from below (E33); zeros where none do."""
    if not held:
        return np.zeros(0)

    def bordered(of: Quadratic) -> Array:
        return np.block([[of.matrix, of.vector[:, None]], [of.vector[None], np.array([[of.constant]])]])

    size = len(objective.vector)
    level = np.zeros((size + 1, size + 1))
    level[size, size] = -1.0
    steps = np.array([*map(bordered, held), level])
    cost = -np.eye(len(steps))[-1]
    curved = bordered(objective) - CONVEX_BY * np.diag([1.0] * size + [0.0])
    found = _least(cost, [(curved, steps)], len(held))
    return np.zeros(len(held)) if found is None else found[:-1]


def _least(cost: Array, cones: Sequence[tuple[Array, Array]], held: int = 0) -> Array | None:
    """The x of least cost' x with every C + sum x_k S_k semidefinite and its first numbers not under zero.

    Nothing depends on how good it is: what follows from it is judged. None where it is no number.
    Handed to the solver directly, for these programs are small and many.
    """
    import clarabel
    from scipy.sparse import csc_array

    slopes = [-np.eye(held, len(cost)), *(-column(steps).T for _, steps in cones)]
    right = np.concatenate([np.zeros(held), *(column(constant) for constant, _ in cones)])
    kinds = [clarabel.NonnegativeConeT(held), *(clarabel.PSDTriangleConeT(len(constant)) for constant, _ in cones)]
    x = np.array(answered(cost, csc_array(np.concatenate(slopes)), right, kinds, _TIGHT).x, dtype=float)
    return x if np.all(np.isfinite(x)) else None


def answered(cost: Array, rows: Any, right: Array, cones: Sequence[Any], settings: Mapping[str, Any]) -> Any:
    """What Clarabel says of least cost' x with right - rows x in the cones."""
    import clarabel
    from scipy.sparse import csc_array

    told = clarabel.DefaultSettings()
    for name, value in settings.items():
        setattr(told, name, value)
    nothing = csc_array((len(cost), len(cost)))
    return clarabel.DefaultSolver(nothing, cost, rows, right, cones, told).solve()


@cache
def triangle(size: int) -> tuple[Indices, Indices, Array]:
    """Places of the upper triangle column by column, and the factors that keep lengths."""
    columns, rows = np.tril_indices(size)
    return rows, columns, np.where(rows == columns, 1.0, math.sqrt(2.0))


def column(matrices: Array) -> Array:
    """The upper triangles column by column, so that lengths are kept, shape (..., n (n + 1) / 2)."""
    i, j, factor = triangle(matrices.shape[-1])
    return np.asarray(matrices[..., i, j] * factor)
