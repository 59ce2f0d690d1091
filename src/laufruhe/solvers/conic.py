"""Least weighted sum of norms under limits, as a second-order cone program (P1).

The program is built once for a set of slopes; constants and limits may be parameters, so
that a sweep solves again without building again.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import SolverError
from laufruhe.load_models.affine import AffineNorm, AffineProblem, reach
from laufruhe.numerics.norms import Cones
from laufruhe.problem.decision import Domain
from laufruhe.prove.certificate import Multipliers
from laufruhe.solvers.direct_cones import TIGHT, ConicSolution

Array = NDArray[np.float64]


@dataclass
class _Cone:
    """One norm in the program, its rows in units of `unit`."""

    constant: Any
    value: Any
    cone: Any
    unit: float
    shape: tuple[int, int]
    row_factors: Array

    def dual_rows(self, objective_unit: float) -> Array:
        """mu Z of the rows [SI] (P2), in the objective's own unit."""
        z = -np.asarray(self.cone.dual_value[1], dtype=float).reshape(self.shape)
        return z * self.row_factors[:, None] * (objective_unit / self.unit)


class ConicProgram:
    """An affine problem as a cvxpy program, solved by Clarabel as often as wanted.

    Parameters
    ----------
    problem
        Its slopes, weights and domains are built in.
    reusable
        Whether constants and maxima may change between solves. What is gained in a
        sweep is paid once, when the program is compiled.
    """

    def __init__(self, problem: AffineProblem, reusable: bool = False) -> None:
        self._problem = problem
        self._reusable = reusable
        # decisions in units of what they may need, rows in units of what these can reach
        self._y = cp.Variable(problem.size)
        self._unit = reach(problem, [norm for _, norm in problem.terms])
        self._terms = [self._cone(norm, self._unit) for _, norm in problem.terms]
        self._limits = [self._cone(norm, reach(problem, [norm])) for _, norm in problem.limits]
        self._maxima = [
            self._number(np.array(maximum / cone.unit))
            for (maximum, _), cone in zip(problem.limits, self._limits, strict=True)
        ]
        least = [weight * cone.value for (weight, _), cone in zip(problem.terms, self._terms, strict=True)]
        constraints = [cone.cone for cone in (*self._terms, *self._limits)]
        constraints += [cone.value <= most for cone, most in zip(self._limits, self._maxima, strict=True)]
        constraints += [
            c
            for domain in problem.domains
            for c in membership(domain, self._y[domain.columns], float(problem.units[domain.start]))
        ]
        self._program = cp.Problem(cp.Minimize(sum(least)), constraints)

    def _cone(self, norm: AffineNorm, unit: float) -> _Cone:
        """V0 + B x in a second-order cone a row, or in one cone for a root mean square."""
        k, d = norm.constant.shape
        constant = self._number(norm.constant / unit)
        slope = (norm.slope * (self._problem.units / unit)).reshape(k * d, -1)
        rows = cp.reshape(slope @ self._y, (k, d), order="C") + constant
        cones = norm.norm.cones(norm.grid)
        value, cone = held_norm(cones, rows, norm.grid.steps)
        return _Cone(constant, value, cone, unit, (k, d), cones.factors)

    def _number(self, value: Array) -> Any:
        return cp.Parameter(value.shape, value=value) if self._reusable else cp.Constant(value)

    def solve(self, problem: AffineProblem | None = None) -> ConicSolution:
        """Solve with the constants and maxima of `problem`, whose slopes must be those built in.

        Raises
        ------
        SolverError
            If the solver stops without telling optimal from infeasible.
        """
        if problem is not None:
            self._take(problem)
        problem = self._problem if problem is None else problem
        with warnings.catch_warnings():
            # an inaccurate answer is judged by its certificate, not by a warning
            warnings.simplefilter("ignore")
            try:
                self._program.solve(solver=cp.CLARABEL, **TIGHT)
            except cp.error.SolverError:
                self._solve_loosely()
        return self._answer(problem)

    def _solve_loosely(self) -> None:
        """At the solver's own tolerances, which tell limits that all but contradict each other from those that do."""
        try:
            self._program.solve(solver=cp.CLARABEL)
        except cp.error.SolverError as error:
            raise SolverError(f"the cone solver gave up ({error})") from None

    def _take(self, problem: AffineProblem) -> None:
        if not self._reusable:
            raise ValueError("a program that is not reusable cannot take other constants")
        for cone, (_, norm) in zip((*self._terms, *self._limits), (*problem.terms, *problem.limits), strict=True):
            cone.constant.value = norm.constant / cone.unit
        for most, cone, (maximum, _) in zip(self._maxima, self._limits, problem.limits, strict=True):
            most.value = maximum / cone.unit

    def _answer(self, problem: AffineProblem) -> ConicSolution:
        status, stats = self._program.status, self._program.solver_stats
        seconds, iterations = float(stats.solve_time or 0.0), int(stats.num_iters or 0)
        if status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE):
            return ConicSolution(None, Multipliers((), ()), seconds, iterations)
        if self._y.value is None:
            raise SolverError(f"the cone solver stopped with status '{status}'")
        x = np.asarray(self._y.value) * self._problem.units
        for domain in problem.domains:
            x[domain.columns] = domain.project(x)
        terms = tuple(
            cone.dual_rows(self._unit) / weight for cone, (weight, _) in zip(self._terms, problem.terms, strict=True)
        )
        limits = tuple(cone.dual_rows(self._unit) for cone in self._limits)
        return ConicSolution(x, Multipliers(terms, limits), seconds, iterations)


