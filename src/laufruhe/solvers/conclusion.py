"""Build results from designs: exact evaluation, shadow prices and certificate (P5, E15)."""

from __future__ import annotations

import cmath
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

from laufruhe.errors import BoundError, ModelError
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.progress import report_design
from laufruhe.numerics.witness import is_over
from laufruhe.problem.decision import Decision, Kind
from laufruhe.problem.dependence import depends, open_kinds
from laufruhe.problem.error_bounds import measure_sampling_error, relative
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value, with_fine_sampling
from laufruhe.problem.measure import Limit, Measure, Side
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import (
    Certificate,
    Proof,
    ProofStrength,
    make_certificate,
    relative_gap,
    unproven_certificate,
)
from laufruhe.prove.witness import Witness
from laufruhe.solvers.accuracy import objective_error
from laufruhe.solvers.prices import ACTIVE, Price
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.ranking import why_no_order
from laufruhe.solvers.values import DecisionValue, LimitValue, NearestDesign, ObjectiveValue

T = TypeVar("T")
FEASIBLE = 1e-6
"""Relative violation of a limit that counts as zero."""
FEASIBILITY_TOL = 10.0 * FEASIBLE
"""Largest relative violation of a feasible design."""
VIOLATION_PENALTY = 10.0
"""Penalty of a witness: its objective rises by this factor times its relative violation, since prices are unknown."""
MAX_REFINEMENTS = 3
"""Largest number of refinements of the samples while a lower bound exceeds the objective."""
# prices below this share of the objective are rounding errors
STEP, UNCHANGED = 1e-3, 1e-9
"""Step of a decision relative to its scale, and relative change of a measure that counts as none."""
_PRICE_FLOOR = 1e-7
# a limit is active if relaxing it by all of its value gains more than this share of the objective
_ACTIVE_PRICE = 1e-3

_UNPROVEN = {Status.OPTIMAL: Status.FEASIBLE, Status.INFEASIBLE: Status.FAILED}
"""Status of a result whose proof is withheld, by the status that the proof gave."""


@dataclass(frozen=True, eq=False)
class Design:
    """Values of all decisions with their evaluation by the exact model.

    Attributes
    ----------
    problem
        Problem with the crank star and the firing order of the design.
    value, violation
        Objective [SI], and largest relative violation of a limit.
    """

    problem: Problem
    values: tuple[Value, ...]
    evaluation: Evaluation
    value: float
    violation: float

    @classmethod
    def of(cls, problem: Problem, values: Sequence[Value], evaluation: Evaluation) -> Design:
        """Return a design from the values of all decisions and its evaluation."""
        value = objective_value(problem, evaluation)
        return cls(problem, tuple(values), evaluation, value, evaluation.violation(problem.limits))

    @property
    def rank(self) -> tuple[bool, float]:
        """Sort key: smallest violation of limits first, then smallest objective."""
        is_infeasible = self.violation > FEASIBILITY_TOL
        return is_infeasible, self.violation if is_infeasible else self.value


@dataclass(frozen=True, eq=False)
class ProofData:
    """Proof of a method for the best design that it proposes.

    Attributes
    ----------
    bound
        Lower bound of the objective over all feasible designs [SI].
    strength
        Kind of proof that a bound of this method can give.
    kkt_residual, method
        Residual of the optimality conditions and name of the method, as in a certificate.
    prices
        Known shadow prices by limit and side.
    bounds
        Shadow prices of active bounds of decisions, by the name of the size or angle that is bounded.
    """

    bound: float
    strength: ProofStrength
    kkt_residual: float
    method: str
    prices: Mapping[Side, Price] = field(default_factory=dict)
    bounds: Mapping[str, Price] = field(default_factory=dict)


def evaluate_design(problem: Problem, values: Sequence[Value], samples: int | None = None) -> Design:
    """Evaluate a design by the exact model from the value of every decision [SI].

    Raises
    ------
    ModelError
        If the design has no finite loads, for example at an undamped resonance.
    """
    design = Design.of(problem, values, evaluate(problem.fixed_at(values), samples=samples))
    if design.violation <= FEASIBILITY_TOL:
        report_design(design.value, (decision.name for decision in problem.decisions), values)
    return design


