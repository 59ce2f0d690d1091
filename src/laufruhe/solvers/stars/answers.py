"""Which solver decides the discrete part, and what it proved (S18)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.amplitudes import AmplitudeObjective, amplitude_objective
from laufruhe.load_models.couple_norms import couple_norms, three_stars
from laufruhe.load_models.pair_tables import PairObjective
from laufruhe.numerics.norms import NORMS
from laufruhe.physics.crank_stars import Stars
from laufruhe.problem.channels import ROCKING_COUPLE
from laufruhe.problem.evaluation import Evaluation, evaluate, finely, objective_value
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.nothing import nothing_of
from laufruhe.problem.phasing import Candidate, Method
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import gap_of
from laufruhe.prove.throws.firing_share import firing_bound
from laufruhe.solvers.stars.cuts import CutsFound, search_designs
from laufruhe.solvers.stars.exchange import improved
from laufruhe.solvers.stars.families import Family, FiringFamily
from laufruhe.solvers.stars.firing_search import MOST_SLOTS, enumerate_orders
from laufruhe.solvers.stars.program import coarse_value, owners_of, solve_design
from laufruhe.solvers.stars.ranking import RankedStar, ranked_star
from laufruhe.solvers.stars.search import StarsFound, best_starts, enumerate_stars, search_stars

MOST_LISTED = 1_000_000
# looking at every star is as quick as a search up to here
FEW_STARS = 60_000


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


def searched(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> Answer:
    """The best designs of all even stars, by whatever suits objective and size (S18)."""
    if any(isinstance(family, FiringFamily) for family in families):
        return _by_orders(problem, phasing, families)
    simple = [(family, own) for family in families if (own := _amplitudes(phasing, family)) is not None]
    if len(simple) < len(families) or any(family.fixed for family in families):
        return _by_designs(problem, phasing, families)
    answers = []
    for family, own in simple:
        space = replace(family.space, mirror=True, reflect=True)
        few = phasing.method is Method.AUTO and space.size <= FEW_STARS
        if few or phasing.method is Method.ENUMERATION:
            found = enumerate_stars(space, own, phasing.best)
            answers.append(_stars_answer(phasing, family, found, "every star looked at"))
        else:
            found = search_stars(space, own, phasing.best, phasing.time_limit)
            answers.append(_stars_answer(phasing, family, found, "stars by halves that meet in a window of couples"))
    return _joined(answers, phasing.best)


def _by_orders(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> Answer:
    """Firing orders one by one where root mean squares alone are asked, else by cone programs."""
    (family,) = families
    own = [measure for measure in problem.measures if not measure.channel.is_number]
    squares = all(measure.is_load and measure.norm.is_euclidean for measure in own)
    if not squares or problem.decisions or phasing.shafts.optional or family.fixed:
        return _by_designs(problem, phasing, families)
    if phasing.cylinders > MOST_SLOTS:
        raise ModelError(f"firing orders of more than {MOST_SLOTS} cylinders are too many to examine; give throws")
    model = family.model(phasing)
    objective = PairObjective.of(model.at(model.samples))
    found = enumerate_orders(objective, phasing.cylinders, phasing.best, phasing.time_limit)
    answer = _stars_answer(phasing, family, found, "every firing order looked at, pair by pair of throws")
    return replace(answer, infeasible=0 if answer.designs else found.nodes)


def _amplitudes(phasing: Phasing, family: Family) -> AmplitudeObjective | None:
    """The objective of a family by order alone, where it is of that kind (S3)."""
    first = phasing.realise(family.candidate(phasing, family.first))
    return amplitude_objective(first, phasing, family.layout)


def _decided(
    phasing: Phasing, family: Family, steps: tuple[int, ...], built: tuple[int, ...], value: float, bound: float,
    proven: bool,
) -> Decided:  # fmt: skip
    candidate = family.candidate(phasing, steps, phasing.without(built))
    return Decided(family, steps, built, candidate, value, bound, proven)


def _stars_answer(phasing: Phasing, family: Family, found: StarsFound, method: str) -> Answer:
    designs = tuple(
        _decided(phasing, family, tuple(int(p) for p in star), (), float(value), float(value), found.complete)
        for star, value in zip(found.stars, found.values, strict=True)
    )
    return Answer(designs, found.lower_bound, found.complete, found.nodes, method)


def _by_designs(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> Answer:
    """Return the answer of cone programs: cuts where the stars can be listed, else exchanges of throws."""
    if sum(family.size for family in families) > MOST_LISTED:
        shared = _by_couples(problem, phasing, families)
        return _by_exchanges(problem, phasing, families) if shared is None else shared
    nothing = nothing_of(problem)
    count = 10**9 if phasing.method is Method.ENUMERATION else phasing.best
    answers = []
    for family in families:
        model = family.model(phasing)
        found = search_designs(model, family.stars, count, problem.tolerance, phasing.time_limit, nothing)
        designs = tuple(
            _decided(
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
    return _joined(answers, phasing.best)


def _by_couples(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> Answer | None:
    """Even stars that differ by their couples alone: those with little first, then all that may be better (S46, S48).

    None where stars differ by more, or anything else is open.
    """
    if len(families) > 1 or problem.decisions or phasing.shafts.optional:
        return None
    (family,) = families
    found = _with_least_couples(phasing, family)
    stars, looked_at = [tuple(map(int, star)) for star in found], len(found)
    answer = _told(problem, phasing, family, stars, 0.0)
    if answer.complete:
        return _joined([answer], phasing.best)
    own = couple_norms(problem, family.space, [_realised(phasing, family, star) for star in three_stars(family.space)])
    if own is None:
        return None
    every = search_stars(family.space, own, phasing.best, phasing.time_limit, found)
    stars += [tuple(map(int, star)) for star in every.stars]
    told = _told(problem, phasing, family, stars, every.lower_bound)
    method = "stars by halves that meet in a window of couples"
    return replace(
        _joined([told], phasing.best), complete=every.complete, looked_at=looked_at + every.nodes, method=method
    )


def _told(
    problem: Problem, phasing: Phasing, family: Family, stars: Sequence[tuple[int, ...]], bound: float
) -> Answer:  # fmt: skip
    """Stars with their values, and whether the best of them leaves what every even star has (S40)."""
    designs, complete = [], False
    for steps in dict.fromkeys(stars):
        value, design = _evaluated(phasing, family, steps)
        fine = finely(design)
        # a search at more angles closes what these leave open of a mean (P7)
        shared = firing_bound(problem, fine)
        left = gap_of(objective_value(problem, fine), max(bound, shared), nothing_of(problem, design.engine))
        bound = max(bound, firing_bound(problem, design))
        complete = complete or left <= problem.tolerance
        designs.append(_decided(phasing, family, steps, (), value, bound, left <= problem.tolerance))
    designs.sort(key=lambda design: design.value)
    method = "star without couples, which leaves what every even one has"
    return Answer(tuple(designs), bound, complete, len(designs), method)


def _with_least_couples(phasing: Phasing, family: Family) -> Stars:
    """Stars with little couple, none where more than that tells stars apart (S47)."""
    of_couples = replace(phasing, realise=lambda candidate: _couples(phasing.realise(candidate)))
    own = _amplitudes(of_couples, family)
    if own is None:
        return np.zeros((0, family.space.throws), dtype=np.uint8)
    return best_starts(replace(family.space, mirror=True, reflect=True), own, phasing.best).stars


def _realised(phasing: Phasing, family: Family, steps: Iterable[int]) -> Problem:
    return phasing.realise(family.candidate(phasing, tuple(map(int, steps))))


def _evaluated(phasing: Phasing, family: Family, steps: tuple[int, ...]) -> tuple[float, Evaluation]:
    problem = _realised(phasing, family, steps)
    design = evaluate(problem)
    return objective_value(problem, design), design


def _couples(problem: Problem) -> Problem:
    """With the couple alone: all that even stars may have of their own."""
    return problem.changed(objective=(Term(Measure(ROCKING_COUPLE, NORMS["rms"])),))


def _is_closed(found: CutsFound, tolerance: float, nothing: float) -> bool:
    return bool(found.solved) and gap_of(found.solved[0].value, found.lower_bound, nothing) <= tolerance


def _by_exchanges(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> Answer:
    """Return the best star that exchanges of throws lead to, bounded by its own dual rows over all stars (S44, S14)."""
    nothing = nothing_of(problem)
    answers = []
    for family in families:
        simple = _amplitudes(phasing, family) is not None
        space = replace(family.space, mirror=simple, reflect=simple)
        model = family.model(phasing, space)
        owners = owners_of(model)
        first = _first_of(phasing, family)
        built = min(phasing.shafts.allowed, key=lambda some: coarse_value(model, first, some, owners))
        star = improved(model, first, built, owners)
        found, cut = solve_design(model, star, built, owners, problem.tolerance, nothing)
        if found is None or cut is None:
            answers.append(Answer((), 0.0, False, 1, "exchanges of throws"))
            continue
        bound = cut.least(space)
        done = gap_of(found.value, bound, nothing) <= 2.0 * problem.tolerance
        method = f"exchanges of throws at {model.samples} angles"
        design = _decided(phasing, family, found.star, found.built, found.value, found.bound, done)
        answers.append(Answer((design,), bound, done, 1, method))
    return _joined(answers, phasing.best)


def _first_of(phasing: Phasing, family: Family) -> tuple[int, ...]:
    """Return the star with least couple, or the first where there is none."""
    stars = [tuple(map(int, star)) for star in _with_least_couples(phasing, family)]
    return min(stars, key=lambda star: _evaluated(phasing, family, star)[0], default=family.first)


def _joined(answers: Sequence[Answer], count: int) -> Answer:
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
