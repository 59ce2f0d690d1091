"""A design for built engines as a result: evaluated, compared with the best drawing, tolerances priced (R10, R11)."""

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
from laufruhe.solvers.accuracy import error_of
from laufruhe.solvers.conclusion import (
    KEPT,
    Design,
    ProofData,
    decided,
    decision_values,
    infeasible_result,
    limit_values,
)
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import LimitValue, ObjectiveValue

CHECKED, CHECKED_CURVED = 20_000, 400
"""Engines of the second sample: where loads are affine in the errors, and where each is built anew."""
STEP = 0.05
"""Share of a tolerance by which it is moved to price it."""


@dataclass(frozen=True, eq=False)
class ActiveErrors:
    """Sets of errors that hold a design, and the multipliers of their objectives and limits.

    Attributes
    ----------
    errors
        Shape (columns,) each.
    shares
        Of each in the largest objective, adding up to one.
    prices
        Of each the multipliers of its limits.
    residual
        Of the optimality conditions (P5).
    """

    errors: tuple[Array, ...] = ()
    shares: tuple[float, ...] = ()
    prices: tuple[tuple[tuple[Limit, float], ...], ...] = ()
    residual: float = 0.0


def compare_designs(
    problem: Problem, adversary: Adversary, nominal: Sequence[Value], robust: Sequence[Value], found: WorstEngines,
    active: ActiveErrors, scenarios: int,
) -> RobustResult:  # fmt: skip
    """Compare the best drawing and the design decided, each built many times, and the price of every tolerance."""
    from scipy.stats import beta

    over = robust_of(problem).over
    sample = _Sample.of(problem, over, adversary.samples)
    values = sample.values(problem, robust)
    share = SHARE if over.share is None else over.share
    first = adversary.at(nominal, proven=True)
    designs = (
        _design("best drawing", problem, nominal, first, sample.values(problem, nominal), share),
        _design("decided", problem, robust, found, values, share),
    )
    worst = evaluate_built(with_errors(problem, found.errors[0]), robust, adversary.samples)
    exceeding = int((values > found.bound * (1.0 + 1e-12)).sum())
    # Clopper and Pearson (R10)
    at_most = float(beta.ppf(CONFIDENCE, exceeding + 1, len(values) - exceeding)) if exceeding < len(values) else 1.0
    return RobustResult(
        over=over, exact=over.share is None and tolerances_of(problem).is_affine, share=share,
        nominal=designs[0], robust=designs[1], tolerances=_price_tolerances(problem, robust, active, sample, share),
        scenarios=scenarios, divisions=found.divisions, engines=len(values), seed=sample.seed, worst_engine=worst,
        exceeding=exceeding, exceeding_at_most=at_most,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Sample:
    """Engines that no decision has seen."""

    errors: Array
    seed: int
    samples: int

    @classmethod
    def of(cls, problem: Problem, over: Population, samples: int) -> _Sample:
        count = CHECKED if tolerances_of(problem).is_affine else min(over.engines, CHECKED_CURVED)
        random = np.random.default_rng([over.seed, 1])
        return cls(tolerances_of(problem).draw(random, count), over.seed, samples)

    def values(self, problem: Problem, values: Sequence[Value]) -> Array:
        """Return the objective of every engine of a design; errors that loads are affine in are all taken at once."""
        if tolerances_of(problem).is_affine:
            return objective_values(BuiltEngines(problem, values, self.samples).terms, self.errors)
        engines = (evaluate_built(with_errors(problem, z), values, self.samples) for z in self.errors)
        return np.array([objective_value(problem, engine) for engine in engines])


def _design(
    name: str, problem: Problem, values: Sequence[Value], found: WorstEngines, built: Array, share: float
) -> BuiltDesign:
    from scipy.stats import binom

    ordered = np.sort(built)
    low, high = (int(binom.ppf(0.5 + side * 0.5 * CONFIDENCE, len(built), share)) for side in (-1.0, 1.0))
    pairs = zip(problem.decisions, values, strict=True)
    entries = tuple((e.name, e.value, e.unit) for d, v in pairs for e in decision_values(d, v))
    none = with_errors(problem, np.zeros(tolerances_of(problem).count))
    drawing = objective_value(problem, evaluate_built(none, values, problem.fidelity.samples))
    level = float(ordered[min(int(np.ceil(share * len(built))) - 1, len(built) - 1)])
    worst = found.bound if robust_of(problem).over.share is None else float(ordered[-1])
    return BuiltDesign(
        name, entries, drawing, worst, level,
        float(ordered[max(low - 1, 0)]), float(ordered[min(high, len(built) - 1)]),
        tuple(float(q) for q in np.quantile(built, SHARES)),
    )  # fmt: skip


def _price_tolerances(
    problem: Problem, values: Sequence[Value], active: ActiveErrors, sample: _Sample, share: float
) -> tuple[PricedTolerance, ...]:
    """Return every tolerance with its price, the dearest first."""
    told = []
    for tolerance in tolerances_of(problem).tolerances:
        wide, narrow = (
            _scaled_objective(problem, values, active, sample, share, tolerance, 1.0 + s) for s in (STEP, -STEP)
        )
        saving = (wide - narrow) / (2.0 * STEP)
        told.append(PricedTolerance(
            tolerance.name, tolerance.size, tolerance.unit, str(tolerance.law), str(tolerance.scope),
            len(tolerance.errors), saving / tolerance.size, saving,
        ))  # fmt: skip
    return tuple(sorted(told, key=lambda one: -one.saving))


def _scaled_objective(
    problem: Problem,
    values: Sequence[Value],
    active: ActiveErrors,
    sample: _Sample,
    share: float,
    tolerance: Tolerance,
    factor: float,
) -> float:
    """Return the objective of what holds the design, with one tolerance so many times as wide (R11)."""
    moved = with_tolerances(problem, tolerances_of(problem).scaled(tolerance.name, factor))
    if robust_of(problem).over.share is not None:
        return float(np.quantile(sample.values(moved, values), share))
    total = 0.0
    for errors, own, prices in zip(active.errors, active.shares, active.prices, strict=True):
        priced = [(limit, price) for limit, price in prices if price > 0.0 and limit.measure.is_load]
        if own > 0.0 or priced:
            found = evaluate_built(with_errors(moved, errors), values, sample.samples)
            total += own * objective_value(problem, found)
            total += sum(price * found.value(limit.measure) for limit, price in priced)
    return total


def infeasible_robust_result(
    problem: Problem, given: WorstEngines, conflict: tuple[str, ...], timing: dict[str, float]
) -> Result:
    """Return that no design keeps its limits in every engine, and how the worst engines of the one given stand."""
    found = infeasible_result(problem, evaluate(problem), conflict, timing)
    return replace(found, limits=_limits_in_the_worst_case(problem, found.limits, given, {}))


def _limits_in_the_worst_case(
    problem: Problem, limits: Sequence[LimitValue], found: WorstEngines, prices: Mapping[Limit, float]
) -> tuple[LimitValue, ...]:
    # limits of a drawing as its worst engines stand to them
    worst, own = dict(found.limits), []
    for limit, value in zip(problem.limits, limits, strict=True):
        maximum = worst.get(limit, value.value)
        active = maximum >= value.limit * (1.0 - problem.tolerance)
        price = prices.get(limit, 0.0) if active else 0.0
        own.append(replace(value, value=maximum, active=active, shadow_price=price))
    return tuple(own)


def robust_result(
    problem: Problem,
    design: Design,
    given: WorstEngines,
    found: WorstEngines,
    active: ActiveErrors,
    shown: ProofData,
    details: RobustResult,
    timing: dict[str, float],
) -> Result:
    """Return the result of a design for built engines; `given` is of the one given."""
    met = max(found.violation, design.violation) <= KEPT
    zero_level = numerical_zero(problem, design.evaluation.engine)
    certificate = make_certificate(
        found.bound, shown.bound, zero_level, problem.tolerance, shown.strength, shown.kkt_residual, shown.method
    )
    prices: dict[Limit, float] = {}
    for limit, price in (priced for own in active.prices for priced in own):
        prices[limit] = prices.get(limit, 0.0) + price
    limits = _limits_in_the_worst_case(problem, limit_values(problem, design.evaluation), found, prices)
    status = Status.OPTIMAL if certificate.kind is Proof.GLOBAL else Status.FEASIBLE
    broken = violated_limits(found.limits)
    message = f"the best design found breaks {' and '.join(map(repr, broken)) or 'a limit'} in some engines"
    return Result(
        problem=problem,
        status=status if met else Status.FAILED,
        objective=ObjectiveValue.of(problem, found.bound, given.value),
        certificate=certificate,
        decisions=decided(design),
        limits=limits,
        initial=evaluate(problem),
        final=design.evaluation,
        message="" if met else message,
        error=partial(error_of, problem, details.worst_engine),
        timing=timing,
        details=details,
    )  # fmt: skip
