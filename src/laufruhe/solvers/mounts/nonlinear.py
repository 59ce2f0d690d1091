"""Solve for mounts, and unbalances with them: multistart search, then lower bounds."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.errors import counted
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over, until_time_limit
from laufruhe.problem import channels
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Limit, Measure, Term
from laufruhe.problem.mount_resonance import evaluate_start, off_resonance
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import GAP_SAFETY, BoxResult
from laufruhe.prove.certificate import ProofStrength, gap_of, gap_tolerance_of
from laufruhe.prove.mounts.named import named_part
from laufruhe.prove.mounts.provers import Question, run_provers
from laufruhe.prove.mounts.subdivision import is_stiffness_problem, stiffness_bounds
from laufruhe.solvers.conclusion import (
    FEASIBILITY_TOL,
    Design,
    ProofData,
    build_result,
    infeasible_result,
    nearest_record,
    priced_decisions,
    quote_names,
    smallest_conflict,
    unbalance_values,
    values_of,
    witness_of,
)
from laufruhe.solvers.cones.unbalances import conflict_on_any_mounts, solve_unbalances
from laufruhe.solvers.mounts.convex import CONVEX, is_convex, solve_convex_mounts
from laufruhe.solvers.mounts.search import MountSearch, SearchResult
from laufruhe.solvers.mounts.starts import StartPoint, evaluate_design_at, start_of_result
from laufruhe.solvers.relaxation import with_better_bound
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.sampling_refinement import sampling_overestimate
from laufruhe.solvers.smooth.local_optimum import LocalOptimum, describe_starts, distinct_optima

# largest number of bounds by all provers, with searches from their lowest boxes in between
MAX_DIVISIONS = 3
# share of the problem's largest number of boxes for a test of one set of limits
CONFLICT_SHARE = 0.1


def mount_numbers(design: Design) -> Array:
    """Return the open numbers of the mounts of a design [SI], shape (n,)."""
    pairs = zip(design.problem.decisions, design.values, strict=True)
    return np.array([float(value.real) for decision, value in pairs if not decision.is_affine])


def bound_search(problem: Problem, search: MountSearch, defer_bounds: bool) -> BoxResult:
    """Return the lower bound of a mount search by all provers, which also tell where to search on.

    The search continues where the bounds are lowest. Bounds are left to `with_mount_bounds` if `defer_bounds` is True,
    unless only stiffness is open.
    """
    division = BoxResult(0.0, 0)
    if search.moves is not None or not problem.search.proves or (defer_bounds and not is_stiffness_problem(problem)):
        return division
    for _ in until_time_limit(range(MAX_DIVISIONS)):
        design = search.best_or_initial.design if search.best_or_initial is not None else None
        value, witness = math.inf, None
        if design is not None and design.violation <= FEASIBILITY_TOL:
            # bounds exclude errors of coarse sampling
            value = design.value - sampling_overestimate(problem, design.evaluation)
            witness = witness_of(design, mount_numbers(design))
        gap_tolerance = gap_tolerance_of(
            value, problem.tolerance, numerical_zero(problem, design.evaluation.engine if design else None)
        )
        values = design.values if design is not None else ()
        question, count = Question(problem, value, gap_tolerance, values, witness), len(problem.mount_decisions)
        division = run_provers(question)
        starts = [(start[:count].tolist(), start[count:] if len(start) > count else None) for start in division.places]
        if not starts or is_time_over() or not search.search_from(starts):
            break
        # after a small improvement, the bound still closes the gap
        if search.best is not None and search.best.design.value > question.value - gap_tolerance:
            break
    return division


def with_mount_bounds(result: Result, value: float, cutoff: float = math.inf, in_batch: bool = False) -> Result:
    """Return a result with a better lower bound, by all provers of its open mounts.

    Parameters
    ----------
    value
        Objective that the bound need not exceed, such as that of the best of all crank stars [SI].
    cutoff
        Lower bound at which the proof stops [SI].
    in_batch
        True if many results are bounded, so that cheap bounds come first.
    """
    problem, certificate = result.problem, result.certificate
    if certificate is None or result.objective is None or problem.phasing is not None:
        return result
    zero_level = numerical_zero(problem, result.final.engine)
    gap_tolerance = max(
        gap_tolerance_of(value, problem.tolerance, zero_level), (value - min(cutoff, value)) / GAP_SAFETY
    )
    question = Question(problem, value, gap_tolerance, values_of(problem, result), in_batch=in_batch)
    division = run_provers(question)
    return with_better_bound(result, division.bound, f"bounds of mounts from {counted(division.boxes, 'box')}")


def are_contradictory(problem: Problem, limits: Sequence[Limit]) -> bool:
    """Return True if boxes prove that these limits of an `is_stiffness_problem` contradict each other."""
    without_terms = replace(problem, objective=(), limits=tuple(limits))
    divisions = stiffness_bounds(without_terms, math.inf, 0.0, (CONFLICT_SHARE,))
    return bool(limits) and any(division.bound == math.inf for division in divisions)


def minimal_conflict(problem: Problem) -> tuple[str, ...]:
    """Return the names of a minimal set of contradicting limits of an infeasible `is_stiffness_problem`."""
    return smallest_conflict(problem.limits, lambda limits: are_contradictory(problem, limits))


# ratio of local optima from which the certificate mentions it
NOTABLE_RATIO = 1.01


def solve_mounts(
    problem: Problem,
    workers: int | None = None,
    defer_bounds: bool = False,
    start_mounts: Sequence[float] | None = None,
) -> Result:
    """Solve by a convex program if possible, else by `solve_joint`, which has the same parameters."""
    if is_convex(problem):
        return solve_convex_mounts(problem)
    return solve_joint(problem, workers, defer_bounds, start_mounts)


def solve_joint(
    problem: Problem,
    workers: int | None = None,
    defer_bounds: bool = False,
    start_mounts: Sequence[float] | None = None,
) -> Result:
    """Return the best local optimum of a multistart search, with a lower bound (E20-E24).

    Parameters
    ----------
    workers
        Number of processes; by default the number of processors.
    defer_bounds
        True to leave bounds to `with_mount_bounds`, for one of several problems.
    start_mounts
        Numbers of the mounts of the first start [SI], shape (n,).
    """
    return _search_and_bound(
        problem, workers, None, None if start_mounts is None else (list(start_mounts), None), defer_bounds
    )[0]


def solve_moved(problem: Problem, moves: ThrowMoves, even_result: Result | None) -> tuple[Result, Candidate]:
    """Return the best mounts and throws if throws may leave an evenly spaced crank star, and the moved crank (E36).

    The first start is `even_result`, the result of the star without moves.
    """
    first = start_of_result(problem, even_result) if even_result is not None and even_result.decisions else None
    # bounds over mounts alone are not valid for moved throws
    result, turns = _search_and_bound(problem, None, moves, first, True)
    return result, moves.candidate(turns)


def _search_and_bound(
    problem: Problem,
    workers: int | None,
    moves: ThrowMoves | None,
    first: StartPoint | None,
    defer_bounds: bool,
) -> tuple[Result, Array]:
    """Return the best mounts with their bounds, and the moves of the throws from their crank star [rad], (moves,)."""
    started = time.perf_counter()
    initial = evaluate_start(problem)
    search = MountSearch(problem, initial, workers, moves, first, keep_initial=moves is None)
    model_time = time.perf_counter()
    search.run()
    first_best = search.best_or_initial
    is_feasible = first_best is not None and first_best.design.violation <= FEASIBILITY_TOL
    rebalanced = _rebalanced(first_best) if first_best is not None and is_feasible else None
    division = bound_search(problem, search, defer_bounds)
    best = search.best_or_initial
    timing = {"model": model_time - started, "solve": time.perf_counter() - model_time}
    if best is None or best.design.violation > FEASIBILITY_TOL:
        conflict = _proven_conflict(problem)
        if not conflict and division.bound == math.inf:
            conflict = minimal_conflict(problem)
        result = infeasible_result(problem, initial, conflict, timing)
        return result if conflict else failed_search(search, result), search.turns
    if rebalanced is None or first_best is None or first_best.design.values != best.design.values:
        # a prover has found a better design
        rebalanced = _rebalanced(best)
    best, balance_gap = rebalanced
    design, bound = best.design, division.bound
    zero_level = numerical_zero(problem, design.evaluation.engine)
    # the bound is not valid for moved throws
    if moves is None and problem.search.proves and gap_of(design.value, bound, zero_level) > problem.tolerance:
        bound = max(bound, mounts_bound(problem, () if defer_bounds else design.values))
    proof = search_proof(
        best, division, bound, _method(search.optima, max(design.value, zero_level), balance_gap, division)
    )
    if moves is not None:
        # prices of limits refer to the problem with open throws
        design = replace(design, problem=replace(design.problem, phasing=moves.phasing))
    return build_result(design, initial, proof, timing), search.turns


def search_proof(best: SearchResult, division: BoxResult, bound: float, method: str) -> ProofData:
    """Return the proof of a search's best result: its lower bound [SI], gap and method."""
    return ProofData(
        bound=bound,
        strength=ProofStrength.PARTIAL if division.boxes else ProofStrength.RELAXED,
        kkt_residual=best.optimum.kkt_residual if best.optimum is not None else math.inf,
        method=method,
        prices=best.joint.prices(best.optimum) if best.optimum is not None else {},
    )


