"""Solve convex programs of mount stiffness by Clarabel: matrix inequalities and matrix fractions."""

from __future__ import annotations

import warnings
from contextlib import suppress
from dataclasses import replace
from typing import Any

import cvxpy as cp
import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.physics.mount_numbers import AxisResidual
from laufruhe.prove.mounts.convex_functions import (
    Compliance,
    ConvexDuals,
    ConvexFunction,
    ConvexProgram,
    Eigenvalue,
    LinearFunction,
    Residual,
    excludes,
)
from laufruhe.solvers.cones.conic import ATTEMPTS

# a bound from the duals of a matrix inequality has these tolerances
TIGHT = {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}


def solve_cones(program: ConvexProgram) -> tuple[Array, ConvexDuals] | None:
    """Return stiffnesses [N/m], shape (n,), and duals; None if duals prove that the limits contradict each other.

    If Clarabel fails with all settings, minimise the violation of the limits instead, which is always feasible. If that
    fails too, return the middle of the box.
    """
    solution = _Program(program).solve()
    if solution is not None:
        return solution
    relaxed = _Program(replace(program, terms=()), relaxed=True).solve()
    if relaxed is None:
        return 0.5 * (program.lower + program.upper), ConvexDuals.none(program)
    x, duals = relaxed
    return None if excludes(program, x, duals) else (x, ConvexDuals.none(program))


class _Program:
    """Scaled convex program in cvxpy.

    If `relaxed` is True, the objective includes the largest relative violation of the limits.
    """

    def __init__(self, program: ConvexProgram, relaxed: bool = False) -> None:
        self.program = program
        lower, upper = program.lower, program.upper
        scale = np.maximum(np.abs(lower), np.abs(upper))
        self.scale = np.where(scale > 0.0, scale, 1.0)
        middle = 0.5 * (lower + upper)
        self.unit = float(np.trace(program.matrices.at(middle))) / 6.0 or 1.0
        self.y = cp.Variable(len(lower))
        slopes = (program.matrices.slopes * self.scale[:, None, None] / self.unit).reshape(len(lower), 36)
        matrix = cp.reshape(slopes.T @ self.y, (6, 6), order="C") + program.matrices.base / self.unit
        self.matrix = 0.5 * (matrix + matrix.T)
        size = max((abs(term.value(middle)) for _, term in program.terms), default=1.0)
        self.size = size if np.isfinite(size) and size > 0.0 else 1.0
        self._constraints: list[Any] = [self.y >= lower / self.scale, self.y <= upper / self.scale]
        terms, self._cones = [], []
        for weight, term in program.terms:
            epigraph, cone = self._epigraph(term)
            terms.append(weight * epigraph / self.size)
            self._cones.append(cone)
        violation = cp.Variable(nonneg=True) if relaxed else 0.0
        self._limits = [self._limited(limit.function, limit.maximum, violation) for limit in program.limits]
        self._problem = cp.Problem(cp.Minimize(sum(terms) + violation if terms or relaxed else 0), self._constraints)

    def solve(self) -> tuple[Array, ConvexDuals] | None:
        """Return stiffnesses within their bounds [N/m], shape (n,), and duals, by the first settings that succeed."""
        for settings in (TIGHT, *ATTEMPTS):
            with warnings.catch_warnings():
                # the certificate measures the accuracy
                warnings.simplefilter("ignore")
                with suppress(cp.error.SolverError):
                    self._problem.solve(solver=cp.CLARABEL, **settings)
            if self._problem.status == cp.OPTIMAL:
                x = np.clip(np.asarray(self.y.value) * self.scale, self.program.lower, self.program.upper)
                limits = [_dual(constraint, factor, self.size) for constraint, factor in self._limits]
                prices, duals = tuple(price for price, _ in limits), tuple(dual for _, dual in limits)
                return np.asarray(x), ConvexDuals(tuple(_vector(cone) for cone in self._cones), prices, duals)
        return None

    def _epigraph(self, function: ConvexFunction) -> tuple[Any, Any]:
        # expression of the function, and the cone of its dual vector
        if isinstance(function, LinearFunction):
            return function.constant + (function.gradient * self.scale) @ self.y, None
        if isinstance(function, Compliance):
            return (function.factor / self.unit) * cp.matrix_frac(function.load, self.matrix), None
        if isinstance(function, Residual):
            return self._residual(function.axis)
        raise TypeError(f"{type(function).__name__} may be limited, not minimised")

    def _residual(self, axis: AxisResidual) -> tuple[Any, Any]:
        """Return the expression of the torque-roll residual and the constraint that defines it.

        The squared angular frequency of the roll motion is a variable within bounds.
        """
        response = axis.stiffness_part(self.program.matrices.at(0.5 * (self.program.lower + self.program.upper)))
        unit = float(np.linalg.norm(response)) or 1.0
        square_unit = unit / float(np.linalg.norm(axis.mass))
        epigraph, square = cp.Variable(), cp.Variable()
        self._constraints.append(square >= axis.minimum / square_unit)
        if axis.maximum < np.inf:
            self._constraints.append(square <= axis.maximum / square_unit)
        rows = (self.unit / unit) * (axis.left @ self.matrix @ axis.right) - square * (square_unit / unit) * axis.mass
        cone = cp.SOC(epigraph, rows)
        self._constraints.append(cone)
        return unit * epigraph, cone

    def _limited(self, function: ConvexFunction, maximum: float, violation: Any) -> tuple[Any, float]:
        # constraint, and the factor from its dual to program units
        scale = abs(maximum) or 1.0
        if isinstance(function, Eigenvalue):
            bound = (maximum + violation * scale) / self.unit
            constraint, factor = bound * np.eye(6) - function.sign * self.matrix >> 0, 1.0 / self.unit
        else:
            constraint, factor = self._epigraph(function)[0] / scale <= maximum / scale + violation, 1.0 / scale
        self._constraints.append(constraint)
        return constraint, factor


def _dual(constraint: Any, factor: float, size: float) -> tuple[float, Array | None]:
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
    head, rows = (np.asarray(part, dtype=float).reshape(-1) for part in cone.dual_value)
    return -rows / max(float(head[0]), 1e-300)
