"""The economics of balancing: least mount force against the mass that shafts may have, with proofs.

One program is built for a set of shafts; along the front only the mass limit changes, so
every point is a re-solve (P1). Each is bounded from below on a grid twice as fine (P6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from laufruhe.errors import ModelError, SolverError
from laufruhe.machine import Role
from laufruhe.numerics.mixed_norms import Norm
from laufruhe.problem.model import Limit, Problem
from laufruhe.problem.quantity import Quantity, Subject
from laufruhe.solvers.affine import AffineModel, AffineProblem
from laufruhe.solvers.certificate import best_bound
from laufruhe.solvers.conic import ConicProgram

Array = NDArray[np.float64]

SAMPLES = 360
_MASS = Limit("mass on shafts", Quantity(Subject.BALANCER_MASS, Norm.SUM), np.inf)


@dataclass(frozen=True)
class FrontPoint:
    """One point of a front.

    Attributes
    ----------
    mass_limit, mass
        Allowed and used on balancer shafts [kg].
    force
        Least objective at this limit, by the exact rows on the finer grid [SI].
    lower_bound
        What no design within the limit falls below [SI].
    """

    mass_limit: float
    mass: float
    force: float
    lower_bound: float

    @property
    def gap(self) -> float:
        """Relative distance of the design from its bound."""
        return (self.force - self.lower_bound) / self.force if self.force else 0.0


def shafts_of(problem: Problem) -> tuple[str, ...]:
    """Names of the balancer shafts, in the order of the engine."""
    return tuple(dict.fromkeys(r.shaft.name for r in problem.engine.rotors if r.role is Role.BALANCER))


def with_shafts(problem: Problem, kept: Sequence[str]) -> Problem:
    """The problem without the balancer shafts that are not named."""
    unknown = set(kept) - set(shafts_of(problem))
    if unknown:
        raise ModelError(f"'{min(unknown)}' is no balancer shaft of this engine; name one that is")
    rotors = tuple(r for r in problem.engine.rotors if r.role is not Role.BALANCER or r.shaft.name in kept)
    names = {rotor.name for rotor in rotors}
    shortened = (replace(d, drives=tuple(v for v in d.drives if v.rotor in names)) for d in problem.decisions)
    decisions = tuple(d for d in shortened if d.drives)
    return replace(problem, engine=replace(problem.engine, rotors=rotors), decisions=decisions)


def front(problem: Problem, mass_limits: Sequence[float], samples: int = SAMPLES) -> tuple[FrontPoint, ...]:
    """Least objective under each limit on the mass of the shafts [kg], in the order given.

    Raises
    ------
    SolverError
        If a limit cannot be met.
    """
    if not problem.decisions:
        value = AffineModel(problem).at(2 * samples).objective(np.zeros(0))
        return tuple(FrontPoint(limit, 0.0, value, value) for limit in mass_limits)
    if not shafts_of(problem):
        # counterweights alone: no mass counts, so one solve is the whole front
        model = AffineModel(problem)
        coarse, fine = model.at(samples), model.at(2 * samples)
        force, bound = _solved(ConicProgram(coarse, reusable=True), coarse, fine)[1:]
        return tuple(FrontPoint(limit, 0.0, force, bound) for limit in mass_limits)
    limited = replace(problem, limits=(*problem.limits, replace(_MASS, maximum=max(mass_limits))))
    model = AffineModel(limited)
    coarse, fine = model.at(samples), model.at(2 * samples)
    program = ConicProgram(coarse, reusable=True)
    return tuple(_point(program, _limited(coarse, most), _limited(fine, most), most) for most in mass_limits)


def _limited(affine: AffineProblem, most: float) -> AffineProblem:
    *others, (_, mass) = affine.limits
    return replace(affine, limits=(*others, (most, mass)))


def _point(program: ConicProgram, coarse: AffineProblem, fine: AffineProblem, most: float) -> FrontPoint:
    x, force, bound = _solved(program, coarse, fine)
    return FrontPoint(most, fine.limits[-1][1].value(x), force, bound)


def _solved(program: ConicProgram, coarse: AffineProblem, fine: AffineProblem) -> tuple[Array, float, float]:
    """Decisions, objective and bound on the finer grid."""
    solution = program.solve(coarse)
    if solution.x is None:
        raise SolverError("no design keeps the limits, that on the mass of the shafts among them")
    return solution.x, fine.objective(solution.x), best_bound(fine, coarse, solution.x, solution.multipliers).value


def fronts(builds: dict[str, Problem], mass_limits: Sequence[float], samples: int = SAMPLES) -> xr.Dataset:
    """Fronts of several builds as one labelled dataset; a build without shafts is a level line."""
    found = [front(problem, mass_limits, samples) for problem in builds.values()]
    dims = ("build", "mass_limit")

    def table(name: str, unit: str, words: str) -> tuple[tuple[str, str], list[list[float]], dict[str, str]]:
        return dims, [[getattr(p, name) for p in row] for row in found], {"units": unit, "long_name": words}

    return xr.Dataset(
        {
            "force": table("force", "N", "least objective"),
            "lower_bound": table("lower_bound", "N", "what no design falls below"),
            "mass": table("mass", "kg", "mass on the shafts"),
            "gap": table("gap", "1", "relative gap of the proof"),
        },
        coords={
            "build": list(builds),
            "mass_limit": ("mass_limit", list(mass_limits), {"units": "kg", "long_name": "mass allowed on shafts"}),
            "shafts": ("build", [len(shafts_of(p)) for p in builds.values()], {"units": "1"}),
        },
        attrs={"title": "Economics of balancing", "kind": "economics"},
    )
