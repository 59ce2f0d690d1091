"""Provers: methods that bound designs on open mounts from below, behind one interface.

The core has boxes of stiffness (E38-E40). Extensions add theirs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cache

from laufruhe.extension import in_order
from laufruhe.numerics.budget import is_time_over, minimum_time
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.mounts.subdivision import is_stiffness_problem, stiffness_bounds
from laufruhe.prove.witness import Witness

EARLY = 0.2
"""Share of the budget of boxes of stiffness that is spent before the other provers have their turn."""
MIN_SECONDS = 0.5
"""Time for the first bound, even after the end of the time budget [s]."""


@dataclass(eq=False)
class Question:
    """Question to provers, whether any design is better than the incumbent by more than the gap tolerance.

    Attributes
    ----------
    problem
        Problem on elastic mounts with open numbers.
    value
        Objective of the incumbent [SI], infinite without one; provers lower it when they find a better design.
    gap_tolerance
        Improvement that counts as none [SI].
    good_values
        Values of the decisions of a good design.
    witness
        Incumbent as the vector of its open mount numbers, to check bounds; None without an incumbent.
    in_batch
        Whether this is one of many problems, so that cheap bounds come first.
    open_throws
        Open phasing and the candidate crank, if throws are open between bounds; None for a fixed crank.
    bound
        Best lower bound so far [SI], raised by `run_provers`.
    """

    problem: Problem
    value: float
    gap_tolerance: float
    good_values: Sequence[Value] = ()
    witness: Witness | None = None
    in_batch: bool = False
    open_throws: tuple[Phasing, Candidate] | None = None
    bound: float = 0.0


@dataclass(frozen=True)
class Prover:
    """A method that bounds designs on open mounts from below.

    Attributes
    ----------
    name
        Name of the prover's boxes in messages.
    applies
        Function that returns True if the prover bounds a problem.
    bounds
        Function that yields increasing bounds, each after more work, with the number of all boxes so far. The `places`
        of a result are start points for a search: open mount numbers, then columns of the unbalances.
    before
        Name of the prover that this one precedes.
    for_open_throws
        Whether the prover bounds only problems with throws that are open between bounds.
    """

    name: str
    applies: Callable[[Problem], bool]
    bounds: Callable[[Question], Iterator[BoxResult]]
    before: str = ""
    for_open_throws: bool = False


def _stiffness_bounds(question: Question) -> Iterator[BoxResult]:
    yield from stiffness_bounds(
        question.problem, question.value, question.gap_tolerance, (EARLY, 1.0), question.witness
    )


PROVERS = (Prover("boxes of stiffness", is_stiffness_problem, _stiffness_bounds),)
"""Provers of the core."""


@cache
def provers() -> tuple[Prover, ...]:
    """Return all provers in their order."""
    ordered: tuple[Prover, ...] = in_order("provers", Prover, PROVERS)
    return ordered


def run_provers(question: Question) -> BoxResult:
    """Prove a lower bound by all methods that apply, in rounds of growing work, until the gap closes or time is over.

    The bound of the question is raised to the best one found. The result has this bound, the number of all boxes, and
    the start points of the last prover that has any.
    """
    eligible = [prover for prover in provers() if prover.for_open_throws is (question.open_throws is not None)]
    running = [prover.bounds(question) for prover in eligible if prover.applies(question.problem)]
    results: dict[Iterator[BoxResult], BoxResult] = {}

    def is_over() -> bool:
        return bool(results) and (is_time_over() or not question.bound < question.value - question.gap_tolerance)

    while running and not is_over():
        for bounds in tuple(running):
            if is_over():
                break
            with minimum_time(MIN_SECONDS) if not results else nullcontext():
                result = next(bounds, None)
            if result is None:
                running.remove(bounds)
            else:
                results[bounds], question.bound = result, max(question.bound, result.bound)
    places = [result.places for result in results.values() if result.places]
    return BoxResult(question.bound, sum(result.boxes for result in results.values()), places[-1] if places else ())
