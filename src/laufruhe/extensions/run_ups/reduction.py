"""Reduction of run-ups: the problem without run-ups is solved first."""

from laufruhe.load_models.simulated import simulated_measures
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import open_kinds
from laufruhe.problem.problem import Problem
from laufruhe.solvers.methods import Decide, Reduction
from laufruhe.solvers.result import Result


def _applies(problem: Problem) -> bool:
    return bool(simulated_measures(problem)) and bool(open_kinds(problem)) and Kind.NUMBER not in open_kinds(problem)


def _solve(problem: Problem, decide: Decide, _: Decide) -> Result:
    from laufruhe.extensions.run_ups.solver import solve_runs

    return solve_runs(problem, open_kinds(problem), decide)


REDUCTION = Reduction("run-ups", _applies, _solve, before="constant objective")
