"""Mounts, and unbalances with them: multistart search, then bounds."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace

import numpy as np

from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over
from laufruhe.numerics.workers import speculation, worker_pool
from laufruhe.problem import channels
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.mount_resonance import evaluate_start, off_resonance
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.certificate import ProofStrength, gap_of, gap_tolerance_of
from laufruhe.prove.mounts.named import named_part
from laufruhe.prove.mounts.provers import Question, proven, provers
from laufruhe.prove.mounts.subdivision import divides
from laufruhe.solvers.conclusion import (
    KEPT,
    Design,
    ProofData,
    build_result,
    decided,
    infeasible_result,
    nearest_of,
    unbalances_of,
)
from laufruhe.solvers.cones.unbalances import conflict_on_any_mounts, solve_unbalances
from laufruhe.solvers.mounts.bounds import conflict_of, divided_by, excludes
from laufruhe.solvers.mounts.convex import CONVEX, is_convex, solve_convex_mounts
from laufruhe.solvers.mounts.places import Place, evaluate_design_at
from laufruhe.solvers.mounts.search import MountSearch, SearchResult
from laufruhe.solvers.mounts.starts import evaluation_count, place_of
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.smooth.ipopt import run
from laufruhe.solvers.smooth.local_optimum import LocalOptimum, distinct, ends_in_words
from laufruhe.solvers.smooth.program import SmoothProgram

WORTH_SAYING = 1.01
# operating points of all candidates from which on a search takes longer than the start of workers
MANY_LOOKS = 256


def solve_mounts(
    problem: Problem, workers: int | None = None, among: bool = False, near: Sequence[float] | None = None
) -> Result:
    """Solve a convex problem exactly, and any other by `solve_joint`."""
    return solve_convex_mounts(problem) if is_convex(problem) else solve_joint(problem, workers, among, near)


def solve_joint(
    problem: Problem, workers: int | None = None, among: bool = False, near: Sequence[float] | None = None
) -> Result:
    """Return the best local optimum of a multistart search, with a lower bound (E20-E24).

    Parameters
    ----------
    problem
        Problem on elastic mounts.
    workers
        Processes; as many as processors by default.
    among
        Whether the problem is one of several, which are bounded when the best of all is known.
    near
        Numbers of the mounts of the first start.

    Raises
    ------
    SolverError
        If a process of the solver dies.
    """
    return _solved(problem, workers, None, None if near is None else (list(near), None), among)[0]


def solve_moved(problem: Problem, moves: ThrowMoves, even: Result | None) -> tuple[Result, Candidate]:
    """Solve a problem whose throws may leave their star, and return the new throws (E36).

    Parameters
    ----------
    problem
        Problem of the star.
    moves
        Throws that may move.
    even
        Result of the star itself, the first start.
    """
    first = place_of(problem, even) if even is not None and even.decisions else None
    # bounds of mounts alone do not hold for moved throws
    result, turns = _solved(problem, None, moves, first, True)
    return result, moves.candidate(turns)


def _solved(
    problem: Problem,
    workers: int | None,
    moves: ThrowMoves | None,
    first: Place | None,
    among: bool,
) -> tuple[Result, Array]:
    """Return the result, and deviations of the throws [rad]."""
    started = time.perf_counter()
    initial = evaluate_start(problem)
    worth = evaluation_count(problem) >= MANY_LOOKS and workers != 1 and not among
    with worker_pool(run, *(prover.bounds for prover in provers())) if worth else nullcontext():
        search = MountSearch(problem, initial, workers, moves, first, beside=moves is None)
        modelled = time.perf_counter()
        search.run()
        with speculation(_balance, math.inf) as ahead:
            # decide the unbalances anew while provers bound, which may still find a better design
            ahead.prefetch((each.design.values, _share(each.design)) for each in [search.chosen] if each is not None)
            divided = divided_by(problem, search, among)
            best = search.chosen
            timing = {"model": modelled - started, "solve": time.perf_counter() - modelled}
            if best is None or best.design.violation > KEPT:
                return _none(problem, search, initial, divided, timing), search.turns
            balance = ahead.result(best.design.values, _share(best.design))
    proven = None if balance is None else _rebalanced(best.design, *balance)
    design = best.design if proven is None or proven[0].value >= best.design.value else proven[0]
    return _result(search, initial, replace(best, design=design), proven, divided, timing, among), search.turns


def _mounts(design: Design) -> list[float]:
    pairs = zip(design.problem.decisions, design.values, strict=True)
    return [value.real for decision, value in pairs if not decision.is_affine]


def _share(design: Design) -> tuple[Problem, Sequence[float]]:
    return design.problem, _mounts(design)


def _balance(share: tuple[Problem, Sequence[float]]) -> tuple[list[complex], float] | None:
    """Return the best unbalances on fixed mounts and their proven gap, or None if that is not convex."""
    problem, mounts = share
    if not problem.unbalances or not problem.load_terms or problem.mount_terms or is_time_over():
        return None
    if any(limit.measure.unit == "" for limit in problem.mount_limits):
        # transmissibility depends on what excites
        return None
    engine = problem.design(mounts, problem.mount_decisions)
    result = solve_unbalances(replace(problem, engine=engine).balance)
    if result.certificate is None or result.status is not Status.OPTIMAL:
        return None
    return unbalances_of(problem, result), result.certificate.gap


def _rebalanced(design: Design, unbalances: Sequence[complex], gap: float) -> tuple[Design, float] | None:
    mounts, columns = iter(_mounts(design)), iter(unbalances)
    values = [next(columns) if d.is_affine else next(mounts) for d in design.problem.decisions]
    again = evaluate_design_at(design.problem, values)
    return None if again is None or again.violation > KEPT else (again, gap)


def _convex_part(problem: Problem) -> Problem | None:
    decisions = problem.mount_decisions
    if not decisions or not all(decision.is_stiffness for decision in decisions):
        return None
    terms = tuple(term for term in problem.mount_terms if term.measure.channel in CONVEX)
    alone = replace(problem, objective=terms or (Term(Measure(channels.TOTAL_STIFFNESS)),), decisions=decisions)
    limits = tuple(limit for limit in problem.mount_limits if is_convex(replace(alone, limits=(limit,))))
    return replace(alone, limits=limits)


def _proven_conflict(problem: Problem) -> tuple[str, ...]:
    """Return limits that contradict each other by convex programs, or by boxes of stiffness without unbalances."""
    conflict = conflict_on_any_mounts(problem)
    if conflict:
        return conflict
    convex = _convex_part(problem)
    conflict = () if convex is None else solve_convex_mounts(convex).conflict
    if conflict or not problem.unbalances:
        return conflict
    # numbers without loads are the same for all unbalances
    limits = tuple(limit for limit in problem.mount_limits if not limit.measure.channel.depends_on_loads)
    alone = replace(problem, decisions=problem.mount_decisions, objective=(), limits=limits)
    return conflict_of(alone) if divides(alone) and excludes(alone, limits) else ()


def mounts_bound(problem: Problem, near: Sequence[Value] = ()) -> float:
    """Return a lower bound by the sum of bounds of each kind of terms, none of which is negative [SI].

    Convex programs bound numbers of the mounts (E16-E19). Cone programs of the unbalances bound loads of the block
    and masses (P4). Provers bound forces and travel of the mounts if other terms are in the objective too.

    Parameters
    ----------
    near
        Values of the decisions of a good design.
    """
    problem, total, parts = named_part(problem), 0.0, []
    on_mounts, block = (
        tuple(term for term in problem.load_terms if term.measure.on_mounts == kind) for kind in (True, False)
    )
    if near and on_mounts and (block or problem.mount_terms):
        alone = replace(problem, objective=on_mounts)
        evaluation = evaluate(alone, alone.design(list(near)))
        value = objective_value(alone, evaluation)
        total += proven(
            Question(alone, value, gap_tolerance_of(value, alone.tolerance, numerical_zero(alone)), near)
        ).bound
    if block:
        limits = tuple(limit for limit in problem.load_limits if not limit.measure.on_mounts)
        alone = replace(off_resonance(problem).balance, objective=block, limits=limits)
        if alone.decisions:
            parts.append(solve_unbalances(alone))
        else:
            total += objective_value(alone, evaluate(alone))
    convex = _convex_part(problem)
    if convex is not None and set(convex.objective) <= set(problem.objective):
        parts.append(solve_convex_mounts(convex))
    return total + sum(part.certificate.lower_bound for part in parts if part.certificate is not None)


def _result(
    search: MountSearch,
    initial: Evaluation,
    best: SearchResult,
    proven: tuple[Design, float] | None,
    divided: BoxResult,
    timing: dict[str, float],
    among: bool,
) -> Result:
    problem, design, optimum = search.problem, best.design, best.optimum
    zero_level = numerical_zero(problem, design.evaluation.engine)
    bound = divided.bound
    # the bound does not hold for moved throws
    if search.moves is None and problem.search.proves and gap_of(design.value, bound, zero_level) > problem.tolerance:
        bound = max(bound, mounts_bound(problem, () if among else design.values))
    proof = ProofData(
        bound=bound,
        strength=ProofStrength.PARTIAL if divided.boxes else ProofStrength.RELAXED,
        kkt_residual=optimum.kkt_residual if optimum is not None else math.inf,
        method=_method(search.optima, max(design.value, zero_level), proven, divided),
        prices=best.joint.prices(optimum) if optimum is not None else {},
    )
    if search.moves is not None:
        # prices of limits depend on the open throws
        design = replace(design, problem=replace(design.problem, phasing=search.moves.phasing))
    return build_result(design, initial, proof, timing)


def _method(
    optima: Sequence[LocalOptimum], scale: float, proven: tuple[Design, float] | None, divided: BoxResult
) -> str:
    different = distinct(optima, scale)
    text = ends_in_words(optima, len(different))
    if len(different) > 1 and different[-1].value > WORTH_SAYING * different[0].value > 0.0:
        text += f", up to {different[-1].value / different[0].value:.3g} times the best"
    if proven is not None:
        text += f"; balance on these mounts proven within {proven[1]:.0e}"
    if divided.boxes:
        text += f"; bounds of mounts looked at in {divided.boxes} box{'es' if divided.boxes > 1 else ''}"
    return text


def _none(
    problem: Problem, search: MountSearch, initial: Evaluation, divided: BoxResult, timing: dict[str, float]
) -> Result:
    """Return a result without a design, with the limits that contradict each other if that is proven."""
    conflict = _proven_conflict(problem)
    if not conflict and divided.bound == math.inf:
        conflict = conflict_of(problem)
    result = infeasible_result(problem, initial, conflict, timing)
    if conflict:
        return result
    nearest = min(search.optima, key=lambda o: o.violation)
    names = _violated_limits(search.joint, nearest)
    message = (
        f"no design found: from {sum(o.starts for o in search.optima)} starts none meets {names or 'the limits'} "
        f"(nearest misses by {nearest.violation:.3g} of a limit); relax it, or open more"
    )
    design = search.best.design if search.best else None
    near = nearest_of(problem, design.evaluation, decided(design)) if design else None
    return replace(result, status=Status.FAILED, message=message, nearest=near)


def _violated_limits(joint: SmoothProgram, optimum: LocalOptimum) -> str:
    program = joint.program
    g = optimum.constraints
    if len(g) != len(program.constraint_names):
        return ""
    miss = np.maximum(program.constraint_lower - g, g - program.constraint_upper)
    names = [program.constraint_names[k] for k in np.flatnonzero(miss > 1e-6)]
    return " and ".join(f"'{name}'" for name in dict.fromkeys(names) if name != "modes")
