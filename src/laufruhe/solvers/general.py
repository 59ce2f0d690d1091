"""Optimise any open numbers by local programs of exact evaluations, without a lower bound.

An open number of the problem file has an address there, and each design is built anew from the file. Unbalances and
other numbers in which loads are affine come from cone programs, in turn with local programs of the others. Open
crank stars are solved one by one, up to a maximum number.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from laufruhe.errors import ModelError, SolverError, counted
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import timed_rounds
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
"""Kinds of numbers that cone programs optimise while all others are fixed."""
ROUNDS, GAIN = 4, 1e-6
"""Largest number of rounds of cone program and local program, and relative gain below which they stop."""
MAX_STARS = 60
"""Largest number of crank stars, firing orders and sets of shafts that are solved one by one."""


def solve_by_local_programs(
    problem: Problem, decide: Decide, by_cones: Callable[[Problem], bool], starts: Sequence[Sequence[Value]] = ()
) -> Result:  # fmt: skip
    """Return the best design of local searches from several starts, with zero as its lower bound.

    Parameters
    ----------
    decide
        Solver of a problem in which some decisions are fixed; by a cone program if `by_cones` is True.
    starts
        Further values of all decisions from which local programs start.
    """
    phasing = problem.phasing
    if phasing is not None and (phasing.continuous or phasing.throw_bounds is not None):
        return solve_moved_throws(problem, phasing, lambda moved: solve_by_local_programs(moved, decide, by_cones))
    if phasing is not None:
        return solve_star_by_star(problem, decide)
    started = time.perf_counter()
    initial, program = evaluate_start(problem), LocalProgram.of(problem)
    # raise ModelError before the search if the initial design cannot be evaluated
    objective_value(problem, initial)
    points = [*map(program.shares, (problem.start, *starts)), *spread_starts(problem)]
    modelled = time.perf_counter()
    best = best_local_optimum(program, points, problem.search.starts)
    cone_decisions = tuple(decision for decision in problem.decisions if decision.kind in INNER)
    if 0 < len(cone_decisions) < len(problem.decisions) and by_cones(problem.changed(decisions=cone_decisions)):
        best = _alternate_with_cones(program, best, decide)
    design = evaluate_design(problem, program.values(best))
    text = f"local programs from the best of {counted(len(points), 'start')}"
    claims = dict.fromkeys(measure.norm.claim for measure in problem.measures if measure.is_load)
    text = "; ".join(filter(None, [text, *claims]))
    proof = proof_data(program, design, 0.0, ProofStrength.RELAXED, text)
    # gas pressure and speeds may depend on open numbers
    solved = replace(problem, points=tuple(loads.point for loads in design.evaluation.loads))
    timing = {"model": modelled - started, "solve": time.perf_counter() - modelled}
    return build_result(replace(design, problem=solved), initial, proof, timing)


def _alternate_with_cones(program: LocalProgram, best: Array, decide: Decide) -> Array:
    """Return a better design: cone programs of the unbalances alternate with local searches over all decisions."""
    problem = program.problem
    other_decisions = tuple(decision for decision in problem.decisions if decision.kind not in INNER)
    for k in timed_rounds(ROUNDS):
        rank = program.rank(best)
        report_progress("cones and local programs in turn", k, ROUNDS, rank[1])
        values = dict(zip((d.name for d in problem.decisions), program.values(best), strict=True))
        try:
            fixed = problem.fixed_at([values[decision.name] for decision in other_decisions], other_decisions)
            cone_values = values_of(fixed, decide(replace(fixed, search=replace(fixed.search, proves=False))))
        except (ModelError, SolverError):
            break
        values |= dict(zip((d.name for d in fixed.decisions), cone_values, strict=True))
        point = program.shares([values[decision.name] for decision in problem.decisions])
        best = min(best, best_local_optimum(program, [point], 1), point, key=program.rank)
        if program.rank(best)[1] >= rank[1] * (1.0 - GAIN):
            break
    return best


def solve_star_by_star(problem: Problem, decide: Decide) -> Result:
    """Return the best result over all crank stars with even firing and all sets of shafts, up to `MAX_STARS`.

    Each is solved as a problem of its own.
    """
    phasing = problem.phasing
    assert phasing is not None
    stars = even_stars(phasing)
    if not stars:
        return no_star(problem, why_none_fires(phasing)[0])
    return solve_every_order(problem, phasing, stars, lambda part, _: decide(replace(part, phasing=None)), MAX_STARS)
