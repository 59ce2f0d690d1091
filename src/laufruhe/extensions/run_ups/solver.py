"""Optimum with run-ups and shut-downs in objective or limits.

The problem without run-ups is solved first: if its optimum satisfies the limits of run-ups, it is optimal, and its
lower bound holds in any case. For fixed mounts without bump stops loads add up, and a cone program has the active steps
of a run (E28a). With open mounts or bump stops, a smooth program has the peaks of the exact model (E28b).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from laufruhe.errors import ModelError
from laufruhe.extensions.run_ups.cones import Decide, RunRows, solve_run_cones
from laufruhe.load_models.simulated import simulated_measures
from laufruhe.machine.mount import every_spring
from laufruhe.problem.decision import Kind
from laufruhe.problem.measure import Limit, Term
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import quote_names, violated_limits, with_constant_limits
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.phasing_solver import even_stars, solve_every_order

_LINEAR = frozenset({Kind.UNBALANCE, Kind.SHARE})
_SMOOTH = frozenset({Kind.UNBALANCE, Kind.STIFFNESS, Kind.MOUNT})


def solve_runs(problem: Problem, kinds: frozenset[Kind], decide: Decide) -> Result:
    """Return the optimal design of a problem with run-ups in its objective or limits.

    All open numbers are of `kinds`, such as unbalances or stiffness; `decide` solves a problem without run-ups.

    Raises
    ------
    ModelError
        If no method minimises a run-up over these kinds.
    """
    simulated = simulated_measures(problem)
    limits = tuple(limit for limit in problem.limits if limit.measure in simulated)
    terms = tuple(term for term in problem.objective if term.measure in simulated)
    without_runs = problem.changed(
        objective=tuple(term for term in problem.objective if term not in terms),
        limits=tuple(limit for limit in problem.limits if limit not in limits),
    )
    relaxed = None
    if without_runs.objective:
        relaxed = decide(without_runs)
        violated = violated_limits(limits, relaxed.final)
        if not relaxed.status.has_design or not (violated or terms):
            # the relaxed optimum satisfies the limits of run-ups
            return with_constant_limits(relaxed, problem.limits)
        if relaxed.problem.fidelity != problem.fidelity:
            # its bound holds for the fidelity that its accuracy needed
            problem = problem.at(relaxed.problem.fidelity)
    result = _run_result(problem, kinds, limits, terms, relaxed, decide)
    if result is not None:
        return result
    other_kinds = " and ".join(kind.name.lower() for kind in sorted(kinds - _SMOOTH)) or "this"
    if terms or relaxed is None:
        name = terms[0].measure.name
        raise ModelError(
            f"{name} is minimised over unbalances and mounts, not over {other_kinds}; fix them, or limit it instead"
        )
    names = quote_names(violated_limits(limits, relaxed.final))
    message = (
        f"the best design found breaks {names}: with {other_kinds} open, a run-up is only checked, not optimised; "
        f"relax it, fix {other_kinds}, or limit travel"
    )
    return replace(
        with_constant_limits(relaxed, problem.limits), status=Status.FAILED, certificate=None, message=message
    )


def _run_result(
    problem: Problem, kinds: frozenset[Kind], limits: Sequence[Limit], terms: Sequence[Term], relaxed: Result | None,
    decide: Decide,
) -> Result | None:  # fmt: skip
    """Return the optimum with run-ups by the method that suits the kinds of open numbers; None without a method."""
    phasing = problem.phasing
    if phasing is not None:
        has_stops = any(spring.stop_gap < math.inf for _, spring in every_spring(problem.engine.mounts))
        if phasing.continuous or has_stops or not kinds <= _LINEAR | {Kind.STAR}:
            return None
        return solve_every_order(problem, phasing, even_stars(phasing), decide)
    rows = RunRows.from_problem(problem, simulated_measures(problem)) if kinds <= _LINEAR else None
    if rows is not None:
        return solve_run_cones(problem, limits, terms, rows, decide)
    if not kinds <= _SMOOTH:
        return None
    from laufruhe.extensions.run_ups.mounts import solve_run_mounts

    return solve_run_mounts(problem, relaxed)
