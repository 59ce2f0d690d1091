"""Search for even stars too many to enumerate: by couples (S5, S46, S48), or by exchanges of throws (S44)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from laufruhe.extensions.long_cranks.couple_objectives import StarAmplitudes, couple_norms, three_stars
from laufruhe.extensions.long_cranks.couple_search import best_starts, search_stars
from laufruhe.load_models.star_model import StarModel
from laufruhe.numerics.budget import is_time_over, limit_time, until_time_limit
from laufruhe.numerics.norms import RMS
from laufruhe.physics.crank_stars import Stars
from laufruhe.problem.channels import ROCKING_COUPLE
from laufruhe.problem.evaluation import evaluate, objective_value, with_fine_sampling
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import gap_of
from laufruhe.prove.throws.firing_windows_bound import firing_bound
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.even_search import (
    EvenDesign,
    EvenStarResult,
    amplitudes,
    can_list,
    enumerate_stars,
    enumeration_result,
    merge_results,
    search_even,
)
from laufruhe.solvers.stars.families import Family
from laufruhe.solvers.stars.phasing_solver import solve_phasing
from laufruhe.solvers.stars.star_program import coarse_value, solve_design

MIN_GAIN = 1e-6
"""Smallest relative gain of an exchange; coarse sampling blurs less."""
_BY_HALVES = "stars by halves that meet in a window of couples"


def solve_long_cranks(problem: Problem) -> Result:
    """Decide open throws, firing orders, shafts and unbalances of a long crank."""
    return solve_phasing(problem, search_long)


def search_long(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> EvenStarResult:
    """Return the best designs over all evenly firing crank stars of a long crank (S18).

    The objective and the number of throws select the method.
    """
    if can_list(problem, families):
        return search_even(problem, phasing, families)
    simple = [(family, objective) for family in families if (objective := _amplitudes(phasing, family)) is not None]
    if len(simple) < len(families):
        answer = _search_by_couples(problem, phasing, families)
        return _search_by_exchanges(problem, phasing, families) if answer is None else answer
    answers = []
    for family, objective in simple:
        space = replace(family.space, mirror=True, reflect=True)
        if phasing.lists_all:
            stars = enumerate_stars(space, objective, phasing.best, phasing.time_limit)
            method = "stars evaluated one by one"
        else:
            stars, method = search_stars(space, objective, phasing.best, phasing.time_limit), _BY_HALVES
        answers.append(enumeration_result(phasing, family, stars, method))
    return merge_results(answers, phasing.best)


def _amplitudes(phasing: Phasing, family: Family) -> StarAmplitudes | None:
    objective = amplitudes(phasing, family)
    return None if objective is None else StarAmplitudes(objective.orders, objective.terms)


def _search_by_couples(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> EvenStarResult | None:
    """Return the best crank stars, if stars differ by their couples alone (S46, S48).

    Stars with small couples are evaluated first, then all that may be better. The result is None if crank stars
    differ by more than their couples, or if unbalances or shafts are open.
    """
    if len(families) > 1 or problem.decisions or phasing.shafts.optional:
        return None
    (family,) = families
    known = _with_least_couples(phasing, family)
    stars, looked_at = [tuple(map(int, star)) for star in known], len(known)
    answer = _evaluate_stars(problem, phasing, family, stars, 0.0)
    if answer.complete:
        return merge_results([answer], phasing.best)
    check_stars = [
        phasing.problem_of(family.candidate(phasing, tuple(map(int, star)))) for star in three_stars(family.space)
    ]
    objective = couple_norms(problem, family.space, check_stars)
    if objective is None:
        return None
    search_result = search_stars(family.space, objective, phasing.best, phasing.time_limit, known)
    stars += [tuple(map(int, star)) for star in search_result.stars]
    answer = _evaluate_stars(problem, phasing, family, stars, search_result.lower_bound)
    answer = merge_results([answer], phasing.best)
    return replace(
        answer, complete=search_result.complete, looked_at=looked_at + search_result.nodes, method=_BY_HALVES
    )


def _evaluate_stars(
    problem: Problem, phasing: Phasing, family: Family, stars: Sequence[tuple[int, ...]], bound: float
) -> EvenStarResult:  # fmt: skip
    """Return the exact objectives of crank stars.

    Complete if the best one meets the bound over all even stars (S40).
    """
    designs, complete = [], False
    for steps in dict.fromkeys(stars):
        star_problem = phasing.problem_of(family.candidate(phasing, steps))
        design = evaluate(star_problem)
        value, fine = objective_value(star_problem, design), with_fine_sampling(design)
        # at more angles the bound of a mean is closer to the mean over the cycle (P7)
        shared = firing_bound(problem, fine)
        gap = gap_of(objective_value(problem, fine), max(bound, shared), numerical_zero(problem, design.engine))
        bound = max(bound, firing_bound(problem, design))
        is_proven = gap <= problem.tolerance
        complete = complete or is_proven
        designs.append(EvenDesign(phasing, family, steps, (), value, bound, is_proven))
    designs.sort(key=lambda design: design.value)
    method = "crank star without couples; its objective is common to all even stars"
    return EvenStarResult(tuple(designs), bound, complete, len(designs), method)


def _with_least_couples(phasing: Phasing, family: Family) -> Stars:
    couple = (Term(Measure(ROCKING_COUPLE, RMS)),)
    of_couples = replace(phasing, problem_of=lambda candidate: phasing.problem_of(candidate).changed(objective=couple))
    objective = _amplitudes(of_couples, family)
    if objective is None:
        return np.zeros((0, family.space.throws), dtype=np.uint8)
    with limit_time(phasing.time_limit):
        return best_starts(replace(family.space, mirror=True, reflect=True), objective, phasing.best).stars


def _search_by_exchanges(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> EvenStarResult:
    """Return the best crank star that exchanges of throws reach, with a bound from its dual rows (S44, S14)."""
    zero_level = numerical_zero(problem)
    answers = []
    for family in families:
        is_simple = _amplitudes(phasing, family) is not None
        space = replace(family.space, mirror=is_simple, reflect=is_simple)
        model = family.model(phasing, space)
        starts = [tuple(map(int, star)) for star in _with_least_couples(phasing, family)]
        engines = {star: phasing.problem_of(family.candidate(phasing, star)) for star in starts}
        values = {star: objective_value(star_problem, evaluate(star_problem)) for star, star_problem in engines.items()}
        first = min(starts, key=values.__getitem__, default=family.first)
        built = min(phasing.shafts.allowed, key=lambda shafts: coarse_value(model, first, shafts))
        with limit_time(phasing.time_limit):
            star = improved(model, first, built)
        design, cut = solve_design(model, star, built, problem.tolerance, zero_level)
        if design is None or cut is None:
            answers.append(EvenStarResult((), 0.0, False, 1, "exchanges of throws"))
            continue
        bound = cut.minimum(space)
        done = gap_of(design.value, bound, zero_level) <= 2.0 * problem.tolerance
        method = f"exchanges of throws at {model.samples} angles"
        best = EvenDesign(phasing, family, design.star, design.built, design.value, design.bound, done)
        answers.append(EvenStarResult((best,), bound, done, 1, method))
    return merge_results(answers, phasing.best)


def improved(model: StarModel, star: tuple[int, ...], built: tuple[int, ...]) -> tuple[int, ...]:
    """Return the best crank star that exchanges of throws reach from `star` (S44).

    The other decisions of each star are optimal at few samples.
    """
    value = coarse_value(model, star, built)
    while not is_time_over():
        neighbours = ((coarse_value(model, x, built), x) for x in until_time_limit(exchanges(star)))
        minimum, best = min(neighbours, default=(math.inf, star))
        if not minimum < value * (1.0 - MIN_GAIN):
            break
        value, star = minimum, best
    return star


def exchanges(star: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """Yield crank stars in which two or three throws exchange their steps; the first throw keeps its own."""
    yielded = {star}
    for i in range(1, len(star)):
        for j in range(1, i):
            for places in ((i, j), *((i, j, k) for k in range(1, j)), *((j, i, k) for k in range(1, j))):
                exchanged_steps = list(star)
                for place, source in zip(places, (*places[1:], places[0]), strict=True):
                    exchanged_steps[place] = star[source]
                if (exchanged := tuple(exchanged_steps)) not in yielded:
                    yielded.add(exchanged)
                    yield exchanged
