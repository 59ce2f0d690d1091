"""Which solver decides the discrete part, and what it proved (S18)."""

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
from laufruhe.solvers.stars.cuts import CutsFound, search_designs
from laufruhe.solvers.stars.families import Family, FiringFamily, families_of
from laufruhe.solvers.stars.firing_search import MOST_SLOTS, enumerate_orders
from laufruhe.solvers.stars.ranking import RankedStar, ranked_star
from laufruhe.solvers.stars.search import StarsFound, enumerate_stars

MOST_LISTED = 1_000_000


@dataclass(frozen=True, eq=False)
class Decided:
    """A design that a search returned, before it is evaluated anew."""

    family: Family
    steps: tuple[int, ...]
    built: tuple[int, ...]
    candidate: Candidate
    value: float
    bound: float
    proven: bool

    def ranked(self, phasing: Phasing) -> RankedStar:
        """Its entry of a ranking."""
        told = self.family.told(phasing, self.candidate)
        return ranked_star(told, self.candidate, self.steps, self.value, self.bound, self.proven)


@dataclass(frozen=True, eq=False)
class Answer:
    """Designs, best first, and what no design goes under."""

    designs: tuple[Decided, ...]
    bound: float
    complete: bool
    looked_at: int
    method: str
    infeasible: int = 0


def lists(problem: Problem, families: Sequence[Family]) -> bool:
    """Return whether the even stars of a problem, or its firing orders, are few enough to be looked at one by one."""
    return sum(family.size for family in families) <= MOST_LISTED or _by_pairs(problem, families)


def is_long(problem: Problem) -> bool:
    """Return whether even stars are open that are too many to be listed."""
    phasing = problem.phasing
    if phasing is None or phasing.throws is not None or phasing.throw_bounds is not None:
        return False
    return not lists(problem, families_of(phasing, problem.feels_order)[0])


def refuse(problem: Problem) -> None:
    """Refuse stars that are too many to be listed.

    Raises
    ------
    ModelError
        If they are.
    """
    if is_long(problem):
        raise _too_many()


def _too_many() -> ModelError:
    rule, remedy = lack("long_cranks")
    return ModelError(f"a crank of more than {MOST_LISTED} even stars {rule}; {remedy}")


def searched(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> Answer:
    """Return the best designs of all even stars: every star where orders alone count, else cuts of cone programs."""
    if not lists(problem, families):
        raise _too_many()
    if any(isinstance(family, FiringFamily) for family in families):
        return _by_orders(problem, phasing, families)
    simple = [(family, own) for family in families if (own := amplitudes(phasing, family)) is not None]
    if len(simple) < len(families) or any(family.fixed for family in families):
        return _by_designs(problem, phasing, families)
    answers = []
    for family, own in simple:
        space = replace(family.space, mirror=True, reflect=True)
        found = enumerate_stars(space, own, phasing.best)
        answers.append(stars_answer(phasing, family, found, "every star looked at"))
    return joined(answers, phasing.best)


def _by_pairs(problem: Problem, families: Sequence[Family]) -> bool:
    """Return whether firing orders differ by root mean squares alone, pair by pair of throws."""
    own = [measure for measure in problem.measures if not measure.channel.is_number]
    squares = all(measure.is_load and measure.norm.is_euclidean for measure in own)
    firing = all(isinstance(family, FiringFamily) and not family.fixed for family in families)
    return firing and squares and not problem.decisions and not (problem.phasing and problem.phasing.shafts.optional)


def _by_orders(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> Answer:
    """Firing orders one by one where root mean squares alone are asked, else by cone programs."""
    (family,) = families
    if not _by_pairs(problem, families):
        return _by_designs(problem, phasing, families)
    if phasing.cylinders > MOST_SLOTS:
        raise ModelError(f"firing orders of more than {MOST_SLOTS} cylinders are too many to examine; give throws")
    model = family.model(phasing)
    objective = PairObjective.of(model.at(model.samples))
    found = enumerate_orders(objective, phasing.cylinders, phasing.best, phasing.time_limit)
    answer = stars_answer(phasing, family, found, "every firing order looked at, pair by pair of throws")
    return replace(answer, infeasible=0 if answer.designs else found.nodes)


def amplitudes(phasing: Phasing, family: Family) -> AmplitudeObjective | None:
    """The objective of a family by order alone, where it is of that kind (S3)."""
    first = phasing.realise(family.candidate(phasing, family.first))
    return amplitude_objective(first, phasing, family.layout)


def decided(
    phasing: Phasing, family: Family, steps: tuple[int, ...], built: tuple[int, ...], value: float, bound: float,
    proven: bool,
) -> Decided:  # fmt: skip
    """Return a design of a family by its steps and the sets of shafts that are built."""
    candidate = family.candidate(phasing, steps, phasing.without(built))
    return Decided(family, steps, built, candidate, value, bound, proven)


def stars_answer(phasing: Phasing, family: Family, found: StarsFound, method: str) -> Answer:
    """Return what a search of stars alone found, as an answer."""
    designs = tuple(
        decided(phasing, family, tuple(int(p) for p in star), (), float(value), float(value), found.complete)
        for star, value in zip(found.stars, found.values, strict=True)
    )
    return Answer(designs, found.lower_bound, found.complete, found.nodes, method)


def _by_designs(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> Answer:
    """Return the answer of cone programs, with cuts."""
    nothing = numerical_zero(problem)
    count = 10**9 if phasing.method is Method.ENUMERATION else phasing.best
    answers = []
    for family in families:
        model = family.model(phasing)
        found = search_designs(model, family.stars, count, problem.tolerance, phasing.time_limit, nothing)
        designs = tuple(
            decided(
                phasing,
                family,
                s.star,
                s.built,
                s.value,
                s.bound,
                s.value <= found.beyond * (1.0 + problem.tolerance),
            )
            for s in found.solved
        )
        method = f"cone programs of {len(found.solved)} of {found.designs} designs, dual cuts for the others"
        # what is proven of the best does not need the whole ranking
        closed = found.complete or _is_closed(found, problem.tolerance, nothing)
        answers.append(Answer(designs, found.lower_bound, closed, len(found.solved), method, found.infeasible))
    return joined(answers, phasing.best)


def _is_closed(found: CutsFound, tolerance: float, nothing: float) -> bool:
    return bool(found.solved) and gap_of(found.solved[0].value, found.lower_bound, nothing) <= tolerance


def joined(answers: Sequence[Answer], count: int) -> Answer:
    """Of several geometries the best designs, equals counted once."""
    designs = sorted((d for answer in answers for d in answer.designs), key=lambda d: d.value)
    kept: list[Decided] = []
    for design in designs:
        if not any(_equal(design, other) for other in kept):
            kept.append(design)
        if len(kept) == count:
            break
    return Answer(
        tuple(kept),
        min(answer.bound for answer in answers),
        all(answer.complete for answer in answers),
        sum(answer.looked_at for answer in answers),
        answers[0].method,
        sum(answer.infeasible for answer in answers),
    )


def _equal(a: Decided, b: Decided) -> bool:
    """Whether one star is an image of the other and is worth the same (S2)."""
    if a.family is not b.family or a.built != b.built or abs(a.value - b.value) > 1e-6 * max(a.value, b.value):
        return False
    space = replace(a.family.space, mirror=True, reflect=True)
    both = space.canonical(np.array([a.steps, b.steps], dtype=np.uint8))
    return bool(np.all(both[0] == both[1]))