def _rebalanced(best: SearchResult) -> tuple[SearchResult, float | None]:
    """Return a result with optimal unbalances on the same mounts, and the proven gap of these unbalances.

    The gap is None if the program of the unbalances is not convex, or gives no feasible design.
    """
    design, problem = best.design, best.design.problem
    if not problem.unbalances or not problem.load_terms or problem.mount_terms or is_time_over():
        return best, None
    if any(limit.measure.unit == "" for limit in problem.mount_limits):
        # transmissibility depends on the excitation
        return best, None
    numbers = mount_numbers(design).tolist()
    engine = problem.design(numbers, problem.mount_decisions)
    result = solve_unbalances(replace(problem, engine=engine).balance)
    if result.certificate is None or result.status is not Status.OPTIMAL:
        return best, None
    rebalanced = evaluate_design_at(problem, numbers, unbalance_values(problem, result))
    if rebalanced is None or rebalanced.violation > FEASIBILITY_TOL:
        return best, None
    gap = result.certificate.gap
    return best if rebalanced.value >= design.value else replace(best, design=rebalanced), gap


def _convex_part(problem: Problem) -> Problem | None:
    decisions = problem.mount_decisions
    if not decisions or not all(decision.is_stiffness for decision in decisions):
        return None
    terms = tuple(term for term in problem.mount_terms if term.measure.channel in CONVEX)
    convex = replace(problem, objective=terms or (Term(Measure(channels.TOTAL_STIFFNESS)),), decisions=decisions)
    limits = tuple(limit for limit in problem.mount_limits if is_convex(replace(convex, limits=(limit,))))
    return replace(convex, limits=limits)


