"""Result of a design for built engines: comparison with the nominal design, and prices of tolerances (R10, R11)."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from laufruhe.extensions.robust.built_engines import (
    Adversary,
    SampledEngines,
    WorstEngines,
    evaluate_built,
    violated_limits,
)
from laufruhe.extensions.robust.result import CONFIDENCE, SHARE, SHARES, BuiltDesign, PricedTolerance, RobustResult
from laufruhe.extensions.robust.tolerance import robust_of, tolerances_of, with_errors, with_tolerances
from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Limit
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import Proof, ProofStrength, make_certificate
from laufruhe.solvers.accuracy import objective_error
from laufruhe.solvers.conclusion import (
    FEASIBILITY_TOL,
    decision_values,
    evaluate_design,
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


@dataclass(frozen=True, eq=False)
class RobustDesign:
    """Design with an upper bound over its engines, and a lower bound over all designs.

    Attributes
    ----------
    values
        Values of the decisions.
    worst
        Worst engines of the design.
    bound
        Lower bound of the objective over all designs [SI].
    active
        Sets of errors that determine the design.
    scenarios, angles
        Counts of error sets and of samples in the program.
    samples
        Samples over the cycle for evaluations of engines.
    margin
        Share by which limits were lowered, because peaks lie between samples.
    conflict
        Limits that no design satisfies in each engine; all other attributes are then undefined.
    """

    values: tuple[Value, ...]
    worst: WorstEngines
    bound: float
    active: ActiveErrors
    scenarios: int
    angles: int
    samples: int
    margin: float = 0.0
    conflict: tuple[str, ...] = ()


def robust_result(
    problem: Problem, adversary: Adversary, nominal: Sequence[Value], initial_worst: WorstEngines, robust: RobustDesign,
    method: str, seconds: float,
) -> Result:  # fmt: skip
    """Return the result of a design for built engines, compared with the nominal design on random engines.

    Parameters
    ----------
    adversary
        Search for the worst engines.
    nominal
        Values of the decisions of the optimum without errors.
    initial_worst
        Worst engines of the initial design.
    method
        Name of the method for the certificate.
    seconds
        Time of the search [s].
    """
    from scipy.special import betaincinv

    started, worst = time.perf_counter(), robust.worst
    design = evaluate_design(problem, robust.values, robust.samples)
    population, tolerances = robust_of(problem).population, tolerances_of(problem)
    share = SHARE if population.share is None else population.share
    # random engines that no decision has used
    count = CHECKED if tolerances.is_affine else min(population.engines, CHECKED_CURVED)
    errors = tolerances.draw(np.random.default_rng([population.seed, 1]), count)
    engines = SampledEngines(problem, errors, adversary.samples)
    objectives = engines.objectives(robust.values)
    nominal_worst = adversary.at(nominal, proven=True)
    nominal_objectives = engines.objectives(nominal)
    exceeding = int((objectives > worst.bound * (1.0 + 1e-12)).sum())
    # Clopper and Pearson (R10)
    at_most = float(betaincinv(exceeding + 1, count - exceeding, CONFIDENCE)) if exceeding < count else 1.0
    details = RobustResult(
        population=population, exact=population.share is None and tolerances.is_affine, share=share,
        nominal=_design("nominal design", problem, nominal, nominal_worst, nominal_objectives, share),
        robust=_design("robust design", problem, robust.values, worst, objectives, share),
        tolerances=_priced_tolerances(problem, robust, errors, adversary.samples, share),
        scenarios=robust.scenarios, divisions=worst.divisions, engines=count, seed=population.seed,
        worst_engine=evaluate_built(with_errors(problem, worst.errors[0]), robust.values, adversary.samples),
        exceeding=exceeding, exceeding_at_most=at_most,
    )  # fmt: skip
    is_feasible = max(worst.violation, design.violation) <= FEASIBILITY_TOL
    certificate = make_certificate(
        worst.bound, robust.bound, numerical_zero(problem, design.evaluation.engine), problem.tolerance,
        ProofStrength.EXACT if population.share is None else ProofStrength.RELAXED, robust.active.residual, method,
    )  # fmt: skip
    prices: dict[Limit, float] = {}
    for limit, price in (pair for prices_of_set in robust.active.prices for pair in prices_of_set):
        prices[limit] = prices.get(limit, 0.0) + price
    status = Status.OPTIMAL if certificate.kind is Proof.GLOBAL else Status.FEASIBLE
    violated = " and ".join(map(repr, violated_limits(worst.limits))) or "a limit"
    return Result(
        problem=problem,
        status=status if is_feasible else Status.FAILED,
        objective=ObjectiveValue.of(problem, worst.bound, initial_worst.value),
        certificate=certificate,
        decisions=priced_decisions(design),
        limits=_limits_in_the_worst_case(problem, limit_values(problem, design.evaluation), worst, prices),
        initial=evaluate(problem),
        final=design.evaluation,
        message="" if is_feasible else f"the best design found breaks {violated} in some engines",
        error=partial(objective_error, problem, details.worst_engine),
        timing={"solve": seconds, "compare": time.perf_counter() - started},
        details=details,
    )


def _design(
    name: str, problem: Problem, values: Sequence[Value], worst_engines: WorstEngines, objectives: Array, share: float
) -> BuiltDesign:
    from scipy.special import bdtrik

    ordered = np.sort(objectives)
    ends = np.array([0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE])
    low, high = np.ceil(bdtrik(ends, len(objectives), share)).astype(int)
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


def _priced_tolerances(
    problem: Problem, robust: RobustDesign, engine_errors: Array, samples: int, share: float
) -> tuple[PricedTolerance, ...]:
    """Return every tolerance with its price, the fall of the objective if it is tighter, the largest first (R11)."""

    def objective(name: str, factor: float) -> float:
        # objective of the active error sets, or of the share of engines, with one tolerance times the factor
        scaled_problem = with_tolerances(problem, tolerances_of(problem).scaled(name, factor))
        if robust_of(problem).population.share is not None:
            engines = SampledEngines(scaled_problem, engine_errors, samples)
            return float(np.quantile(engines.objectives(robust.values), share))
        total, active = 0.0, robust.active
        for errors, weight, prices in zip(active.errors, active.shares, active.prices, strict=True):
            limit_prices = [(limit, price) for limit, price in prices if price > 0.0 and limit.measure.is_load]
            if weight > 0.0 or limit_prices:
                evaluation = evaluate_built(with_errors(scaled_problem, errors), robust.values, samples)
                total += weight * objective_value(problem, evaluation)
                total += sum(price * evaluation.value(limit.measure) for limit, price in limit_prices)
        return total

    priced = []
    for tolerance in tolerances_of(problem).tolerances:
        upper, lower = (objective(tolerance.name, 1.0 + step) for step in (STEP, -STEP))
        saving = (upper - lower) / (2.0 * STEP)
        priced.append(PricedTolerance(
            tolerance.name, tolerance.size, tolerance.unit, str(tolerance.law), str(tolerance.scope),
            len(tolerance.errors), saving / tolerance.size, saving,
        ))  # fmt: skip
    return tuple(sorted(priced, key=lambda tolerance_price: -tolerance_price.saving))


def infeasible_robust_result(
    problem: Problem, initial_worst: WorstEngines, conflict: tuple[str, ...], timing: dict[str, float]
) -> Result:
    """Return the result without a feasible design; limits have their values in the worst initial engines."""
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
