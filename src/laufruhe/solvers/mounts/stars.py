"""Solve for crank stars together with mounts and unbalances (E35).

There are finitely many even stars. A cone program balances each star on the initial mounts, and its dual rows bound
every other star (S14). This ranks the stars. The best of them are solved with open mounts and unbalances, one by one.
The ranking proves nothing about the joint problem, so the result states how many stars were not solved. If firing may
be uneven, throws then leave the best stars as variables of the same smooth program (E36). If throws have bounds, branch
and bound over throws, mounts and unbalances gives a lower bound (E72).
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
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.certificate import Proof, ProofStrength, gap_tolerance_of, make_certificate
from laufruhe.prove.mounts.provers import Question, run_provers
from laufruhe.prove.mounts.subdivision import is_stiffness_problem
from laufruhe.solvers.conclusion import conflict_message, evaluate_design, refine_result, values_of, witness_of
from laufruhe.solvers.mounts.nonlinear import mount_numbers, solve_mounts, solve_moved, with_mount_bounds
from laufruhe.solvers.mounts.starts import start_of_result
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.sampling_refinement import sampling_overestimate
from laufruhe.solvers.stars.even_search import MAX_LISTED
from laufruhe.solvers.stars.families import Family, families_of
from laufruhe.solvers.stars.ranking import RankedStar, distinct_orders, ranked_star, ranking_result
from laufruhe.solvers.stars.star_program import search_designs
from laufruhe.solvers.stars.star_results import StarDesign, no_star, with_star
from laufruhe.solvers.throws.throw_starts import firing_intervals, start_candidates, why_none_fires

# number of the best crank stars whose throws are moved
MAX_SEARCHED = 3
# starts of a crank star, in addition to the mounts of the first star of the ranking
FEW_STARTS = 2


Star: TypeAlias = tuple[Candidate, tuple[int, ...] | None]
"""A crank star with a set of shafts, and the steps of its throws if it fires evenly."""


def _rank(design: StarDesign) -> tuple[bool, float]:
    # sort key: feasible designs first, then by objective
    return not design.result.status.has_design, design.value


def _minimum_value(designs: list[StarDesign]) -> float:
    return min((value for has_no_design, value in map(_rank, designs) if not has_no_design), default=math.inf)


def solve_star_mounts(problem: Problem) -> Result:
    """Return the best crank star with its mounts and unbalances; those of every star are optimised (E35).

    Raises
    ------
    ModelError
        If there are too many stars to list.
    """
    phasing = problem.phasing
    if phasing is None:
        raise ValueError("the problem has no open phasing")
    started = time.perf_counter()
    ranking, count = _stars(problem, phasing)
    stars = [(replace(star, firing_order=order.order), steps) for star, steps in ranking
             for order in distinct_orders(problem, _fix_firing_order(phasing, star, steps), star, steps)]  # fmt: skip
    design_count = count - len(ranking) + len(stars)
    rank_time = time.perf_counter()
    # searches and bounds share workers, because starting these takes as long as solving a star
    with executor_for() as executor, working_on(executor):
        solved = _solve_with_few_starts(problem, phasing, stars)
        solved = _with_bounds(solved, phasing, design_count)
        if phasing.continuous:
            solved = sorted([*solved, *_solve_moved_throws(problem, phasing, solved)], key=_rank)
    timing = {"rank": rank_time - started, "solve": time.perf_counter() - rank_time}
    return replace(_result(problem, phasing, solved, design_count), timing=timing)


def _stars(problem: Problem, phasing: Phasing) -> tuple[list[Star], int]:
    """Return crank stars to solve, best on the initial mounts first, and the number of all crank stars."""
    if phasing.throws is not None:
        star = Candidate(phasing.throws, None, *phasing.minimum_geometry)
        sets = phasing.shafts.allowed
        return [(replace(star, left_out=phasing.without(built)), None) for built in sets], len(sets)
    if phasing.throw_bounds is not None:
        return [], 0
    # firing orders of shared throws are enumerated later
    by_firing = problem.depends_on_firing_order and not phasing.shares_throws
    families, _ = families_of(phasing, by_firing)
    if sum(family.size for family in families) > MAX_LISTED:
        raise ModelError(
            f"open throws have over {MAX_LISTED} crank stars, too many with open mounts; fix the firing order"
        )
    on_initial = replace(phasing, problem_of=lambda candidate: _on_initial_mounts(phasing.problem_of(candidate)))
    lists_all = phasing.lists_all
    scored: list[tuple[float, Star]] = []
    designs = 0
    for family in families:
        family_stars, count = _ranked(problem, on_initial, family, 10**9 if lists_all else phasing.best)
        scored, designs = scored + family_stars, designs + count
    scored.sort(key=lambda pair: pair[0])
    return [star for _, star in scored][: designs if lists_all else phasing.best], designs


def _ranked(problem: Problem, phasing: Phasing, family: Family, count: int) -> tuple[list[tuple[float, Star]], int]:
    """Return crank stars of one geometry with their objective on the initial mounts, and the number of all (S15)."""
    model = family.model(phasing)
    designs = search_designs(
        model, family.stars, count, max(problem.tolerance, 1e-3), phasing.time_limit, numerical_zero(model.problem)
    )
    stars: list[tuple[float, Star]] = []
    for solved in designs.solved:
        candidate = family.candidate(phasing, solved.star, phasing.without(solved.built))
        stars.append((solved.value, (candidate, None if family.is_of_orders else solved.star)))
    return stars, designs.designs


def _on_initial_mounts(problem: Problem) -> Problem:
    # loads rank stars, or the RMS mount force if the objective has no loads
    terms = problem.load_terms or (Term(Measure(channels.MOUNT_FORCE, RMS)),)
    masses = tuple(limit for limit in problem.limits if limit.measure.is_mass)
    return replace(problem.balance, objective=terms, limits=masses)


def _problem_of(problem: Problem, phasing: Phasing, candidate: Candidate, starts: int) -> Problem:
    star_problem = phasing.problem_of(candidate)
    search = replace(problem.search, starts=starts)
    return replace(star_problem, phasing=None, tolerance=problem.tolerance, fidelity=problem.fidelity, search=search)


def _solve_with_few_starts(problem: Problem, phasing: Phasing, stars: list[Star]) -> list[StarDesign]:
    """Return the optimal mounts of every crank star, best first.

    The first star is solved from all starts, the others from its mounts and few starts.
    """
    starts = problem.search.starts
    problems = [_problem_of(problem, phasing, candidate, starts) for candidate, _ in stars[:1]]
    problems += [_problem_of(problem, phasing, candidate, min(starts, FEW_STARTS)) for candidate, _ in stars[1:]]
    results = list[Result]()
    with limit_time(phasing.time_limit):
        for first in problems[:1]:
            with search_scope(f"first of {counted(len(stars), 'star')}"):
                results.append(solve_mounts(first, defer_bounds=True))
        usable = [result for result in results if result.decisions and starts > FEW_STARTS]
        start_mounts = start_of_result(usable[0].problem, usable[0])[0] if usable else None
        # one process per star
        work = partial(solve_mounts, workers=1, defer_bounds=True, start_mounts=start_mounts)
        results += ordered_map(work, problems[1:], "stars on their mounts") if not is_time_over() else []
    designs = [StarDesign(star, result, steps) for (star, steps), result in zip(stars, results, strict=False)]
    return sorted(designs, key=_rank)


def _with_bounds(designs: list[StarDesign], phasing: Phasing, design_count: int) -> list[StarDesign]:
    """Return the designs with better lower bounds by the provers of mounts, up to the best star's objective (E54)."""
    minimum = _minimum_value(designs)
    if len(designs) < design_count or phasing.continuous or not 0.0 < minimum < math.inf:
        return designs
    if is_stiffness_problem(designs[0].result.problem):
        # the search has found these bounds
        return designs
    first = with_mount_bounds(designs[0].result, minimum, in_batch=len(designs) > 1)
    bounded = [replace(designs[0], result=first), *designs[1:]]
    # the bound of the problem is the smallest of all stars
    cutoff = first.certificate.lower_bound if first.certificate is not None else minimum
    work = partial(with_mount_bounds, value=minimum, cutoff=cutoff, in_batch=True)
    others = ordered_map(work, [design.result for design in designs[1:]], "bounds of stars on their mounts")
    for k, result in enumerate(others, 1):
        bounded[k] = replace(bounded[k], result=result)
    return bounded


