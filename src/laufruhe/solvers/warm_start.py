"""A problem that differs little from one that is solved, decided from the designs that are known of that (F14).

Nothing is proven of what is found, so nothing is divided for a proof either.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from laufruhe.errors import ModelError, SolverError
from laufruhe.load_models.affine import AffineModel
from laufruhe.load_models.simulated import simulated_measures
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.machine import Engine
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import kinds_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem, Search
from laufruhe.solvers.conclusion import initial_design, values_of
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.methods import solve
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.ranking import candidates_of

STARTS, STARS, STARS_THAT_MOVE = 3, 3, 2
"""Of a first search where mounts are open, and stars that are ranked; fewer of them where mounts or throws move too."""
BOXES, NEAR_BOXES = 100, 30
"""Of places and leads at most, each of which has a design in its middle; fewer where a design is known."""
LIKE = 0.1
"""Share by which what is minimised of a design known may differ where searches from it are enough."""
STEPS = 96
"""Over the cycle, by which stars that stand on even steps are ranked."""


def is_convex(problem: Problem) -> bool:
    """Tell if all decisions are unbalances, phasing is fixed, and no measure needs a simulation."""
    return (
        problem.phasing is None
        and len(problem.unbalances) == len(problem.decisions)
        and not simulated_measures(problem)
    )


def compares_stars(problem: Problem) -> bool:
    """Tell if all stars are compared: phasing is open, but throws and mounts are fixed."""
    return problem.phasing is not None and not (problem.phasing.continuous or problem.mount_decisions)


def by_cones(problem: Problem, samples: int | None = None) -> Engine | None:
    """The best unbalances at some steps over the period of the loads, all by default, without refinement."""
    model = AffineModel(problem)
    x = solve_cones(model.at(samples or model.full_samples)).x
    return None if x is None else problem.design([domain.complex_value(x) for domain in model.domains])


def first_of(problem: Problem) -> Result | None:
    """A search as `solve` has it, with a few starts, and without boxes that prove no more than a design."""
    phasing = problem.phasing
    if phasing is not None:
        moves = phasing.continuous or bool(problem.mount_decisions)
        few = min(phasing.best, STARS_THAT_MOVE if moves else STARS)
        problem = replace(problem, phasing=replace(phasing, best=few, thorough=False))
    # what is made of each star is not proven either
    result = solve(problem.changed(search=_unproven(problem, STARTS, BOXES)))
    return result if result.status.has_design else None


def next_to(problem: Problem, known: Result) -> Engine | None:
    """The best engine that searches from known designs find; None where none of them ends within the limits.

    Parameters
    ----------
    known
        Of a problem with the same decisions: where numbers are sought from, and the stars that are compared.
    """
    if compares_stars(problem):
        # the best of many stars may be far from the best known
        return _of_stars(problem, first_of(problem.at(_coarse(problem.fidelity))) or known)
    engines = [_from(problem, known) if problem.phasing is None else _of_stars(problem, known)]
    if not _is_like(problem, known):
        with suppress(SolverError, ModelError):
            engines.append(_engine(first_of(problem)))
    return _best(problem, engines)


def _is_like(problem: Problem, known: Result) -> bool:
    # the known design is worth about the same for this problem
    value = objective_value(problem, evaluate(problem, known.final.engine))
    return known.objective is not None and abs(value - known.objective.value) <= LIKE * known.objective.value


def _best(problem: Problem, engines: Sequence[Engine | None]) -> Engine | None:
    designs = [initial_design(problem, evaluate(problem, engine)) for engine in engines if engine is not None]
    best = min((design for design in designs if design is not None), key=lambda design: design.rank, default=None)
    return None if best is None else best.evaluation.engine


def _of_stars(problem: Problem, known: Result) -> Engine | None:
    """The best of the stars that rank first, with throws that move from it where these may."""
    phasing = problem.phasing
    if phasing is None or known.phasing is None:
        return None
    stars: dict[Engine, Candidate] = {}
    for candidate in candidates_of(phasing, known.phasing.ranking)[:STARS]:
        star = replace(phasing.realise(candidate), phasing=None)
        engine = _from(star, known) if star.decisions else star.engine
        if engine is not None:
            stars[engine] = candidate
    best = _best(problem, [*stars])
    if best is None or not phasing.continuous:
        return best
    return _moved(phasing, stars[best], known) or best


def _coarse(fidelity: Fidelity) -> Fidelity:
    return replace(fidelity, samples=min(fidelity.samples, STEPS), gas_samples=fidelity.gas_steps)


def _moved(phasing: Phasing, star: Candidate, known: Result) -> Engine | None:
    problem = replace(phasing.realise(star), phasing=None)
    if problem.mount_decisions:
        from laufruhe.solvers.mounts.nonlinear import solve_moved

        moves = ThrowMoves(phasing, phasing.layout_of(star), star, phasing.intervals)
        return _engine(solve_moved(_begun(problem, known), moves, None)[0])
    from laufruhe.solvers.throws.uneven_throws import local_optimum

    found = local_optimum(phasing, star, phasing.intervals, nudged=False)
    return None if found is None else _engine(found.result)


def _from(problem: Problem, known: Result) -> Engine | None:
    # a convex problem needs no start
    return by_cones(problem) if is_convex(problem) else _engine(solve(_begun(problem, known)))


def _begun(problem: Problem, known: Result) -> Problem:
    # the problem with known values as its only start
    values = values_of(problem, known)
    pairs = list(zip(problem.decisions, values, strict=True))
    numbers = [(decision, value) for decision, value in pairs if decision.address_drives]
    drawn = problem.fixed_at([value for _, value in numbers], [decision for decision, _ in numbers])
    known_there = {decision.name: decision for decision in drawn.decisions}
    decisions = tuple(replace(known_there.get(d.name, d), start=value) for d, value in pairs)
    return replace(problem.fixed_at(values), decisions=decisions, search=_unproven(problem, 1, NEAR_BOXES))


def _unproven(problem: Problem, starts: int, few: int) -> Search:
    # search settings with few starts and boxes, without proof
    boxes = min(problem.search.boxes_or(few), few) if kinds_of(problem) & {Kind.PLACE, Kind.LEAD} else 0
    return replace(problem.search, starts=min(problem.search.starts, starts), boxes=boxes, proves=False)


def _engine(result: Result | None) -> Engine | None:
    met = result is not None and result.status.has_design
    return result.final.engine if result is not None and met else None
