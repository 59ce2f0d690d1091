"""Engines as built to one design: their loads (R2, R3), and who seeks the worst of them (R4).

Adversaries seek among all errors that tolerances allow, or among engines that were drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.robust.tolerance import Tolerances, tolerances_of, with_errors
from laufruhe.extensions.robust.worst_case import MOST_NODES, Terms, check_worst, worst_case
from laufruhe.load_models.affine import AffineModel, AffineNorm
from laufruhe.load_models.batch import by_feature
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.batch_norms import BatchNorm
from laufruhe.problem.evaluation import Evaluation, evaluate, limit_samples, objective_value, over
from laufruhe.problem.measure import Limit, Measure, kinks_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers.conclusion import KEPT

QUICK = 1
"""Parts of the errors that are bounded before the design is final."""


class BuiltEngines:
    """Loads of one design as drawn, and what every error of a whole size adds.

    Parameters
    ----------
    problem
        Of built engines, or of one drawing.
    tolerances
        Those of the problem where None; loads have to be affine in all errors.
    values
        Of its decisions.
    samples
        Steps over the cycle.
    """

    def __init__(
        self, problem: Problem, values: Sequence[Value], samples: int, tolerances: Tolerances | None = None
    ) -> None:
        self.problem, self.samples = problem, samples
        own = tolerances_of(problem) if tolerances is None else tolerances
        units = np.concatenate([np.zeros((1, own.count)), np.eye(own.count)])
        self._built = [evaluate_built(with_errors(problem, unit, own), values, samples) for unit in units]

    def norm(self, measure: Measure) -> AffineNorm:
        """Return the norm of a measure over the errors."""
        drawn, finer = self._built[0], measure.norm.refinement
        bends = None
        if measure.is_load:
            signals = over(drawn.engine.cycle.base_order, drawn.signals(measure.load))
            bends = kinks_of(measure, signals, drawn.engine)
        rows = [each.rows(measure, finer * self.samples, bends) for each in self._built]
        bare = rows[0].vectors
        slope = np.stack([each.vectors - bare for each in rows[1:]], axis=-1) if rows[1:] else bare[..., None][..., :0]
        return AffineNorm(rows[0].norm, bare, np.ascontiguousarray(slope), rows[0].grid)

    @property
    def terms(self) -> tuple[tuple[float, AffineNorm], ...]:
        """Weights and norms of the objective."""
        return tuple((term.weight, self.norm(term.measure)) for term in self.problem.objective)


def evaluate_built(own: Problem, values: Sequence[Value], samples: int) -> Evaluation:
    """Return a design with the errors of a built problem."""
    return evaluate(own, own.design(values), samples)


def objective_values(terms: Sequence[tuple[float, AffineNorm]], errors: Array) -> Array:
    """Return the weighted sum of the norms of many engines, errors of shape (engines, columns)."""
    features = np.concatenate([np.ones((len(errors), 1)), errors], axis=1)
    total = np.zeros(len(errors))
    for weight, norm in terms:
        rows = np.ascontiguousarray(by_feature(norm))
        total += weight * BatchNorm(norm.norm, rows, norm.grid).values(features)
    return total


@dataclass(frozen=True, eq=False)
class WorstEngines:
    """The worst engines of one design.

    Attributes
    ----------
    value
        Objective of the worst engine found.
    bound
        What none exceeds.
    errors
        Of engines that are worst in the objective, or break a limit.
    limits
        What no engine exceeds of each limit.
    violation
        Largest relative violation of a limit.
    broken
        Names of limits that an engine found breaks.
    divisions
        Parts of the errors that were looked at.
    proven
        Whether the bounds are all that they can be.
    """

    value: float
    bound: float
    errors: tuple[Array, ...]
    limits: tuple[tuple[Limit, float], ...]
    violation: float
    broken: tuple[str, ...]
    divisions: int
    proven: bool


def load_limits_of(problem: Problem) -> tuple[Limit, ...]:
    """Return limits that errors move: masses are those of the drawing."""
    return tuple(limit for limit in problem.load_limits if limit.measure.is_load)


def largest_violation(limits: Sequence[tuple[Limit, float]]) -> float:
    """Return the largest relative violation; negative where all have room."""
    return max(((value - limit.maximum) / (limit.maximum or 1.0) for limit, value in limits), default=0.0)


def violated_limits(limits: Sequence[tuple[Limit, float]]) -> tuple[str, ...]:
    """Return the names of limits that are passed by more than counts as kept."""
    return tuple(limit.name for limit, value in limits if value > limit.maximum * (1.0 + KEPT))


@dataclass(frozen=True, eq=False)
class WorstCaseAdversary:
    """Seek among all errors within the tolerances, every load affine in them (R4); read limits at many angles (P7)."""

    problem: Problem
    samples: int
    tolerance: float

    def at(self, values: Sequence[Value], proven: bool) -> WorstEngines:
        """Return the worst engines, by branch and bound."""
        engines = BuiltEngines(self.problem, values, self.samples)
        columns, maximum = tolerances_of(self.problem).columns, MOST_NODES if proven else QUICK
        found = worst_case(engines.terms, columns, self.tolerance, maximum=maximum)
        if proven:
            check_worst(engines.terms, columns, found)
        errors, limits, divisions = [found.errors], [], found.nodes
        broken: list[str] = []
        finely = {self.samples: engines}
        for limit in load_limits_of(self.problem):
            angles = limit_samples(limit.measure, self.samples)
            finely[angles] = finely.get(angles) or BuiltEngines(self.problem, values, angles)
            terms: Terms = ((1.0, finely[angles].norm(limit.measure)),)
            own = worst_case(terms, columns, self.tolerance, maximum=maximum)
            limits.append((limit, own.bound if proven else own.value))
            divisions += own.nodes
            if own.value > limit.maximum:
                errors.append(own.errors)
            broken += violated_limits([(limit, own.value)])
        return WorstEngines(
            found.value,
            found.bound,
            tuple(errors),
            tuple(limits),
            largest_violation(limits),
            tuple(broken),
            divisions,
            proven,
        )


@dataclass(frozen=True, eq=False)
class SampledEngines:
    """Engines that were drawn, or some of them.

    Attributes
    ----------
    errors
        Shape (engines, columns).
    """

    problem: Problem
    errors: Array
    samples: int
    models: list[AffineModel] = field(default_factory=list)

    def subset(self, which: NDArray[np.intp]) -> SampledEngines:
        """Return some of them."""
        models = [self.models[k] for k in which] if self.models else []
        return SampledEngines(self.problem, self.errors[which], self.samples, models)

    def objective(self, values: Sequence[Value]) -> Array:
        """Return the objective of every engine."""
        return np.asarray(self._values(values, None))

    def at(self, values: Sequence[Value], proven: bool) -> WorstEngines:  # noqa: ARG002
        """Return the worst of all of them, exactly."""
        worst = self._values(values, None)
        errors, limits = [self.errors[int(np.argmax(worst))]], []
        for limit in load_limits_of(self.problem):
            own = self._values(values, limit)
            limits.append((limit, float(own.max())))
            if own.max() > limit.maximum:
                errors.append(self.errors[int(np.argmax(own))])
        value, broken = float(worst.max()), violated_limits(limits)
        return WorstEngines(
            value, value, tuple(errors), tuple(limits), largest_violation(limits), broken, len(self.errors), True
        )

    def _values(self, values: Sequence[Value], limit: Limit | None) -> Array:
        samples = self.samples if limit is None else limit_samples(limit.measure, self.samples)
        if tolerances_of(self.problem).is_affine:
            engines = BuiltEngines(self.problem, values, samples)
            terms: Sequence[tuple[float, AffineNorm]] = (
                engines.terms if limit is None else ((1.0, engines.norm(limit.measure)),)
            )
            return objective_values(terms, self.errors)
        if not self.models:
            self.models.extend(AffineModel(with_errors(self.problem, z)) for z in self.errors)
        found = (evaluate_built(model.problem, values, samples) for model in self.models)
        return np.array([
            objective_value(self.problem, each) if limit is None else each.value(limit.measure) for each in found
        ])  # fmt: skip


Adversary: TypeAlias = WorstCaseAdversary | SampledEngines
"""Seeks the worst engines of a design; where it is to be proven, with a bound that is worth the time."""
