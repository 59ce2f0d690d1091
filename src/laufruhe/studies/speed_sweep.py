"""Optima over speed by re-solving one program, in forces over speed squared so that only constants change (P1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from laufruhe.errors import ModelError, SolverError
from laufruhe.problem.model import Problem
from laufruhe.problem.quantity import MASSES
from laufruhe.solvers.affine import AffineModel, AffineProblem
from laufruhe.solvers.certificate import best_bound
from laufruhe.solvers.conic import ConicProgram


@dataclass(frozen=True)
class SpeedPoint:
    """The proven optimum at one speed [rad/s]: least objective and its bound [SI], and the decisions."""

    speed: float
    force: float
    lower_bound: float
    decisions: tuple[complex, ...]


def speed_sweep(problem: Problem, speeds: Sequence[float], samples: int = 360) -> tuple[SpeedPoint, ...]:
    """Least objective at every crank speed [rad/s].

    Raises
    ------
    ModelError
        If the problem has several operating points, limits, or a mass to minimise: these
        do not keep their slopes over speed.
    SolverError
        If the solver gives no design.
    """
    if len(problem.points) != 1 or problem.limits or any(t.quantity.subject in MASSES for t in problem.objective):
        raise ModelError("a speed sweep needs one operating point and loads alone; leave limits and masses out")
    program: ConicProgram | None = None
    slopes: AffineProblem | None = None
    found = []
    for speed in speeds:
        moved = replace(problem, points=(replace(problem.points[0], speed=speed),))
        model = AffineModel(moved)
        coarse, fine = _over_square(model.at(samples), speed), _over_square(model.at(2 * samples), speed)
        if program is None or slopes is None or not _same_shape(slopes, coarse):
            program, slopes = ConicProgram(coarse, reusable=True), coarse
        solution = program.solve(coarse)
        if solution.x is None:
            raise SolverError(f"no design at {speed:g} rad/s")
        bound = best_bound(fine, coarse, solution.x, solution.multipliers)
        values = tuple(complex(domain.complex_value(solution.x)) for domain in model.domains)
        found.append(SpeedPoint(speed, fine.objective(solution.x) * speed**2, bound.value * speed**2, values))
    return tuple(found)


def _over_square(affine: AffineProblem, speed: float) -> AffineProblem:
    terms = tuple(
        (weight, replace(norm, constant=norm.constant / speed**2, slope=norm.slope / speed**2))
        for weight, norm in affine.terms
    )
    return replace(affine, terms=terms)


def _same_shape(first: AffineProblem, second: AffineProblem) -> bool:
    """A period or a component may come or go with the gas loads; then the program is built anew."""
    return all(a.slope.shape == b.slope.shape for (_, a), (_, b) in zip(first.terms, second.terms, strict=True))
