"""Deciding mounts: convex where all that is asked is, else nonlinear."""

from __future__ import annotations

from laufruhe.problem.model import Problem
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
        return solve_convex_mounts(problem)
    from laufruhe.solvers.mount_nonlinear import solve_joint

    return solve_joint(problem, workers)
