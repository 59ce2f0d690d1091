"""Optimise any open numbers by local programs of exact evaluations, without a lower bound.

An open number of the problem file has an address there, and each design is built anew from the file. Open crank stars
are solved one by one, up to a maximum number.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from laufruhe.errors import counted
from laufruhe.problem.evaluation import objective_value
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.conclusion import build_result, evaluate_design
from laufruhe.solvers.result import Result
from laufruhe.solvers.smooth.local_programs import LocalProgram, best_local_optimum, proof_data, spread_starts
from laufruhe.solvers.stars.phasing_solver import even_stars, solve_every_order
from laufruhe.solvers.stars.star_results import no_star
from laufruhe.solvers.throws.moved_throws import solve_moved_throws
from laufruhe.solvers.throws.throw_starts import why_none_fires

Decide = Callable[[Problem], Result]
MAX_STARS = 60
"""Largest number of crank stars, firing orders and sets of shafts that are solved one by one."""


def solve_by_local_programs(problem: Problem, decide: Decide, starts: Sequence[Sequence[Value]] = ()) -> Result:
    """Return the best design of local searches from several starts, with zero as its lower bound.

    Parameters
    ----------
    decide
        Solver of a problem with a fixed crank star.
    starts
        Further values of all decisions from which local programs start.
    """
    phasing = problem.phasing
    if phasing is not None and (phasing.continuous or phasing.throw_bounds is not None):
        return solve_moved_throws(problem, phasing, lambda moved: solve_by_local_programs(moved, decide))
    if phasing is not None:
        return solve_star_by_star(problem, decide)
    started = time.perf_counter()
    initial, program = evaluate_start(problem), LocalProgram.of(problem)
    # raise ModelError before the search if the initial design cannot be evaluated
    objective_value(problem, initial)
    points = [*map(program.shares, (problem.start, *starts)), *spread_starts(problem)]
    modelled = time.perf_counter()
    best = best_local_optimum(program, points, problem.search.starts)
    design = evaluate_design(problem, program.values(best))
    text = f"local programs from the best of {counted(len(points), 'start')}"
    claims = dict.fromkeys(measure.norm.claim for measure in problem.measures if measure.is_load)
    text = "; ".join(filter(None, [text, *claims]))
    proof = proof_data(program, design, 0.0, ProofStrength.RELAXED, text)
    # gas pressure and speeds may depend on open numbers
    solved = replace(problem, points=tuple(loads.point for loads in design.evaluation.loads))
    timing = {"model": modelled - started, "solve": time.perf_counter() - modelled}
    return build_result(replace(design, problem=solved), initial, proof, timing)


def solve_star_by_star(problem: Problem, decide: Decide) -> Result:
    """Return the best result over all crank stars with even firing and all sets of shafts, up to `MAX_STARS`.

    Each is solved as a problem of its own.
    """
    phasing = problem.phasing
    assert phasing is not None
    stars = even_stars(phasing)
    if not stars:
        return no_star(problem, why_none_fires(phasing)[0])
    return solve_every_order(problem, phasing, stars, decide, MAX_STARS)
