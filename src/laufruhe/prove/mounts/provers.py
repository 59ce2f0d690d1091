"""Provers: whoever bounds designs on open mounts from below, all of them asked alike.

The core has boxes of stiffness (E38-E40); extensions add theirs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cache

from laufruhe.extension import in_order
from laufruhe.numerics.budget import at_least, passed
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.best_first import Divided
from laufruhe.prove.mounts.subdivision import divided_bounds, divides
from laufruhe.prove.witness import Known

EARLY = 0.2
"""Share of the boxes of stiffness that is tried before other provers go on."""
LEAST_SECONDS = 0.5
"""Time that the first bound has where time is over [s]."""


@dataclass(eq=False)
class Question:
    """Ask provers if no design is more than `room` better than the best that is known.

    Attributes
    ----------
    problem
        On elastic mounts, some of their numbers open.
    value
        Objective of the best design known [SI], infinite where none is; a prover that meets a better one lowers it.
    room
        Difference that counts as none [SI].
    near
        Decisions of a design near which the best one is.
    known
        The best design by its numbers of the mounts, the witness of bounds.
    of_many
        The same is asked of many problems, so that a bound that is nearly as good and quick comes first.
    moves
        Throws that are open between bounds beside the mounts, and where they stand; None of a crank that is given.
    bound
        Best bound so far [SI]; provers read it, `proven` raises it.
    """

    problem: Problem
    value: float
    room: float
    near: Sequence[Value] = ()
    known: Known | None = None
    of_many: bool = False
    moves: tuple[Phasing, Candidate] | None = None
    bound: float = 0.0


@dataclass(frozen=True)
class Prover:
    """A way to bound designs on open mounts from below.

    Attributes
    ----------
    name
        Of what it divides, in words.
    applies
        Return whether it bounds anything of a problem.
    bounds
        Yield bounds that get better, each after more work; boxes are counted from the first one on. Places are numbers
        of mounts, and columns of unbalances after them, from which a search may find a better design.
    before
        Name of the prover that one of an extension stands before.
    of_moves
        Whether it bounds designs whose throws are open beside the mounts, and no others.
    """

    name: str
    applies: Callable[[Problem], bool]
    bounds: Callable[[Question], Iterator[Divided]]
    before: str = ""
    of_moves: bool = False


def _stiffness_bounds(question: Question) -> Iterator[Divided]:
    yield from divided_bounds(question.problem, question.value, question.room, (EARLY, 1.0), question.known)


PROVERS = (Prover("boxes of stiffness", divides, _stiffness_bounds),)
"""Those of the core."""


@cache
def provers() -> tuple[Prover, ...]:
    """Return all provers in the order in which they are asked."""
    found: tuple[Prover, ...] = in_order("provers", Prover, PROVERS)
    return found


def proven(question: Question) -> Divided:
    """Ask all provers that apply in rounds of growing work, until one closes the question or time is over."""
    asked = [prover for prover in provers() if prover.of_moves is (question.moves is not None)]
    answers = [prover.bounds(question) for prover in asked if prover.applies(question.problem)]
    found: dict[Iterator[Divided], Divided] = {}
    while answers:
        for each in tuple(answers):
            if found and (passed() or not question.bound < question.value - question.room):
                return _together(question, found)
            with at_least(LEAST_SECONDS) if not found else nullcontext():
                answer = next(each, None)
            if answer is None:
                answers.remove(each)
                continue
            found[each], question.bound = answer, max(question.bound, answer.bound)
    return _together(question, found)


def _together(question: Question, found: Mapping[Iterator[Divided], Divided]) -> Divided:
    places = [each.places for each in found.values() if each.places]
    return Divided(question.bound, sum(each.boxes for each in found.values()), places[-1] if places else ())
