"""One solver per file; what they return is evaluated again by the exact model."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from laufruhe.errors import ModelError
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.solvers.accuracy import error_of, solve_within
from laufruhe.solvers.direct_cones import solve_direct
from laufruhe.solvers.mount_result import objective_of
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.unbalances import solve_unbalances

__all__ = ["Result", "Status", "solve", "state"]


def solve(problem: Problem, say: Callable[[str], None] = lambda _: None, *, many: bool = False) -> Result:
    """Decide what a problem leaves open.

    Parameters
    ----------
    problem
        What is open, wanted and forbidden.
    say
        Told what is being decided, where that takes long.
    many
        Whether this is one of many small problems: cone programs are then handed to the solver as
        arrays, and not stated in cvxpy first. The design is the same.

    Raises
    ------
    SolverError
        If a solver stops without an answer.
    ModelError
        If the engine as given cannot be evaluated.
    """
    if problem.mount_decisions and (problem.fidelity.mounts, problem.fidelity.modes) != ("frequency", None):
        raise ModelError("fidelity.mounts or fidelity.modes would change with the mounts that are open; leave it out")
    if problem.phasing is not None and problem.asks_mounts:
        from laufruhe.solvers.mount_stars import solve_star_mounts

        return solve_star_mounts(problem, say)
    if problem.phasing is None and not problem.decisions:
        return state(problem)
    if problem.asks_mounts:
        from laufruhe.solvers.mounts import solve_mounts

        return solve_mounts(problem)
    if problem.phasing is not None:
        from laufruhe.solvers.phasing import solve_phasing

        return solve_within(problem, solve_phasing)
    if problem.decisions and not problem.objective:
        raise ModelError(f"{len(problem.decisions)} number(s) are open and nothing is minimised; add an objective")
    return solve_within(problem, partial(solve_unbalances, cones=solve_direct if many else None))


def state(problem: Problem, to_start_from: bool = False) -> Result:
    """The design as given, evaluated and not changed.

    Parameters
    ----------
    to_start_from
        Whether it is only where a search starts, so that it may stand on a resonance.
    """
    started = time.perf_counter()
    evaluation = evaluate_start(problem) if to_start_from else evaluate(problem)
    return Result(
        problem=problem,
        status=Status.FEASIBLE,
        objective=objective_of(problem, evaluation, evaluation),
        certificate=None,
        decisions=(),
        limits=(),
        initial=evaluation,
        final=evaluation,
        error_estimate=0.0 if evaluation.resonance else error_of(problem, evaluation),
        timing={"evaluate": time.perf_counter() - started},
    )