def held_norm(cones: Cones, rows: Any, steps: int) -> tuple[Any, Any]:
    """A norm of rows (k, d), signals of `steps` rows, as a linear expression, and the cones that hold it (P1)."""
    heads = cp.Variable(len(cones.value))
    if cones.centred:
        k, d = rows.shape
        centres = cp.Variable((k // steps, d))
        rows = rows - np.kron(np.eye(k // steps), np.ones((steps, 1))) @ centres
    if cones.whole:
        return heads[0], cp.SOC(heads[0], cp.vec(cp.multiply(cones.factors[:, None], rows), order="C"))
    tops = heads if len(cones.value) == len(cones.head) else heads[cones.head]
    return cones.value @ heads, cp.SOC(tops, rows, axis=1)


def membership(domain: Domain, y: Any, unit: float, on: Any = 1.0) -> list[Any]:
    """The decision's own set, in units of a size (P4), shrunk to nothing where `on` is zero (S10)."""
    low, high = domain.set.lower / unit, domain.set.upper / unit
    if domain.width == 1:
        return [y >= low * on, y <= high * on]
    inside: list[Any] = [cp.SOC(high * cp.Constant(1.0) * on, y)]
    if len(domain.set.edges):
        (ax, ay), (bx, by) = domain.set.edges
        inside += [ax * y[1] - ay * y[0] >= 0.0, bx * y[1] - by * y[0] <= 0.0]
    return inside


def lightest(problem: AffineProblem, x: Array, still: Array, weights: Sequence[float]) -> Array:
    """Among x + still z, the decisions of least weighted size that stay in their sets and under mass limits.

    Parameters
    ----------
    problem
        Domains and limits.
    x
        An optimal decision vector.
    still
        Shape (n, m): directions that no load can tell apart.
    weights
        Of every decision's size.
    """
    total = sum(w * float(np.hypot.reduce(x[d.columns])) for w, d in zip(weights, problem.domains, strict=True))
    # nothing lighter is larger than all of this together, whatever the bounds
    units = [
        min(d.scale, total / w) if w * total > 0.0 else d.scale for w, d in zip(weights, problem.domains, strict=True)
    ]
    scales = np.repeat(units, [d.width for d in problem.domains])
    z = cp.Variable(still.shape[1])
    step = still * (np.abs(x).max() or 1.0)
    y = x / scales + (step / scales[:, None]) @ z
    sizes = [
        w * unit / max(units) * cp.norm(y[d.columns])
        for w, unit, d in zip(weights, units, problem.domains, strict=True)
    ]
    held = [c for d, unit in zip(problem.domains, units, strict=True) for c in membership(d, y[d.columns], unit)]
    program = cp.Problem(cp.Minimize(cp.sum(cp.hstack(sizes))), [*held, *_masses_held(problem, x, step, z)])
    with warnings.catch_warnings():
        # the loads stay what they are however accurate this is
        warnings.simplefilter("ignore")
        try:
            program.solve(solver=cp.CLARABEL)
        except cp.error.SolverError:
            return x
    if z.value is None:
        return x
    lighter = x + step @ np.asarray(z.value)
    for domain in problem.domains:
        lighter[domain.columns] = domain.project(lighter)
    return np.asarray(lighter)


def _masses_held(problem: AffineProblem, x: Array, step: Array, z: Any) -> list[Any]:
    """Limits on masses, along the directions that no load can tell apart."""
    held = []
    for maximum, norm in problem.limits:
        moves = np.einsum("kdn,nm->kdm", norm.slope, step)
        if np.any(moves != 0.0) and norm.norm.sums_lengths:
            k, d = norm.constant.shape
            rows = norm.rows(x) + cp.reshape(moves.reshape(k * d, -1) @ z, (k, d), order="C")
            held.append(norm.grid.weights @ cp.norm(rows, axis=1) <= max(maximum, norm.value(x)))
    return held
