"""Search all even crank stars for the best designs, by enumeration or by cuts of cone programs (S18)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extension import missing_extension
from laufruhe.load_models.amplitudes import AmplitudeObjective, amplitude_objective
from laufruhe.load_models.star_model import PairObjective
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over, limit_time
from laufruhe.numerics.progress import report_progress
from laufruhe.physics.crank_stars import Stars, StarSpace
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import gap_of
from laufruhe.solvers.stars.families import Family, families_of
from laufruhe.solvers.stars.ranking import RankedStar, ranked_star
from laufruhe.solvers.stars.star_program import search_designs

SLACK = 1e-9
"""Relative difference of objectives that counts as none."""
MAX_SLOTS = 13
"""Largest number of cylinders whose firing orders are enumerated; their number grows as the factorial."""


@dataclass(frozen=True, eq=False)
class StarSearchResult:
    """Best crank stars in ascending order of the objective.

    Attributes
    ----------
    stars, values
        Steps of the stars, shape (n, throws), and objectives [SI], shape (n,).
    lower_bound
        Lower bound of the objective over all stars [SI].
    complete
        True if the search ended with a proof that these stars are the best.
    nodes
        Number of partial and complete stars that the search evaluated.
    """

    stars: Stars
    values: Array
    lower_bound: float
    complete: bool
    nodes: int


class BestStars:
    """Best `count` crank stars so far, best first: steps, shape (n, throws), and objectives [SI], shape (n,)."""

    def __init__(self, count: int, throws: int) -> None:
        self.count, self.throws = count, throws
        self.stars, self.values = np.zeros((0, throws), dtype=np.uint8), np.zeros(0)

    @property
    def cut(self) -> float:
        """Objective that a new crank star must be below [SI]; infinite while fewer than `count` stars are known."""
        return float(self.values[-1]) if len(self.values) >= self.count else float("inf")

    def offer(self, stars: Stars, values: Array) -> None:
        """Keep those of n crank stars that are among the best so far, without duplicates; `values` are objectives.

        Stars with an infinite objective are left out.
        """
        is_feasible = np.isfinite(values)
        stars, values = stars[is_feasible], values[is_feasible]
        if not len(values) or float(values.min()) > self.cut * (1.0 + SLACK):
            return
        best = np.argsort(values, kind="stable")[: 4 * self.count]
        all_stars = np.concatenate([self.stars, stars[best]])
        all_values = np.concatenate([self.values, values[best]])
        _, first = np.unique(all_stars, axis=0, return_index=True)
        # objectives equal within rounding sort by their star, so that runs are repeatable
        scale = float(np.abs(all_values).max()) or 1.0
        keys = (*(all_stars[first, k] for k in range(self.throws - 1, -1, -1)), np.round(all_values[first] / scale, 11))
        selected = first[np.lexsort(keys)[: self.count]]
        self.stars, self.values = all_stars[selected], all_values[selected]


def enumerate_stars(
    space: StarSpace, objective: AmplitudeObjective | PairObjective, count: int = 1, time_limit: float = float("inf")
) -> StarSearchResult:
    """Return the best `count` crank stars of a space, by evaluating all of them in blocks.

    After `time_limit` [s] the search returns the best stars so far, without a proof.
    """
    best, nodes, complete = BestStars(count, space.throws), 0, True
    with limit_time(time_limit):
        for block in space.blocks():
            if nodes and is_time_over():
                complete = False
                break
            best.offer(block, objective.values(space, block))
            nodes += len(block)
            report_progress("crank stars", nodes, space.size, float(best.values.min(initial=np.inf)))
    minimum = float(best.values[0]) if len(best.values) else float("inf")
    bound = minimum if complete else objective.lower_bound(space)
    return StarSearchResult(best.stars, best.values, bound, complete, nodes)


MAX_LISTED = 1_000_000
"""Largest number of even crank stars that are enumerated."""


@dataclass(frozen=True, eq=False)
class EvenDesign:
    """Design of an even crank star from a search, before the exact model evaluates it.

    Attributes
    ----------
    steps, built
        Steps of the throws, and indices of the sets of optional shafts that are built.
    value, bound
        Objective, and its lower bound over all designs of this star [SI].
    proven
        True if no design outside the result is better.
    """

    phasing: Phasing
    family: Family
    steps: tuple[int, ...]
    built: tuple[int, ...]
    value: float
    bound: float
    proven: bool

    @cached_property
    def candidate(self) -> Candidate:
        """Throws, bank and split pin angle, and shafts of the crank star."""
        return self.family.candidate(self.phasing, self.steps, self.phasing.without(self.built))

    @property
    def ranking_entry(self) -> RankedStar:
        """Entry of the design in the ranking of crank stars of a result."""
        phasing = self.phasing
        if self.family.is_of_orders:
            phasing = replace(phasing, firing_order=self.candidate.firing_order)
        return ranked_star(phasing, self.candidate, self.steps, self.value, self.bound, self.proven)

    def equals(self, other: EvenDesign) -> bool:
        """Return True if both crank stars are mirror images of each other with equal objectives (S2)."""
        if self.family is not other.family or self.built != other.built:
            return False
        if abs(self.value - other.value) > 1e-6 * max(self.value, other.value):
            return False
        space = replace(self.family.space, mirror=True, reflect=True)
        both = space.canonical(np.array([self.steps, other.steps], dtype=np.uint8))
        return bool(np.all(both[0] == both[1]))


@dataclass(frozen=True, eq=False)
class EvenStarResult:
    """Best designs of a search over even crank stars, best first, and the lower bound of all.

    Attributes
    ----------
    bound
        Lower bound of the objective over all designs [SI].
    complete
        True if the search ended with a proof, False if its time ended.
    looked_at
        Number of stars or partial stars that the search evaluated.
    infeasible
        Number of stars without a feasible design.
    """

    designs: tuple[EvenDesign, ...]
    bound: float
    complete: bool
    looked_at: int
    method: str
    infeasible: int = 0


def can_list(problem: Problem, families: Sequence[Family]) -> bool:
    """Return True if the even stars or firing orders of all families are few enough to enumerate."""
    return sum(family.size for family in families) <= MAX_LISTED or _differ_by_squares(problem, families)


def is_long(problem: Problem) -> bool:
    """Return True if the open even stars of a problem are too many to enumerate."""
    phasing = problem.phasing
    if phasing is None or phasing.throws is not None or phasing.throw_bounds is not None:
        return False
    return not can_list(problem, families_of(phasing, problem.depends_on_firing_order)[0])


def refuse_long(problem: Problem) -> None:
    """Raise `ModelError` if the open even stars of a problem are too many to enumerate."""
    if is_long(problem):
        rule, remedy = missing_extension("long_cranks")
        raise ModelError(f"a problem with more than {MAX_LISTED} evenly firing crank stars {rule}; {remedy}")


def search_even(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> EvenStarResult:
    """Return the best designs over all evenly firing crank stars in `families`.

    The method is enumeration if the objective depends on single orders or on squares of loads, else cuts of cone
    programs.
    """
    refuse_long(problem)
    if _differ_by_squares(problem, families):
        (family,) = families
        if phasing.cylinders > MAX_SLOTS:
            raise ModelError(
                f"firing orders of more than {MAX_SLOTS} cylinders are too many to evaluate; fix the throws"
            )
        model = family.model(phasing)
        pairs = PairObjective.from_problem(model.at(model.samples))
        search = enumerate_stars(family.space, pairs, phasing.best, phasing.time_limit)
        result = enumeration_result(phasing, family, search, "firing orders evaluated by pairs of throws")
        return replace(result, infeasible=0 if result.designs else search.nodes)
    objectives = [objective for family in families if (objective := amplitudes(phasing, family)) is not None]
    if len(objectives) < len(families):
        return _search_by_cuts(problem, phasing, families)
    results = []
    for family, objective in zip(families, objectives, strict=True):
        space = replace(family.space, mirror=True, reflect=True)
        search = enumerate_stars(space, objective, phasing.best, phasing.time_limit)
        results.append(enumeration_result(phasing, family, search, "stars evaluated one by one"))
    return merge_results(results, phasing.best)


def _differ_by_squares(problem: Problem, families: Sequence[Family]) -> bool:
    loads = [measure for measure in problem.measures if not measure.channel.is_number]
    has_squares = all(measure.is_load and measure.norm.is_euclidean for measure in loads)
    is_firing = all(family.is_of_orders and not family.fixed for family in families)
    has_shafts = problem.phasing is not None and bool(problem.phasing.shafts.optional)
    return bool(families) and is_firing and has_squares and not problem.decisions and not has_shafts


def amplitudes(phasing: Phasing, family: Family) -> AmplitudeObjective | None:
    """Return the objective of a family of crank stars as norms of single orders; None if it has another form (S3)."""
    if family.fixed or family.is_of_orders:
        return None
    first = phasing.problem_of(family.candidate(phasing, family.first))
    return amplitude_objective(first, phasing, family.layout)


def enumeration_result(phasing: Phasing, family: Family, search: StarSearchResult, method: str) -> EvenStarResult:
    """Return the result of an enumeration of crank stars; `method` is its name for the certificate."""
    if not search.complete:
        method = f"{method}, not all in the time"
    designs = tuple(
        EvenDesign(phasing, family, tuple(map(int, star)), (), float(value), float(value), search.complete)
        for star, value in zip(search.stars, search.values, strict=True)
    )
    return EvenStarResult(designs, search.lower_bound, search.complete, search.nodes, method)


def _search_by_cuts(problem: Problem, phasing: Phasing, families: Sequence[Family]) -> EvenStarResult:
    zero_level = numerical_zero(problem)
    count = 10**9 if phasing.lists_all else phasing.best
    results = []
    for family in families:
        model = family.model(phasing)
        search = search_designs(model, family.stars, count, problem.tolerance, phasing.time_limit, zero_level)
        maximum = search.open_bound * (1.0 + problem.tolerance)
        designs = tuple(
            EvenDesign(phasing, family, s.star, s.built, s.value, s.bound, s.value <= maximum) for s in search.solved
        )
        method = f"cone programs of {len(search.solved)} of {search.designs} designs, dual cuts for the others"
        # the proof of the best design needs no proof of the whole ranking
        is_closed = bool(designs) and gap_of(designs[0].value, search.lower_bound, zero_level) <= problem.tolerance
        complete = search.complete or is_closed
        results.append(
            EvenStarResult(designs, search.lower_bound, complete, len(search.solved), method, search.infeasible)
        )
    return merge_results(results, phasing.best)


def merge_results(results: Sequence[EvenStarResult], count: int) -> EvenStarResult:
    """Merge results of several geometries into the best `count` designs, without duplicates."""
    best: list[EvenDesign] = []
    for design in sorted((d for result in results for d in result.designs), key=lambda d: d.value):
        if not any(design.equals(best_design) for best_design in best):
            best.append(design)
        if len(best) == count:
            break
    return EvenStarResult(
        tuple(best),
        min(result.bound for result in results),
        all(result.complete for result in results),
        sum(result.looked_at for result in results),
        results[0].method,
        sum(result.infeasible for result in results),
    )