def _solve_moved_throws(problem: Problem, phasing: Phasing, designs: list[StarDesign]) -> list[StarDesign]:
    """Return designs with throws moved from the best crank stars, or from the middle of their bounds (E36)."""
    starts: list[tuple[Candidate, Result | None]] = [
        (design.candidate, design.result) for design in designs[:MAX_SEARCHED] if not _rank(design)[0]
    ]
    starts = starts or [(start, None) for start in start_candidates(phasing, None)[:MAX_SEARCHED]]
    moved_designs: list[StarDesign] = []
    for k, (candidate, even_result) in enumerate(() if designs and is_time_over() else starts):
        best = _minimum_value([*designs, *moved_designs])
        report_progress("throws that leave their star", k, len(starts), value=best)
        star_problem = _problem_of(problem, phasing, candidate, problem.search.starts)
        moves = ThrowMoves(phasing, phasing.layout_of(candidate), candidate, phasing.intervals)
        result, crank = solve_moved(star_problem, moves, even_result)
        if result.objective is not None and not phasing.intervals.holds(firing_intervals(phasing, crank)):
            continue
        moved_designs.append(StarDesign(crank, result, has_moved_throws=True))
    return moved_designs


def _result(problem: Problem, phasing: Phasing, designs: list[StarDesign], design_count: int) -> Result:
    initial = evaluate(problem)
    if not designs:
        reason, is_proven = why_none_fires(phasing)
        return no_star(problem, reason, Status.INFEASIBLE if is_proven else Status.FAILED)
    best = designs[0]
    if _rank(best)[0]:
        return _without_design(problem, designs, initial, design_count)
    complete = len(designs) == design_count and not phasing.continuous
    ranking = [_ranking_entry(phasing, x, complete and x is best) for x in designs if not _rank(x)[0]]
    details = ranking_result(
        phasing, best.candidate, ranking, design_count, len(designs), _method(designs, design_count)
    )
    zero_level = numerical_zero(problem, best.result.final.engine)
    bound = 0.0
    if complete:
        certificates = [design.result.certificate for design in designs]
        bound = min(certificate.lower_bound if certificate else 0.0 for certificate in certificates)
    division = _divide_boxes(problem, phasing, best)
    bound = max(bound, division.bound)
    result, value_error = refine_result(best.result, bound, zero_level)
    best = replace(best, result=result)
    method = details.method
    if division.boxes:
        method += f"; {counted(division.boxes, 'box')} of throws, mounts and unbalances"
    certificate = best.result.certificate
    if certificate is not None:
        text, residual = f"{method}; of the best: {certificate.method}", certificate.kkt_residual
        certificate = make_certificate(
            best.value, bound, zero_level, problem.tolerance, ProofStrength.PARTIAL, residual, text, value_error
        )
    return with_star(problem, phasing, best.result, best.candidate, certificate, details)


