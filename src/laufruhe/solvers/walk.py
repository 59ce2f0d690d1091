"""Check lower bounds by an independent local search from the final design.

The search ("walk") uses bounds, limits and the exact model only. It shares no code with the method that found the
design or its proof. A feasible design below the lower bound shows that the bound is wrong.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from laufruhe.errors import BoundError, LaufruheError
from laufruhe.machine.firing import firing_turns, from_one, intervals_of, lap_orders
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import Domain, decision_vector, domains_of, projected_vector
from laufruhe.problem.error_bounds import measure_sampling_error, relative
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import SOONEST, Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import unproven_certificate
from laufruhe.solvers.accuracy import objective_error
from laufruhe.solvers.conclusion import Design, limit_values, priced_decisions, values_of, without_proof
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.sampling_refinement import violation_at_fine_sampling
from laufruhe.solvers.stars.ranking import candidates_of, ranked_star
from laufruhe.solvers.stars.star_results import phase_decisions
from laufruhe.solvers.values import ObjectiveValue

MAX_EVALUATIONS, SEED = 64, 0
"""Largest number of evaluations, and seed of the random directions."""
SHARE, SECONDS = 0.03, 0.01
"""Processor time of a walk: share of the time of the solve, and smallest time [s]."""
STEP, SHORTER, LONGER = 0.1, 0.2, 2.0
"""First step relative to the range of a decision, and its factors after a failure and after a success."""
ORDERS = 6
"""Number of firing orders of one crank star that the walk tries."""
ROUNDING = 1e-9
"""Relative difference that counts as none."""


@dataclass(frozen=True, eq=False)
class Point:
    """Design before its evaluation: a problem with its crank star, and the values of the decisions [SI].

    The candidate is the crank star and firing order; None if neither is open.
    """

    problem: Problem
    values: tuple[Value, ...]
    candidate: Candidate | None = None


Move = Callable[[Point, float], Point | None]
"""Function that returns a design at a signed step, relative to the range of the decisions; None if bounds forbid it."""
Change = Callable[[Candidate, float], Candidate | None]
"""Function that returns a crank star and firing order at a signed step; None if there is none."""


@dataclass(frozen=True, eq=False)
class EvaluatedPoint:
    """Design evaluated by the exact model: its objective, and the largest relative violation of a limit.

    `upper_violation` is the largest violation plus sampling error.
    """

    point: Point
    evaluation: Evaluation
    value: float
    violation: float
    upper_violation: float

    def is_better(self, other: EvaluatedPoint, allowed: float) -> bool:
        """Return True if the violation above `allowed` is smaller, or equal and the objective smaller."""
        key, other_key = (max(evaluated.violation, allowed) for evaluated in (self, other))
        return (key, self.value) < (other_key, other.value)


def check_by_walk(problem: Problem, result: Result, spent: float) -> Result:
    """Return the result, without its proof if a nearby design is better than the claimed lower bound allows.

    Random steps from the result's design, each evaluated exactly, look for such a design.

    Parameters
    ----------
    problem
        Problem as the caller of `solve` gave it.
    spent
        Processor time of the solve [s].
    """
    is_infeasible = result.status is Status.INFEASIBLE
    bound = result.certificate.lower_bound if result.certificate is not None else 0.0
    has_claim = (
        bool(result.limits) and problem.phasing is None if is_infeasible else result.status.has_design and bound > 0.0
    )
    if not has_claim or problem.extras:
        return result
    start = _start_point(result)
    # a step may lead to a resonance
    with np.errstate(all="ignore"):
        witness = _LocalSearch(result, start).run(max(SHARE * spent, SECONDS))
        if witness is None or not _contradicts(result, witness, None if is_infeasible else bound):
            return result
    return _without_proof(problem, result, witness, bound)


def _start_point(result: Result) -> Point:
    # the initial design if the result has none
    problem = result.problem
    values = tuple(values_of(problem, result))
    if problem.phasing is not None and result.phasing is not None:
        candidate = next(iter(candidates_of(problem.phasing, result.phasing.ranking[:1])), None)
        return Point(problem, values, candidate)
    return Point(problem, values)


class _LocalSearch:
    """Local search by steps from a design to better ones until a time limit."""

    def __init__(self, result: Result, start: Point) -> None:
        self.limits, self.samples = result.problem.limits, result.final.samples
        errors = [limit.error_estimate for limit in result.limits]
        self.errors = errors if len(errors) == len(self.limits) else [0.0] * len(self.limits)
        self.random = np.random.default_rng(SEED)
        self.start, self.is_infeasible, self.final = start, result.status is Status.INFEASIBLE, result.final
        self.phasing = result.problem.phasing

    def run(self, seconds: float) -> EvaluatedPoint | None:
        """Return the best feasible design near the start that steps reach in a processor time [s]; None without one."""
        until = time.thread_time() + seconds
        best = self._evaluate(self.start, None)
        if best is None:
            return None
        allowed, witness = 0.0 if self.is_infeasible else max(best.violation, 0.0), None
        sources = [self._star_steps(), self._number_steps()]
        pending = [next(source, None) for source in sources]
        count = 0
        for k in itertools.cycle(range(len(sources))):
            if not any(pending) or count >= MAX_EVALUATIONS or time.thread_time() >= until:
                break
            if (step := pending[k]) is None:
                continue
            move, share = step
            point = move(best.point, share)
            evaluated = None if point is None else self._evaluate(point, best)
            count += point is not None
            is_improved = evaluated is not None and evaluated.is_better(best, allowed)
            if (
                evaluated is not None
                and evaluated.upper_violation <= 0.0
                and (witness is None or evaluated.value < witness.value)
            ):
                witness = evaluated
            if is_improved and evaluated is not None:
                best = evaluated
            try:
                pending[k] = sources[k].send(is_improved)
            except StopIteration:
                pending[k] = None
        return witness

    def _evaluate(self, point: Point, best: EvaluatedPoint | None) -> EvaluatedPoint | None:
        """Return the exact evaluation of a design; None if it is no better than `best`, or has no finite loads."""
        problem = point.problem
        try:
            engine, final = problem.design(point.values), self.final
            # the final design has been evaluated before
            is_final = engine == final.engine and problem.fidelity == final.fidelity
            evaluation = final if is_final else evaluate(problem, engine, self.samples)
            value = objective_value(problem, evaluation)
            if not math.isfinite(value) or (best is not None and best.violation <= 0.0 and value >= best.value):
                return None
            violations = [evaluation.check_limit(limit).violation for limit in self.limits]
        except LaufruheError:
            return None
        upper_violation = max(
            (violation + error for violation, error in zip(violations, self.errors, strict=True)), default=0.0
        )
        return EvaluatedPoint(point, evaluation, value, max(violations, default=0.0), upper_violation)

    def _number_steps(self) -> Generator[tuple[Move, float], bool, None]:
        """Yield steps of the open numbers along coordinates and random directions; a successful one is repeated."""
        columns = sum(domain.width for domain in domains_of(self.start.problem.decisions))
        moves = [*(partial(_move_along, row) for row in np.eye(columns)), *self._angle_moves()]
        sizes = [STEP] * len(moves)
        for size in STEP * SHORTER ** np.arange(8.0):
            for k in self.random.permutation(len(moves)):
                for sign in (1.0, -1.0):
                    if (yield moves[k], sign * sizes[k]):
                        while (yield moves[k], sign * sizes[k]):
                            sizes[k] *= LONGER
                        break
                else:
                    sizes[k] *= SHORTER
                if len(moves) > 1:
                    direction = self.random.normal(size=columns) / math.sqrt(max(columns, 1))
                    yield partial(_move_along, direction), size

    def _angle_moves(self) -> list[Move]:
        phasing, candidate = self.phasing, self.start.candidate
        if phasing is None or candidate is None or not phasing.continuous:
            return []
        changes: list[Change] = [partial(_move_throw, phasing, k) for k in range(len(candidate.throws))]
        changes += [partial(_move_angle, phasing, name) for name in ("bank_angle", "split_pin")]
        return [partial(_change, phasing, change) for change in changes]

    def _star_steps(self) -> Generator[tuple[Move, float], bool, None]:
        # ends when no neighbour is better
        moves = self._star_moves()
        failures = 0
        for k in itertools.cycle(self.random.permutation(len(moves))):
            failures = 0 if (yield moves[k], 1.0) else failures + 1
            if failures == len(moves):
                return

    def _star_moves(self) -> list[Move]:
        """Return the changes of a crank star that the search tries.

        These are exchanges of throws, alone or symmetric to the middle, other firing orders, and other optional shafts.
        """
        phasing, candidate = self.phasing, self.start.candidate
        if phasing is None or candidate is None:
            return []
        changes: list[Change] = []
        if phasing.throws is None and phasing.throw_bounds is None:
            last = len(candidate.throws) - 1
            for i, j in itertools.combinations(range(last + 1), 2):
                changes.append(partial(_exchange, phasing, [(i, j)]))
                if i + j < last and {i, j}.isdisjoint({last - i, last - j}):
                    changes.append(partial(_exchange, phasing, [(i, j), (last - i, last - j)]))
        if phasing.firing_order is None:
            changes += [partial(_change_order, phasing, k) for k in range(ORDERS)]
        if phasing.shafts.optional:
            changes += [partial(_build_shafts, phasing, shafts) for shafts in phasing.shafts.allowed]
        return [partial(_change, phasing, change) for change in changes]


def _move_along(direction: Array, point: Point, step: float) -> Point | None:
    """Return the design after a step along a direction, shape (n,), relative to the ranges of the decisions."""
    domains = domains_of(point.problem.decisions)
    x = decision_vector(domains, point.values)
    if len(x) != len(direction):
        return None
    widths = [d.set.upper - d.set.lower for d in domains for _ in range(d.width)]
    moved = x + step * direction * np.array(widths)
    for domain in domains:
        moved[domain.columns] = domain.project(moved)
    if np.array_equal(moved, x):
        return None
    return replace(point, values=tuple(_value(domain, moved) for domain in domains))


def _value(domain: Domain, x: Array) -> Value:
    value = domain.complex_value(x)
    return value if domain.decision.is_affine else value.real


def _move_throw(phasing: Phasing, k: int, candidate: Candidate, step: float) -> Candidate:
    # the first throw stays at zero without bounds of its own (C5)
    throws = list(candidate.throws)
    if phasing.throw_bounds is None:
        width = min(phasing.intervals.maximum - phasing.intervals.minimum, phasing.even_interval)
        throws[k] += step * width if k else 0.0
    else:
        low, high = phasing.throw_bounds[k]
        throws[k] = min(max(throws[k] + step * (high - low), low), high)
    return replace(candidate, throws=tuple(throws))


def _move_angle(phasing: Phasing, name: str, candidate: Candidate, step: float) -> Candidate | None:
    low, high = (phasing.bank if name == "bank_angle" else phasing.split) or (0.0, 0.0)
    angle = getattr(candidate, name)
    if angle is None:
        return None
    return replace(candidate, **{name: min(max(angle + step * (high - low), low), high)})


def _exchange(phasing: Phasing, pairs: Sequence[tuple[int, int]], candidate: Candidate, _: float) -> Candidate | None:
    """Return the crank with the throws of each pair exchanged, and their cylinders in the firing order."""
    pins, throws, order = phasing.layout_of(candidate).pins, list(candidate.throws), candidate.firing_order
    for i, j in pairs:
        cylinders, other = ([k + 1 for k, pin in enumerate(pins) if pin == throw] for throw in (i, j))
        if len(cylinders) != len(other) or order is None:
            return None
        throws[i], throws[j] = throws[j], throws[i]
        changed = dict(zip((*cylinders, *other), (*other, *cylinders), strict=True))
        order = from_one([changed.get(number, number) for number in order])
    # cylinder 1 keeps its angle (C5)
    shift = candidate.throws[0] - throws[0]
    rotated = tuple((angle + shift) % math.tau for angle in throws)
    return replace(candidate, throws=rotated, firing_order=order)


def _change_order(phasing: Phasing, k: int, candidate: Candidate, _: float) -> Candidate | None:
    orders = lap_orders(phasing.cycle, phasing.layout_of(candidate), candidate.throws)
    order = next(itertools.islice(orders, k, None), None)
    return None if order is None else replace(candidate, firing_order=order)


def _build_shafts(phasing: Phasing, built: Sequence[int], candidate: Candidate, _: float) -> Candidate:
    return replace(candidate, left_out=phasing.without(built))


def _change(phasing: Phasing, change: Change, point: Point, step: float) -> Point | None:
    """Return the design of a changed candidate with the present decisions; None if its firing order is not allowed."""
    candidate = None if point.candidate is None else change(point.candidate, step)
    if candidate is None or candidate == point.candidate:
        return None
    if phasing.firing_order is not None and candidate.firing_order != phasing.firing_order:
        return None
    if candidate.firing_order is not None:
        turns = firing_turns(phasing.layout_of(candidate), candidate.throws, candidate.firing_order)
        intervals = intervals_of(phasing.cycle, turns)
        if not phasing.intervals.holds(intervals) or min(intervals) <= SOONEST:
            return None
    try:
        problem = phasing.problem_of(candidate)
    except LaufruheError:
        return None
    values_by_name = dict(zip((d.name for d in point.problem.decisions), point.values, strict=True))
    values = [values_by_name.get(decision.name, decision.start) for decision in problem.decisions]
    domains = domains_of(problem.decisions)
    x = projected_vector(domains, values)
    return Point(problem, tuple(_value(domain, x) for domain in domains), candidate)


def _contradicts(result: Result, witness: EvaluatedPoint, bound: float | None) -> bool:
    """Return True if a known design refutes a bound: it is feasible and below it by more than the sampling error.

    `bound` is None if the result claims that no design is feasible.
    """
    problem, evaluation = witness.point.problem, witness.evaluation
    if bound is not None:
        if witness.value >= bound:
            return False
        # the bound may hold for the samples of the fidelity only
        coarse = replace(evaluation, samples=min(evaluation.samples, result.problem.fidelity.samples))
        factor = 1.0 + 2.0 * objective_error(problem, coarse) + ROUNDING
        if witness.value * factor + numerical_zero(problem, evaluation.engine) >= bound:
            return False
    standings = ((limit, evaluation.check_limit(limit)) for limit in problem.limits)
    is_feasible = all(
        standing.violation + relative(measure_sampling_error(limit.measure, evaluation), standing.value) <= 0.0
        for limit, standing in standings
    )
    return is_feasible and violation_at_fine_sampling(problem, evaluation) <= 0.0


def _without_proof(problem: Problem, result: Result, witness: EvaluatedPoint, bound: float) -> Result:
    """Return the better design of the check as a result without proof."""
    point, candidate, original = witness.point, witness.point.candidate, result.problem
    problem_of_design = replace(point.problem, phasing=original.phasing)
    design = Design(problem_of_design, point.values, witness.evaluation, witness.value, witness.violation)
    decisions, details = priced_decisions(design), result.phasing
    if details is not None and candidate is not None and original.phasing is not None:
        decisions = (*phase_decisions(problem, original.phasing, candidate), *decisions)
        if candidate != next(iter(candidates_of(original.phasing, details.ranking[:1])), None):
            first = ranked_star(original.phasing, candidate, None, witness.value, 0.0, False)
            details = replace(details, ranking=(first, *details.ranking))
    values = [objective_value(replace(original, objective=x.terms), witness.evaluation) for x in original.ranks]
    unproven = replace(
        result,
        problem=problem_of_design,
        status=Status.FEASIBLE,
        objective=ObjectiveValue.of(original, witness.value, objective_value(original, result.initial)),
        certificate=unproven_certificate(witness.value, math.inf, "local search by exact evaluations, without a bound"),
        decisions=decisions,
        limits=limit_values(problem_of_design, witness.evaluation),
        final=witness.evaluation,
        message="",
        error=partial(objective_error, problem_of_design, witness.evaluation),
        phasing=details,
        ranks=tuple(
            replace(rank, minimum=min(rank.minimum, value) if k == 0 else rank.minimum, final=value, price=math.nan)
            for k, (rank, value) in enumerate(zip(result.ranks, values, strict=False))
        ),
        nearest=None,
    )
    source, claim = "check by local search", bound
    if result.status is Status.INFEASIBLE:
        source, claim = "check by local search: a design meets the limits, although none was said to exist", math.inf
    return without_proof(unproven, BoundError(source, claim, witness.value))
