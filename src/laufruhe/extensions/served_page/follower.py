"""Optimum of unbalances while a slider moves: one cone program at few samples, in milliseconds (P1, P4).

Rows depend on the engine only and are computed once; a moved limit changes one number of the program. The result
is a design, its value at twice as many samples, and a bound for the whole cycle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import AffineModel, AffineProblem
from laufruhe.problem.dependence import is_affine
from laufruhe.problem.measure import Limit
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import best_bound, relative_gap
from laufruhe.solvers.conclusion import FEASIBILITY_TOL
from laufruhe.solvers.cones.conic import refine_multipliers, solve_cones
from laufruhe.solvers.cones.tie_break import break_ties
from laufruhe.solvers.cones.unbalances import smallest_conflict

FEW_ANGLES = 48
"""Number of samples over the period of the loads, if the problem uses more."""
TIMES = 2
"""Samples at which an optimum is evaluated, over samples of its program."""


@dataclass(frozen=True, eq=False)
class SliderOptimum:
    """Optimum for the current limits: objective at the samples, lower bound over all feasible designs [SI], and gap.

    Attributes
    ----------
    values
        Values of the decisions; empty without a design.
    standing, prices
        Value of every limit's measure, and its shadow price.
    conflict
        Names of limits that cannot be met together, proven for the whole cycle.
    """

    values: tuple[Value, ...]
    value: float
    bound: float
    gap: float
    standing: tuple[float, ...]
    prices: tuple[float, ...]
    conflict: tuple[str, ...] = ()


def can_follow(problem: Problem) -> bool:
    """Return True if the optimum can follow sliders: loads are affine in all open numbers, and a norm is minimised."""
    kinds = {decision.kind for decision in problem.decisions}
    has_norm = bool(problem.objective) and not any(term.measure.channel.is_number for term in problem.objective)
    has_no_extras = not problem.extras and problem.phasing is None
    # limits on run-ups are left out and named; all other measures must be affine
    measures = [measure for measure in problem.measures if not measure.channel.simulation]
    affine = all(is_affine(measure.channel, kinds, problem) for measure in measures)
    convex = all(measure.norm.is_convex for measure in problem.measures if measure.is_load)
    return bool(kinds) and all(kind.is_affine for kind in kinds) and has_norm and has_no_extras and affine and convex


class Follower:
    """Fast optimum of one problem, which satisfies `can_follow`, under changing limits.

    A `ModelError` says that its loads are not affine in what is open.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._model = model = AffineModel(problem)
        self._zero_level = numerical_zero(problem)
        self.samples = min(model.full_samples, FEW_ANGLES)
        self._coarse = model.at(self.samples)
        self._fine = model.at(TIMES * self.samples)
        self._averaged = model.at(TIMES * self.samples, averaged=True)

    def at(self, limits: Sequence[Limit]) -> SliderOptimum:
        """Return the optimal values of the open numbers under these limits."""
        maximum_of = {limit.measure: limit.maximum for limit in limits if limit.maximum < np.inf}
        load_limits = self._problem.load_limits

        def limited(rows: AffineProblem) -> AffineProblem:
            pairs = zip(load_limits, rows.limits, strict=True)
            return replace(rows, limits=tuple((maximum_of.get(x.measure, old), norm) for x, (old, norm) in pairs))

        coarse, fine, averaged = map(limited, (self._coarse, self._fine, self._averaged))
        names = [limit.name for limit in load_limits]
        solution = solve_cones(coarse)
        if solution.x is None:
            # averaged rows never overestimate: their contradiction proves one of the whole cycle
            solution = solve_cones(averaged)
            if solution.x is None:
                return _conflict(smallest_conflict(averaged, names))
            bound = best_bound(averaged, solution.x, solution.multipliers)
        else:
            solution = replace(solution, x=break_ties(self._problem, fine, solution.x))
            assert solution.x is not None
            bound = best_bound(averaged, solution.x, refine_multipliers(coarse, averaged, solution.multipliers))
        assert solution.x is not None
        x, value = solution.x, fine.objective(solution.x)
        price = dict(zip(names, bound.multipliers.shadow_prices(averaged), strict=True))
        limit_values = {name: norm.value(x) for name, (_, norm) in zip(names, fine.limits, strict=True)}
        broken_constants = tuple(
            name
            for name, (maximum, norm) in zip(names, fine.limits, strict=True)
            if norm.value(x) > maximum * (1.0 + FEASIBILITY_TOL) and not norm.slope.any()
        )
        if broken_constants:
            return _conflict(broken_constants)
        return SliderOptimum(
            values=tuple(domain.complex_value(x) for domain in self._model.domains),
            value=value,
            bound=bound.value,
            gap=relative_gap(value, bound.value, self._zero_level),
            standing=tuple(limit_values.get(limit.name, np.nan) for limit in limits),
            prices=tuple(price.get(limit.name, 0.0) for limit in limits),
        )


def _conflict(conflict: tuple[str, ...]) -> SliderOptimum:
    return SliderOptimum((), np.inf, np.inf, 0.0, (), (), conflict)
