"""Least sum of norms under limits as a problem of cvxpy, for own constraints and any solver (P1).

The decision variables are those of the file in SI units. Forces are affine in them. Every measure is an epigraph
variable above the cones of its norm.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np

from laufruhe.errors import ModelError, SolverError, refused
from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem, typical_size
from laufruhe.load_models.labelled_rows import affine_problem_of, named_values, part_names, row_axes, samples_of
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import Domain
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Multipliers
from laufruhe.solvers.cones.cone_program import ConicSolution, project_on_sets

_EXCLUDED = (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE)


@dataclass(frozen=True, eq=False)
class NormExpression:
    """Norm of load rows in a problem of cvxpy.

    Attributes
    ----------
    rows
        Load rows V0 + B x as an affine expression, shape (k, d) [SI].
    value
        Expression above the norm, and equal to it where it is minimised or its limit binds [SI].
    constraints
        Constraints between rows and value; the first ones have the dual rows.
    unit
        Unit in which these constraints measure the norm [SI].
    axes
        Labels of the rows and their components by dimension, such as mount, angle and direction.
    """

    norm: AffineNorm
    rows: Any
    value: Any
    constraints: tuple[Any, ...]
    unit: float
    axes: Mapping[str, Sequence[Any] | Array]

    @classmethod
    def of(cls, norm: AffineNorm, x: Any, unit: float, axes: Mapping[str, Sequence[Any] | Array]) -> NormExpression:
        """State a norm of rows that are affine in the expression x, shape (n,)."""
        (k, d), cones = norm.constant.shape, norm.norm.cones(norm.grid)
        rows = cp.reshape(norm.constant.ravel() + norm.slope.reshape(k * d, -1) @ x, (k, d), order="C")
        heads = cp.Variable(len(cones.value))
        inside, further = rows / unit, []
        if cones.centred:
            signals = k // norm.grid.steps
            inside = inside - np.repeat(np.eye(signals), norm.grid.steps, axis=0) @ cp.Variable((signals, d))
        inside = cp.multiply(cones.factors[:, None], inside)
        if cones.is_single:
            first = [cp.SOC(heads[0], cp.vec(inside, order="C"))]
        elif d == 1:
            # linear, so that solvers of linear programs accept it
            first = [inside[:, 0] <= heads[cones.head], -inside[:, 0] <= heads[cones.head]]
        else:
            first = [cp.SOC(heads[cones.head], inside, axis=1)]
        if cones.linear_rows is not None:
            row, head, factors = cones.linear_rows
            matrix = np.zeros((int(row.max()) + 1, len(cones.value)))
            np.add.at(matrix, (row, head), factors)
            further.append(matrix @ heads <= 0.0)
        if cones.squares is not None:
            a, b, c = (heads[indices] for indices in cones.squares)
            further.append(cp.SOC(b + c, cp.vstack([b - c, 2.0 * a])))
        return cls(norm, rows, unit * (cones.value @ heads), (*first, *further), unit, axes)

    def at(self, **labels: Any) -> Any:
        """Return the rows with these labels, such as mount="left", as an affine expression, shape (rows, components).

        With a direction it has the shape (rows,).
        """
        import xarray as xr

        shape = [len(labels) for labels in self.axes.values()]
        indices = np.arange(self.rows.size).reshape(shape)
        selected = xr.DataArray(indices, self.axes, list(self.axes)).sel(labels).to_numpy()
        chosen = cp.vec(self.rows, order="C")[selected.ravel()]
        d = shape[-1]
        return chosen if list(self.axes)[-1] in labels else cp.reshape(chosen, (selected.size // d, d), order="C")

    @property
    def dual_rows(self) -> Array:
        """Dual rows of a solution, shape (k, d); zero where the solver gives none."""
        cones, (k, d) = self.norm.norm.cones(self.norm.grid), self.norm.constant.shape
        first = self.constraints[0]
        if not cones.is_single and d == 1:
            z = _finite(first.dual_value, (k, 1)) - _finite(self.constraints[1].dual_value, (k, 1))
        else:
            duals = first.dual_value or (None, None)
            # the duals of cvxpy point against the rows
            z = -_finite(duals[1], (k, d))
        return np.asarray(z * cones.factors[:, None] / self.unit)


def _finite(values: Any, shape: tuple[int, ...]) -> Array:
    numbers = np.zeros(shape) if values is None else np.asarray(values, dtype=float)
    return np.asarray(np.nan_to_num(numbers.reshape(shape), posinf=0.0, neginf=0.0))


class BalanceProgram(cp.Problem):  # type: ignore[misc]
    """Balance problem in cvxpy, to be solved, or to be taken apart and extended.

    Attributes
    ----------
    decisions
        Variables by the names of the open numbers [SI]: shape (1,), or real and imaginary part of an unbalance with an
        open angle, shape (2,) (C4).
    terms, limits
        Norms of the objective and of the limits, by name.
    """

    def __init__(
        self, affine: AffineProblem, terms: Mapping[str, Mapping[str, Any]], limits: Mapping[str, Mapping[str, Any]]
    ) -> None:
        self._affine = affine
        self.decisions = {d.decision.name: cp.Variable(d.width, name=d.decision.name) for d in affine.domains}
        x = cp.hstack(list(self.decisions.values())) if affine.domains else np.zeros(0)
        unit = typical_size(affine, [norm for _, norm in affine.terms])
        self.terms = {
            name: NormExpression.of(norm, x, unit, axes)
            for (name, axes), (_, norm) in zip(terms.items(), affine.terms, strict=True)
        }
        self.limits = {
            name: NormExpression.of(norm, x, limit or typical_size(affine, [norm]), axes)
            for (name, axes), (limit, norm) in zip(limits.items(), affine.limits, strict=True)
        }
        constraints = [bound for d in affine.domains for bound in _bounds(d, self.decisions[d.decision.name])]
        for norm in (*self.terms.values(), *self.limits.values()):
            constraints += norm.constraints
        for (maximum, _), norm in zip(affine.limits, self.limits.values(), strict=True):
            constraints.append(norm.value / norm.unit <= maximum / norm.unit)
        weighted = zip(affine.terms, self.terms.values(), strict=True)
        super().__init__(cp.Minimize(sum((weight * term.value for (weight, _), term in weighted), 0.0)), constraints)

    @property
    def values(self) -> dict[str, float]:
        """Values of the open numbers in a solution, moved into their sets, by the names that results use [SI, rad]."""
        return named_values(self._affine.domains, self._vector)

    @property
    def multipliers(self) -> dict[str, Array]:
        """Dual rows of a solution by the name of the term or limit, shape (k, d), for `laufruhe.certify`."""
        pairs = zip(self._affine.terms, self.terms.items(), strict=True)
        terms = {name: norm.dual_rows / (weight or 1.0) for (weight, _), (name, norm) in pairs}
        return terms | {name: norm.dual_rows for name, norm in self.limits.items()}

    @property
    def _vector(self) -> Array:
        # a number that no constraint keeps has no value, and NaN of a solver counts as zero
        parts = [_finite(variable.value, variable.shape) for variable in self.decisions.values()]
        return project_on_sets(self._affine, np.concatenate([np.zeros(0), *parts]))

    def solution(self) -> ConicSolution:
        """Return decision vector and dual rows after a solve; no vector if the solver excludes every design."""
        count, rows = len(self._affine.terms), tuple(self.multipliers.values())
        x = None if self.status in _EXCLUDED else self._vector
        return ConicSolution(x, Multipliers(rows[:count], rows[count:]), 0.0)


def _bounds(domain: Domain, variable: Any) -> list[Any]:
    bounds = domain.set
    if domain.width == 1:
        return [variable >= bounds.lower, variable <= bounds.upper]
    edges = (
        sign * (y * variable[0] - x * variable[1]) <= 0.0
        for sign, (x, y) in zip((1.0, -1.0), bounds.edges, strict=False)
    )
    return [cp.norm(variable) <= bounds.upper, *edges]


def program_of(problem: Problem, angles: int | None = None) -> BalanceProgram:
    """Return the balance problem in cvxpy, with `angles` samples over the cycle (`Problem.to_cvxpy`)."""
    model = AffineModel(affine_problem_of(problem), keep_all=True)
    unstated = [measure.norm.name for measure in model.problem.measures if not measure.norm.is_convex]
    if unstated:
        raise ModelError(f"norm '{unstated[0]}' has no cones; state it in cvxpy, as a function of the rows")
    samples = samples_of(model, angles)
    affine, (terms, limits) = model.at(samples), part_names(model.problem)
    # a limit on a number of the mounting is the same for every design
    pairs = zip(limits.items(), model.problem.limits, strict=True)
    limits = {name: measure for (name, measure), limit in pairs if limit in model.problem.load_limits}

    def axes_of(
        measures: Mapping[str, Measure], parts: Sequence[tuple[float, AffineNorm]]
    ) -> dict[str, dict[str, Any]]:
        named = zip(measures.items(), parts, strict=True)
        return {name: row_axes(model, measure, norm, samples) for (name, measure), (_, norm) in named}

    return BalanceProgram(affine, axes_of(terms, affine.terms), axes_of(limits, affine.limits))


def check_solver(name: str) -> str:
    """Return the name of a solver as cvxpy writes it.

    Raises
    ------
    InputError
        If cvxpy does not find it.
    """
    names = cp.installed_solvers()
    if str(name).upper() not in names:
        rule = "is no solver that cvxpy finds"
        raise refused("solver", str(name), rule, f"install it, or name one of {', '.join(sorted(names))}")
    return name.upper()


def solve_by_cvxpy(affine: AffineProblem, solver: str) -> ConicSolution:
    """Minimise the weighted sum of norms under limits by a solver of cvxpy, which proposes a design and dual rows.

    Raises
    ------
    SolverError
        If the solver refuses the program, or stops without an answer.
    """
    program = BalanceProgram(
        affine, {str(k): {} for k in range(len(affine.terms))}, {f"limit {k}": {} for k in range(len(affine.limits))}
    )
    try:
        with warnings.catch_warnings():
            # the certificate judges a solution that the solver calls inaccurate
            warnings.simplefilter("ignore")
            program.solve(solver=solver)
    except (cp.error.SolverError, cp.error.DCPError) as error:
        reason = " ".join(str(error).split())
        raise SolverError(f"{solver} does not solve this problem ({reason}); name another solver") from None
    return program.solution()
