"""From a decided design to a result: judged by the exact model, priced, and certified in one way (P5, E15)."""

from __future__ import annotations

import cmath
import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from laufruhe.errors import ModelError
from laufruhe.fidelity.error_bounds import missed, relative
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.witness import is_over
from laufruhe.problem.decision import Decision, Kind
from laufruhe.problem.dependence import depends, kinds_of
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value, with_fine_sampling
from laufruhe.problem.measure import Limit, Measure, Side
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import Certificate, Proof, ProofStrength, gap_of, make_certificate
from laufruhe.prove.witness import Witness
from laufruhe.solvers.accuracy import error_of
from laufruhe.solvers.prices import ACTIVE, Price, angle_name
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.ranking import why_no_order
from laufruhe.solvers.values import DecisionValue, LimitValue, Nearest, ObjectiveValue

FEASIBLE = 1e-6
"""Relative excess over a limit that counts as none."""
KEPT = 10.0 * FEASIBLE
"""Relative excess that a design may have and be called one."""
STEEP = 10.0
"""Times a relative excess over a limit that counts of the objective of a witness, whose prices nobody knows yet."""
READINGS = 3
"""Times that an objective is read at more angles where a bound lies over it."""
# share of the objective under which a price is a rounding
_FELT = 1e-7
# share of the objective from which a price tells that a limit holds the design, whatever room its tolerance left
_TOLD = 1e-3
NEAR, STILL = 1e-3, 1e-9
"""Share of a decision's scale by which it is moved, and share of what is limited that is no change of it."""


@dataclass(frozen=True, eq=False)
class Design:
    """Decisions and what the exact model says of them.

    Attributes
    ----------
    problem
        With the star and the firing order of the design.
    values
        Of its decisions.
    value
        Objective.
    violation
        Largest relative excess over a limit.
    """

    problem: Problem
    values: tuple[Value, ...]
    evaluation: Evaluation
    value: float
    violation: float

    @property
    def rank(self) -> tuple[bool, float]:
        """Sort key: smallest violation of limits first, then smallest objective."""
        broken = self.violation > KEPT
        return broken, self.violation if broken else self.value


@dataclass(frozen=True, eq=False)
class ProofData:
    """Proof of a method for the best design that it proposes.

    Attributes
    ----------
    bound
        What no design allowed goes under.
    strength
        What such a bound can prove.
    kkt_residual, method
        As in a certificate.
    prices
        Of sides of limits, those that are known.
    bounds
        Prices of bounds, by the name of the size or angle that stands at one.
    """

    bound: float
    strength: ProofStrength
    kkt_residual: float
    method: str
    prices: Mapping[Side, Price] = field(default_factory=dict)
    bounds: Mapping[str, Price] = field(default_factory=dict)


def evaluate_design(problem: Problem, values: Sequence[Value], samples: int | None = None) -> Design:
    """A design by the exact model.

    Raises
    ------
    ModelError
        If it has no loads, as on a resonance that nothing damps.
    """
    held = problem.fixed_at(values)
    evaluation = evaluate(held, samples=samples)
    value = objective_value(problem, evaluation)
    return Design(problem, tuple(values), evaluation, value, evaluation.violation(problem.limits))


def initial_design(problem: Problem, initial: Evaluation) -> Design | None:
    """The design as given; None where it has no loads."""
    if initial.resonance:
        return None
    value = objective_value(problem, initial)
    return Design(problem, problem.start, initial, value, initial.violation(problem.limits))


def better(design: Design, other: Design | None) -> Design:
    """Return the design with the smaller violation of limits; at equal violation, with the smaller objective."""
    if other is None:
        return design
    return min((design, other), key=lambda each: (max(each.violation, KEPT), each.value))


@dataclass(frozen=True, eq=False)
class Reading:
    """Objective of a design beside a bound of all.

    Attributes
    ----------
    evaluation
        At the angles at which the objective was read.
    value
        Objective.
    doubt
        By how much it may be read too low: between these angles, and where limits are exceeded by a rounding.
    """

    evaluation: Evaluation
    value: float
    doubt: float