def initial_design(problem: Problem, initial: Evaluation) -> Design | None:
    """Return the initial design from its evaluation; None at an undamped resonance, where loads are infinite."""
    return None if initial.resonance else Design.of(problem, problem.start, initial)


def refine_objective(
    problem: Problem, evaluation: Evaluation, value: float, bound: float, zero_level: float,
    prices: Mapping[Side, Price] | None = None,
) -> tuple[Evaluation, float, float]:  # fmt: skip
    """Return a design's evaluation and objective, with more samples while a lower bound exceeds the objective (P7).

    A bound holds for the mean over the cycle, and a mean of few samples may be smaller than that.

    Parameters
    ----------
    zero_level
        Value of the objective that is numerically zero.
    prices
        Shadow prices of limits, which value violations within the tolerance.

    Returns
    -------
    Evaluation, its objective, and the largest error by which this objective may be too low: from sampling, and from
    violations within the tolerance. The error is infinite if the design violates limits at many samples.
    """
    for _ in range(MAX_REFINEMENTS):
        if not is_over(bound, value, zero_level) or not any(is_sampled(term.measure) for term in problem.objective):
            break
        evaluation = with_fine_sampling(evaluation)
        value = objective_value(problem, evaluation)
    if not is_over(bound, value, zero_level):
        return evaluation, value, 0.0
    fine = with_fine_sampling(evaluation) if problem.limits else evaluation
    if fine.violation(problem.limits) > FEASIBLE:
        return evaluation, value, math.inf
    value_error = sum(term.weight * measure_sampling_error(term.measure, evaluation) for term in problem.objective)
    for (limit, side), price in (prices or {}).items():
        standing = fine.check_limit(limit)
        if standing.side == side and price.relaxed > 0.0:
            value_error += price.relaxed * max(standing.violation, 0.0) * abs(standing.edge)
    return evaluation, value, value_error


def refine_result(result: Result, bound: float, zero_level: float) -> tuple[Result, float]:
    """Return a result, with more samples while a bound exceeds its objective, and the error of that objective [SI]."""
    if result.objective is None:
        return result, 0.0
    final, value, value_error = refine_objective(
        result.problem, result.final, result.objective.value, bound, zero_level, result.prices
    )
    return replace(result, final=final, objective=replace(result.objective, value=value)), value_error


def without_proof(result: Result, error: BoundError) -> Result:
    """Return a result without any bound; its message states the contradiction between bound and design."""
    value = result.objective.value if result.objective is not None else 0.0
    certificate = result.certificate
    if certificate is not None:
        certificate = unproven_certificate(value, certificate.kkt_residual, certificate.method)
    reason = f"its proof is withheld: {error}; please report it, with the problem file"
    phasing = result.phasing
    if phasing is not None:
        ranking = tuple(replace(star, lower_bound=0.0, proven=False) for star in phasing.ranking)
        trade = tuple(replace(point, lower_bound=0.0) for point in phasing.trade)
        phasing = replace(phasing, ranking=ranking, trade=trade)
    return replace(
        result,
        status=_UNPROVEN.get(result.status, result.status),
        certificate=certificate,
        message="; ".join(filter(None, (result.message, reason))),
        conflict=(),
        ranks=tuple(replace(rank, lower_bound=0.0, gap=1.0, proof=Proof.NONE) for rank in result.ranks),
        phasing=phasing,
    )


def witness_of(design: Design, place: Array, violation: float = FEASIBLE) -> Witness | None:
    """Return a design as a witness, a value that no lower bound may exceed.

    The result is None if the design's relative violation of limits is larger than `violation`.

    Its coordinates in the boxes of the bound are `place`, shape (n,).
    """
    if design.violation > violation:
        return None
    problem, evaluation = design.problem, design.evaluation

    def read() -> float:
        zero_level = numerical_zero(problem, evaluation.engine)
        _, value, value_error = refine_objective(problem, evaluation, design.value, math.inf, zero_level)
        return value * (1.0 + VIOLATION_PENALTY * max(design.violation, 0.0)) + value_error + zero_level

    return Witness(place, design.value, read)


def is_sampled(measure: Measure) -> bool:
    """Return True if the value of a measure depends on the number of samples."""
    return measure.is_load and not measure.norm.is_euclidean


