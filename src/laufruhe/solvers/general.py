"""Local programs of whatever numbers are open, by exact evaluations alone: nothing is bounded.

A number of the file is open by its address: every design that has it is put together anew. Where cones know some of
what is open, they decide it for the numbers found, and programs go on from there. Where stars are open too, each of a
limited number of them is decided so.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from laufruhe.errors import ModelError, SolverError, counted
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import rounds
from laufruhe.numerics.progress import report_progress
from laufruhe.problem.decision import Kind
from laufruhe.problem.evaluation import objective_value
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.conclusion import build_result, evaluate_design, values_of
from laufruhe.solvers.result import Result
from laufruhe.solvers.smooth.local_programs import LocalProgram, best_local_optimum, proof_data, spread_starts
from laufruhe.solvers.stars.phasing_solver import even_stars, solve_every_order
from laufruhe.solvers.stars.star_results import no_star
from laufruhe.solvers.throws.moved_throws import solve_moved_throws
from laufruhe.solvers.throws.throw_starts import why_none_fires

Decide = Callable[[Problem], Result]
INNER = frozenset({Kind.UNBALANCE, Kind.SHARE, Kind.PISTON})
"""Kinds that cones decide for given values of all else, where what is asked lets them."""
ROUNDS, GAIN = 4, 1e-6
"""Times that cones and programs take turns, and the share that a turn has to gain for another."""
MOST_STARS = 60
"""Stars, firing orders and sets of shafts that are decided one by one."""


def solve_generally(
    problem: Problem, decide: Decide, by_cones: Callable[[Problem], bool], near: Sequence[Sequence[Value]] = ()
) -> Result:  # fmt: skip
    """Return the best design of local programs from several starts; no bound but zero is told of others.

    Parameters
    ----------
    decide
        What decides the rest of what is open while some of it is held.
    by_cones
        Return whether cones decide a problem.
    near
        Designs to begin with.
    """
    phasing = problem.phasing
    if phasing is not None and (phasing.continuous or phasing.throw_bounds is not None):
        return solve_moved_throws(problem, phasing, lambda moved: solve_generally(moved, decide, by_cones))
    if phasing is not None:
        return solve_star_by_star(problem, decide)
    started = time.perf_counter()
    initial, program = evaluate_start(problem), LocalProgram.of(problem)
    # what cannot be evaluated is refused first
    objective_value(problem, initial)
    places = [*map(program.shares, (problem.start, *near)), *spread_starts(problem)]
    modelled = time.perf_counter()
    best = best_local_optimum(program, places, problem.search.starts)
    inner = tuple(decision for decision in problem.decisions if decision.kind in INNER)
    if 0 < len(inner) < len(problem.decisions) and by_cones(problem.changed(decisions=inner)):
        best = _in_turns(program, best, decide)
    design = evaluate_design(problem, program.values(best))
    text = f"local programs from the best of {counted(len(places), 'start')}"
    found = proof_data(program, design, 0.0, ProofStrength.RELAXED, text)
    # gas and speeds may follow from open numbers
    own = replace(problem, points=tuple(loads.point for loads in design.evaluation.loads))
    timing = {"model": modelled - started, "solve": time.perf_counter() - modelled}
    return build_result(replace(design, problem=own), initial, found, timing)


def _in_turns(program: LocalProgram, best: Array, decide: Decide) -> Array:
    """Cones for the numbers found, then local programs from there, as long as that gains."""
    problem = program.problem
    outer = tuple(decision for decision in problem.decisions if decision.kind not in INNER)
    for k in rounds(ROUNDS):
        before = program.rank(best)
        report_progress("cones and local programs in turn", k, ROUNDS, before[1])
        values = dict(zip((d.name for d in problem.decisions), program.values(best), strict=True))
        try:
            held = problem.fixed_at([values[decision.name] for decision in outer], outer)
            own = values_of(held, decide(replace(held, search=replace(held.search, proves=False))))
        except (ModelError, SolverError):
            break
        values |= dict(zip((d.name for d in held.decisions), own, strict=True))
        by_cones = program.shares([values[decision.name] for decision in problem.decisions])
        best = min(best, best_local_optimum(program, [by_cones], 1), by_cones, key=program.rank)
        if program.rank(best)[1] >= before[1] * (1.0 - GAIN):
            break
    return best


def solve_star_by_star(problem: Problem, decide: Decide) -> Result:
    """Decide each star that fires evenly, with each set of shafts, as a problem of its own; of many, some drawn."""
    phasing = problem.phasing
    assert phasing is not None
    stars = even_stars(phasing)
    if not stars:
        return no_star(problem, why_none_fires(phasing)[0])
    return solve_every_order(problem, phasing, stars, lambda own, _: decide(replace(own, phasing=None)), MOST_STARS)
