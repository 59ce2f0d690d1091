"""Solve for crank stars, firing orders and shafts together (S18)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeAlias

import numpy as np

from laufruhe.errors import ModelError, SolverError, counted
from laufruhe.machine.firing import MAX_ORDERS
from laufruhe.numerics.budget import is_time_over, limit_time
from laufruhe.numerics.progress import report_progress
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import Dependence, dependence, depends, open_kinds
from laufruhe.problem.evaluation import evaluate, objective_value, with_more_samples
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate, Intervals
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import Proof, ProofStrength, gap_tolerance_of, make_certificate
from laufruhe.prove.throws.firing_windows_bound import firing_bound
from laufruhe.solvers.accuracy import objective_error
from laufruhe.solvers.conclusion import quote_names, refine_result, violated_limits, with_constant_limits
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.even_search import EvenDesign, EvenStarResult, search_even
from laufruhe.solvers.stars.families import Family, families_of
from laufruhe.solvers.stars.ranking import ORDERS_LISTED, distinct_orders, ranked_orders, ranked_star, ranking_result
from laufruhe.solvers.stars.star_program import solve_design
from laufruhe.solvers.stars.star_results import StarDesign, no_star, solve_fixed, with_star
from laufruhe.solvers.throws.throw_starts import why_none_fires
from laufruhe.solvers.values import ObjectiveValue


def torque_numbers(problem: Problem) -> list[Measure]:
    """Return the numbers of the crank's torque that depend on no open number but the star.

    All even stars of equal cylinders have the same dead centres, and so the same torque (S35). Other numbers, such as
    the heat of an absorber, depend on the places of the throws too.
    """
    others = open_kinds(problem) - {Kind.STAR}
    return [
        measure
        for measure in problem.measures
        if measure.channel.is_number
        and measure.channel.depends_on_torque
        and dependence(measure.channel, Kind.STAR, problem) is Dependence.SWING
        and not depends(measure.channel, others, problem)
    ]


def alike_measures(problem: Problem) -> list[Measure]:
    """Return the numbers that are equal for all even stars of equal cylinders: those of torque, and constants."""
    kinds = open_kinds(problem) | {Kind.STAR}
    constants = [m for m in problem.measures if m.channel.is_number and not depends(m.channel, kinds, problem)]
    return [*torque_numbers(problem), *constants]


def solve_alike_stars(problem: Problem, phasing: Phasing, solve: Callable[[Problem], Result]) -> Result:
    """Choose among even crank stars without the measures that are equal for all of them (S35).

    All even stars of equal cylinders have the same dead centres, and so the same torque. `solve` solves the problem
    without these measures.
    """
    alike = alike_measures(problem)
    names = " and ".join(dict.fromkeys(measure.channel.name for measure in alike))
    equal_stars = f"all even stars have the same {names}"
    initial = evaluate(problem)
    equal_limits = [limit for limit in problem.limits if limit.measure in alike]
    violated = violated_limits(equal_limits, initial)
    if violated:
        reason = (
            f"no crank star keeps {quote_names(violated)}: the {names} is equal for all even stars; "
            "relax the limit, or increase the inertia of all that turns"
        )
        return no_star(problem, reason, conflict=violated)
    limits = tuple(limit for limit in problem.limits if limit not in equal_limits)
    terms = tuple(term for term in problem.objective if term.measure not in alike)
    limit_terms = [Term(limit.measure) for limit in limits if not limit.measure.channel.is_number]
    if not terms and not limit_terms:
        return _any_star(problem, phasing, equal_stars)
    # without other terms, any design within the limits is optimal
    load_terms = terms or tuple(limit_terms[:1])

    def without_alike(star_problem: Problem) -> Problem:
        load_limits = tuple(x for x in star_problem.limits if x.measure not in alike)
        return star_problem.changed(objective=load_terms, limits=load_limits)

    inner = replace(phasing, problem_of=lambda candidate: without_alike(phasing.problem_of(candidate)))
    result = solve(replace(without_alike(problem), phasing=inner))
    result = with_constant_limits(
        replace(result, problem=result.problem.changed(objective=problem.objective)), problem.limits
    )
    result = replace(result, problem=replace(result.problem, phasing=phasing))
    if result.objective is None or result.certificate is None:
        return result
    # part of the objective that is equal for all stars
    equal_terms = [term for term in problem.objective if term.measure in alike]
    equal_value = sum((term.weight * result.final.value(term.measure) for term in equal_terms), 0.0)
    value, proof = objective_value(problem, result.final), result.certificate
    bound = equal_value + (proof.lower_bound if terms else 0.0)
    zero_level = numerical_zero(problem, result.final.engine)
    details = result.phasing
    if details is not None and terms:
        ranking = (
            replace(s, value=s.value + equal_value, lower_bound=s.lower_bound + equal_value) for s in details.ranking
        )
        details = replace(details, ranking=tuple(ranking))
    method = f"{proof.method}; {equal_stars}"
    return replace(
        result,
        objective=ObjectiveValue.of(problem, value, objective_value(problem, initial)),
        certificate=make_certificate(
            value, bound, zero_level, problem.tolerance, ProofStrength.EXACT, proof.kkt_residual, method
        ),
        phasing=details,
        error=partial(objective_error, result.problem, result.final),
    )


def _any_star(problem: Problem, phasing: Phasing, equal_stars: str) -> Result:
    """Return the result of the first crank star, because all evenly firing crank stars have the same objective."""
    families, reason = families_of(phasing)
    if not families:
        return no_star(problem, f"no crank star exists: {reason}")
    family = families[0]
    candidate = family.candidate(phasing, family.first)
    result = solve_fixed(replace(phasing.problem_of(candidate), phasing=None))
    value = objective_value(result.problem, result.final)
    proof = make_certificate(
        value, value, numerical_zero(problem), problem.tolerance, ProofStrength.EXACT, 0.0, equal_stars
    )
    ranking = [ranked_star(phasing, candidate, family.first, value, value, True)]
    details = ranking_result(phasing, candidate, ranking, sum(x.size for x in families), 1, equal_stars)
    return with_star(problem, phasing, result, candidate, proof, details)


MAX_TIMES, ROUNDS = 16, 2
"""Largest factor of samples for a search that cannot prove its best crank star, and number of such searches."""
Star: TypeAlias = tuple[Candidate, tuple[int, ...] | None]
"""A crank star, and the steps of its throws if it fires evenly."""
Decide: TypeAlias = Callable[[Problem], Result]
Search: TypeAlias = Callable[[Problem, Phasing, Sequence[Family]], EvenStarResult]


def solve_phasing(problem: Problem, search: Search = search_even) -> Result:
    """Return the best throws, firing order, shafts and unbalances together, with a ranking of crank stars.

    Its certificate is `global` if the search ended with a proof, `global within gap` if its
    time ended, and `local` if throws left the even steps. `search` returns the best designs of families of even stars.
    """
    phasing = problem.phasing
    if phasing is None:
        raise SolverError("the problem has no open phasing")
    has_torque = bool(torque_numbers(problem))
    if phasing.throws is None and has_torque and not phasing.continuous and problem.cylinders_are_alike:
        return solve_alike_stars(problem, phasing, partial(solve_phasing, search=search))
    started = time.perf_counter()
    if phasing.throws is not None:
        result = solve_every_order(problem, phasing, even_stars(phasing))
    elif phasing.throw_bounds is not None:
        result = _solve_uneven(problem, phasing, None)
    else:
        result = _solve_open_throws(problem, phasing, search)
    return replace(result, timing={**result.timing, "phasing": time.perf_counter() - started})


def _solve_open_throws(problem: Problem, phasing: Phasing, search: Search) -> Result:
    is_even = phasing.intervals.holds([phasing.even_interval])
    has_torque = bool(torque_numbers(problem))
    if has_torque and problem.cylinders_are_alike:
        even = replace(phasing, intervals=Intervals(phasing.even_interval, phasing.even_interval))
        solve = partial(solve_phasing, search=search)
        result = solve_alike_stars(problem, even, solve) if is_even and families_of(even)[0] else None
        return _solve_uneven(problem, phasing, None if result is None or result.objective is None else result)
    is_resolved = any(measure.is_cylinder_resolved for measure in problem.measures)
    solves_each = problem.depends_on_firing_order and (phasing.shares_throws or is_resolved)
    if is_even and (has_torque or solves_each):
        stars = even_stars(phasing)
        result = solve_every_order(problem, phasing, stars) if stars else no_star(problem, why_none_fires(phasing)[0])
        if not phasing.continuous:
            return result
        return _solve_uneven(problem, phasing, None if result.objective is None else result)
    families = families_of(phasing, problem.depends_on_firing_order)[0] if is_even else ()
    if not families:
        if phasing.continuous:
            return _solve_uneven(problem, phasing, None)
        return no_star(problem, why_none_fires(phasing)[0])
    search_result = search(_with_half_tolerance(problem), phasing, families)
    if not search_result.designs:
        if phasing.continuous:
            return _solve_uneven(problem, phasing, None)
        names = tuple(limit.name for limit in problem.limits)
        if search_result.complete:
            # each star may violate other limits
            limits = (quote_names(names) or "the bounds") + " together" * (len(names) > 1)
            tried = counted(search_result.infeasible, "design")
            reason = f"no crank star keeps {limits}, whatever else is decided ({tried} tried)"
            return no_star(problem, reason, conflict=names)
        cause = "the time limit" if is_time_over() else f"phasing.time_limit = {phasing.time_limit:g} s"
        reason = f"no feasible design was found in {cause}; raise it"
        return no_star(problem, reason, Status.FAILED)
    result = _best_of(problem, phasing, search_result)
    if search_result.complete and problem.search.proves:
        result = _with_more_samples(problem, families, result, search)
    return _solve_uneven(problem, phasing, result) if phasing.continuous else result


def _with_half_tolerance(problem: Problem) -> Problem:
    # one half for the optimum of a design, the other half for the comparison of designs
    return replace(problem, tolerance=0.5 * problem.tolerance)


def _with_more_samples(problem: Problem, families: Sequence[Family], result: Result, search: Search) -> Result:
    """Return the result of searches with more samples, while sampling errors keep the gap open (P7)."""
    for _ in range(ROUNDS):
        gap = result.certificate.gap if result.certificate else 0.0
        if gap <= problem.tolerance or result.status is Status.OPTIMAL or is_time_over():
            break
        # the error of sample averages is proportional to the square of the step
        problem = with_more_samples(problem, min(math.ceil(math.sqrt(2.0 * gap / problem.tolerance)), MAX_TIMES))
        assert problem.phasing is not None
        search_result = search(_with_half_tolerance(problem), problem.phasing, families)
        candidate = _best_of(problem, problem.phasing, search_result) if search_result.designs else result
        if candidate.certificate is None or candidate.certificate.gap >= gap or not search_result.complete:
            break
        result = candidate
    return result


def _best_of(problem: Problem, phasing: Phasing, search_result: EvenStarResult) -> Result:
    """Return the result of the best even crank star, certified by the lower bound over all designs (S17)."""
    designs = [(design, entry) for design in search_result.designs if (entry := design.ranking_entry).firing_orders]
    if not designs:
        return no_star(problem, "no crank star has a firing order that keeps the firing intervals allowed")
    remaining = iter(designs)
    for best, first in remaining:
        left_out = phasing.without(_needed_shafts(problem, phasing, best))
        candidate = replace(best.candidate, firing_order=first.firing_orders[0].order, left_out=left_out)
        result = solve_fixed(replace(_with_half_tolerance(phasing.problem_of(candidate)), phasing=None))
        # a peak between samples of the search may violate a limit
        if StarDesign(candidate, result).is_feasible:
            break
    else:
        reason = (
            f"each of the best {counted(len(designs), 'crank star')} violates a limit between the samples of the search"
        )
        return no_star(problem, f"{reason}; raise phasing.best or fidelity.samples", Status.FAILED)
    bound, zero_level = search_result.bound, numerical_zero(problem)
    if result.objective and not any(phasing.is_geometry_open):
        bound = max(bound, firing_bound(problem, result.final))
    result, value_error = refine_result(result, bound, zero_level)
    value = result.objective.value if result.objective else best.value
    certificate = make_certificate(
        value, bound, zero_level, problem.tolerance, ProofStrength.EXACT,
        result.certificate.kkt_residual if result.certificate else 0.0, search_result.method, value_error,
    )  # fmt: skip
    ranking = [replace(first, shafts=phasing.built(candidate)), *(entry for _, entry in remaining)]
    count = sum(family.size for family in families_of(phasing, problem.depends_on_firing_order)[0])
    details = ranking_result(phasing, candidate, ranking, count, search_result.looked_at, search_result.method)
    return with_star(problem, phasing, result, candidate, certificate, details)


def _needed_shafts(problem: Problem, phasing: Phasing, best: EvenDesign) -> tuple[int, ...]:
    """Return the indices of the sets of shafts that the best design needs: without one of them, it would be worse."""
    needed = best.built
    if not needed:
        return needed
    model = best.family.model(phasing)
    zero_level, tolerance = numerical_zero(problem), 0.5 * problem.tolerance
    for k in sorted(best.built, key=lambda k: -phasing.shafts.masses[k]):
        fewer = tuple(j for j in needed if j != k)
        design, _ = solve_design(model, best.steps, fewer, tolerance, zero_level)
        if design is not None and design.value <= best.value + gap_tolerance_of(best.value, tolerance, zero_level):
            needed = fewer
    return needed


def even_stars(phasing: Phasing) -> list[Star]:
    """Return the fixed throws, or all even crank stars including mirror images."""
    if phasing.throws is not None:
        return [(Candidate(phasing.throws, None, *phasing.minimum_geometry), None)]
    pairs = [(family, tuple(map(int, star))) for family in families_of(phasing)[0] for star in family.stars]
    return [(replace(family.candidate(phasing, steps), firing_order=None), steps) for family, steps in pairs]


def solve_every_order(
    problem: Problem, phasing: Phasing, stars: Sequence[Star], decide: Decide = solve_fixed, maximum: int | None = None
) -> Result:
    """Solve every combination of crank star, firing order with loads of its own, and set of shafts.

    Parameters
    ----------
    stars
        Crank stars with the steps of their throws.
    decide
        Solver of the other decisions of a design.
    maximum
        Largest number of designs to solve, chosen at random if there are more; None to solve all.
    """
    orders = {star: ranked_orders(phasing, star, steps) for star, steps in stars}
    if not any(orders.values()):
        return no_star(problem, why_none_fires(phasing)[0])
    # small sets first, so that a shaft without benefit is not built
    sets = sorted(phasing.shafts.allowed, key=lambda built: (len(built), built))
    star_orders = [
        (star, order.order) for star, steps in stars for order in distinct_orders(problem, phasing, star, steps)
    ]
    if maximum is None and len(star_orders) * len(sets) >= MAX_ORDERS:
        rule = f"{MAX_ORDERS} or more combinations of firing orders and sets of shafts are too many to solve one by one"
        raise ModelError(f"{rule}; fix the firing order, or the throws")
    designs = [
        replace(star, firing_order=o, left_out=phasing.without(built)) for built in sets for star, o in star_orders
    ]
    total = len(designs)
    if maximum is not None and total > maximum:
        indices = np.random.default_rng(problem.search.seed).choice(total, maximum, replace=False)
        designs = [designs[k] for k in sorted({0, *indices.tolist()})]
    started, results = time.perf_counter(), list[StarDesign]()
    for k, candidate in enumerate(designs):
        minimum = min((design.value for design in results), default=math.inf)
        report_progress("firing orders and sets of shafts", k, len(designs), minimum)
        if results and (is_time_over() or time.perf_counter() - started > phasing.time_limit):
            break
        results.append(
            StarDesign(candidate, decide(replace(_with_half_tolerance(phasing.problem_of(candidate)), phasing=None)))
        )
    complete = len(results) == total
    solved = [design for design in results if design.is_feasible]
    if not solved:
        what = "no firing order and no set of shafts that may be built"
        if complete and all(design.is_infeasible for design in results):
            names = tuple(limit.name for limit in problem.limits)
            return no_star(problem, f"{what} keeps the limits", conflict=names)
        return no_star(problem, f"{what} was found that keeps the limits", Status.FAILED)
    zero_level = numerical_zero(problem)
    best = solved[0]
    for design in solved[1:]:
        if design.value < best.value - gap_tolerance_of(best.value, 0.5 * problem.tolerance, zero_level):
            best = design
    bound = min(design.bound for design in results) if complete else 0.0
    count = sum(map(len, orders.values()))
    stars_text = f" of {len(stars)} stars" if len(stars) > 1 else ""
    method = f"{len(star_orders)} of {counted(count, 'firing order')}{stars_text}"
    method += f" evaluated with {counted(len(sets), 'set')} of shafts"
    if not complete:
        method += f", {len(results)} of all {total} chosen at random and solved"
    proof = best.result.certificate
    method_text, residual = (f"{proof.method}; {method}", proof.kkt_residual) if proof else (method, 0.0)
    proofs = [design.result.certificate for design in results if design.result.certificate is not None]
    are_exact = complete and all(x.kind in (Proof.GLOBAL, Proof.WITHIN_GAP) for x in proofs)
    strength = ProofStrength.EXACT if maximum is None or are_exact else ProofStrength.RELAXED
    result, value_error = refine_result(best.result, bound, zero_level)
    best = replace(best, result=result)
    certificate = make_certificate(
        best.value, bound, zero_level, problem.tolerance, strength, residual, method_text, value_error
    )
    # best design of every star; its firing order comes first in the ranking
    firsts: dict[Candidate, StarDesign] = {}
    for design in [best, *sorted(solved, key=lambda design: design.value)]:
        firsts.setdefault(replace(design.candidate, firing_order=None, left_out=()), design)
    ranking = []
    for star, design in [*firsts.items()][: phasing.best]:
        entry = ranked_star(phasing, design.candidate, None, design.value, bound, complete)
        order_entry = next(order for order in orders[star] if order.order == design.candidate.firing_order)
        remaining_orders = tuple(order for order in orders[star] if order != order_entry)
        ranking.append(
            replace(entry, firing_orders=(order_entry, *remaining_orders)[:ORDERS_LISTED], even=order_entry.is_even)
        )
    details = ranking_result(phasing, best.candidate, ranking, count * len(sets), len(solved), method)
    return with_star(problem, phasing, best.result, best.candidate, certificate, details)


def _solve_uneven(problem: Problem, phasing: Phasing, even_result: Result | None) -> Result:
    from laufruhe.solvers.throws.uneven_throws import solve_uneven

    with limit_time(phasing.time_limit):
        return solve_uneven(problem, phasing, even_result)