def build_result(design: Design, initial: Evaluation, proof: ProofData, timing: dict[str, float]) -> Result:
    """Return the result with the better of a design and the initial design; `timing` has seconds by stage."""
    baseline = Design.of(design.problem, design.problem.start, initial)
    return result_of(min(design, baseline, key=lambda candidate: candidate.rank), baseline, proof, timing)


def result_of(design: Design, baseline: Design, proof: ProofData, timing: dict[str, float]) -> Result:
    """Return the result with a design, and with the initial design as `baseline`."""
    problem, initial = design.problem, baseline.evaluation
    is_feasible = design.violation <= FEASIBILITY_TOL
    zero_level = numerical_zero(problem, design.evaluation.engine)
    message = f"the initial design has no finite loads: {initial.resonance}" if initial.resonance else ""
    if is_feasible:
        evaluation, value, value_error = refine_objective(
            problem, design.evaluation, design.value, proof.bound, zero_level, proof.prices
        )
        design = replace(design, evaluation=evaluation, value=value)
        certificate = make_certificate(
            value,
            proof.bound,
            zero_level,
            problem.tolerance,
            proof.strength,
            proof.kkt_residual,
            proof.method,
            value_error,
        )
    else:
        # an infeasible design proves nothing
        bound = max(proof.bound, 0.0)
        gap = relative_gap(design.value, bound, zero_level)
        certificate = Certificate(Proof.NONE, bound, gap, proof.kkt_residual, proof.method)
        message = violation_message(problem, design.evaluation)
    # prices below the gap are rounding errors
    price_floor = max(_PRICE_FLOOR, min(certificate.gap, problem.tolerance))
    limits = limit_values(problem, design.evaluation, proof.prices, design.value, price_floor)
    proven = certificate.kind is Proof.GLOBAL
    return Result(
        problem=problem,
        status=Status.FAILED if not is_feasible else Status.OPTIMAL if proven else Status.FEASIBLE,
        objective=ObjectiveValue.of(problem, design.value, baseline.value),
        certificate=certificate,
        decisions=priced_decisions(design, proof.bounds, price_floor),
        limits=limits,
        initial=initial,
        final=design.evaluation,
        message=message,
        error=partial(objective_error, problem, design.evaluation),
        timing=timing,
    )


def violation_message(problem: Problem, evaluation: Evaluation) -> str:
    """Return a message that the best design found violates limits."""
    names = quote_names(violated_limits(problem.limits, evaluation)) or "a limit"
    return f"the best design found violates {names}; relax it, or open more numbers"


def evaluate_only(problem: Problem, allow_resonance: bool = False, samples: int | None = None) -> Result:
    """Return the initial design as a result, without optimisation; infeasible if no firing order fits its throws.

    If `allow_resonance` is True, the design may stand on an undamped resonance, as the start of a search may.
    """
    started, requested = time.perf_counter(), problem
    problem = problem.drawing
    evaluation = evaluate_start(problem) if allow_resonance else evaluate(problem, samples=samples)
    phasing = problem.phasing
    reason = why_no_order(phasing, phasing.throws) if phasing is not None and phasing.throws is not None else ""
    result = Result(
        problem=problem,
        status=Status.INFEASIBLE if reason else Status.FEASIBLE,
        message=reason,
        objective=ObjectiveValue.of_initial(problem, evaluation),
        limits=() if evaluation.resonance else limit_values(problem, evaluation),
        initial=evaluation,
        final=evaluation,
        error=float if evaluation.resonance else partial(objective_error, problem, evaluation),
        timing={"evaluate": time.perf_counter() - started},
    )
    for extra in () if allow_resonance else requested.extras:
        result = extra.evaluated(requested, result)
    return result


def quote_names(names: Iterable[str]) -> str:
    """Return names in quotation marks, joined by "and"."""
    return " and ".join(f"'{name}'" for name in names)


def conflict_message(conflict: Sequence[str]) -> str:
    """Return a message that no design meets all of the named limits."""
    names = quote_names(conflict) or "the bounds"
    verb = "contradict each other" if len(conflict) > 1 else "cannot be met by any design within the bounds"
    return f"no design exists: {names} {verb}"


def smallest_conflicting(conflicting: Iterable[T], conflicts: Callable[[Sequence[T]], bool]) -> list[T]:
    """Return a minimal subset that still conflicts: without any one of its elements, `conflicts` is False."""
    subset = list(conflicting)
    for element in tuple(subset):
        reduced = [other for other in subset if other is not element]
        if conflicts(reduced):
            subset = reduced
    return subset


