"""A program over cones, by its dual where that is solved sooner: where its matrices are large beside other cones.

    least q'x   with   b - A x in K,   the matrices X_k of x nowhere indefinite
    least b'z   with   A_o' z = -q_o,   q_k + A_k' z nowhere indefinite for every X_k,   z in the dual of K

with A_k the columns of X_k and A_o all others: X_k and x_o are multipliers of the second program. As the first is told
to a solver, an entry of X_k is a column and a row, and both are eliminated; as the second, it is a row. Their steps are
the same, so both are scaled as the first one is: rows and columns by the roots of their largest entries again and
again (Ruiz, RAL-TR-2001-034), those of a cone alike. As the second, rows of all other cones are variables and rows;
what costs most is full among the entries of a cone, so it is the larger square that should not stand there twice.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array, eye_array, vstack

from laufruhe.extensions.mount_relaxation.quadratics import solver_of
from laufruhe.numerics.arrays import Array, Indices

# rounds of the scaling, and what no scale is outside of
_ROUNDS, _LEAST, _MOST = 10, 1e-4, 1e4


@dataclass(frozen=True, eq=False)
class Cone:
    """Rows that stand together.

    Attributes
    ----------
    size
        Of its rows.
    kind
        As the solver has it; None where the rows are equations.
    is_alike
        Whether its rows have one scale.
    """

    size: int
    kind: Any
    is_alike: bool


class _Solver:
    """Of one program, for any cost.

    Parameters
    ----------
    rows, right
        A and b.
    cones
        K, row by row.
    matrices
        Columns of every X_k, of which there is one at least, and their cone.
    scaled
        Whether the program is scaled.
    settings
        Of the solver.
    """

    def __init__(
        self, rows: Any, right: Array, cones: Sequence[Cone], matrices: Sequence[tuple[Indices, Any]], scaled: bool,
        settings: Mapping[str, Any],
    ) -> None:  # fmt: skip
        count, width = rows.shape
        self._scaled, self._settings = scaled, {**settings, "equilibrate_enable": False}
        self._along: Array = np.ones(count)
        self._across: Array = np.ones(width)
        if scaled:
            self._along, self._across = _scales(rows, cones, matrices)
        self._told = csc_array(diags_array(self._along) @ rows @ diags_array(self._across))
        self._right = self._along * right
        self._own = np.concatenate([columns for columns, _ in matrices])
        self._solver: Any = None

    def solved(self, cost: Array) -> tuple[Array, Array, float]:
        """x and z, whatever the solver says of them, and q'x; infinite where it takes that for unbounded."""
        scaled = self._across * cost
        factor = _factor(scaled) if self._scaled else 1.0
        x, z, is_bounded = self._answer(factor * scaled)
        x = self._across * x
        return x, self._along * z / factor, float(cost @ x) if is_bounded else math.inf

    def _answer(self, cost: Array) -> tuple[Array, Array, bool]:
        """x and z as scaled, and whether there is a least value."""
        raise NotImplementedError


class Dual(_Solver):
    """By the dual."""

    def __init__(
        self, rows: Any, right: Array, cones: Sequence[Cone], matrices: Sequence[tuple[Indices, Any]], scaled: bool,
        settings: Mapping[str, Any],
    ) -> None:  # fmt: skip
        super().__init__(rows, right, cones, matrices, scaled, settings)
        count, width = rows.shape
        free = width - len(self._own)
        self._order = np.concatenate([np.setdiff1d(np.arange(width), self._own), self._own])
        self._signs = np.where(np.arange(width) < free, 1.0, -1.0)
        held = np.flatnonzero(np.repeat([cone.kind is not None for cone in cones], [cone.size for cone in cones]))
        self._aside = np.zeros(len(held))
        turned = diags_array(self._signs) @ self._told[:, self._order].T
        self._rows = csc_array(vstack([turned, -eye_array(count, format="csr")[held]]))
        self._kinds = [_zero(free), *(kind for _, kind in matrices), *(c.kind for c in cones if c.kind is not None)]

    def _answer(self, cost: Array) -> tuple[Array, Array, bool]:
        right = np.append(-self._signs * cost[self._order], self._aside)
        if self._solver is None:
            self._solver = solver_of(self._right, self._rows, right, self._kinds, self._settings)
        else:
            self._solver.update(b=right)
        found = self._solver.solve()
        x = np.empty(len(cost))
        x[self._order] = -self._signs * np.nan_to_num(np.array(found.z))[: len(cost)]
        # infeasible where the program itself is unbounded
        return x, np.nan_to_num(np.array(found.x)), not _is_infeasible(found)


