"""A second witness: a walk by exact evaluations from the decided design.

The walk knows the bounds, the limits and the exact model. It shares nothing with the search that found the design, nor
with the proof. A design on its way that lies under the lower bound shows that the bound is false.
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
from laufruhe.problem.decision import Domain, columns_of, domains_of, vector_of
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
"""Evaluations of a walk at most, and the seed of its random directions."""
SHARE, SECONDS = 0.03, 0.01
"""Processor time of a walk: so many seconds, or a share of the time of the solve where that is more."""
STEP, SHORTER, LONGER = 0.1, 0.2, 2.0
"""First step as a share of the bounds, and its factors after a failure and after a success."""
ORDERS = 6
"""Firing orders of one star that are tried."""
ROUNDING = 1e-9
"""Relative difference that counts as none."""


@dataclass(frozen=True, eq=False)
class Stand:
    """A design before it is evaluated.

    Attributes
    ----------
    problem
        With its star.
    values
        Of the decisions.
    candidate
        Star and firing order; None where neither is open.
    """

    problem: Problem
    values: tuple[Value, ...]
    candidate: Candidate | None = None


Move = Callable[[Stand, float], Stand | None]
"""Gives the design that is a signed share of the bounds away; None where the bounds leave none."""


@dataclass(frozen=True, eq=False)
class Visit:
    """A design by the exact model.

    Attributes
    ----------
    value
        Objective.
    violation
        Largest relative excess over a limit.
    sure
        The same with what samples may have missed of each limit.
    """

    stand: Stand
    evaluation: Evaluation
    value: float
    violation: float
    sure: float

    def is_better(self, other: Visit, allowed: float) -> bool:
        """Compare by the limits first, then by the objective."""
        own, theirs = (max(each.violation, allowed) for each in (self, other))
        return (own, self.value) < (theirs, other.value)


def walked(problem: Problem, found: Result, spent: float) -> Result:
    """Return the result, its proof withheld where a walk from its design shows that it is false.

    Parameters
    ----------
    problem
        As it was asked.
    spent
        Processor time of the solve [s].
    """
    is_none = found.status is Status.INFEASIBLE
    bound = found.certificate.lower_bound if found.certificate is not None else 0.0
    claims = bool(found.limits) and problem.phasing is None if is_none else found.status.has_design and bound > 0.0
    if not claims or problem.extras:
        return found
    start = _start(found)
    # a step may lead onto a resonance
    with np.errstate(all="ignore"):
        witness = _Walk(found, start).run(max(SHARE * spent, SECONDS))
        if witness is None or not _is_shown(found, witness, None if is_none else bound):
            return found
    return _withheld(problem, found, witness, bound)


def _start(found: Result) -> Stand:
    # the initial design if none was decided
    problem = found.problem
    values = tuple(values_of(problem, found))
    if problem.phasing is not None and found.phasing is not None:
        candidate = next(iter(candidates_of(problem.phasing, found.phasing.ranking[:1])), None)
        return Stand(problem, values, candidate)
    return Stand(problem, values)


class _Walk:
    """Steps from a design to better ones while time is left."""

    def __init__(self, found: Result, start: Stand) -> None:
        self.limits, self.samples = found.problem.limits, found.final.samples
        errors = [limit.error_estimate for limit in found.limits]
        self.errors = errors if len(errors) == len(self.limits) else [0.0] * len(self.limits)
        self.random = np.random.default_rng(SEED)
        self.start, self.is_none, self.final = start, found.status is Status.INFEASIBLE, found.final
        self.phasing = found.problem.phasing

    def run(self, seconds: float) -> Visit | None:
        """Return the best design that surely keeps the limits; None where no step found a better one."""
        is_over = _timer(seconds)
        here = self._visit(self.start, None)
        if here is None:
            return None
        allowed, witness = 0.0 if self.is_none else max(here.violation, 0.0), None
        sources = [self._choices(), self._steps()]
        coming = [next(source, None) for source in sources]
        seen = 0
        for k in itertools.cycle(range(len(sources))):
            if not any(coming) or seen >= MOST or is_over():
                return witness
            if (step := coming[k]) is None:
                continue
            move, share = step
            stand = move(here.stand, share)
            visit = None if stand is None else self._visit(stand, here)
            seen += stand is not None
            won = visit is not None and visit.is_better(here, allowed)
            if visit is not None and visit.sure <= 0.0 and (witness is None or visit.value < witness.value):
                witness = visit
            if won and visit is not None:
                here = visit
            try:
                coming[k] = sources[k].send(won)
            except StopIteration:
                coming[k] = None
        return witness

    def _visit(self, stand: Stand, here: Visit | None) -> Visit | None:
        """The design by the exact model; None where it has no loads. Limits are read where it may be better."""
        problem = stand.problem
        try:
            engine, final = problem.design(stand.values), self.final
            # the exact model has evaluated the design that is told
            is_told = engine == final.engine and problem.fidelity == final.fidelity
            evaluation = final if is_told else evaluate(problem, engine, self.samples)
            value = objective_value(problem, evaluation)
            if not math.isfinite(value) or (here is not None and here.violation <= 0.0 and value >= here.value):
                return None
            excesses = [evaluation.standing(limit).violation for limit in self.limits]
        except LaufruheError:
            return None
        sure = max((violation + error for violation, error in zip(excesses, self.errors, strict=True)), default=0.0)
        return Visit(stand, evaluation, value, max(excesses, default=0.0), sure)

    def _steps(self) -> Generator[tuple[Move, float], bool, None]:
        """Steps along coordinates, and along random directions beside them; each goes on while it leads down."""
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
        failed = 0
        for k in itertools.cycle(self.random.permutation(len(moves))):
            failed = 0 if (yield moves[k], 1.0) else failed + 1
            if failed == len(moves):
                return

    def _stars(self) -> list[Move]:
        """Throws that change places, alone or with those of the other end; other firing orders and optional shafts."""
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
        return [*moves, *(_built(phasing, built) for built in phasing.shafts.allowed if phasing.shafts.optional)]


def _timer(seconds: float) -> Callable[[], bool]:
    """Return whether so much processor time of this thread has passed; a clock on the wall is never behind it."""
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
    """Step along a direction in shares of the bounds, back into them."""

    def move(stand: Stand, share: float) -> Stand | None:
        domains = domains_of(stand.problem.decisions)
        x = vector_of(domains, stand.values)
        if len(x) != len(direction):
            return None
        wide = [d.set.upper - d.set.lower for d in domains for _ in range(d.width)]
        moved = x + share * direction * np.array(wide)
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
    """Move one throw; the first one is where cylinder 1 fires unless it has bounds of its own (C5)."""
    bounds = phasing.throw_bounds
    wide = min(phasing.intervals.maximum - phasing.intervals.minimum, phasing.even_interval)

    def move(stand: Stand, share: float) -> Stand | None:
        assert stand.candidate is not None
        throws = list(stand.candidate.throws)
        if bounds is None:
            throws[k] += share * wide if k else 0.0
        else:
            low, high = bounds[k]
            throws[k] = min(max(throws[k] + share * (high - low), low), high)
        return _realised(phasing, stand, replace(stand.candidate, throws=tuple(throws)))

    return move


def _angle(phasing: Phasing, name: str) -> Move:
    """Move the bank angle or the split pins."""
    low, high = (phasing.bank if name == "bank_angle" else phasing.split) or (0.0, 0.0)

    def move(stand: Stand, share: float) -> Stand | None:
        assert stand.candidate is not None
        given = getattr(stand.candidate, name)
        if given is None:
            return None
        angle = min(max(given + share * (high - low), low), high)
        return _realised(phasing, stand, replace(stand.candidate, **{name: angle}))

    return move


def _swapped(phasing: Phasing, pairs: Sequence[tuple[int, int]]) -> Move:
    """Throws of each pair change places, and their cylinders their turns in the firing order."""

    def move(stand: Stand, _: float) -> Stand | None:
        candidate = stand.candidate
        assert candidate is not None
        pins, throws, order = phasing.layout_of(candidate).pins, list(candidate.throws), candidate.firing_order
        for i, j in pairs:
            own, other = ([k + 1 for k, pin in enumerate(pins) if pin == throw] for throw in (i, j))
            if len(own) != len(other) or order is None:
                return None
            throws[i], throws[j] = throws[j], throws[i]
            changed = dict(zip((*own, *other), (*other, *own), strict=True))
            order = from_one([changed.get(number, number) for number in order])
        # cylinder 1 stays where it fires (C5)
        back = candidate.throws[0] - throws[0]
        turned = tuple((angle + back) % math.tau for angle in throws)
        return _realised(phasing, stand, replace(candidate, throws=turned, firing_order=order))

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
    """The design of a candidate with the decisions as they stand; None where it fires as is not allowed."""
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
    known = dict(zip((d.name for d in stand.problem.decisions), stand.values, strict=True))
    values = [known.get(decision.name, decision.start) for decision in problem.decisions]
    domains = domains_of(problem.decisions)
    x = columns_of(domains, values)
    return Stand(problem, tuple(_value(domain, x) for domain in domains), candidate)


# --- what a walk shows


def _is_shown(found: Result, witness: Visit, bound: float | None) -> bool:
    """Tell if a design keeps the limits, and lies under the bound if there is one, by more than samples may miss."""
    problem, own = witness.stand.problem, witness.evaluation
    if bound is not None:
        if witness.value >= bound:
            return False
        # the bound may be of as few angles as the fidelity has
        coarse = replace(own, samples=min(own.samples, found.problem.fidelity.samples))
        over = 1.0 + 2.0 * error_of(problem, coarse) + ROUNDING
        if witness.value * over + numerical_zero(problem, own.engine) >= bound:
            return False
    standings = ((limit, own.standing(limit)) for limit in problem.limits)
    kept = all(
        stands.violation + relative(missed(limit.measure, own), stands.value) <= 0.0 for limit, stands in standings
    )
    return kept and violation_at_fine_sampling(problem, own) <= 0.0


def _withheld(problem: Problem, found: Result, witness: Visit, bound: float) -> Result:
    """The design of the walk, of which nothing is proven."""
    stand, candidate, own = witness.stand, witness.stand.candidate, found.problem
    shown = replace(stand.problem, phasing=own.phasing)
    design = Design(shown, stand.values, witness.evaluation, witness.value, witness.violation)
    decisions, details = decided(design), found.phasing
    if details is not None and candidate is not None and own.phasing is not None:
        decisions = (*phase_decisions(problem, own.phasing, candidate), *decisions)
        if candidate != next(iter(candidates_of(own.phasing, details.ranking[:1])), None):
            first = ranked_star(own.phasing, candidate, None, witness.value, 0.0, False)
            details = replace(details, ranking=(first, *details.ranking))
    moved = replace(
        found,
        problem=shown,
        status=Status.FEASIBLE,
        objective=ObjectiveValue.of(own, witness.value, objective_value(own, found.initial)),
        certificate=unproven_certificate(witness.value, math.inf, "a walk by exact evaluations, which proves nothing"),
        decisions=decisions,
        limits=limit_values(shown, witness.evaluation),
        final=witness.evaluation,
        message="",
        error=partial(error_of, shown, witness.evaluation),
        phasing=details,
        ranks=_reached(found, witness),
        nearest=None,
    )
    what, minimum = "a walk", bound
    if found.status is Status.INFEASIBLE:
        what, minimum = "a walk; it was said that no design keeps the limits", math.inf
    return without_proof(moved, BoundError(what, minimum, witness.value))


def _reached(found: Result, witness: Visit) -> tuple[RankValue, ...]:
    own = found.problem
    values = [objective_value(replace(own, objective=rank.terms), witness.evaluation) for rank in own.ranks]
    return tuple(
        replace(rank, minimum=min(rank.minimum, value) if k == 0 else rank.minimum, final=value, price=math.nan)
        for k, (rank, value) in enumerate(zip(found.ranks, values, strict=False))
    )
