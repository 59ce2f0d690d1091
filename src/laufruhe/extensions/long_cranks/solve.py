"""Decide even stars that are too many to be listed: those without couples, halves that meet, exchanges of throws."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from laufruhe.extensions.long_cranks.amplitudes import StarAmplitudes
from laufruhe.extensions.long_cranks.couples import couple_norms, three_stars
from laufruhe.extensions.long_cranks.exchange import improved
from laufruhe.extensions.long_cranks.search import best_starts, search_stars
from laufruhe.numerics.norms import NORMS
from laufruhe.physics.crank_stars import Stars
from laufruhe.problem.channels import ROCKING_COUPLE
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value, with_fine_sampling
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Method
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import gap_of
from laufruhe.prove.throws.firing_share import firing_bound
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.answers import Answer, amplitudes, decided, joined, lists, searched, stars_answer
from laufruhe.solvers.stars.families import Family, FiringFamily
from laufruhe.solvers.stars.phasing import solve_phasing
from laufruhe.solvers.stars.program import coarse_value, owners_of, solve_design
from laufruhe.solvers.stars.search import enumerate_stars


def solve_long_cranks(problem: Problem) -> Result:
    """Decide open throws, firing orders, shafts and unbalances together, as `solve_phasing` does."""
    return solve_phasing(problem, search_long)


def search_long(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> Answer:
    """Return the best designs of all even stars, by whatever suits objective and size (S18)."""
    if lists(problem, families):
        return searched(problem, phasing, families)
    by_order = any(isinstance(family, FiringFamily) or family.fixed for family in families)
    simple = [] if by_order else [(each, own) for each in families if (own := _amplitudes(phasing, each)) is not None]
    if len(simple) < len(families):
        shared = _by_couples(problem, phasing, families)
        return _by_exchanges(problem, phasing, families) if shared is None else shared
    answers = []
    for family, own in simple:
        space = replace(family.space, mirror=True, reflect=True)
        if phasing.method is Method.ENUMERATION:
            found, method = enumerate_stars(space, own, phasing.best), "every star looked at"
        else:
            found = search_stars(space, own, phasing.best, phasing.time_limit)
            method = "stars by halves that meet in a window of couples"
        answers.append(stars_answer(phasing, family, found, method))
    return joined(answers, phasing.best)


def _amplitudes(phasing: Phasing, family: Family) -> StarAmplitudes | None:
    own = amplitudes(phasing, family)
    return None if own is None else StarAmplitudes(own.orders, own.terms)


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
        return joined([answer], phasing.best)
    own = couple_norms(problem, family.space, [_realised(phasing, family, star) for star in three_stars(family.space)])
    if own is None:
        return None
    every = search_stars(family.space, own, phasing.best, phasing.time_limit, found)
    stars += [tuple(map(int, star)) for star in every.stars]
    told = _told(problem, phasing, family, stars, every.lower_bound)
    method = "stars by halves that meet in a window of couples"
    return replace(
        joined([told], phasing.best), complete=every.complete, looked_at=looked_at + every.nodes, method=method
    )


def _told(
    problem: Problem, phasing: Phasing, family: Family, stars: Sequence[tuple[int, ...]], bound: float
) -> Answer:  # fmt: skip
    """Stars with their values, and whether the best of them leaves what every even star has (S40)."""
    designs, complete = [], False
    for steps in dict.fromkeys(stars):
        value, design = _evaluated(phasing, family, steps)
        fine = with_fine_sampling(design)
        # a search at more angles closes what these leave open of a mean (P7)
        shared = firing_bound(problem, fine)
        left = gap_of(objective_value(problem, fine), max(bound, shared), numerical_zero(problem, design.engine))
        bound = max(bound, firing_bound(problem, design))
        complete = complete or left <= problem.tolerance
        designs.append(decided(phasing, family, steps, (), value, bound, left <= problem.tolerance))
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
    """Minimise the couple alone: even stars differ in nothing else."""
    return problem.changed(objective=(Term(Measure(ROCKING_COUPLE, NORMS["rms"])),))


def _by_exchanges(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> Answer:
    """Return the best star that exchanges of throws lead to, bounded by its own dual rows over all stars (S44, S14)."""
    nothing = numerical_zero(problem)
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
        design = decided(phasing, family, found.star, found.built, found.value, found.bound, done)
        answers.append(Answer((design,), bound, done, 1, method))
    return joined(answers, phasing.best)


def _first_of(phasing: Phasing, family: Family) -> tuple[int, ...]:
    """Return the star with least couple, or the first where there is none."""
    stars = [tuple(map(int, star)) for star in _with_least_couples(phasing, family)]
    return min(stars, key=lambda star: _evaluated(phasing, family, star)[0], default=family.first)
