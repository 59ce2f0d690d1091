"""The optimum of one problem at one fidelity, for its regret (F14)."""

from __future__ import annotations

from dataclasses import replace

from laufruhe.errors import ModelError, SolverError
from laufruhe.load_models.affine import AffineModel
from laufruhe.machine import Engine
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from laufruhe.solvers.result import Status

FOUND = (Status.OPTIMAL, Status.FEASIBLE)
STARS_ON_OPEN_MOUNTS = 2
"""Each of them takes a joint solve, at every fidelity."""


def is_open(problem: Problem) -> bool:
    """Whether a problem leaves anything to be decided."""
    return bool(problem.decisions or problem.phasing)


def is_local(problem: Problem) -> bool:
    """Whether its optimum is one of many: mounts decided for loads, searched from the design as given alone."""
    return bool(problem.mount_decisions and problem.load_terms)


def optimum(problem: Problem, samples: int | None = None) -> Engine | None:
    """The best engine at a fidelity; None where it decides nothing, or finds no design within the limits.

    Unbalances alone are decided at `samples` steps over the period of the loads, without
    refinement. Open stars and mounts are solved as `solve` does, of the latter one start, of
    both together the stars that rank first.
    """
    try:
        if problem.phasing is None and not problem.mount_decisions:
            return _balanced(problem, samples)
        one = replace(problem, search=replace(problem.search, starts=1))
        if one.phasing is not None and one.mount_decisions:
            one = replace(one, phasing=replace(one.phasing, best=STARS_ON_OPEN_MOUNTS))
        result = solve(one)
    except (SolverError, ModelError):
        # cheap physics may leave nothing that solves: it is no choice for deciding then
        return None
    return result.final.engine if result.status in FOUND else None


def _balanced(problem: Problem, samples: int | None) -> Engine | None:
    from laufruhe.solvers.conic import ConicProgram

    model = AffineModel(problem)
    solution = ConicProgram(model.at(samples or model.full_samples)).solve()
    if solution.x is None:
        return None
    return problem.design([domain.complex_value(solution.x) for domain in model.domains])
