"""Who seeks the worst engines of a design: among all errors allowed, or among engines that were drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.robust.built_engines import BuiltEngines, evaluated, values_of
from laufruhe.extensions.robust.error_parts import Terms
from laufruhe.extensions.robust.tolerance import built, tolerances_of
from laufruhe.extensions.robust.worst_case import MOST_NODES, check_worst, worst_case
from laufruhe.load_models.affine import AffineModel, AffineNorm
from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import limit_samples, objective_value
from laufruhe.problem.measure import Limit
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers.conclusion import KEPT

QUICK = 1
"""Parts of the errors that are looked at while designs still change."""


@dataclass(frozen=True, eq=False)
class Found:
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
    excess
        Largest relative excess over a limit.
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
    excess: float
    broken: tuple[str, ...]
    divisions: int
    proven: bool


def moved_limits(problem: Problem) -> tuple[Limit, ...]:
    """Return limits that errors move: masses are those of the drawing."""
    return tuple(limit for limit in problem.load_limits if limit.measure.is_load)


def excess_of(limits: Sequence[tuple[Limit, float]]) -> float:
    """Return the largest relative excess; negative where all have room."""
    return max(((value - limit.maximum) / (limit.maximum or 1.0) for limit, value in limits), default=0.0)


def names_broken(limits: Sequence[tuple[Limit, float]]) -> tuple[str, ...]:
    """Return the names of limits that are passed by more than counts as kept."""
    return tuple(limit.name for limit, value in limits if value > limit.maximum * (1.0 + KEPT))


@dataclass(frozen=True, eq=False)
class EveryError:
    """Seek among all errors within the tolerances, every load affine in them (R4); read limits at many angles (P7)."""

    problem: Problem
    samples: int
    tolerance: float

    def at(self, values: Sequence[Value], proven: bool) -> Found:
        """Return the worst engines, by branch and bound."""
        engines = BuiltEngines(self.problem, values, self.samples)
        columns, most = tolerances_of(self.problem).columns, MOST_NODES if proven else QUICK
        found = worst_case(engines.terms, columns, self.tolerance, most=most)
        if proven:
            check_worst(engines.terms, columns, found)
        errors, limits, divisions = [found.errors], [], found.nodes
        broken: list[str] = []
        finely = {self.samples: engines}
        for limit in moved_limits(self.problem):
            angles = limit_samples(limit.measure, self.samples)
            finely[angles] = finely.get(angles) or BuiltEngines(self.problem, values, angles)
            terms: Terms = ((1.0, finely[angles].norm(limit.measure)),)
            own = worst_case(terms, columns, self.tolerance, most=most)
            limits.append((limit, own.bound if proven else own.value))
            divisions += own.nodes
            if own.value > limit.maximum:
                errors.append(own.errors)
            broken += names_broken([(limit, own.value)])
        return Found(
            found.value, found.bound, tuple(errors), tuple(limits), excess_of(limits), tuple(broken), divisions, proven
        )


@dataclass(frozen=True, eq=False)
class DrawnEngines:
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

    def kept(self, which: NDArray[np.intp]) -> DrawnEngines:
        """Return some of them."""
        models = [self.models[k] for k in which] if self.models else []
        return DrawnEngines(self.problem, self.errors[which], self.samples, models)

    def objective(self, values: Sequence[Value]) -> Array:
        """Return the objective of every engine."""
        return np.asarray(self._measured(values, None))

    def at(self, values: Sequence[Value], proven: bool) -> Found:  # noqa: ARG002
        """Return the worst of all of them, exactly."""
        worst = self._measured(values, None)
        errors, limits = [self.errors[int(np.argmax(worst))]], []
        for limit in moved_limits(self.problem):
            own = self._measured(values, limit)
            limits.append((limit, float(own.max())))
            if own.max() > limit.maximum:
                errors.append(self.errors[int(np.argmax(own))])
        value, broken = float(worst.max()), names_broken(limits)
        return Found(value, value, tuple(errors), tuple(limits), excess_of(limits), broken, len(self.errors), True)

    def _measured(self, values: Sequence[Value], limit: Limit | None) -> Array:
        samples = self.samples if limit is None else limit_samples(limit.measure, self.samples)
        if tolerances_of(self.problem).is_affine:
            engines = BuiltEngines(self.problem, values, samples)
            terms: Sequence[tuple[float, AffineNorm]] = (
                engines.terms if limit is None else ((1.0, engines.norm(limit.measure)),)
            )
            return values_of(terms, self.errors)
        if not self.models:
            self.models.extend(AffineModel(built(self.problem, z)) for z in self.errors)
        found = (evaluated(model.problem, values, samples) for model in self.models)
        return np.array([
            objective_value(self.problem, each) if limit is None else each.value(limit.measure) for each in found
        ])  # fmt: skip


Adversary: TypeAlias = EveryError | DrawnEngines
"""Seeks the worst engines of a design; where it is to be proven, with a bound that is worth the time."""
