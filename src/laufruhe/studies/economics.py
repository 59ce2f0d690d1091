"""The economics of balancing: least mount force against number and mass of shafts, with proofs.

Every point is a whole solve: a mass limit costs no more than an unlimited design, each comes
with its own certificate on the exact model, and the price of the limit says what the next
kilogram is worth. The engine with one more cylinder stands beside, rebuilt at equal power
(Hasselgruber 1964, eqs. 14-23).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated, Literal

import numpy as np
import xarray as xr
from pydantic import Field, model_validator

from laufruhe.errors import ModelError, SolverError
from laufruhe.files.fields import Name, Table, refusal
from laufruhe.numerics.norms import NORMS
from laufruhe.problem import channels
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from laufruhe.studies.part import variable
from laufruhe.studies.shafts import shafts_of

MASS_ON_SHAFTS = Measure(channels.BALANCER_MASS, NORMS["mean"])
PLAIN = "plain"
"""Name of the engine without any of the shafts."""
LIMIT_NAME = "mass on shafts"
Judgement = Literal["negligible", "noticeable", "better", "worth building", "not worth building"]
SAME = 1e-4
"""Relative difference of forces below which proofs cannot tell designs apart."""


class Standing(StrEnum):
    """What an engine is in a comparison."""

    PLAIN = "plain"
    SHAFTS = "with shafts"
    NEXT = "more cylinders"


class Claim(Table):
    """What a source says of a set of shafts; it is confirmed or not."""

    says: Judgement | None = None
    falls_by: Annotated[float, Field(gt=0.0, lt=1.0)] | None = Field(
        default=None, description="Share by which the force is said to fall."
    )
    against: Name = Field(default=PLAIN, description="Build that it is compared with.")
    where: str = Field(default="", description="Figure or passage.")

    @model_validator(mode="after")
    def _says_something(self) -> Claim:
        if self.says is None and self.falls_by is None:
            raise refusal("claims nothing; give says, falls_by, or both")
        return self


NO_CLAIM = Claim.model_construct()


@dataclass(frozen=True)
class FrontPoint:
    """One point of a front: the mass allowed (infinite where nothing is asked of it) and used on shafts [kg].

    The least objective at this limit, what no design within it falls below, and the fall per
    kilogram more [SI / kg]; that is zero where the limit does not bind, and at no mass at all,
    where the solver's price has nothing to vary.
    """

    mass_limit: float
    mass: float
    force: float
    lower_bound: float
    price: float

    @property
    def gap(self) -> float:
        """Relative distance of the design from its bound."""
        return (self.force - self.lower_bound) / self.force if self.force else 0.0


def best(problem: Problem, mass_limit: float = np.inf) -> FrontPoint:
    """The proven optimum under a limit on the mass of the balancer shafts [kg].

    Raises
    ------
    SolverError
        If no design keeps the limits of the problem and this one.
    """
    asked = shafts_of(problem) and np.isfinite(mass_limit)
    limits = (*problem.limits, Limit(LIMIT_NAME, MASS_ON_SHAFTS, mass_limit)) if asked else problem.limits
    result = solve(replace(problem, limits=limits))
    if result.objective is None or result.status not in ("optimal", "feasible"):
        within = f" with {mass_limit:g} kg on the shafts" if asked else ""
        raise SolverError(f"'{problem.name}' has no design{within}: {result.message or result.status}")
    bound = result.certificate.lower_bound if result.certificate else result.objective.value
    mass = result.final.value(MASS_ON_SHAFTS) if shafts_of(problem) else 0.0
    price = next((limit.shadow_price for limit in result.limits if limit.name == LIMIT_NAME), 0.0)
    return FrontPoint(mass_limit, mass, result.objective.value, bound, price)


@dataclass(frozen=True)
class Front:
    """Least objective of one engine under each limit on the mass of its shafts, and whatever these weigh."""

    points: tuple[FrontPoint, ...]
    optimum: FrontPoint
    shafts: int
    cylinders: int
    objective: str
    unit: str


def front(problem: Problem, mass_limits: Sequence[float]) -> Front:
    """Least objective under each limit on the mass of the shafts [kg], and without one.

    A limit that the free optimum keeps changes nothing, so it is not solved for.

    Raises
    ------
    ModelError
        If the problem minimises no load.
    SolverError
        If there is no design.
    """
    if not problem.load_terms or any(term.measure.is_mass for term in problem.objective):
        raise ModelError("shafts are weighed against a load, and none is minimised; minimise mean mount force")
    optimum = best(problem)
    return Front(
        points=tuple(
            replace(optimum, mass_limit=limit) if limit >= optimum.mass else best(problem, limit)
            for limit in mass_limits
        ),
        optimum=optimum,
        shafts=len(shafts_of(problem)),
        cylinders=len(problem.engine.cylinders),
        objective=problem.objective_name,
        unit=problem.objective_unit or "",
    )


def compared(fronts: Mapping[str, Front], claims: Mapping[str, Claim], following: Collection[str]) -> xr.Dataset:
    """Fronts of several engines, the plain one first, at the same mass limits, as one labelled dataset.

    Parameters
    ----------
    following
        Names of the plain engines with more cylinders.

    Raises
    ------
    ModelError
        If they do not minimise one and the same load.
    """
    lines = list(fronts.values())
    asked = sorted({line.objective for line in lines})
    if len(asked) > 1:
        raise ModelError(f"engines minimise different things ({'; '.join(asked)}); give all one objective")
    unit, said = lines[0].unit, [claims.get(name, NO_CLAIM) for name in fronts]
    standing = [Standing.NEXT if name in following else Standing.SHAFTS for name in fronts]

    values = {
        name: variable(("build", "mass_limit"), [[getattr(p, name) for p in line.points] for line in lines], words, per)
        for name, (words, per) in _AT_LIMITS.items()
    }
    for name, (of, words, per) in _FREE.items():
        values[name] = variable("build", [getattr(line.optimum, of) for line in lines], words, per)
    for _, _, about in values.values():
        about["units"] = about["units"].format(unit)
    limits = [point.mass_limit for point in lines[0].points]
    coords = {
        "build": list(fronts),
        "mass_limit": variable("mass_limit", limits, "mass allowed on shafts", "kg"),
        "shafts": variable("build", [line.shafts for line in lines], "balancer shafts"),
        "cylinders": ("build", [line.cylinders for line in lines], {"units": "1"}),
        "standing": ("build", [str(Standing.PLAIN), *map(str, standing[1:])]),
        "claim": ("build", [claim.says or "" for claim in said], {"long_name": "what the source says"}),
        "claimed_fall": ("build", [claim.falls_by or np.nan for claim in said], {"units": "1"}),
        "claimed_against": ("build", [claim.against for claim in said]),
        "claimed_where": ("build", [claim.where for claim in said]),
    }
    data = xr.Dataset(values, coords, {"title": "", "kind": "", "objective": asked[0]})
    return data.assign(efficient=_efficient(data))


_AT_LIMITS = {
    "force": ("least objective", "{}"),
    "lower_bound": ("what no design falls below", "{}"),
    "mass": ("mass on the shafts", "kg"),
    "gap": ("relative gap of the proof", "1"),
    "price": ("fall of the least objective per kilogram more", "{} / kg"),
}
_FREE = {
    "optimum": ("force", "least objective whatever the shafts weigh", "{}"),
    "optimum_bound": ("lower_bound", "what no design falls below, whatever the shafts weigh", "{}"),
    "optimum_mass": ("mass", "mass on the shafts at the least objective", "kg"),
}


def _efficient(data: xr.Dataset) -> tuple[tuple[str, str], np.ndarray, dict[str, str]]:
    """Points of the front over all builds: none has less force for no more shafts and no more mass."""
    force, shafts = data["force"].values, data["shafts"].values
    same = data["standing"].values != Standing.NEXT
    on_front = np.zeros(force.shape, dtype=bool)
    for b in np.flatnonzero(same):
        rivals = force[same & (shafts <= shafts[b])]
        for k in range(force.shape[1]):
            lighter = rivals[:, :k].min(initial=np.inf)
            fewer = force[same & (shafts < shafts[b]), k].min(initial=np.inf)
            own = rivals[:, k].min()
            on_front[b, k] = force[b, k] <= own and force[b, k] < (1.0 - SAME) * min(lighter, fewer)
    return ("build", "mass_limit"), on_front, {"long_name": "whether no other design is better in every respect"}