class Plain(_Solver):
    """By the program as it is told."""

    def __init__(
        self, rows: Any, right: Array, cones: Sequence[Cone], matrices: Sequence[tuple[Indices, Any]], scaled: bool,
        settings: Mapping[str, Any],
    ) -> None:  # fmt: skip
        super().__init__(rows, right, cones, matrices, scaled, settings)
        count = len(self._own)
        entries = coo_array((-np.ones(count), (np.arange(count), self._own)), shape=(count, rows.shape[1]))
        self._rows = csc_array(vstack([self._told, entries]))
        self._sides = np.append(self._right, np.zeros(count))
        self._kinds = [_zero(cone.size) if cone.kind is None else cone.kind for cone in cones]
        self._kinds += [kind for _, kind in matrices]

    def _answer(self, cost: Array) -> tuple[Array, Array, bool]:
        if self._solver is None:
            self._solver = solver_of(cost, self._rows, self._sides, self._kinds, self._settings)
        else:
            self._solver.update(q=cost)
        found = self._solver.solve()
        x, z = (np.nan_to_num(np.array(each)) for each in (found.x, found.z))
        return x, z[: len(self._right)], not _is_unbounded(found)


def solver_for(
    rows: Any, right: Array, cones: Sequence[Cone], matrices: Sequence[tuple[Indices, Any]], scaled: bool,
    settings: Mapping[str, Any],
) -> Dual | Plain:  # fmt: skip
    """That which is sooner done: matrices, or all other cones, are full and stand in it once."""
    alone = sum(len(columns) ** 2 for columns, _ in matrices)
    others = sum(cone.size**2 for cone in cones if cone.is_alike)
    return (Dual if alone >= others else Plain)(rows, right, cones, matrices, scaled, settings)


def _factor(cost: Array) -> float:
    size = float(np.abs(cost).max(initial=0.0))
    return float(np.clip(1.0 / size, _LEAST, _MOST)) if size > 0.0 else 1.0


def _is_infeasible(found: Any) -> bool:
    import clarabel

    return found.status in (clarabel.SolverStatus.PrimalInfeasible, clarabel.SolverStatus.AlmostPrimalInfeasible)


def _is_unbounded(found: Any) -> bool:
    import clarabel

    return found.status in (clarabel.SolverStatus.DualInfeasible, clarabel.SolverStatus.AlmostDualInfeasible)


def _zero(size: int) -> Any:
    import clarabel

    return clarabel.ZeroConeT(size)


def _scales(rows: Any, cones: Sequence[Cone], matrices: Sequence[tuple[Indices, Any]]) -> tuple[Array, Array]:
    """Of rows and columns, as if every entry of a matrix had a row too."""
    count, width = rows.shape
    own = np.concatenate([columns for columns, _ in matrices])
    row, column = (np.append(a, b) for a, b in ((rows.row, count + np.arange(len(own))), (rows.col, own)))
    sizes = np.append(np.abs(rows.data), np.ones(len(own)))
    along, across = np.ones(count + len(own)), np.ones(width)
    by = [_grouped(place) for place in (row, column)]
    for _ in range(_ROUNDS):
        left = along[row] * sizes * across[column]
        along, across = (_nearer(scales, left, *order) for scales, order in zip((along, across), by, strict=True))
    at = 0
    for size, is_alike in [*((cone.size, cone.is_alike) for cone in cones), *((len(k), True) for k, _ in matrices)]:
        if is_alike:
            along[at : at + size] = along[at : at + size].mean()
        at += size
    across[own] = 1.0 / along[count:]
    return along[:count], across


def _grouped(place: Indices) -> tuple[Indices, Indices, Indices]:
    """An order in which what has the same place stands together; the places, and where each of them begins."""
    order = np.argsort(place, kind="stable")
    return order, *np.unique(place[order], return_index=True)


def _nearer(scales: Array, sizes: Array, order: Indices, there: Indices, first: Indices) -> Array:
    """Scales that bring the largest of the sizes at every place nearer to one."""
    found, largest = scales.copy(), np.maximum.reduceat(sizes[order], first)
    found[there] /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
    return np.clip(found, _LEAST, _MOST)