def smallest_conflict(limits: Sequence[Limit], conflicts: Callable[[Sequence[Limit]], bool]) -> tuple[str, ...]:
    """Return the names of a minimal set of limits that no design meets together; `conflicts` tests a set."""
    return tuple(limit.name for limit in smallest_conflicting(limits, conflicts))


def infeasible_result(
    problem: Problem, initial: Evaluation, conflict: tuple[str, ...], timing: dict[str, float]
) -> Result:
    """Return an infeasible result with the conflicting limits and the limit values of the initial design."""
    return Result(
        problem=problem,
        status=Status.INFEASIBLE,
        limits=limit_values(problem, initial),
        initial=initial,
        final=initial,
        message=conflict_message(conflict),
        conflict=conflict,
        timing=timing,
    )


def failed_result(problem: Problem, initial: Evaluation, names: Sequence[str], timing: dict[str, float]) -> Result:
    """Return a failed result: no feasible design was found, and none is proven not to exist."""
    message = (
        f"no design was found that meets {quote_names(tuple(names))}, but one may exist; relax it, or allow more time"
    )
    return replace(infeasible_result(problem, initial, (), timing), status=Status.FAILED, message=message)


def violated_limits(limits: Sequence[Limit], evaluation: Evaluation) -> tuple[str, ...]:
    """Return names of limits whose relative violation is more than `FEASIBILITY_TOL`."""
    return tuple(limit.name for limit in limits if evaluation.check_limit(limit).violation > FEASIBILITY_TOL)


def nearest_record(problem: Problem, design: Evaluation, decisions: tuple[DecisionValue, ...]) -> NearestDesign:
    """Return the record of an infeasible design for reports: its decisions, and the limit that it violates most."""
    limit = max(problem.limits, key=lambda limit: design.check_limit(limit).violation)
    standing = design.check_limit(limit)
    return NearestDesign(
        limit.name, standing.side, standing.edge, limit.measure.unit, standing.value, standing.violation,
        violated_limits(problem.limits, design), decisions,
    )  # fmt: skip


def limit_values(
    problem: Problem,
    evaluation: Evaluation,
    prices: Mapping[Side, Price] | None = None,
    value: float = 0.0,
    price_floor: float = _PRICE_FLOOR,
) -> tuple[LimitValue, ...]:
    """Return value and shadow price of each limit at a design with the objective `value` [SI] (E15).

    Parameters
    ----------
    prices
        Known shadow prices by side of a limit; None if nothing is open.
    price_floor
        Share of the objective below which a price counts as zero.
    """
    return tuple(_limit_value(problem, limit, evaluation, prices, value, price_floor) for limit in problem.limits)


def _limit_value(
    problem: Problem, limit: Limit, evaluation: Evaluation, prices: Mapping[Side, Price] | None, value: float,
    price_floor: float = _PRICE_FLOOR,
) -> LimitValue:  # fmt: skip
    standing = evaluation.check_limit(limit)
    if prices is None:
        # no decision can move
        price = Price.both(math.nan)
    elif standing.violation >= -ACTIVE and not _is_moved(problem, evaluation, limit):
        # no decision changes the measure: relaxing gains nothing, and tightening excludes every design
        price = Price(0.0, math.inf)
    else:
        # the price of an active side may be unknown
        price = prices.get((limit, standing.side), Price.both(math.nan))
    is_priced = price.relaxed * abs(standing.edge) > _ACTIVE_PRICE * value and standing.violation >= -problem.tolerance
    active = bool(standing.violation >= -ACTIVE or is_priced)
    minimum = price_floor * value / abs(standing.edge) if standing.edge else 0.0
    price = price.floored(minimum) if active else Price(0.0, 0.0)
    error = relative(measure_sampling_error(limit.measure, evaluation), standing.value)
    window = limit.minimum, limit.maximum
    return LimitValue(
        limit.name, standing.value, standing.edge, limit.measure.unit, active, price.relaxed, standing.side, error,
        price.other, window if all(map(math.isfinite, window)) else None,
    )  # fmt: skip


