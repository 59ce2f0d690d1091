"""Optimise a problem from the result of a similar one, without proof (F14)."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from laufruhe.errors import ModelError, SolverError
from laufruhe.load_models.affine import AffineModel
from laufruhe.load_models.simulated import simulated_measures
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.machine import Engine
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import open_kinds
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem, Search
from laufruhe.solvers.conclusion import initial_design, values_of
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.methods import solve
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.ranking import candidates_of

STARTS, STARS, STARS_THAT_MOVE = 3, 3, 2
"""Starts of the first search, crank stars that it ranks, and fewer crank stars if mounts or throws are open too."""
BOXES, NEAR_BOXES = 100, 30
"""Largest number of boxes of positions and leads: of the first search, and of a search from a known design."""
SIMILAR = 0.1
"""Relative difference of the objective up to which a search from the known design alone is sufficient."""
STEPS = 96
"""Samples per cycle for the ranking of crank stars with even firing."""


def is_convex(problem: Problem) -> bool:
    """Return True if all decisions are unbalances, phasing is fixed, and no measure needs a simulation."""
    return (
        problem.phasing is None
        and len(problem.unbalances) == len(problem.decisions)
        and not simulated_measures(problem)
    )


def compares_stars(problem: Problem) -> bool:
    """Return True if all crank stars are compared: phasing is open, throws are on even steps, and mounts are fixed."""
    return problem.phasing is not None and not (problem.phasing.continuous or problem.mount_decisions)


def solve_by_cones(problem: Problem, samples: int | None = None) -> Engine | None:
    """Return the engine with optimal unbalances by one cone program; None if it has no solution.

    `samples` is the number of samples over the period of the loads; by default that of the model.
    """
    model = AffineModel(problem)
    x = solve_cones(model.at(samples or model.full_samples)).x
    return None if x is None else problem.design([domain.complex_value(x) for domain in model.domains])


def first_search(problem: Problem) -> Result | None:
    """Return a quick result of `solve` with few starts and boxes, without proof; None without a feasible design."""
    phasing = problem.phasing
    if phasing is not None:
        is_continuous = phasing.continuous or bool(problem.mount_decisions)
        count = min(phasing.best, STARS_THAT_MOVE if is_continuous else STARS)
        problem = replace(problem, phasing=replace(phasing, best=count, thorough=False))
    # the design of each star needs no proof
    result = solve(problem.changed(search=_unproven(problem, STARTS, BOXES)))
    return result if result.status.has_design else None


def reoptimise(problem: Problem, neighbour: Result) -> Engine | None:
    """Return the best engine of searches that start from the known result of a similar problem.

    The similar problem has the same decisions. Its result gives the start values and the crank stars to compare. None
    if no search ends within the limits.
    """
    if compares_stars(problem):
        # the best star may differ from the best one of the neighbour
        fidelity = problem.fidelity
        coarse = replace(fidelity, samples=min(fidelity.samples, STEPS), gas_samples=fidelity.gas_steps)
        return _best_star(problem, first_search(problem.at(coarse)) or neighbour)
    engines = [_engine_from(problem, neighbour) if problem.phasing is None else _best_star(problem, neighbour)]
    if not _is_similar(problem, neighbour):
        with suppress(SolverError, ModelError):
            engines.append(_engine(first_search(problem)))
    return _best_engine(problem, engines)


def _is_similar(problem: Problem, neighbour: Result) -> bool:
    # the design of the neighbour has about the same objective in this problem
    value = objective_value(problem, evaluate(problem, neighbour.final.engine))
    return (
        neighbour.objective is not None
        and abs(value - neighbour.objective.value) <= SIMILAR * neighbour.objective.value
    )


def _best_engine(problem: Problem, engines: Sequence[Engine | None]) -> Engine | None:
    designs = [initial_design(problem, evaluate(problem, engine)) for engine in engines if engine is not None]
    best = min((design for design in designs if design is not None), key=lambda design: design.rank, default=None)
    return None if best is None else best.evaluation.engine


def _best_star(problem: Problem, neighbour: Result) -> Engine | None:
    """Return the best engine over the first crank stars of a ranking; open throws may then leave the best star."""
    phasing = problem.phasing
    if phasing is None or neighbour.phasing is None:
        return None
    stars: dict[Engine, Candidate] = {}
    for candidate in candidates_of(phasing, neighbour.phasing.ranking)[:STARS]:
        star = replace(phasing.problem_of(candidate), phasing=None)
        engine = _engine_from(star, neighbour) if star.decisions else star.engine
        if engine is not None:
            stars[engine] = candidate
    best = _best_engine(problem, [*stars])
    if best is None or not phasing.continuous:
        return best
    return _moved_throws(phasing, stars[best], neighbour) or best


def _moved_throws(phasing: Phasing, star: Candidate, neighbour: Result) -> Engine | None:
    problem = replace(phasing.problem_of(star), phasing=None)
    if problem.mount_decisions:
        from laufruhe.solvers.mounts.nonlinear import solve_moved

        moves = ThrowMoves(phasing, phasing.layout_of(star), star, phasing.intervals)
        return _engine(solve_moved(_started_at(problem, neighbour), moves, None)[0])
    from laufruhe.solvers.throws.uneven_throws import local_optimum

    optimum = local_optimum(phasing, star, phasing.intervals, with_perturbations=False)
    return None if optimum is None else _engine(optimum.result)


def _engine_from(problem: Problem, neighbour: Result) -> Engine | None:
    # a convex problem needs no start
    return solve_by_cones(problem) if is_convex(problem) else _engine(solve(_started_at(problem, neighbour)))


def _started_at(problem: Problem, neighbour: Result) -> Problem:
    # the problem with the values of the neighbour as its only start
    values = values_of(problem, neighbour)
    pairs = list(zip(problem.decisions, values, strict=True))
    numbers = [(decision, value) for decision, value in pairs if decision.address_drives]
    fixed = problem.fixed_at([value for _, value in numbers], [decision for decision, _ in numbers])
    rebuilt = {decision.name: decision for decision in fixed.decisions}
    decisions = tuple(replace(rebuilt.get(d.name, d), start=value) for d, value in pairs)
    return replace(problem.fixed_at(values), decisions=decisions, search=_unproven(problem, 1, NEAR_BOXES))


def _unproven(problem: Problem, starts: int, maximum: int) -> Search:
    # search settings with few starts and boxes, without proof
    boxes = min(problem.search.boxes_or(maximum), maximum) if open_kinds(problem) & {Kind.PLACE, Kind.LEAD} else 0
    return replace(problem.search, starts=min(problem.search.starts, starts), boxes=boxes, proves=False)


def _engine(result: Result | None) -> Engine | None:
    return result.final.engine if result is not None and result.status.has_design else None