def read_under(
    problem: Problem, evaluation: Evaluation, value: float, bound: float, zero_level: float,
    prices: Mapping[Side, Price] | None = None,
) -> Reading:  # fmt: skip
    """Return the objective of a design, read at so many angles that what bounds all of a cycle lies under it (P7).

    Means averaged about angles bound those of the whole cycle, and a mean at few angles may lie under them.
    """
    for _ in range(READINGS):
        if not is_over(bound, value, zero_level) or not any(is_sampled(term.measure) for term in problem.objective):
            break
        evaluation = with_fine_sampling(evaluation)
        value = objective_value(problem, evaluation)
    return Reading(evaluation, value, _doubt(problem, evaluation, prices) if is_over(bound, value, zero_level) else 0.0)


def result_under(result: Result, bound: float, zero_level: float) -> tuple[Result, float]:
    """Return a result read at so many angles that a bound lies under it, and by how much it may be read too low."""
    if result.objective is None:
        return result, 0.0
    read = read_under(result.problem, result.final, result.objective.value, bound, zero_level, result.prices)
    return replace(result, final=read.evaluation, objective=replace(result.objective, value=read.value)), read.doubt


def known_of(design: Design, place: Array, violation: float = FEASIBLE) -> Witness | None:
    """Return a design as a witness of bounds in coordinates of theirs; None where it exceeds a limit by more."""
    if design.violation > violation:
        return None
    problem, evaluation = design.problem, design.evaluation

    def read() -> float:
        zero_level = numerical_zero(problem, evaluation.engine)
        found = read_under(problem, evaluation, design.value, math.inf, zero_level)
        return found.value * (1.0 + STEEP * max(design.violation, 0.0)) + found.doubt + zero_level

    return Witness(place, design.value, read)


def is_sampled(measure: Measure) -> bool:
    """Return whether more angles tell more of a measure."""
    return measure.is_load and not measure.norm.is_euclidean


def _doubt(problem: Problem, evaluation: Evaluation, prices: Mapping[Side, Price] | None) -> float:
    # P7: possible underestimate of the objective; infinite if the design breaks limits at many angles
    many = with_fine_sampling(evaluation) if problem.limits else evaluation
    if many.violation(problem.limits) > FEASIBLE:
        return math.inf
    missing = sum(term.weight * missed(term.measure, evaluation) for term in problem.objective)
    for (limit, side), price in (prices or {}).items():
        found = many.standing(limit)
        if found.side == side and price.relaxed > 0.0:
            missing += price.relaxed * max(found.violation, 0.0) * abs(found.edge)
    return missing


def build_result(design: Design, initial: Evaluation, shown: ProofData, timing: dict[str, float]) -> Result:
    """The result of a design, or of the one given where that is better."""
    problem = design.problem
    given = objective_value(problem, initial)
    as_given = Design(problem, problem.start, initial, given, initial.violation(problem.limits))
    design = min(design, as_given, key=lambda each: each.rank)
    met = design.violation <= KEPT
    zero_level = numerical_zero(problem, design.evaluation.engine)
    if met:
        read = read_under(problem, design.evaluation, design.value, shown.bound, zero_level, shown.prices)
        design = replace(design, evaluation=read.evaluation, value=read.value)
        certificate = make_certificate(
            design.value, shown.bound, zero_level, problem.tolerance, shown.strength, shown.kkt_residual, shown.method,
            read.doubt,
        )  # fmt: skip
    else:
        # the bound is of designs, and this is none
        bound = max(shown.bound, 0.0)
        gap = gap_of(design.value, bound, zero_level)
        certificate = Certificate(Proof.NONE, bound, gap, shown.kkt_residual, shown.method)
    # prices under what the proof leaves open are those of its rounding
    unfelt = max(_FELT, min(certificate.gap, problem.tolerance))
    limits = limit_values(problem, design.evaluation, shown.prices, design.value, unfelt)
    proven = certificate.kind is Proof.GLOBAL
    message = f"the design as given has no finite loads: {initial.resonance}" if initial.resonance else ""
    if not met:
        message = broken_message(problem, design.evaluation)
    return Result(
        problem=problem,
        status=Status.FAILED if not met else Status.OPTIMAL if proven else Status.FEASIBLE,
        objective=ObjectiveValue.of(problem, design.value, given),
        certificate=certificate,
        decisions=decided(design, shown.bounds, unfelt),
        limits=limits,
        initial=initial,
        final=design.evaluation,
        message=message,
        error=partial(error_of, problem, design.evaluation),
        timing=timing,
    )


