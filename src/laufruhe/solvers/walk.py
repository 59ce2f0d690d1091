"""Check lower bounds by an independent local search from the optimised design.

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
from laufruhe.fidelity.error_bounds import missed, relative
from laufruhe.machine.firing import firing_turns, from_one, intervals_of, lap_orders
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import Domain, decision_vector, domains_of, projected_vector
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import SOONEST, Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import unproven_certificate
from laufruhe.solvers.accuracy import error_of
from laufruhe.solvers.conclusion import Design, decided, limit_values, values_of
from laufruhe.solvers.failed_proof import without_proof
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.sampling_refinement import violation_at_fine_sampling
from laufruhe.solvers.stars.ranking import candidates_of, ranked_star
from laufruhe.solvers.stars.star_results import phase_decisions
from laufruhe.solvers.values import ObjectiveValue, RankValue

MOST, SEED = 64, 0
"""Largest number of evaluations, and seed of the random directions."""
SHARE, SECONDS = 0.03, 0.01
"""Processor time of a walk: share of the time of the solve, and smallest time [s]."""
STEP, SHORTER, LONGER = 0.1, 0.2, 2.0
"""First step relative to the range of a decision, and its factors after a failure and after a success."""
ORDERS = 6
"""Number of firing orders of one star that the walk tries."""
ROUNDING = 1e-9
"""Relative difference that counts as none."""


@dataclass(frozen=True, eq=False)
class Stand:
    """Design before its evaluation.

    Attributes
    ----------
    problem
        Problem with the star of the design.
    values
        Values of the decisions [SI].
    candidate
        Star and firing order; None if neither is open.
    """

    problem: Problem
    values: tuple[Value, ...]
    candidate: Candidate | None = None


Move = Callable[[Stand, float], Stand | None]
"""Function that returns a design at a signed step, relative to the range of the decisions; None if bounds forbid it."""


@dataclass(frozen=True, eq=False)
class Visit:
    """Design evaluated by the exact model.

    Attributes
    ----------
    value
        Objective.
    violation
        Largest relative violation of a limit.
    sure
        Largest relative violation plus sampling error of a limit.
    """

    stand: Stand
    evaluation: Evaluation
    value: float
    violation: float
    sure: float

    def is_better(self, other: Visit, allowed: float) -> bool:
        """Return True if the violation above `allowed` is smaller, or equal and the objective smaller."""
        key, other_key = (max(visit.violation, allowed) for visit in (self, other))
        return (key, self.value) < (other_key, other.value)


def walked(problem: Problem, result: Result, spent: float) -> Result:
    """Return the result, without proof if a walk from its design finds a better feasible design than the bound allows.

    Parameters
    ----------
    problem
        Problem as the caller of `solve` gave it.
    spent
        Processor time of the solve [s].
    """
    is_infeasible = result.status is Status.INFEASIBLE
    bound = result.certificate.lower_bound if result.certificate is not None else 0.0
    claims = (
        bool(result.limits) and problem.phasing is None if is_infeasible else result.status.has_design and bound > 0.0
    )
    if not claims or problem.extras:
        return result
    start = _start(result)
    # a step may lead to a resonance
    with np.errstate(all="ignore"):
        witness = _Walk(result, start).run(max(SHARE * spent, SECONDS))
        if witness is None or not _is_shown(result, witness, None if is_infeasible else bound):
            return result
    return _withheld(problem, result, witness, bound)


def _start(result: Result) -> Stand:
    # the initial design if the result has none
    problem = result.problem
    values = tuple(values_of(problem, result))
    if problem.phasing is not None and result.phasing is not None:
        candidate = next(iter(candidates_of(problem.phasing, result.phasing.ranking[:1])), None)
        return Stand(problem, values, candidate)
    return Stand(problem, values)


class _Walk:
    """Local search by steps from a design to better ones until a time limit."""

    def __init__(self, result: Result, start: Stand) -> None:
        self.limits, self.samples = result.problem.limits, result.final.samples
        errors = [limit.error_estimate for limit in result.limits]
        self.errors = errors if len(errors) == len(self.limits) else [0.0] * len(self.limits)
        self.random = np.random.default_rng(SEED)
        self.start, self.is_none, self.final = start, result.status is Status.INFEASIBLE, result.final
        self.phasing = result.problem.phasing

    def run(self, seconds: float) -> Visit | None:
        """Return the best feasible design within a processor time [s]; None if no step leads to one."""
        is_over = _timer(seconds)
        best = self._visit(self.start, None)
        if best is None:
            return None
        allowed, witness = 0.0 if self.is_none else max(best.violation, 0.0), None
        sources = [self._choices(), self._steps()]
        pending = [next(source, None) for source in sources]
        count = 0
        for k in itertools.cycle(range(len(sources))):
            if not any(pending) or count >= MOST or is_over():
                return witness
            if (step := pending[k]) is None:
                continue
            move, share = step
            stand = move(best.stand, share)
            visit = None if stand is None else self._visit(stand, best)
            count += stand is not None
            is_improved = visit is not None and visit.is_better(best, allowed)
            if visit is not None and visit.sure <= 0.0 and (witness is None or visit.value < witness.value):
                witness = visit
            if is_improved and visit is not None:
                best = visit
            try:
                pending[k] = sources[k].send(is_improved)
            except StopIteration:
                pending[k] = None
        return witness

    def _visit(self, stand: Stand, best: Visit | None) -> Visit | None:
        """Evaluate a design; None without finite loads, or if its objective is not below that of the best one."""
        problem = stand.problem
        try:
            engine, final = problem.design(stand.values), self.final
            # the final design has been evaluated before
            is_final = engine == final.engine and problem.fidelity == final.fidelity
            evaluation = final if is_final else evaluate(problem, engine, self.samples)
            value = objective_value(problem, evaluation)
            if not math.isfinite(value) or (best is not None and best.violation <= 0.0 and value >= best.value):
                return None
            excesses = [evaluation.check_limit(limit).violation for limit in self.limits]
        except LaufruheError:
            return None
        sure = max((violation + error for violation, error in zip(excesses, self.errors, strict=True)), default=0.0)
        return Visit(stand, evaluation, value, max(excesses, default=0.0), sure)

    def _steps(self) -> Generator[tuple[Move, float], bool, None]:
        """Yield steps along coordinates and random directions; repeat each while it leads to better designs."""
        moves = [*_coordinates(self.start.problem), *self._angles()]
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
                    columns = sum(domain.width for domain in domains_of(self.start.problem.decisions))
                    yield _along(self.random.normal(size=columns) / math.sqrt(max(columns, 1))), size

    def _angles(self) -> list[Move]:
        phasing, candidate = self.phasing, self.start.candidate
        if phasing is None or candidate is None or not phasing.continuous:
            return []
        moves = [_throw(phasing, k) for k in range(len(candidate.throws))]
        return [*moves, *(_angle(phasing, name) for name in ("bank_angle", "split_pin"))]

    def _choices(self) -> Generator[tuple[Move, float], bool, None]:
        # ends when no neighbour is better
        moves = self._stars()
        failures = 0
        for k in itertools.cycle(self.random.permutation(len(moves))):
            failures = 0 if (yield moves[k], 1.0) else failures + 1
            if failures == len(moves):
                return

    def _stars(self) -> list[Move]:
        """Return exchanges of throws, alone or symmetric to the middle, and other firing orders and optional shafts."""
        phasing, candidate = self.phasing, self.start.candidate
        if phasing is None or candidate is None:
            return []
        moves: list[Move] = []
        if phasing.throws is None and phasing.throw_bounds is None:
            last = len(candidate.throws) - 1
            for i, j in itertools.combinations(range(last + 1), 2):
                moves.append(_swapped(phasing, [(i, j)]))
                if i + j < last and {i, j}.isdisjoint({last - i, last - j}):
                    moves.append(_swapped(phasing, [(i, j), (last - i, last - j)]))
        if phasing.firing_order is None:
            moves += [_fired(phasing, k) for k in range(ORDERS)]
        return [*moves, *(_built(phasing, shafts) for shafts in phasing.shafts.allowed if phasing.shafts.optional)]


def _timer(seconds: float) -> Callable[[], bool]:
    """Return a function that returns True after a processor time of this thread [s].

    Processor time never exceeds wall time, so it is read only once the wall time has passed.
    """
    until, ends = time.thread_time() + seconds, time.perf_counter() + seconds

    def is_over() -> bool:
        nonlocal ends
        if time.perf_counter() < ends:
            return False
        left = until - time.thread_time()
        ends = time.perf_counter() + left
        return left <= 0.0

    return is_over


# --- moves of numbers


def _coordinates(problem: Problem) -> list[Move]:
    columns = sum(domain.width for domain in domains_of(problem.decisions))
    return [_along(row) for row in np.eye(columns)]


def _along(direction: Array) -> Move:
    """Return a step along a direction relative to the ranges of the decisions, shape (n,), with projection."""

    def move(stand: Stand, step: float) -> Stand | None:
        domains = domains_of(stand.problem.decisions)
        x = decision_vector(domains, stand.values)
        if len(x) != len(direction):
            return None
        widths = [d.set.upper - d.set.lower for d in domains for _ in range(d.width)]
        moved = x + step * direction * np.array(widths)
        for domain in domains:
            moved[domain.columns] = domain.project(moved)
        if np.array_equal(moved, x):
            return None
        return replace(stand, values=tuple(_value(domain, moved) for domain in domains))

    return move


def _value(domain: Domain, x: Array) -> Value:
    value = domain.complex_value(x)
    return value if domain.decision.is_affine else value.real


# --- moves of throws and firing orders


def _throw(phasing: Phasing, k: int) -> Move:
    """Return a move of throw `k`; the first throw stays at zero without bounds of its own (C5)."""
    bounds = phasing.throw_bounds
    width = min(phasing.intervals.maximum - phasing.intervals.minimum, phasing.even_interval)

    def move(stand: Stand, step: float) -> Stand | None:
        assert stand.candidate is not None
        throws = list(stand.candidate.throws)
        if bounds is None:
            throws[k] += step * width if k else 0.0
        else:
            low, high = bounds[k]
            throws[k] = min(max(throws[k] + step * (high - low), low), high)
        return _realised(phasing, stand, replace(stand.candidate, throws=tuple(throws)))

    return move


def _angle(phasing: Phasing, name: str) -> Move:
    """Return a move of the bank angle or of the split pins."""
    low, high = (phasing.bank if name == "bank_angle" else phasing.split) or (0.0, 0.0)

    def move(stand: Stand, step: float) -> Stand | None:
        assert stand.candidate is not None
        angle = getattr(stand.candidate, name)
        if angle is None:
            return None
        angle = min(max(angle + step * (high - low), low), high)
        return _realised(phasing, stand, replace(stand.candidate, **{name: angle}))

    return move


def _swapped(phasing: Phasing, pairs: Sequence[tuple[int, int]]) -> Move:
    """Return a move that exchanges the throws of each pair, and their cylinders in the firing order."""

    def move(stand: Stand, _: float) -> Stand | None:
        candidate = stand.candidate
        assert candidate is not None
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
        return _realised(phasing, stand, replace(candidate, throws=rotated, firing_order=order))

    return move


def _fired(phasing: Phasing, k: int) -> Move:

    def move(stand: Stand, _: float) -> Stand | None:
        candidate = stand.candidate
        assert candidate is not None
        orders = lap_orders(phasing.cycle, phasing.layout_of(candidate), candidate.throws)
        order = next(itertools.islice(orders, k, None), None)
        return None if order is None else _realised(phasing, stand, replace(candidate, firing_order=order))

    return move


def _built(phasing: Phasing, built: Sequence[int]) -> Move:

    def move(stand: Stand, _: float) -> Stand | None:
        assert stand.candidate is not None
        return _realised(phasing, stand, replace(stand.candidate, left_out=phasing.without(built)))

    return move


def _realised(phasing: Phasing, stand: Stand, candidate: Candidate) -> Stand | None:
    """Return the design of a candidate with the present decisions; None if its firing order is not permitted."""
    if candidate == stand.candidate:
        return None
    if phasing.firing_order is not None and candidate.firing_order != phasing.firing_order:
        return None
    if candidate.firing_order is not None:
        turns = firing_turns(phasing.layout_of(candidate), candidate.throws, candidate.firing_order)
        intervals = intervals_of(phasing.cycle, turns)
        if not phasing.intervals.holds(intervals) or min(intervals) <= SOONEST:
            return None
    try:
        problem = phasing.realise(candidate)
    except LaufruheError:
        return None
    values_by_name = dict(zip((d.name for d in stand.problem.decisions), stand.values, strict=True))
    values = [values_by_name.get(decision.name, decision.start) for decision in problem.decisions]
    domains = domains_of(problem.decisions)
    x = projected_vector(domains, values)
    return Stand(problem, tuple(_value(domain, x) for domain in domains), candidate)


# --- contradictions between designs and bounds


def _is_shown(result: Result, witness: Visit, bound: float | None) -> bool:
    """Return True if a design is feasible and below the bound by more than the sampling error; no bound is None."""
    problem, evaluation = witness.stand.problem, witness.evaluation
    if bound is not None:
        if witness.value >= bound:
            return False
        # the bound may hold for the samples of the fidelity only
        coarse = replace(evaluation, samples=min(evaluation.samples, result.problem.fidelity.samples))
        factor = 1.0 + 2.0 * error_of(problem, coarse) + ROUNDING
        if witness.value * factor + numerical_zero(problem, evaluation.engine) >= bound:
            return False
    standings = ((limit, evaluation.check_limit(limit)) for limit in problem.limits)
    is_feasible = all(
        standing.violation + relative(missed(limit.measure, evaluation), standing.value) <= 0.0
        for limit, standing in standings
    )
    return is_feasible and violation_at_fine_sampling(problem, evaluation) <= 0.0


def _withheld(problem: Problem, result: Result, witness: Visit, bound: float) -> Result:
    """Return the design of the walk as a result without proof."""
    stand, candidate, original = witness.stand, witness.stand.candidate, result.problem
    problem_of_design = replace(stand.problem, phasing=original.phasing)
    design = Design(problem_of_design, stand.values, witness.evaluation, witness.value, witness.violation)
    decisions, details = decided(design), result.phasing
    if details is not None and candidate is not None and original.phasing is not None:
        decisions = (*phase_decisions(problem, original.phasing, candidate), *decisions)
        if candidate != next(iter(candidates_of(original.phasing, details.ranking[:1])), None):
            first = ranked_star(original.phasing, candidate, None, witness.value, 0.0, False)
            details = replace(details, ranking=(first, *details.ranking))
    unproven = replace(
        result,
        problem=problem_of_design,
        status=Status.FEASIBLE,
        objective=ObjectiveValue.of(original, witness.value, objective_value(original, result.initial)),
        certificate=unproven_certificate(witness.value, math.inf, "a walk by exact evaluations, which proves nothing"),
        decisions=decisions,
        limits=limit_values(problem_of_design, witness.evaluation),
        final=witness.evaluation,
        message="",
        error=partial(error_of, problem_of_design, witness.evaluation),
        phasing=details,
        ranks=_reached(result, witness),
        nearest=None,
    )
    source, claim = "a walk", bound
    if result.status is Status.INFEASIBLE:
        source, claim = "a walk; it was said that no design keeps the limits", math.inf
    return without_proof(unproven, BoundError(source, claim, witness.value))


def _reached(result: Result, witness: Visit) -> tuple[RankValue, ...]:
    problem = result.problem
    values = [objective_value(replace(problem, objective=rank.terms), witness.evaluation) for rank in problem.ranks]
    return tuple(
        replace(rank, minimum=min(rank.minimum, value) if k == 0 else rank.minimum, final=value, price=math.nan)
        for k, (rank, value) in enumerate(zip(result.ranks, values, strict=False))
    )
