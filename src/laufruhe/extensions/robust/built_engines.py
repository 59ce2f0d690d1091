"""Engines as built to one design: their loads (R2, R3), and searches for the worst of them (R4).

An adversary searches all errors within tolerances, or a set of random engines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.robust.tolerance import Tolerances, tolerances_of, with_errors
from laufruhe.extensions.robust.worst_case import MAX_NODES, Terms, check_worst, worst_case
from laufruhe.load_models.affine import AffineNorm
from laufruhe.load_models.batch import BatchNorm, feature_rows
from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import Evaluation, evaluate, limit_samples, objective_value, with_common_base
from laufruhe.problem.measure import Limit, Measure, kinks_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers.conclusion import FEASIBILITY_TOL

QUICK = 1
"""Nodes of branch and bound while the design is not final."""


class BuiltEngines:
    """Loads of a design as drawn, and the change by each error of unit size.

    Parameters
    ----------
    problem
        Problem of built engines, or of a drawing.
    values
        Values of its decisions.
    samples
        Samples over the cycle.
    tolerances
        Tolerances, by default those of the problem; all loads must be affine in the errors.
    """

    def __init__(
        self, problem: Problem, values: Sequence[Value], samples: int, tolerances: Tolerances | None = None
    ) -> None:
        self.problem, self.samples = problem, samples
        applied_tolerances = tolerances_of(problem) if tolerances is None else tolerances
        units = np.concatenate([np.zeros((1, applied_tolerances.count)), np.eye(applied_tolerances.count)])
        self._evaluations = [
            evaluate_built(with_errors(problem, unit, applied_tolerances), values, samples) for unit in units
        ]

    def norm(self, measure: Measure) -> AffineNorm:
        """Return a measure as a norm of the manufacturing errors."""
        drawing, refinement = self._evaluations[0], measure.norm.refinement
        kinks = None
        if measure.is_load:
            signals = with_common_base(drawing.engine.cycle.base_order, drawing.signals(measure.load))
            kinks = kinks_of(measure, signals, drawing.engine)
        rows = [evaluation.rows(measure, refinement * self.samples, kinks) for evaluation in self._evaluations]
        constant = rows[0].vectors
        slope = (
            np.stack([evaluation.vectors - constant for evaluation in rows[1:]], axis=-1)
            if rows[1:]
            else constant[..., None][..., :0]
        )
        return AffineNorm(rows[0].norm, constant, np.ascontiguousarray(slope), rows[0].grid)

    @property
    def terms(self) -> tuple[tuple[float, AffineNorm], ...]:
        """Weights and norms of the objective."""
        return tuple((term.weight, self.norm(term.measure)) for term in self.problem.objective)


def evaluate_built(problem: Problem, values: Sequence[Value], samples: int) -> Evaluation:
    """Return the evaluation of a design of a problem with errors."""
    return evaluate(problem, problem.design(values), samples)


def objective_values(terms: Terms, errors: Array) -> Array:
    """Return the objective of many built engines, shape (engines,), from their errors, shape (engines, columns)."""
    features = np.concatenate([np.ones((len(errors), 1)), errors], axis=1)
    total = np.zeros(len(errors))
    for weight, norm in terms:
        rows = np.ascontiguousarray(feature_rows(norm))
        total += weight * BatchNorm(norm.norm, rows, norm.grid).values(features)
    return total


@dataclass(frozen=True, eq=False)
class WorstEngines:
    """Worst engines of one design.

    Attributes
    ----------
    value
        Objective of the worst engine found [SI].
    bound
        Upper bound of the objective over all engines [SI].
    errors
        Errors of the engine with the worst objective, then of engines that violate a limit, shape (columns,) each.
    limits
        For each limit, an upper bound over all engines.
    violation
        Largest relative violation of a limit.
    violated
        Names of limits that an engine found violates.
    divisions
        Count of nodes.
    proven
        True if the bounds used the whole budget of nodes.
    """

    value: float
    bound: float
    errors: tuple[Array, ...]
    limits: tuple[tuple[Limit, float], ...]
    violation: float
    violated: tuple[str, ...]
    divisions: int
    proven: bool


def load_limits_of(problem: Problem) -> tuple[Limit, ...]:
    """Return the limits that errors can change; limits of masses concern the drawing alone."""
    return tuple(limit for limit in problem.load_limits if limit.measure.is_load)


def largest_violation(limits: Sequence[tuple[Limit, float]]) -> float:
    """Return the largest relative violation; negative if all limits are satisfied."""
    return max(((value - limit.maximum) / (limit.maximum or 1.0) for limit, value in limits), default=0.0)


def violated_limits(limits: Sequence[tuple[Limit, float]]) -> tuple[str, ...]:
    """Return the names of limits that are exceeded by more than the feasibility tolerance."""
    return tuple(limit.name for limit, value in limits if value > limit.maximum * (1.0 + FEASIBILITY_TOL))


@dataclass(frozen=True, eq=False)
class WorstCaseAdversary:
    """Search of all errors within tolerances, for loads affine in them (R4); limits have finer samples (P7)."""

    problem: Problem
    samples: int
    tolerance: float

    def at(self, values: Sequence[Value], proven: bool) -> WorstEngines:
        """Return the worst engines that tolerances allow for a design, by branch and bound.

        `values` are the values of its decisions.

        Without `proven`, the search stops after few nodes.
        """
        built_at = cache(partial(BuiltEngines, self.problem, values))
        engines = built_at(self.samples)
        columns, maximum = tolerances_of(self.problem).columns, MAX_NODES if proven else QUICK
        worst = worst_case(engines.terms, columns, self.tolerance, maximum=maximum)
        if proven:
            check_worst(engines.terms, columns, worst)
        errors, limits, divisions = [worst.errors], [], worst.nodes
        violated: list[str] = []
        for limit in load_limits_of(self.problem):
            terms: Terms = ((1.0, built_at(limit_samples(limit.measure, self.samples)).norm(limit.measure)),)
            worst_of_limit = worst_case(terms, columns, self.tolerance, maximum=maximum)
            limits.append((limit, worst_of_limit.bound if proven else worst_of_limit.value))
            divisions += worst_of_limit.nodes
            if worst_of_limit.value > limit.maximum:
                errors.append(worst_of_limit.errors)
            violated += violated_limits([(limit, worst_of_limit.value)])
        return WorstEngines(
            worst.value, worst.bound, tuple(errors), tuple(limits), largest_violation(limits), tuple(violated),
            divisions, proven,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class SampledEngines:
    """Search of a set of random engines.

    Attributes
    ----------
    errors
        Errors of the engines, shape (engines, columns).
    problems
        Problems of the engines, if loads are not affine in the errors.
    """

    problem: Problem
    errors: Array
    samples: int
    problems: list[Problem] = field(default_factory=list)

    def subset(self, indices: NDArray[np.intp]) -> SampledEngines:
        """Return the set of the engines with the given indices."""
        problems = [self.problems[k] for k in indices] if self.problems else []
        return SampledEngines(self.problem, self.errors[indices], self.samples, problems)

    def at(self, values: Sequence[Value], proven: bool) -> WorstEngines:  # noqa: ARG002
        """Return the worst engines of the sample for a design, exactly; `values` are the values of its decisions."""
        objectives = self.objectives(values)
        errors, limits = [self.errors[int(np.argmax(objectives))]], []
        for limit in load_limits_of(self.problem):
            limit_values = self.objectives(values, limit)
            limits.append((limit, float(limit_values.max())))
            if limit_values.max() > limit.maximum:
                errors.append(self.errors[int(np.argmax(limit_values))])
        value, violated = float(objectives.max()), violated_limits(limits)
        return WorstEngines(
            value, value, tuple(errors), tuple(limits), largest_violation(limits), violated, len(self.errors), True
        )

    def objectives(self, values: Sequence[Value], limit: Limit | None = None) -> Array:
        """Return the objective of each random engine, or the measure of `limit` in its place, shape (engines,)."""
        samples = self.samples if limit is None else limit_samples(limit.measure, self.samples)
        if tolerances_of(self.problem).is_affine:
            engines = BuiltEngines(self.problem, values, samples)
            terms: Terms = engines.terms if limit is None else ((1.0, engines.norm(limit.measure)),)
            return objective_values(terms, self.errors)
        if not self.problems:
            self.problems.extend(with_errors(self.problem, errors) for errors in self.errors)
        evaluations = (evaluate_built(problem, values, samples) for problem in self.problems)
        return np.array([
            objective_value(self.problem, evaluation) if limit is None else evaluation.value(limit.measure)
            for evaluation in evaluations
        ])  # fmt: skip


Adversary: TypeAlias = WorstCaseAdversary | SampledEngines
"""Search for the worst engines of a design; `at(values, proven=True)` spends more time on the bound."""
