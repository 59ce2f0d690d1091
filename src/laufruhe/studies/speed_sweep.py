"""Optima over speed of one design problem, each bounded on a grid twice as fine (P1, P6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from laufruhe.errors import ModelError, SolverError
from laufruhe.load_models.affine import AffineModel
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import best_bound
from laufruhe.solvers.direct_cones import solve_direct


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
        If the problem has several operating points.
    SolverError
        If a limit cannot be met, or the solver gives no design.
    """
    if len(problem.points) != 1:
        raise ModelError("a speed sweep needs one operating point; leave the others out")
    found = []
    for speed in speeds:
        model = AffineModel(replace(problem, points=(replace(problem.points[0], speed=speed),)))
        coarse, fine = model.at(samples), model.at(2 * samples)
        solution = solve_direct(coarse)
        if solution.x is None:
            raise SolverError(f"no design at {speed:g} rad/s")
        bound = best_bound(model.at(fine.samples, averaged=True), coarse, solution.x, solution.multipliers)
        values = tuple(complex(domain.complex_value(solution.x)) for domain in model.domains)
        found.append(SpeedPoint(speed, fine.objective(solution.x), bound.value, values))
    return tuple(found)