def _is_moved(problem: Problem, evaluation: Evaluation, limit: Limit) -> bool:
    """Return True if a limited measure changes when some decision takes a small step from its start."""
    channel = limit.measure.channel
    if not depends(channel, open_kinds(problem), problem):
        return False
    # no step of a decision moves a throw
    moves_throws = problem.phasing is not None and depends(channel, {Kind.STAR}, problem)
    if channel.is_load or channel.is_mass or moves_throws:
        return True
    values, at_design = evaluation.values(limit.measure), replace(problem, engine=evaluation.engine)
    steps = (
        (decision, STEP * decision.set.scale * (direction if decision.is_affine else 1.0))
        for decision in problem.decisions for direction in decision.set.directions
    )  # fmt: skip
    for decision, step in steps:
        try:
            shifted = evaluate(problem, at_design.design([decision.start + step], [decision])).values(limit.measure)
        except ModelError:
            return True
        if len(shifted) != len(values) or any(
            abs(x - y) > UNCHANGED * abs(x) for x, y in zip(values, shifted, strict=True)
        ):
            return True
    return False


def with_constant_limits(result: Result, limits: tuple[Limit, ...]) -> Result:
    """Return a result with the values of further limits that no decision changes, in the order of `limits`."""
    problem, known = result.problem, dict(zip(result.problem.limits, result.limits, strict=False))
    final, fine = result.final, with_fine_sampling(result.final)
    values = tuple(
        known.get(limit)
        or _limit_value(problem, limit, fine if final.violation([limit]) > FEASIBILITY_TOL else final, {}, 0.0)
        for limit in limits
    )
    resonant = not known and result.final.resonance
    return replace(result, problem=problem.changed(limits=limits), limits=() if resonant else values)


def unbalance_values(problem: Problem, result: Result) -> list[complex]:
    """Return the unbalances of a result as complex numbers [kg m]."""
    return [complex(value) for value in values_of(replace(problem, decisions=problem.unbalances), result)]


def values_of(problem: Problem, result: Result) -> list[Value]:
    """Return the value of every decision [SI]: the value in the result, or the initial value if the result has none."""
    sizes = {decision.name: decision.value for decision in result.decisions}

    def value(decision: Decision) -> Value:
        size = sizes.get(decision.name)
        if size is None or not decision.is_affine:
            return decision.start if size is None else size
        return cmath.rect(size, sizes.get(decision.angle_name, decision.set.angles[0]))

    return [value(decision) for decision in problem.decisions]


def priced_decisions(
    design: Design, bounds: Mapping[str, Price] | None = None, price_floor: float = 0.0
) -> tuple[DecisionValue, ...]:
    """Return the decision values of a design, with shadow prices of those that lie on a bound.

    `bounds` has the prices by the name of the size or angle. A price counts as zero below the share `price_floor` of
    the objective.
    """
    minimum = price_floor * design.value
    entries = []
    for decision, value in zip(design.problem.decisions, design.values, strict=True):
        for entry in decision_values(decision, value):
            price = (bounds or {}).get(entry.name)
            if price is not None and entry.at_bound:
                price = price.floored(minimum / (max(abs(entry.lower), abs(entry.upper)) or 1.0))
                entry = replace(entry, shadow_price=price.relaxed, tightening_price=price.other)
            entries.append(entry)
    return tuple(entries)


def decision_values(decision: Decision, value: Value) -> tuple[DecisionValue, ...]:
    """Return the entries of a decision for the result: its size, and its angle if the angle is open."""
    bounds = decision.set
    (size, angle), (initial_size, initial_angle) = bounds.split(value), bounds.split(decision.start)
    tolerance = bounds.scale * ACTIVE if decision.is_affine else (bounds.upper - bounds.lower) * ACTIVE
    high, low = size >= bounds.upper - tolerance, size <= bounds.lower + tolerance
    at_bound = high or (bounds.width == 1 and low)
    entry = DecisionValue(decision.name, size, decision.unit, bounds.lower, bounds.upper, initial_size, at_bound)
    if bounds.width == 1:
        return (entry,)
    low_angle, high_angle = bounds.angles
    at_angle_bound = not bounds.free_angle and size > tolerance and min(angle - low_angle, high_angle - angle) < 1e-6
    name = decision.angle_name
    return entry, DecisionValue(name, angle, "rad", low_angle, high_angle, initial_angle, at_angle_bound)