def broken_message(problem: Problem, evaluation: Evaluation) -> str:
    """Return a message that the best design found breaks limits."""
    broken = quoted(broken_limits(problem.limits, evaluation)) or "a limit"
    return f"the best design found breaks {broken}; relax it, or open more"


def state(problem: Problem, to_start_from: bool = False) -> Result:
    """The design as given, evaluated and not changed; infeasible where its throws have no firing order allowed.

    Parameters
    ----------
    to_start_from
        Whether it is only where a search starts, so that it may stand on a resonance.
    """
    started = time.perf_counter()
    problem = problem.drawing
    evaluation = evaluate_start(problem) if to_start_from else evaluate(problem)
    open_of = problem.phasing
    why = why_no_order(open_of, open_of.throws) if open_of is not None and open_of.throws is not None else ""
    return Result(
        problem=problem,
        status=Status.INFEASIBLE if why else Status.FEASIBLE,
        message=why,
        objective=ObjectiveValue.given(problem, evaluation),
        limits=() if evaluation.resonance else limit_values(problem, evaluation),
        initial=evaluation,
        final=evaluation,
        error=float if evaluation.resonance else partial(error_of, problem, evaluation),
        timing={"evaluate": time.perf_counter() - started},
    )


def quoted(names: Iterable[str]) -> str:
    """Names of limits in a sentence."""
    return " and ".join(f"'{name}'" for name in names)


def contradiction(conflict: Sequence[str]) -> str:
    """Return a message that no design keeps the named limits together."""
    names = quoted(conflict) or "the bounds"
    verb = "contradict each other" if len(conflict) > 1 else "cannot be met by any design within the bounds"
    return f"no design exists: {names} {verb}"


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
        message=contradiction(conflict),
        conflict=conflict,
        timing=timing,
    )


def failed_result(problem: Problem, initial: Evaluation, names: Sequence[str], timing: dict[str, float]) -> Result:
    """Return a failed result: the search found no feasible design, and nothing proves that none exists."""
    why = f"no design was found that keeps {quoted(tuple(names))}, and none is excluded; relax it, or give more time"
    return replace(infeasible_result(problem, initial, (), timing), status=Status.FAILED, message=why)


def broken_limits(limits: Sequence[Limit], evaluation: Evaluation) -> tuple[str, ...]:
    """Names of those that a design breaks."""
    return tuple(limit.name for limit in limits if evaluation.standing(limit).violation > KEPT)


def nearest_of(problem: Problem, design: Evaluation, decisions: tuple[DecisionValue, ...]) -> Nearest:
    """A design that is no answer, and the limit that it breaks most."""
    broken = max(problem.limits, key=lambda limit: design.standing(limit).violation)
    stands = design.standing(broken)
    names = broken_limits(problem.limits, design)
    return Nearest(
        broken.name, stands.side, stands.edge, broken.measure.unit, stands.value, stands.violation, names, decisions
    )


def limit_values(
    problem: Problem,
    evaluation: Evaluation,
    prices: Mapping[Side, Price] | None = None,
    value: float = 0.0,
    unfelt: float = _FELT,
) -> tuple[LimitValue, ...]:
    """Return value and price of each limit at a design (E15).

    A price below an `unfelt` share of the objective is zero.
    """
    return tuple(_limit_value(problem, limit, evaluation, prices, value, unfelt) for limit in problem.limits)


def _limit_value(
    problem: Problem,
    limit: Limit,
    evaluation: Evaluation,
    prices: Mapping[Side, Price] | None,
    value: float,
    unfelt: float = _FELT,
) -> LimitValue:
    found = evaluation.standing(limit)
    if prices is None:
        # nothing is open that takes a step
        price = Price.both(math.nan)
    elif found.violation >= -ACTIVE and not _is_moved(problem, evaluation, limit):
        # nothing open moves it: relaxed it changes nothing, and tightened no design keeps it
        price = Price(0.0, math.inf)
    else:
        # an active side without a price has one that nothing here tells
        price = prices.get((limit, found.side), Price.both(math.nan))
    told = price.relaxed * abs(found.edge) > _TOLD * value and found.violation >= -problem.tolerance
    active = bool(found.violation >= -ACTIVE or told)
    price = price.felt(unfelt * value / abs(found.edge) if found.edge else 0.0) if active else Price(0.0, 0.0)
    error = relative(missed(limit.measure, evaluation), found.value)
    return LimitValue(
        limit.name, found.value, found.edge, limit.measure.unit, active, price.relaxed, found.side, error, price.other
    )