def _divide_boxes(problem: Problem, phasing: Phasing, best: StarDesign) -> BoxResult:
    if phasing.throw_bounds is None or not best.is_feasible or not problem.search.proves or is_time_over():
        return BoxResult(0.0, 0)
    star_problem = with_default_sampling(replace(phasing.problem_of(best.candidate), phasing=None))
    design = evaluate_design(star_problem, values_of(star_problem, best.result))
    witness = witness_of(design, mount_numbers(design))
    value = design.value - sampling_overestimate(star_problem, design.evaluation)
    gap_tolerance = gap_tolerance_of(value, problem.tolerance, numerical_zero(problem, design.evaluation.engine))
    return run_provers(
        Question(star_problem, value, gap_tolerance, design.values, witness, open_throws=(phasing, best.candidate))
    )


def _method(designs: list[StarDesign], design_count: int) -> str:
    moved_count = sum(design.has_moved_throws for design in designs)
    even_count = len(designs) - moved_count
    text = "mounts, balance and throws optimised"
    if even_count:
        text = f"mounts and balance optimised for each of {counted(even_count, 'star')}"
    if even_count and design_count > even_count:
        text += f", the best of {design_count} on the initial mounts"
    return f"{text}; throws moved from {counted(moved_count, 'start')}" if moved_count else text


def _ranking_entry(phasing: Phasing, design: StarDesign, proven: bool) -> RankedStar:
    certificate = design.result.certificate
    bound = certificate.lower_bound if certificate is not None else 0.0
    proven = proven and certificate is not None and certificate.kind is Proof.GLOBAL
    fixed = _fix_firing_order(phasing, design.candidate, design.steps)
    return ranked_star(fixed, design.candidate, design.steps, design.value, bound, proven)


def _fix_firing_order(phasing: Phasing, star: Candidate, steps: tuple[int, ...] | None) -> Phasing:
    # firing orders stay open with even steps
    return phasing if steps else replace(phasing, firing_order=star.firing_order or phasing.firing_order)


def _without_design(problem: Problem, designs: list[StarDesign], initial: Evaluation, design_count: int) -> Result:
    """Return a result without a design: infeasible if that is proven for every crank star, else failed."""
    is_proven = len(designs) == design_count and all(f.result.status is Status.INFEASIBLE for f in designs)
    first = designs[0].result
    status = Status.INFEASIBLE if is_proven else Status.FAILED
    # each star may violate other limits
    names = {name for design in designs for name in design.result.conflict} if is_proven else ()
    conflict = tuple(limit.name for limit in problem.limits if limit.name in names)
    reason = conflict_message(conflict) if is_proven else first.message
    message = f"{reason} (best of {len(designs)} of {counted(design_count, 'star')})"
    return replace(
        first, problem=problem, status=status, objective=None, certificate=None, initial=initial, final=initial,
        message=message, conflict=conflict,
    )  # fmt: skip
