"""Local programs of whatever numbers are open, by exact evaluations alone: nothing is bounded."""

from __future__ import annotations

import time

from laufruhe.errors import counted
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Reach
from laufruhe.solvers.conclusion import concluded, judged
from laufruhe.solvers.result import Result
from laufruhe.solvers.smooth.local_programs import LocalProgram, looks, searched, shown


def solve_generally(problem: Problem) -> Result:
    """Return the best design of local programs from several starts; no bound but zero is told of others."""
    started = time.perf_counter()
    initial, program = evaluate_start(problem), LocalProgram.of(problem)
    places = [program.shares(problem.start), *looks(problem)]
    modelled = time.perf_counter()
    best = searched(program, places, problem.search.starts)
    design = judged(problem, program.values(best))
    text = f"local programs from the best of {counted(len(places), 'start')}; nothing is proven of other designs"
    found = shown(program, design, 0.0, Reach.ASIDE, text)
    return concluded(design, initial, found, {"model": modelled - started, "solve": time.perf_counter() - modelled})
