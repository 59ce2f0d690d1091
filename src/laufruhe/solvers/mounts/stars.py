"""Crank stars together with mounts and unbalances (E35).

Even stars are finitely many. On the baseline mounts a cone program balances each star, and its dual rows bound every
other star (S14). This ranks the stars. The best of them are solved with open mounts and unbalances, one by one. The
ranking proves nothing of the joint problem, so the result says how many stars were not solved. If firing may be
uneven, throws then leave the best stars as variables of the same smooth program (E36). Boxes of throws, mounts and
unbalances bound problems with throws between bounds (E72).
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from functools import partial
from typing import TypeAlias

from laufruhe.errors import ModelError, counted
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.numerics.budget import is_time_over, limit_time
from laufruhe.numerics.norms import RMS
from laufruhe.numerics.progress import report_progress, search_scope
from laufruhe.numerics.workers import executor_for, ordered_map, working_on
from laufruhe.problem import channels
from laufruhe.problem.evaluation import Evaluation, evaluate, with_default_sampling
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate, Method
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.certificate import Proof, ProofStrength, gap_tolerance_of, make_certificate
from laufruhe.prove.mounts.provers import Question, proven
from laufruhe.solvers.conclusion import contradiction, evaluate_design, known_of, result_under, values_of
from laufruhe.solvers.mounts.bounds import bounded_under, mount_numbers
from laufruhe.solvers.mounts.nonlinear import solve_mounts, solve_moved
from laufruhe.solvers.mounts.starts import place_of
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.sampling_refinement import over_read
from laufruhe.solvers.stars.cut_search import search_designs
from laufruhe.solvers.stars.even_search import MOST_LISTED
from laufruhe.solvers.stars.families import Family, families_of
from laufruhe.solvers.stars.ranking import RankedStar, distinct_orders, ranked_star, ranking_result
from laufruhe.solvers.stars.star_results import StarDesign, no_star, with_star
from laufruhe.solvers.throws.throw_starts import firing_intervals, starts_of, why_none_fires

MOST_SEARCHED = 3
# starts of a star besides the mounts of the first of the ranking
BESIDE = 2


Star: TypeAlias = tuple[Candidate, tuple[int, ...] | None]
"""A star with a set of shafts, and its steps if it fires evenly."""


def _rank(design: StarDesign) -> tuple[bool, float]:
    # sort key: feasible designs first, then by objective
    return not design.result.status.has_design, design.value


def _minimum(found: list[StarDesign]) -> float:
    return min((value for broken, value in map(_rank, found) if not broken), default=math.inf)


def solve_star_mounts(problem: Problem) -> Result:
    """Return the best of the stars, each with mounts and unbalances decided together (E35).

    Parameters
    ----------
    problem
        Problem on elastic mounts with open throws, firing order or optional shafts.

    Raises
    ------
    ModelError
        If there are too many stars to list.
    SolverError
        If a solver stops without an answer.
    """
    phasing = problem.phasing
    if phasing is None:
        raise ValueError("nothing of the phasing is open")
    started = time.perf_counter()
    ranking, count = _stars(problem, phasing)
    stars = [(replace(star, firing_order=order.order), steps) for star, steps in ranking
             for order in distinct_orders(problem, _only(phasing, star, steps), star, steps)]  # fmt: skip
    designs = count - len(ranking) + len(stars)
    ranked = time.perf_counter()
    # searches and bounds share workers, whose start takes as long as a star
    with executor_for() as executor, working_on(executor):
        found = _solved_shortly(problem, phasing, stars)
        found = _bounded(_solved_fully(problem, found), phasing, designs)
        if phasing.continuous:
            found = sorted([*found, *_moved(problem, phasing, found)], key=_rank)
    timing = {"rank": ranked - started, "solve": time.perf_counter() - ranked}
    return replace(_result(problem, phasing, found, designs), timing=timing)


def _stars(problem: Problem, phasing: Phasing) -> tuple[list[Star], int]:
    """Return stars by their rank on the baseline mounts, and the number of all stars."""
    if phasing.throws is not None:
        star = Candidate(phasing.throws, None, *phasing.minimum_geometry)
        sets = phasing.shafts.allowed
        return [(replace(star, left_out=phasing.without(built)), None) for built in sets], len(sets)
    if phasing.throw_bounds is not None:
        return [], 0
    # firing orders of shared throws are listed later
    by_firing = problem.depends_on_firing_order and not phasing.shares_throws
    families, _ = families_of(phasing, by_firing)
    if sum(family.size for family in families) > MOST_LISTED:
        raise ModelError(f"more than {MOST_LISTED} stars are open together with mounts; fix the firing order")
    on_given = replace(phasing, realise=lambda candidate: _on_given_mounts(phasing.realise(candidate)))
    many = phasing.method is Method.ENUMERATION
    scored: list[tuple[float, Star]] = []
    designs = 0
    for family in families:
        own, count = _ranked(problem, on_given, family, 10**9 if many else phasing.best)
        scored, designs = scored + own, designs + count
    scored.sort(key=lambda pair: pair[0])
    return [star for _, star in scored][: designs if many else phasing.best], designs


def _ranked(problem: Problem, phasing: Phasing, family: Family, count: int) -> tuple[list[tuple[float, Star]], int]:
    """Return stars of one geometry with their least objective on the baseline mounts (S15)."""
    model = family.model(phasing)
    designs = search_designs(
        model, family.stars, count, max(problem.tolerance, 1e-3), phasing.time_limit, numerical_zero(model.problem)
    )
    stars: list[tuple[float, Star]] = [
        (
            s.value,
            (family.candidate(phasing, s.star, phasing.without(s.built)), None if family.is_of_orders else s.star),
        )
        for s in designs.solved
    ]
    return stars, designs.designs


def _on_given_mounts(problem: Problem) -> Problem:
    # stars are ranked by loads, or by RMS mount force without load terms
    terms = problem.load_terms or (Term(Measure(channels.MOUNT_FORCE, RMS)),)
    masses = tuple(limit for limit in problem.limits if limit.measure.is_mass)
    return replace(problem.balance, objective=terms, limits=masses)


def _problem_of(problem: Problem, phasing: Phasing, candidate: Candidate, starts: int) -> Problem:
    realised = phasing.realise(candidate)
    search = replace(problem.search, starts=starts)
    return replace(realised, phasing=None, tolerance=problem.tolerance, fidelity=problem.fidelity, search=search)


def _solved_shortly(problem: Problem, phasing: Phasing, stars: list[Star]) -> list[StarDesign]:
    """Solve the first star with all starts, and the others from its mounts and a few starts; return the best first."""
    starts = problem.search.starts
    problems = [_problem_of(problem, phasing, candidate, starts) for candidate, _ in stars[:1]]
    problems += [_problem_of(problem, phasing, candidate, min(starts, BESIDE)) for candidate, _ in stars[1:]]
    results = list[Result]()
    with limit_time(phasing.time_limit):
        for first in problems[:1]:
            with search_scope(f"first of {counted(len(stars), 'star')}"):
                results.append(solve_mounts(first, among=True))
        known = [result for result in results if result.decisions and starts > BESIDE]
        near = place_of(known[0].problem, known[0])[0] if known else None
        # one process for each star
        work = partial(solve_mounts, workers=1, among=True, near=near)
        results += ordered_map(work, problems[1:], "stars on their mounts") if not is_time_over() else []
    found = [StarDesign(star, result, steps) for (star, steps), result in zip(stars, results, strict=False)]
    return sorted(found, key=_rank)


def _solved_fully(problem: Problem, found: list[StarDesign]) -> list[StarDesign]:
    """Solve the best few stars again with all starts."""
    out = list(found)
    starts = problem.search.starts
    for k, each in enumerate(() if is_time_over() else found[:MOST_SEARCHED]):
        star_problem = each.result.problem
        # a star that is proven to be no better than the best needs no more starts
        if star_problem.search.starts >= starts or each.bound >= found[0].value * (1.0 - problem.tolerance):
            continue
        whole = min(len(found), MOST_SEARCHED)
        report_progress("best stars once more", k, whole, value=_minimum(out))
        more = replace(star_problem, search=replace(star_problem.search, starts=starts))
        with search_scope(f"best star {k + 1} of {whole}"):
            again = replace(each, result=solve_mounts(more, among=True))
        out[k] = min(again, each, key=_rank)
    return sorted(out, key=_rank)


def _bounded(found: list[StarDesign], phasing: Phasing, designs: int) -> list[StarDesign]:
    """Return all stars with bounds of their mounts, for designs no worse than the best of all stars (E54)."""
    minimum = _minimum(found)
    if len(found) < designs or phasing.continuous or not 0.0 < minimum < math.inf:
        return found
    first = bounded_under(found[0].result, minimum, of_many=len(found) > 1)
    out = [replace(found[0], result=first), *found[1:]]
    # the least bound of all stars is that of the problem
    cutoff = first.certificate.lower_bound if first.certificate is not None else minimum
    pieces = [(k, each.result) for k, each in enumerate(found)][1:]
    work = partial(_bounded_one, value=minimum, cutoff=cutoff)
    for k, result in ordered_map(work, pieces, "bounds of stars on their mounts"):
        out[k] = replace(out[k], result=result)
    return out


def _bounded_one(piece: tuple[int, Result], value: float, cutoff: float) -> tuple[int, Result]:
    number, result = piece
    return number, bounded_under(result, value, cutoff, of_many=True)


def _moved(problem: Problem, phasing: Phasing, found: list[StarDesign]) -> list[StarDesign]:
    """Return designs whose throws have left the best stars, or the middle of their bounds (E36)."""
    starts: list[tuple[Candidate, Result | None]] = [
        (each.candidate, each.result) for each in found[:MOST_SEARCHED] if not _rank(each)[0]
    ]
    starts = starts or [(start, None) for start in starts_of(phasing, None)[:MOST_SEARCHED]]
    out: list[StarDesign] = []
    for k, (candidate, even) in enumerate(() if found and is_time_over() else starts):
        report_progress("throws that leave their star", k, len(starts), value=_minimum([*found, *out]))
        star_problem = _problem_of(problem, phasing, candidate, problem.search.starts)
        moves = ThrowMoves(phasing, phasing.layout_of(candidate), candidate, phasing.intervals)
        result, moved = solve_moved(star_problem, moves, even)
        if result.objective is not None and not phasing.intervals.holds(firing_intervals(phasing, moved)):
            continue
        out.append(StarDesign(moved, result, moved=True))
    return out


def _result(problem: Problem, phasing: Phasing, found: list[StarDesign], designs: int) -> Result:
    baseline = evaluate(problem)
    if not found:
        why, proven = why_none_fires(phasing)
        return no_star(problem, why, Status.INFEASIBLE if proven else Status.FAILED)
    best = found[0]
    if _rank(best)[0]:
        return _none(problem, found, baseline, designs)
    complete = len(found) == designs and not phasing.continuous
    ranking = [_entry(phasing, each, complete and each is best) for each in found if not _rank(each)[0]]
    details = ranking_result(phasing, best.candidate, ranking, designs, len(found), _method(found, designs))
    zero_level = numerical_zero(problem, best.result.final.engine)
    bound = 0.0
    if complete:
        certificates = [each.result.certificate for each in found]
        bound = min(certificate.lower_bound if certificate else 0.0 for certificate in certificates)
    divided = _divided(problem, phasing, best)
    bound = max(bound, divided.bound)
    result, doubt = result_under(best.result, bound, zero_level)
    best = replace(best, result=result)
    method = details.method
    if divided.boxes:
        method += f"; {divided.boxes} box{'es' if divided.boxes > 1 else ''} of throws, mounts and unbalances"
    certificate = best.result.certificate
    if certificate is not None:
        text, residual = f"{method}; of the best: {certificate.method}", certificate.kkt_residual
        certificate = make_certificate(
            best.value, bound, zero_level, problem.tolerance, ProofStrength.PARTIAL, residual, text, doubt
        )
    return with_star(problem, phasing, best.result, best.candidate, certificate, details)


def _divided(problem: Problem, phasing: Phasing, best: StarDesign) -> BoxResult:
    if phasing.throw_bounds is None or not best.is_met or not problem.search.proves or is_time_over():
        return BoxResult(0.0, 0)
    realised = with_default_sampling(replace(phasing.realise(best.candidate), phasing=None))
    design = evaluate_design(realised, values_of(realised, best.result))
    known = known_of(design, mount_numbers(design))
    value = design.value - over_read(realised, design.evaluation)
    room = gap_tolerance_of(value, problem.tolerance, numerical_zero(problem, design.evaluation.engine))
    return proven(Question(realised, value, room, design.values, known, moves=(phasing, best.candidate)))


def _method(found: list[StarDesign], designs: int) -> str:
    moved = sum(each.moved for each in found)
    even = len(found) - moved
    text = (
        f"mounts and balance decided for each of {counted(even, 'star')}"
        if even
        else "mounts, balance and throws decided"
    )
    if even and designs > even:
        text += f", the best of {designs} on the mounts as given"
    return f"{text}; throws moved from {counted(moved, 'start')}" if moved else text


def _entry(phasing: Phasing, found: StarDesign, proven: bool) -> RankedStar:
    certificate = found.result.certificate
    bound = certificate.lower_bound if certificate is not None else 0.0
    proven = proven and certificate is not None and certificate.kind is Proof.GLOBAL
    return ranked_star(
        _only(phasing, found.candidate, found.steps), found.candidate, found.steps, found.value, bound, proven
    )


def _only(phasing: Phasing, star: Candidate, steps: tuple[int, ...] | None) -> Phasing:
    # with even steps, firing orders stay open
    return phasing if steps else replace(phasing, firing_order=star.firing_order or phasing.firing_order)


def _none(problem: Problem, found: list[StarDesign], baseline: Evaluation, designs: int) -> Result:
    """Return a result without a design, infeasible only if every star is proven to be."""
    proven = len(found) == designs and all(f.result.status is Status.INFEASIBLE for f in found)
    first = found[0].result
    status = Status.INFEASIBLE if proven else Status.FAILED
    # another star may keep a limit that one violates
    names = {name for each in found for name in each.result.conflict} if proven else ()
    conflict = tuple(limit.name for limit in problem.limits if limit.name in names)
    message = (
        f"{contradiction(conflict) if proven else first.message} (best of {len(found)} of {counted(designs, 'star')})"
    )
    return replace(
        first, problem=problem, status=status, objective=None, certificate=None, initial=baseline, final=baseline,
        message=message, conflict=conflict,
    )  # fmt: skip
