"""Deciding mounts: convex where all that is asked is, else nonlinear."""

from __future__ import annotations

from dataclasses import replace

from laufruhe.problem.problem import Problem
from laufruhe.solvers.result import Result


def solve_mounts(problem: Problem, workers: int | None = None) -> Result:
    """Decide what a problem on elastic mounts leaves open.

    Parameters
    ----------
    problem
        On elastic mounts.
    workers
        Processes that starts are shared among; as many as processors when left out.

    Raises
    ------
    SolverError
        If a solver stops without an answer.
    """
    from laufruhe.solvers.mount_convex import is_convex, solve_convex_mounts

    if is_convex(problem):
        return _remarked(solve_convex_mounts(problem))
    from laufruhe.solvers.mount_nonlinear import solve_joint

    return _remarked(solve_joint(problem, workers))


def _remarked(result: Result) -> Result:
    """The result, with a word on a design as given that has no finite loads."""
    why = result.initial.resonance
    if not why or result.message:
        return result
    return replace(result, message=f"the design as given has no finite loads: {why}")
