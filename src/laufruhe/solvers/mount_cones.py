"""Convex programs of mount stiffness for Clarabel: matrix inequalities and matrix fractions."""

from __future__ import annotations

import warnings
from typing import Any

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import SolverError
from laufruhe.prove.convex_functions import (
    Compliance,
    ConvexDuals,
    ConvexFunction,
    ConvexProgram,
    Eigenvalue,
    Linear,
    Residual,
)

Array = NDArray[np.float64]

_TIGHT = {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}


def solve_cones(program: ConvexProgram) -> tuple[Array, ConvexDuals] | None:
    """Stiffnesses and duals that Clarabel proposes; None where the limits cannot be met together.

    Raises
    ------
    SolverError
        If the solver stops without telling optimal from infeasible.
    """
    scale = np.maximum(np.abs(program.lower), np.abs(program.upper))
    scale = np.where(scale > 0.0, scale, 1.0)
    middle = 0.5 * (program.lower + program.upper)
    unit = float(np.trace(program.matrices.at(middle))) / 6.0 or 1.0
    y = cp.Variable(len(scale))
    slopes = (program.matrices.slopes * scale[:, None, None] / unit).reshape(len(scale), 36)
    matrix = cp.reshape(slopes.T @ y, (6, 6), order="C") + program.matrices.base / unit
    matrix = 0.5 * (matrix + matrix.T)
    size = max((abs(term.value(middle)) for _, term in program.terms), default=1.0)
    size = size if np.isfinite(size) and size > 0.0 else 1.0
    held: list[Any] = [y >= program.lower / scale, y <= program.upper / scale]
    tops, cones = [], []
    for weight, term in program.terms:
        top, cone = _over(term, y, scale, matrix, unit, held)
        tops.append(weight * top / size)
        cones.append(cone)
    limits = [_limited(each.function, each.maximum, y, scale, matrix, unit, held) for each in program.limits]
    least = cp.Problem(cp.Minimize(sum(tops) if tops else 0), held)
    with warnings.catch_warnings():
        # an inaccurate answer is judged by its certificate, not by a warning
        warnings.simplefilter("ignore")
        try:
            least.solve(solver=cp.CLARABEL, **_TIGHT)
        except cp.error.SolverError as error:
            raise SolverError(f"the cone solver gave up ({error})") from None
    if least.status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE):
        return None
    if y.value is None:
        raise SolverError(f"the cone solver stopped with status '{least.status}'")
    x = np.clip(np.asarray(y.value) * scale, program.lower, program.upper)
    duals = [_dual(constraint, factor, size) for constraint, factor in limits]
    vectors = tuple(_vector(cone) for cone in cones)
    return x, ConvexDuals(vectors, tuple(price for price, _ in duals), tuple(dual for _, dual in duals))


def _over(function: ConvexFunction, y: Any, scale: Array, matrix: Any, unit: float, held: list[Any]) -> tuple[Any, Any]:
    """An expression that is the function at the optimum, and the cone whose dual proves it."""
    if isinstance(function, Linear):
        return function.constant + (function.gradient * scale) @ y, None
    if isinstance(function, Compliance):
        return (function.factor / unit) * cp.matrix_frac(function.load, matrix), None
    if isinstance(function, Residual):
        top = cp.Variable()
        cone = cp.SOC(top, (unit / function.square) * (matrix @ function.along) - function.along)
        held.append(cone)
        return top, cone
    raise TypeError(f"{type(function).__name__} is limited, not minimised")


def _limited(
    function: ConvexFunction, maximum: float, y: Any, scale: Array, matrix: Any, unit: float, held: list[Any]
) -> tuple[Any, float]:
    """The constraint, and what its dual is to be multiplied by."""
    if isinstance(function, Eigenvalue):
        constraint = (maximum / unit) * np.eye(6) - function.sign * matrix >> 0
        factor = 1.0 / unit
    else:
        whole = abs(maximum) or 1.0
        constraint = _over(function, y, scale, matrix, unit, held)[0] / whole <= maximum / whole
        factor = 1.0 / whole
    held.append(constraint)
    return constraint, factor


def _dual(constraint: Any, factor: float, size: float) -> tuple[float, Array | None]:
    """Price of a constraint in its own unit, and its dual matrix where it has one."""
    if constraint.dual_value is None:
        return 0.0, None
    array = np.asarray(constraint.dual_value, dtype=float)
    if array.ndim < 2:
        return max(float(array), 0.0) * factor * size, None
    array = 0.5 * (array + array.T)
    return float(np.maximum(np.linalg.eigvalsh(array), 0.0).sum()) * factor * size, array


def _vector(cone: Any) -> Array | None:
    if cone is None or cone.dual_value is None:
        return None
    top, rows = (np.asarray(part, dtype=float).reshape(-1) for part in cone.dual_value)
    return -rows / max(float(top[0]), 1e-300)
