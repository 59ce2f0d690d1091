"""Quadratic functions and multipliers for bounds by them: a solver proposes, what follows holds anyhow (E32, E33)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# least curvature that is left to a sum of quadratic functions of size one
CONVEX_BY = 1e-9
_TIGHT = {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}


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
    import cvxpy as cp

    cover = cp.Variable((size, size), symmetric=True)
    least = cp.Problem(cp.Minimize(cp.trace(felt @ cover)), [cover - matrix / unit >> 0 for matrix in matrices])
    found = _quietly(least, cover)
    found = np.zeros((size, size)) if found is None else unit * found
    # whatever the solver returned, lifted until it covers
    lacking = max(float(np.linalg.eigvalsh(matrix - found)[-1]) for matrix in matrices)
    return np.asarray(found + (max(lacking, 0.0) + 1e-9 * unit) * np.eye(size))


def best_prices(objective: Quadratic, held: Sequence[Quadratic]) -> Array:
    """Multipliers with which the limits bound the objective best from below (E33); zeros where none do."""
    if not held:
        return np.zeros(0)
    import cvxpy as cp

    size = len(objective.vector)
    prices, level = cp.Variable(len(held), nonneg=True), cp.Variable()

    def summed(part: str) -> Any:
        return getattr(objective, part) + sum(p * getattr(each, part) for p, each in zip(prices, held, strict=True))

    column = cp.reshape(summed("vector"), (size, 1), order="C")
    corner = cp.reshape(summed("constant") - level, (1, 1), order="C")
    matrix = cp.bmat([[summed("matrix") - CONVEX_BY * np.eye(size), column], [column.T, corner]])
    found = _quietly(cp.Problem(cp.Maximize(level), [matrix >> 0]), prices)
    return np.zeros(len(held)) if found is None else found


def _quietly(problem: Any, wanted: Any) -> Array | None:
    """The value of a variable at the optimum; None where the solver found none."""
    import cvxpy as cp

    with warnings.catch_warnings():
        # judged by what follows from it, not by a warning
        warnings.simplefilter("ignore")
        try:
            problem.solve(solver=cp.CLARABEL, **_TIGHT)
        except cp.error.SolverError:
            return None
    return None if wanted.value is None else np.asarray(wanted.value, dtype=float)