def _proven_conflict(problem: Problem) -> tuple[str, ...]:
    """Return names of limits that are proven to contradict each other, by convex programs or by branch and bound."""
    conflict = conflict_on_any_mounts(problem)
    if conflict:
        return conflict
    convex = _convex_part(problem)
    conflict = () if convex is None else solve_convex_mounts(convex).conflict
    if conflict or not problem.unbalances:
        return conflict
    # measures without loads do not depend on unbalances
    limits = tuple(limit for limit in problem.mount_limits if not limit.measure.channel.depends_on_loads)
    mounts_only = replace(problem, decisions=problem.mount_decisions, objective=(), limits=limits)
    if not is_stiffness_problem(mounts_only) or not are_contradictory(mounts_only, limits):
        return ()
    return minimal_conflict(mounts_only)


def mounts_bound(problem: Problem, values: Sequence[Value] = ()) -> float:
    """Return a lower bound of the objective [SI] that holds for all mounts: the sum of bounds by kind of term.

    No term is negative. Convex programs bound numbers of the mounts (E16-E19). Cone programs of the unbalances bound
    loads of the block and masses (P4). If the objective has other terms too, provers bound forces and travel of the
    mounts. They need `values`, the decisions of a good design.
    """
    problem, total, results = named_part(problem), 0.0, []
    on_mounts, block = (
        tuple(term for term in problem.load_terms if term.measure.on_mounts == kind) for kind in (True, False)
    )
    if values and on_mounts and (block or problem.mount_terms):
        part = replace(problem, objective=on_mounts)
        evaluation = evaluate(part, part.design(list(values)))
        value = objective_value(part, evaluation)
        total += run_provers(
            Question(part, value, gap_tolerance_of(value, part.tolerance, numerical_zero(part)), values)
        ).bound
    if block:
        limits = tuple(limit for limit in problem.load_limits if not limit.measure.on_mounts)
        part = replace(off_resonance(problem).balance, objective=block, limits=limits)
        if part.decisions:
            results.append(solve_unbalances(part))
        else:
            total += objective_value(part, evaluate(part))
    convex = _convex_part(problem)
    if convex is not None and set(convex.objective) <= set(problem.objective):
        results.append(solve_convex_mounts(convex))
    return total + sum(result.certificate.lower_bound for result in results if result.certificate is not None)


def _method(optima: Sequence[LocalOptimum], scale: float, balance_gap: float | None, division: BoxResult) -> str:
    ends = distinct_optima(optima, scale)
    text = describe_starts(optima, len(ends))
    if len(ends) > 1 and ends[-1].value > NOTABLE_RATIO * ends[0].value > 0.0:
        text += f", up to {ends[-1].value / ends[0].value:.3g} times the best"
    if balance_gap is not None:
        text += f"; balance on these mounts proven within {balance_gap:.0e}"
    return f"{text}; bounds of mounts from {counted(division.boxes, 'box')}" if division.boxes else text


def failed_search(search: MountSearch, result: Result) -> Result:
    """Return the result of a search without a feasible design, with a message that names limits of the nearest one."""
    nearest, program = min(search.optima, key=lambda o: o.violation), search.joint.program
    names = ""
    if len(nearest.constraints) == len(program.constraint_names):
        values = nearest.constraints
        excess = np.maximum(program.constraint_lower - values, values - program.constraint_upper)
        violated = [program.constraint_names[k] for k in np.flatnonzero(excess > 1e-6)]
        names = quote_names(name for name in dict.fromkeys(violated) if name != "modes")
    message = (
        f"no design was found that keeps {names or 'the limits'}, from {sum(o.starts for o in search.optima)} starts "
        f"(the nearest design violates a limit by {nearest.violation:.3g} of it); relax it, or open more numbers"
    )
    design = search.best.design if search.best else None
    nearest_design = nearest_record(search.problem, design.evaluation, priced_decisions(design)) if design else None
    return replace(result, status=Status.FAILED, message=message, nearest=nearest_design)
