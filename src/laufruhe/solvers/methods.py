"""Choose the method for a problem from a table, and solve the problem by it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, partial

from laufruhe.errors import ModelError, SolverError, optional_libraries, wrong_call
from laufruhe.extension import HOMES, extended, in_order, missing_extension
from laufruhe.numerics.budget import is_time_over, limit_time
from laufruhe.numerics.progress import Listener, progress_listener, report_progress
from laufruhe.numerics.witness import collected
from laufruhe.problem.channels import FREQUENCIES
from laufruhe.problem.decision import KINDS, Kind
from laufruhe.problem.dependence import Dependence, depends, open_kinds
from laufruhe.problem.evaluation import Evaluation, objective_value, with_fine_sampling
from laufruhe.problem.measure import Limit, PriorityLevel
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import Proof, ProofStrength
from laufruhe.prove.mounts.named import named_part
from laufruhe.solvers.conclusion import (
    FEASIBILITY_TOL,
    ProofData,
    build_result,
    evaluate_design,
    evaluate_only,
    infeasible_result,
    violated_limits,
    with_constant_limits,
    without_proof,
)
from laufruhe.solvers.cones.unbalances import conflict_on_any_mounts
from laufruhe.solvers.decomposition import is_separable, refuse_unused, solve_decomposed
from laufruhe.solvers.method import BUILT, OF_MOUNTS, Method, imported, is_pointwise
from laufruhe.solvers.mounts.convex import CONVEX, is_convex, solve_convex_mounts
from laufruhe.solvers.relaxation import solve_by_relaxation
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.sampling_refinement import refine_sampling, sampling_overestimate, violation_at_fine_sampling
from laufruhe.solvers.stars.even_search import refuse_long
from laufruhe.solvers.walk import check_by_walk


def with_shafts(problem: Problem, initial: Evaluation, sets: Sequence[int]) -> Evaluation:
    """Return an evaluation with only these optional shafts, as indices of their sets; its loads stay."""
    if problem.phasing is None:
        return initial
    left_out = problem.phasing.without(sets)
    rotors = tuple(rotor for rotor in initial.engine.rotors if rotor.shaft.name not in left_out)
    return replace(initial, engine=replace(initial.engine, rotors=rotors))


TIME_LIMIT_NOTE = "stopped at the time limit"
Decide = Callable[[Problem], Result]
_HERE = "laufruhe.solvers"
_SOLVE_CONES = imported(f"{_HERE}.cones.unbalances:solve_unbalances")
_SOLVE_STARS = imported(f"{_HERE}.stars.phasing_solver:solve_phasing")
_SOLVE_JOINT = imported(f"{_HERE}.mounts.nonlinear:solve_joint")


def solve_separable(problem: Problem) -> Result:
    """Solve groups of decisions that do not affect each other, each by its own method."""
    return solve_decomposed(problem, _solve_reduced)


def solve_all_numbers(problem: Problem, starts: Sequence[Sequence[Value]] = ()) -> Result:
    """Return the best local optimum of all open numbers."""
    from laufruhe.solvers.general import solve_by_local_programs

    return solve_by_local_programs(problem, _solve_reduced, starts)


def _distinguishes_stars(problem: Problem) -> bool:
    # a measure that is a single number ranks stars only if throws stand on even steps
    moves = problem.phasing is not None and problem.phasing.continuous
    numbers = (m.channel.is_number and not m.is_mounting for m in problem.measures)
    return problem.engine.block is not None and not (moves and any(numbers))


_AFFINE = (Dependence.AFFINE,)
_ANY = tuple(Dependence)
_UNBALANCES = {Kind.UNBALANCE: _AFFINE}
_MOUNTS = {**_UNBALANCES, Kind.STIFFNESS: (), Kind.MOUNT: ()}


_CORE: tuple[Method, ...] = (
    Method(
        "evaluation", {}, ProofStrength.EXACT, evaluate_only,
        accepts_norm=lambda _: True,
        proves="the value itself",
    ),
    Method(
        "second-order cones", {**_UNBALANCES, Kind.SHARE: _AFFINE}, ProofStrength.EXACT, _SOLVE_CONES,
        refines_fidelity=True,
        proves="the optimum",
    ),
    Method(
        "second-order cones of pistons", {**_UNBALANCES, Kind.PISTON: _AFFINE}, ProofStrength.EXACT, _SOLVE_CONES,
        refines_fidelity=True,
        proves="the optimum",
    ),
    Method(
        "stars, each with cones", {Kind.STAR: BUILT, **_UNBALANCES}, ProofStrength.EXACT, _SOLVE_STARS,
        refines_fidelity=True,
        accepts_norm=is_pointwise,
        proves="the optimum; where throws leave the even steps as far as boxes of throws, bank angle and split "
        "pins go (S29, S30)",
    ),
    Method(
        "linear matrix inequalities", {Kind.STIFFNESS: ()}, ProofStrength.EXACT, solve_convex_mounts,
        known_channels=frozenset({*CONVEX, FREQUENCIES}),
        accepts_problem=is_convex,
        proves="the optimum",
    ),
    Method(
        "smooth program, boxes of stiffness", {Kind.STIFFNESS: ()}, ProofStrength.PARTIAL, _SOLVE_JOINT,
        known_channels=OF_MOUNTS,
        accepts_norm=is_pointwise,
        proves="mostly the optimum of up to four numbers, often of six; else a bound",
    ),
    Method(
        "smooth program", _MOUNTS, ProofStrength.RELAXED, _SOLVE_JOINT,
        known_channels=OF_MOUNTS,
        accepts_norm=is_pointwise,
        proves="mostly the optimum of up to five numbers of the mounts (E69); else a local one, with a bound",
    ),
    Method(
        "independent numbers separately",
        dict.fromkeys(sorted(set(KINDS.values()) - {Kind.STAR}), _ANY), ProofStrength.RELAXED, solve_separable,
        accepts_norm=lambda _: True,
        accepts_problem=is_separable,
        proves="what each of them proves",
    ),
    Method(
        "stars, each with a smooth program", {Kind.STAR: BUILT, **_MOUNTS}, ProofStrength.RELAXED,
        imported(f"{_HERE}.mounts.stars:solve_star_mounts"),
        known_channels=OF_MOUNTS,
        accepts_norm=is_pointwise,
        accepts_problem=_distinguishes_stars,
        proves="a local optimum, with a bound",
    ),
    Method(
        "local programs of all numbers", dict.fromkeys(KINDS.values(), _ANY), ProofStrength.RELAXED, solve_all_numbers,
        accepts_norm=lambda _: True,
        proves="a local optimum by exact evaluations; a row above that accepts all open numbers and a part of the "
        "objective gives its bound (P18), else it has none; at most 60 stars, each by its own method",
    ),
)  # fmt: skip

METHODS: tuple[Method, ...] = in_order("methods", Method, _CORE)
"""Methods in order of preference; the first one that suits a problem solves it."""


def solve(
    problem: Problem, listener: Listener | None = None, time_limit: float | None = None, diagnose: bool = False
) -> Result:
    """Return the best values of the open numbers of a problem, with a proven lower bound where one is known.

    Parameters
    ----------
    problem
        Engine with open numbers, objective and limits.
    listener
        Receives reports on the progress of searches.
    time_limit
        Time [s] after which searches end with their best design and its lower bound; None for no limit.
    diagnose
        True to complete the result by all diagnoses, such as the attainable values of limits in conflict.

    Raises
    ------
    SolverError
        If a solver stops without a result.
    ModelError
        If the initial design cannot be evaluated, or no method solves the problem.
    """
    with limit_time(time_limit), progress_listener(listener), collected() as reports:
        started, spent = time.perf_counter(), time.thread_time()
        result: Result | None
        try:
            refuse(problem)
            with optional_libraries():
                result = _solve_reduced(problem)
        except SolverError:
            if not is_time_over():
                raise
            result = None
        result = result if result is not None and not is_time_over() else _at_time_limit(problem, result)
        # a method may have changed the problem, but its file is the same
        result = replace(result, problem=replace(result.problem, origin=problem.origin))
        if reports:
            return without_proof(result, reports[0])
        result = check_by_walk(problem, result, time.thread_time() - spent)
        for diagnosis in DIAGNOSES.values() if diagnose else ():
            result = diagnosis.complete(result, problem, time.perf_counter() - started, _solve_reduced)
        return without_proof(result, reports[0]) if reports else result


def _at_time_limit(problem: Problem, result: Result | None) -> Result:
    """Return the result at the time limit: the best design so far, or the initial design if it is feasible."""
    if result is None or result.status is Status.FAILED:
        with suppress(ModelError):
            initial = evaluate_design(problem, problem.start)
            if (
                problem.phasing is None
                # extensions decide by other designs, or measure them otherwise
                and not problem.extras
                and max(initial.violation, violation_at_fine_sampling(problem, initial.evaluation)) <= FEASIBILITY_TOL
            ):
                proof = ProofData(0.0, ProofStrength.RELAXED, math.inf, f"the initial design; {TIME_LIMIT_NOTE}")
                return build_result(initial, initial.evaluation, proof, {})
    if result is None:
        raise SolverError("no design was found within the time limit; raise the time limit")
    if result.status is Status.FAILED:
        return replace(result, message=f"{result.message}; {TIME_LIMIT_NOTE}")
    certificate = result.certificate
    if certificate is None or certificate.kind is Proof.GLOBAL:
        return result
    return replace(result, certificate=replace(certificate, method=f"{certificate.method}; {TIME_LIMIT_NOTE}"))


def method_of(problem: Problem) -> Method:
    """Return the first method that suits a problem; the last suits every one."""
    return next(method for method in METHODS if method.suits(problem))


def refuse(problem: Problem, ranks: Sequence[PriorityLevel] = ()) -> None:
    """Raise an error for a problem that no method solves; `solve` and `check` call it first.

    The problem is complete, or has one objective of `ranks`.

    Raises
    ------
    ModelError
        If the objective depends on no open number, or a combination of open numbers has no method.
    """
    for reduction in reductions():
        if reduction.refuse is not None and reduction.applies(problem):
            return reduction.refuse(problem)
    if problem.ranks:
        name = "objectives in order"
        raise ModelError(f"[[objective]] {'; '.join(missing_extension(HOMES['reductions'][name]))}")
    kinds = open_kinds(problem)
    if problem.mount_decisions and (problem.fidelity.mounts, problem.fidelity.modes) != ("frequency", None):
        raise ModelError(
            "fidelity.mounts and fidelity.modes depend on mounts, which are open; remove both keys from [fidelity]"
        )
    for kind in sorted(kind for kind in kinds if kind.is_alone):
        if not any(depends(measure.channel, {kind}, problem) for measure in problem.measures):
            names = " and ".join(decision.name for decision in problem.decisions if decision.kind is kind)
            raise ModelError(
                f"{names} is open, but no objective or limit depends on it; fix it, or add a measure that depends on it"
            )
    if kinds and not problem.objective:
        words = " and ".join(kind.name.lower() for kind in sorted(kinds))
        raise ModelError(f"{words} is open, but there is no objective; add [objective] or [mounts]")
    if problem.phasing is not None and method_of(problem).solver is _SOLVE_STARS:
        refuse_long(problem)
    if method_of(problem).solver is solve_separable and not _has_constant_objective(problem):
        refuse_unused(problem, ranks)


def _solve_reduced(problem: Problem, remaining: Sequence[Reduction] | None = None) -> Result:
    """Return the result of the first reduction that applies to a problem, else of the first method that suits it.

    A stronger method for part of the measures may raise the lower bound of the method.
    """
    remaining = reductions() if remaining is None else remaining
    for k, reduction in enumerate(remaining):
        if reduction.applies(problem):
            return reduction.solve(problem, _solve_reduced, partial(_solve_reduced, remaining=remaining[k + 1 :]))
    method, kinds = method_of(problem), open_kinds(problem)
    report_progress(method.name)
    if Kind.MOUNT in method.kinds and kinds <= {*_MOUNTS} and (conflict := conflict_on_any_mounts(problem)):
        return infeasible_result(problem, evaluate_start(problem), conflict, {})
    relaxed = _relaxation(problem, kinds, method)
    if relaxed is None:
        result = method.solve(problem)
    else:
        result = solve_by_relaxation(problem, relaxed, partial(_solve_reduced, remaining=()), method.solve)
    return _with_mount_bounds(problem, relaxed, result) if method.solver is solve_all_numbers else result


def _with_mount_bounds(problem: Problem, relaxed: Problem | None, result: Result) -> Result:
    # provers of mounts bound more measures than the methods of mounts accept
    named = named_part(problem)
    is_bounded = relaxed is not None and (relaxed.objective, relaxed.limits) == (named.objective, named.limits)
    is_of_mounts = problem.mount_decisions and open_kinds(problem) <= {*_MOUNTS}
    if is_bounded or not is_of_mounts or not problem.search.proves or result.status is not Status.FEASIBLE:
        return result
    from laufruhe.solvers.mounts.nonlinear import with_mount_bounds

    assert result.objective is not None
    return with_mount_bounds(result, result.objective.value - sampling_overestimate(problem, result.final))


def by_solver(problem: Problem, name: str) -> Problem:
    """Return the problem with a solver of cvxpy that proposes its unbalances; the proof stays that of this package.

    Raises
    ------
    InputError
        If cvxpy does not find the solver, or other numbers than unbalances are open.
    """
    from laufruhe.solvers.cones.cvxpy_program import check_solver

    name, method = check_solver(name), method_of(problem)
    if problem.extras or method.solver is not _SOLVE_CONES:
        what = " and ".join(extra.words for extra in problem.extras) or f"'{method.name}'"
        rule = f"decides unbalances alone, and this problem is decided by {what}"
        raise wrong_call("solver", name, rule, "leave the solver out")
    return problem.changed(origin=problem.origin, search=replace(problem.search, solver=name))


def _constant_limits(problem: Problem) -> list[Limit]:
    kinds = open_kinds(problem)
    return [limit for limit in problem.limits if not depends(limit.measure.channel, kinds, problem)]


def _without_constant_limits(problem: Problem, decide: Decide, _: Decide) -> Result:
    constant = _constant_limits(problem)
    initial = evaluate_start(problem)
    # raise ModelError first if the initial design cannot be evaluated
    objective_value(problem, initial)
    # every design violates the limits that the engine without optional shafts violates
    violated = violated_limits(constant, with_fine_sampling(with_shafts(problem, initial, ())))
    if violated:
        return infeasible_result(problem, initial, violated, {})
    open_limits = tuple(limit for limit in problem.limits if limit not in constant)
    return with_constant_limits(decide(problem.changed(limits=open_limits)), problem.limits)


def _has_constant_objective(problem: Problem) -> bool:
    kinds = open_kinds(problem)
    if not kinds or not problem.objective or problem.phasing is not None:
        return False
    return not any(depends(term.measure.channel, kinds, problem) for term in problem.objective)


def _solve_without_decisions(problem: Problem, _: Decide, rest: Decide) -> Result:
    design = evaluate_design(problem, problem.start)
    if design.violation > FEASIBILITY_TOL:
        return rest(problem)
    proof = ProofData(design.value, ProofStrength.EXACT, 0.0, "no open number changes the objective")
    return build_result(design, design.evaluation, proof, {})


@dataclass(frozen=True)
class Reduction:
    """Solution of one kind of problem by simpler problems.

    Attributes
    ----------
    name
        Name for messages.
    applies
        Return True if the reduction solves a problem.
    solve
        Solve a problem. The second argument solves a simpler problem by all reductions, the third by the later ones.
    refuse
        Raise `ModelError` for a problem that it cannot solve; None if the check of methods is sufficient.
    before
        Name of the reduction that follows one of an extension; empty for the last place.
    """

    name: str
    applies: Callable[[Problem], bool]
    solve: Callable[[Problem, Decide, Decide], Result]
    refuse: Callable[[Problem], None] | None = None
    before: str = ""


REDUCTIONS: tuple[Reduction, ...] = (
    Reduction("refined sampling", lambda _: True, lambda p, _, rest: refine_sampling(p, rest)),
    Reduction("constant limits", lambda p: bool(_constant_limits(p)), _without_constant_limits),
    Reduction("constant objective", _has_constant_objective, _solve_without_decisions),
)  # fmt: skip
"""Reductions of the core, in the order in which they are tried."""


@dataclass(frozen=True)
class Diagnosis:
    """Completion of a result at the end of a solve with `diagnose`.

    Attributes
    ----------
    name
        Name for messages.
    complete
        Function of a result, its problem, the duration of the solve [s] and a solver of further problems that returns
        the completed result.
    """

    name: str
    complete: Callable[[Result, Problem, float, Decide], Result]


DIAGNOSES: Mapping[str, Diagnosis] = extended("diagnoses", Diagnosis, ())
"""Diagnoses of extensions by their names."""


@cache
def reductions() -> tuple[Reduction, ...]:
    """Return the reductions of core and extensions, in the order in which they are tried."""
    table: tuple[Reduction, ...] = in_order("reductions", Reduction, REDUCTIONS)
    return table


def _relaxation(problem: Problem, kinds: frozenset[Kind], method: Method) -> Problem | None:
    """Return the problem with the measures that a method before `method` in the table accepts.

    The method that accepts most terms, then most limits, decides which. The result is None if none accepts a term.
    """
    if method.strength is ProofStrength.EXACT or not problem.search.proves:
        return None
    parts = []
    for other in METHODS[: METHODS.index(method)]:
        if not kinds <= other.kinds:
            continue
        unlimited = problem.changed(limits=())
        terms = tuple(term for term in problem.objective if other.suits(unlimited.changed(objective=(term,))))
        # missing terms must be non-negative for the bound to hold
        missing = [term.measure for term in problem.objective if term not in terms]
        if terms and all(measure.is_load or measure.is_mounting for measure in missing):
            relaxed = unlimited.changed(objective=terms)
            limits = tuple(limit for limit in problem.limits if other.suits(relaxed.changed(limits=(limit,))))
            parts.append(relaxed.changed(limits=limits))
    parts = [part for part in parts if _is_solvable(part)]
    return max(parts, key=lambda part: (len(part.objective), len(part.limits)), default=None)


def _is_solvable(problem: Problem) -> bool:
    try:
        refuse(problem)
    except ModelError:
        return False
    return True