def _is_moved(problem: Problem, evaluation: Evaluation, limit: Limit) -> bool:
    """Tell if anything open moves what is limited, near a design."""
    channel = limit.measure.channel
    if not depends(channel, kinds_of(problem), problem):
        return False
    # no step of a decision moves a throw
    turns = problem.phasing is not None and depends(channel, {Kind.STAR}, problem)
    if channel.is_load or channel.is_mass or turns:
        return True
    given, there = evaluation.values(limit.measure), replace(problem, engine=evaluation.engine)
    steps = (
        (decision, NEAR * decision.set.scale * (direction if decision.is_affine else 1.0))
        for decision in problem.decisions for direction in decision.set.directions
    )  # fmt: skip
    for decision, step in steps:
        try:
            values = evaluate(problem, there.design([decision.start + step], [decision])).values(limit.measure)
        except ModelError:
            return True
        if len(values) != len(given) or any(abs(x - y) > STILL * abs(x) for x, y in zip(given, values, strict=True)):
            return True
    return False


def with_limits(result: Result, limits: tuple[Limit, ...]) -> Result:
    """A result with limits beside its own that nothing open acts on, in the order given."""
    problem, known = result.problem, dict(zip(result.problem.limits, result.limits, strict=False))
    still, finer = result.final, with_fine_sampling(result.final)
    shown = tuple(
        known.get(limit) or _limit_value(problem, limit, finer if still.violation([limit]) > KEPT else still, {}, 0.0)
        for limit in limits
    )
    resonant = not known and result.final.resonance
    return replace(result, problem=problem.changed(limits=limits), limits=() if resonant else shown)


def unbalances_of(problem: Problem, result: Result) -> list[complex]:
    """Complex decisions from the sizes and angles of a result."""
    return [complex(value) for value in values_of(replace(problem, decisions=problem.unbalances), result)]


def values_of(problem: Problem, result: Result) -> list[Value]:
    """Return the value of every decision in a result; the start value if the result has none."""
    found = {decision.name: decision.value for decision in result.decisions}

    def value(decision: Decision) -> Value:
        size = found.get(decision.name)
        if size is None or not decision.is_affine:
            return decision.start if size is None else size
        return cmath.rect(size, found.get(angle_name(decision), decision.set.angles[0]))

    return [value(decision) for decision in problem.decisions]


def decided(
    design: Design, bounds: Mapping[str, Price] | None = None, unfelt: float = 0.0
) -> tuple[DecisionValue, ...]:
    """Return the decisions of a design, with prices of the bounds that it stands at, where that share is felt."""
    minimum = unfelt * design.value
    return tuple(
        _priced(entry, (bounds or {}).get(entry.name), minimum)
        for decision, value in zip(design.problem.decisions, design.values, strict=True)
        for entry in decision_values(decision, value)
    )


def _priced(entry: DecisionValue, price: Price | None, minimum: float) -> DecisionValue:
    if price is None or not entry.at_bound:
        return entry
    own = price.felt(minimum / (max(abs(entry.lower), abs(entry.upper)) or 1.0))
    return replace(entry, shadow_price=own.relaxed, tightening_price=own.other)


def decision_values(decision: Decision, value: Value) -> tuple[DecisionValue, ...]:
    """Size and, where open, angle of one decision."""
    own = decision.set
    (size, angle), (given_size, given_angle) = own.split(value), own.split(decision.start)
    reach = own.scale * ACTIVE if decision.is_affine else (own.upper - own.lower) * ACTIVE
    high, low = size >= own.upper - reach, size <= own.lower + reach
    at_bound = high or (own.width == 1 and low)
    entry = DecisionValue(decision.name, size, decision.unit, own.lower, own.upper, given_size, at_bound)
    if own.width == 1:
        return (entry,)
    low_angle, high_angle = own.angles
    edge = not own.free_angle and size > reach and min(angle - low_angle, high_angle - angle) < 1e-6
    name = angle_name(decision)
    return entry, DecisionValue(name, angle, "rad", low_angle, high_angle, given_angle, edge)
