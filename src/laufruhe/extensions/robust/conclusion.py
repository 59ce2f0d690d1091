"""Result of a design for built engines: comparison with the best drawing, and prices of tolerances (R10, R11)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from laufruhe.extensions.robust.built_engines import (
    Adversary,
    BuiltEngines,
    WorstEngines,
    evaluate_built,
    objective_values,
    violated_limits,
)
from laufruhe.extensions.robust.result import CONFIDENCE, SHARE, SHARES, BuiltDesign, PricedTolerance, RobustResult
from laufruhe.extensions.robust.tolerance import (
    Population,
    Tolerance,
    robust_of,
    tolerances_of,
    with_errors,
    with_tolerances,
)
from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Limit
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import Proof, make_certificate
from laufruhe.solvers.accuracy import objective_error
from laufruhe.solvers.conclusion import (
    FEASIBILITY_TOL,
    Design,
    ProofData,
    decision_values,
    infeasible_result,
    limit_values,
    priced_decisions,
)
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import LimitValue, ObjectiveValue

CHECKED, CHECKED_CURVED = 20_000, 400
"""Engines of the comparison if loads are affine in the errors, and if each engine has its own model."""
STEP = 0.05
"""Relative step of a tolerance for its price by central difference."""


@dataclass(frozen=True, eq=False)
class ActiveErrors:
    """Sets of errors that determine a design, with multipliers of their objectives and limits.

    Attributes
    ----------
    errors
        Errors of each set, shape (columns,).
    shares
        Multiplier of the objective of each set; the sum is 1.
    prices
        Multipliers of the limits of each set.
    residual
        Residual of the optimality conditions (P5).
    """

    errors: tuple[Array, ...] = ()
    shares: tuple[float, ...] = ()
    prices: tuple[tuple[tuple[Limit, float], ...], ...] = ()
    residual: float = 0.0


def compare_designs(
    problem: Problem, adversary: Adversary, nominal: Sequence[Value], robust: Sequence[Value],
    robust_worst: WorstEngines, active: ActiveErrors, scenarios: int,
) -> RobustResult:  # fmt: skip
    """Compare the best drawing with the robust design on random engines, and price each tolerance.

    Parameters
    ----------
    adversary
        Search for the worst engines.
    nominal, robust
        Values of the decisions of both designs.
    robust_worst
        Worst engines of the robust design.
    active
        Error sets that determine it.
    scenarios
        Count of error sets in the program.
    """
    from scipy.stats import beta

    population = robust_of(problem).population
    sample = _Sample.of(problem, population, adversary.samples)
    values = sample.values(problem, robust)
    share = SHARE if population.share is None else population.share
    nominal_worst = adversary.at(nominal, proven=True)
    designs = (
        _design("best drawing", problem, nominal, nominal_worst, sample.values(problem, nominal), share),
        _design("decided", problem, robust, robust_worst, values, share),
    )
    worst = evaluate_built(with_errors(problem, robust_worst.errors[0]), robust, adversary.samples)
    exceeding = int((values > robust_worst.bound * (1.0 + 1e-12)).sum())
    # Clopper and Pearson (R10)
    at_most = float(beta.ppf(CONFIDENCE, exceeding + 1, len(values) - exceeding)) if exceeding < len(values) else 1.0
    return RobustResult(
        population=population, exact=population.share is None and tolerances_of(problem).is_affine, share=share,
        nominal=designs[0], robust=designs[1], tolerances=_price_tolerances(problem, robust, active, sample, share),
        scenarios=scenarios, divisions=robust_worst.divisions, engines=len(values), seed=sample.seed,
        worst_engine=worst, exceeding=exceeding, exceeding_at_most=at_most,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Sample:
    """Random engines that no decision has used."""

    errors: Array
    seed: int
    samples: int

    @classmethod
    def of(cls, problem: Problem, population: Population, samples: int) -> _Sample:
        count = CHECKED if tolerances_of(problem).is_affine else min(population.engines, CHECKED_CURVED)
        random = np.random.default_rng([population.seed, 1])
        return cls(tolerances_of(problem).draw(random, count), population.seed, samples)

    def values(self, problem: Problem, values: Sequence[Value]) -> Array:
        """Return the objective of each engine of a design, shape (engines,); affine loads are evaluated together."""
        if tolerances_of(problem).is_affine:
            return objective_values(BuiltEngines(problem, values, self.samples).terms, self.errors)
        engines = (evaluate_built(with_errors(problem, z), values, self.samples) for z in self.errors)
        return np.array([objective_value(problem, engine) for engine in engines])


def _design(
    name: str, problem: Problem, values: Sequence[Value], worst_engines: WorstEngines, objectives: Array, share: float
) -> BuiltDesign:
    from scipy.stats import binom

    ordered = np.sort(objectives)
    low, high = (int(binom.ppf(0.5 + side * 0.5 * CONFIDENCE, len(objectives), share)) for side in (-1.0, 1.0))
    pairs = zip(problem.decisions, values, strict=True)
    entries = tuple(
        (entry.name, entry.value, entry.unit) for decision, value in pairs for entry in decision_values(decision, value)
    )
    no_errors = with_errors(problem, np.zeros(tolerances_of(problem).count))
    drawing = objective_value(problem, evaluate_built(no_errors, values, problem.fidelity.samples))
    level = float(ordered[min(int(np.ceil(share * len(objectives))) - 1, len(objectives) - 1)])
    worst = worst_engines.bound if robust_of(problem).population.share is None else float(ordered[-1])
    return BuiltDesign(
        name, entries, drawing, worst, level,
        float(ordered[max(low - 1, 0)]), float(ordered[min(high, len(objectives) - 1)]),
        tuple(float(quantile) for quantile in np.quantile(objectives, SHARES)),
    )  # fmt: skip


def _price_tolerances(
    problem: Problem, values: Sequence[Value], active: ActiveErrors, sample: _Sample, share: float
) -> tuple[PricedTolerance, ...]:
    """Return the priced tolerances, the most expensive first."""
    priced = []
    for tolerance in tolerances_of(problem).tolerances:
        upper, lower = (
            _scaled_objective(problem, values, active, sample, share, tolerance, 1.0 + step) for step in (STEP, -STEP)
        )
        saving = (upper - lower) / (2.0 * STEP)
        priced.append(PricedTolerance(
            tolerance.name, tolerance.size, tolerance.unit, str(tolerance.law), str(tolerance.scope),
            len(tolerance.errors), saving / tolerance.size, saving,
        ))  # fmt: skip
    return tuple(sorted(priced, key=lambda tolerance_price: -tolerance_price.saving))


def _scaled_objective(
    problem: Problem,
    values: Sequence[Value],
    active: ActiveErrors,
    sample: _Sample,
    share: float,
    tolerance: Tolerance,
    factor: float,
) -> float:
    """Return the objective of the active error sets, or of the share, with one tolerance times `factor` (R11)."""
    scaled_problem = with_tolerances(problem, tolerances_of(problem).scaled(tolerance.name, factor))
    if robust_of(problem).population.share is not None:
        return float(np.quantile(sample.values(scaled_problem, values), share))
    total = 0.0
    for errors, weight, prices in zip(active.errors, active.shares, active.prices, strict=True):
        limit_prices = [(limit, price) for limit, price in prices if price > 0.0 and limit.measure.is_load]
        if weight > 0.0 or limit_prices:
            evaluation = evaluate_built(with_errors(scaled_problem, errors), values, sample.samples)
            total += weight * objective_value(problem, evaluation)
            total += sum(price * evaluation.value(limit.measure) for limit, price in limit_prices)
    return total


def infeasible_robust_result(
    problem: Problem, initial_worst: WorstEngines, conflict: tuple[str, ...], timing: dict[str, float]
) -> Result:
    """Return the result without a feasible design; limits have their values in the worst engines of the initial one."""
    result = infeasible_result(problem, evaluate(problem), conflict, timing)
    return replace(result, limits=_limits_in_the_worst_case(problem, result.limits, initial_worst, {}))


def _limits_in_the_worst_case(
    problem: Problem, limits: Sequence[LimitValue], worst_engines: WorstEngines, prices: Mapping[Limit, float]
) -> tuple[LimitValue, ...]:
    # values of limits in the worst engines
    worst_values, result = dict(worst_engines.limits), []
    for limit, value in zip(problem.limits, limits, strict=True):
        maximum = worst_values.get(limit, value.value)
        active = maximum >= value.limit * (1.0 - problem.tolerance)
        price = prices.get(limit, 0.0) if active else 0.0
        result.append(replace(value, value=maximum, active=active, shadow_price=price))
    return tuple(result)


def robust_result(
    problem: Problem,
    design: Design,
    initial_worst: WorstEngines,
    final_worst: WorstEngines,
    active: ActiveErrors,
    proof: ProofData,
    details: RobustResult,
    timing: dict[str, float],
) -> Result:
    """Return the result of a design for built engines.

    Parameters
    ----------
    initial_worst, final_worst
        Worst engines of the initial design and of the robust design.
    active
        Error sets that determine the design.
    proof
        Bound of the objective with its method.
    details
        Comparison with the best drawing.
    """
    is_feasible = max(final_worst.violation, design.violation) <= FEASIBILITY_TOL
    zero_level = numerical_zero(problem, design.evaluation.engine)
    certificate = make_certificate(
        final_worst.bound, proof.bound, zero_level, problem.tolerance, proof.strength, proof.kkt_residual, proof.method
    )
    prices: dict[Limit, float] = {}
    for limit, price in (pair for prices_of_set in active.prices for pair in prices_of_set):
        prices[limit] = prices.get(limit, 0.0) + price
    limits = _limits_in_the_worst_case(problem, limit_values(problem, design.evaluation), final_worst, prices)
    status = Status.OPTIMAL if certificate.kind is Proof.GLOBAL else Status.FEASIBLE
    violated = violated_limits(final_worst.limits)
    message = f"the best design found breaks {' and '.join(map(repr, violated)) or 'a limit'} in some engines"
    return Result(
        problem=problem,
        status=status if is_feasible else Status.FAILED,
        objective=ObjectiveValue.of(problem, final_worst.bound, initial_worst.value),
        certificate=certificate,
        decisions=priced_decisions(design),
        limits=limits,
        initial=evaluate(problem),
        final=design.evaluation,
        message="" if is_feasible else message,
        error=partial(objective_error, problem, details.worst_engine),
        timing=timing,
        details=details,
    )  # fmt: skip
