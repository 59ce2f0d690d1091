"""Reductions of problems with tolerances or measured parts to problems of a drawing."""

from __future__ import annotations

from laufruhe.extensions.robust.assembly import Assembly
from laufruhe.extensions.robust.tolerance import Robust
from laufruhe.problem.problem import Problem
from laufruhe.solvers.methods import Decide, Reduction
from laufruhe.solvers.result import Result

_BEFORE = "constant limits"


def _solve_assembly(problem: Problem, decide: Decide, rest: Decide) -> Result:
    from laufruhe.extensions.robust.assembly_solver import solve_assembly

    return solve_assembly(problem, decide, rest)


def _refuse_assembly(problem: Problem) -> None:
    from laufruhe.extensions.robust.assembly_solver import refuse

    refuse(problem)


def _solve_built(problem: Problem, decide: Decide, rest: Decide) -> Result:
    from laufruhe.extensions.robust.solver import solve_built

    return solve_built(problem, decide, rest)


def _refuse_built(problem: Problem) -> None:
    from laufruhe.extensions.robust.solver import refuse

    refuse(problem)


ASSEMBLY = Reduction(
    "assembly", lambda problem: problem.extra(Assembly) is not None, _solve_assembly, _refuse_assembly, _BEFORE
)
TOLERANCES = Reduction(
    "tolerances", lambda problem: problem.extra(Robust) is not None, _solve_built, _refuse_built, _BEFORE
)
