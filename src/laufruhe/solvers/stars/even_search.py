"""Search over all even stars: which solver decides, and what it proves (S18)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extension import lack
from laufruhe.load_models.amplitudes import AmplitudeObjective, amplitude_objective
from laufruhe.load_models.pair_tables import PairObjective
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate, Method
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import gap_of
from laufruhe.solvers.stars.cut_search import search_designs
from laufruhe.solvers.stars.enumeration import MOST_SLOTS, StarSearchResult, enumerate_orders, enumerate_stars
from laufruhe.solvers.stars.families import Family, families_of
from laufruhe.solvers.stars.ranking import RankedStar, ranked_star

MOST_LISTED = 1_000_000


@dataclass(frozen=True, eq=False)
class EvenDesign:
    """A design that a search returned, before it is evaluated anew.

    Attributes
    ----------
    steps
        Steps of the throws.
    built
        Numbers of the sets of optional shafts that are built.
    value, bound
        Objective, and its bound over all designs of this star [SI].
    proven
        Whether nothing that was left out is better.
    """

    family: Family
    steps: tuple[int, ...]
    built: tuple[int, ...]
    candidate: Candidate
    value: float
    bound: float
    proven: bool

    @classmethod
    def of_steps(
        cls, phasing: Phasing, family: Family, steps: tuple[int, ...], built: tuple[int, ...], value: float,
        bound: float, proven: bool,
    ) -> EvenDesign:  # fmt: skip
        """Return the design of a family with these steps and sets of shafts."""
        return cls(family, steps, built, family.candidate(phasing, steps, phasing.without(built)), value, bound, proven)

    def ranked(self, phasing: Phasing) -> RankedStar:
        """Return its entry of a ranking."""
        if self.family.is_of_orders:
            phasing = replace(phasing, firing_order=self.candidate.firing_order)
        return ranked_star(phasing, self.candidate, self.steps, self.value, self.bound, self.proven)

    def equals(self, other: EvenDesign) -> bool:
        """Return True if its star is an image of the other and is worth the same (S2)."""
        if self.family is not other.family or self.built != other.built:
            return False
        if abs(self.value - other.value) > 1e-6 * max(self.value, other.value):
            return False
        space = replace(self.family.space, mirror=True, reflect=True)
        both = space.canonical(np.array([self.steps, other.steps], dtype=np.uint8))
        return bool(np.all(both[0] == both[1]))


@dataclass(frozen=True, eq=False)
class EvenStarResult:
    """Designs, best first, and the bound of all designs."""

    designs: tuple[EvenDesign, ...]
    bound: float
    complete: bool
    looked_at: int
    method: str
    infeasible: int = 0


def can_list(problem: Problem, families: Sequence[Family]) -> bool:
    """Return True if the even stars of a problem, or its firing orders, are few enough to be looked at one by one."""
    return sum(family.size for family in families) <= MOST_LISTED or _differ_by_squares(problem, families)


def is_long(problem: Problem) -> bool:
    """Return True if even stars are open that are too many to be listed."""
    phasing = problem.phasing
    if phasing is None or phasing.throws is not None or phasing.throw_bounds is not None:
        return False
    return not can_list(problem, families_of(phasing, problem.depends_on_firing_order)[0])


def refuse_long(problem: Problem) -> None:
    """Raise `ModelError` if even stars are open that are too many to be listed."""
    if is_long(problem):
        raise _too_many()


def _too_many() -> ModelError:
    rule, remedy = lack("long_cranks")
    return ModelError(f"a crank of more than {MOST_LISTED} even stars {rule}; {remedy}")


def search_even(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> EvenStarResult:
    """Return the best designs of all even stars: every star where orders alone count, else cuts of cone programs."""
    if not can_list(problem, families):
        raise _too_many()
    if _differ_by_squares(problem, families):
        (family,) = families
        if phasing.cylinders > MOST_SLOTS:
            raise ModelError(f"firing orders of more than {MOST_SLOTS} cylinders are too many to examine; give throws")
        model = family.model(phasing)
        pairs = PairObjective.of(model.at(model.samples))
        listed = enumerate_orders(pairs, phasing.cylinders, phasing.best, phasing.time_limit)
        answer = listed_answer(phasing, family, listed, "every firing order looked at, pair by pair of throws")
        return replace(answer, infeasible=0 if answer.designs else listed.nodes)
    simple = [(family, objective) for family in families if (objective := amplitudes(phasing, family)) is not None]
    if len(simple) < len(families):
        return _search_by_cuts(problem, phasing, families)
    answers = []
    for family, objective in simple:
        listed = enumerate_stars(replace(family.space, mirror=True, reflect=True), objective, phasing.best)
        answers.append(listed_answer(phasing, family, listed, "every star looked at"))
    return merge_answers(answers, phasing.best)


def _differ_by_squares(problem: Problem, families: Sequence[Family]) -> bool:
    loads = [measure for measure in problem.measures if not measure.channel.is_number]
    has_squares = all(measure.is_load and measure.norm.is_euclidean for measure in loads)
    is_firing = all(family.is_of_orders and not family.fixed for family in families)
    has_shafts = problem.phasing is not None and bool(problem.phasing.shafts.optional)
    return bool(families) and is_firing and has_squares and not problem.decisions and not has_shafts


def amplitudes(phasing: Phasing, family: Family) -> AmplitudeObjective | None:
    """Return the objective of a family as norms of single orders, where it is of that kind (S3)."""
    if family.fixed or family.is_of_orders:
        return None
    first = phasing.realise(family.candidate(phasing, family.first))
    return amplitude_objective(first, phasing, family.layout)


def listed_answer(phasing: Phasing, family: Family, listed: StarSearchResult, method: str) -> EvenStarResult:
    """Return the result of a search of stars alone as an answer."""
    designs = tuple(
        EvenDesign.of_steps(phasing, family, tuple(map(int, star)), (), float(value), float(value), listed.complete)
        for star, value in zip(listed.stars, listed.values, strict=True)
    )
    return EvenStarResult(designs, listed.lower_bound, listed.complete, listed.nodes, method)


def _search_by_cuts(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> EvenStarResult:
    zero_level = numerical_zero(problem)
    count = 10**9 if phasing.method is Method.ENUMERATION else phasing.best
    answers = []
    for family in families:
        model = family.model(phasing)
        search = search_designs(model, family.stars, count, problem.tolerance, phasing.time_limit, zero_level)
        highest = search.beyond * (1.0 + problem.tolerance)
        designs = tuple(
            EvenDesign.of_steps(phasing, family, s.star, s.built, s.value, s.bound, s.value <= highest)
            for s in search.solved
        )
        method = f"cone programs of {len(search.solved)} of {search.designs} designs, dual cuts for the others"
        # what is proven of the best does not need the whole ranking
        is_closed = bool(designs) and gap_of(designs[0].value, search.lower_bound, zero_level) <= problem.tolerance
        complete = search.complete or is_closed
        answers.append(
            EvenStarResult(designs, search.lower_bound, complete, len(search.solved), method, search.infeasible)
        )
    return merge_answers(answers, phasing.best)


def merge_answers(answers: Sequence[EvenStarResult], count: int) -> EvenStarResult:
    """Return the best `count` designs of several geometries, equal ones counted once."""
    best: list[EvenDesign] = []
    for design in sorted((d for answer in answers for d in answer.designs), key=lambda d: d.value):
        if not any(design.equals(other) for other in best):
            best.append(design)
        if len(best) == count:
            break
    return EvenStarResult(
        tuple(best),
        min(answer.bound for answer in answers),
        all(answer.complete for answer in answers),
        sum(answer.looked_at for answer in answers),
        answers[0].method,
        sum(answer.infeasible for answer in answers),
    )
