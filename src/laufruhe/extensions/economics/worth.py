"""Which shafts are worth building: fronts, the rules, argued once, and what a source says held against them.

Every point of a front is a whole solve, which takes no longer with a mass limit than without. Each point has its own
certificate on the exact model, and the price of the limit is the worth of the next kilogram.

The economics are the study's own (Hasselgruber 1964, Massenausgleich): shafts are justified
by comparison with the engine of one more cylinder, and by what they change at the mounts.

W1  Indistinguishable forces. Two forces closer than `NEGLIGIBLE` look alike in the bars by
    which the study judges.
W2  What is noticed. A fall of twice that, `NOTICEABLE`, stands out in the same bars.
W3  A set of shafts is worth building on two conditions. It takes off a noticeable share of the
    least force with fewer shafts. And the engine then runs smoother, by more than W1, than the
    plain engine with one more cylinder at equal power. Otherwise the
    smaller number of shafts, or the cylinder, is the better purchase.

All forces are proven optima of sizes and angles. So no other sizes of the same shafts change a verdict, unless a share
is closer to its threshold than the gap of the proof.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias

import numpy as np

from laufruhe.errors import SolverError
from laufruhe.numerics.norms import NORMS
from laufruhe.present.numbers import percent
from laufruhe.problem import channels
from laufruhe.problem.evaluation import objective_value
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.problem.static_load import with_loads
from laufruhe.solvers import solve
from laufruhe.studies.scenes import shafts_of
from laufruhe.studies.text import NEGLIGIBLE, NOTICEABLE, PRINTED_FALL, Verdict

if TYPE_CHECKING:
    import xarray as xr

MASS_ON_SHAFTS = Measure(channels.BALANCER_MASS, NORMS["mean"])
LIMIT_NAME = "mass on shafts"
PLAIN, SHAFTS, MORE_CYLINDERS = "plain", "with shafts", "more cylinders"
"""Roles of engines in a comparison; the first is also the name of the engine without shafts."""
Judgement: TypeAlias = Literal["negligible", "noticeable", "better", "worth building", "not worth building"]
_TOLERANCE_WORDS = f"tolerance {100.0 * PRINTED_FALL:.0f} points: effect of the unprinted rod ratio and gas trace"


class FrontPoint(NamedTuple):
    """Least objective of an engine under a limit on the shaft mass.

    Attributes
    ----------
    force, lower_bound, gap
        Least objective and its lower bound [SI], and the relative gap.
    mass
        Mass used on the shafts [kg].
    price
        Fall of the objective per kilogram of a higher limit [SI / kg]; zero if the limit does not bind or is zero.
    counterpart
        Objective of the same design with its static part if it is alternating, otherwise without.
    """

    force: float
    lower_bound: float
    gap: float
    mass: float
    price: float
    counterpart: float


def best(problem: Problem, mass_limit: float = math.inf) -> FrontPoint:
    """Return the proven least objective under a limit on the balancer mass [kg]; `SolverError` without a design."""
    is_limited = shafts_of(problem) and math.isfinite(mass_limit)
    limits = (*problem.limits, Limit(LIMIT_NAME, MASS_ON_SHAFTS, mass_limit)) if is_limited else problem.limits
    result = solve(replace(problem, limits=limits))
    if result.objective is None or result.status not in ("optimal", "feasible"):
        within = f" with {mass_limit:g} kg on the shafts" if is_limited else ""
        raise SolverError(f"'{problem.name}' has no design{within}: {result.message or result.status}")
    value, proof = result.objective.value, result.certificate
    mass = result.final.value(MASS_ON_SHAFTS) if shafts_of(problem) else 0.0
    price = next((limit.shadow_price for limit in result.limits if limit.name == LIMIT_NAME), 0.0)
    bound, gap = (proof.lower_bound, proof.gap) if proof else (value, 0.0)
    counterpart_problem = with_loads(problem, alternating=True)
    if counterpart_problem.objective == problem.objective:
        counterpart_problem = with_loads(problem, alternating=False)
    return FrontPoint(value, bound, gap, mass, price, objective_value(counterpart_problem, result.final))


def front(problem: Problem, mass_limits: Sequence[float]) -> list[FrontPoint]:
    """Return the least objective under each limit on the shaft mass [kg], and last without a limit.

    A limit that the free optimum keeps changes nothing, so it is not solved for.
    """
    free = best(problem)
    return [*(free if limit >= free.mass else best(problem, limit) for limit in mass_limits), free]


class _Engine(NamedTuple):
    """Engine of an economics dataset: shafts, least force and its lower bound."""

    name: str
    standing: str
    shafts: int
    force: float
    bound: float


def _engines(data: xr.Dataset) -> dict[str, _Engine]:
    names = ("build", "standing", "shafts", "optimum", "optimum_bound")
    rows = zip(*(data[name].values.tolist() for name in names), strict=True)
    return {row[0]: _Engine(*row) for row in rows}


def worths(data: xr.Dataset) -> dict[str, tuple[bool, str]]:
    """Return for each set of shafts of an economics dataset True if it is worth building (W3), and the reason."""
    engines = _engines(data)
    built = (engine for engine in engines.values() if engine.standing == SHAFTS and engine.shafts)
    return {engine.name: _worth(engines, engine) for engine in built}


def _worth(engines: Mapping[str, _Engine], engine: _Engine) -> tuple[bool, str]:
    next_one = next(e for e in engines.values() if e.standing == MORE_CYLINDERS)
    fewer = min(e.force for e in engines.values() if e.standing != MORE_CYLINDERS and e.shafts < engine.shafts)
    following = next_one.name
    further, ratio = 1.0 - engine.force / fewer, engine.force / next_one.force
    if further < 0.0:
        why = f"fewer shafts are better: {percent(-further)} against the best of them"
    elif further < NOTICEABLE:
        size = "negligible" if further < NEGLIGIBLE else "slight"
        why = f"{size}: {percent(-further)} against the best with fewer shafts"
    elif ratio > 1.0 + NEGLIGIBLE:
        why = f"{following} without shafts run smoother: {percent(1.0 / ratio - 1.0)}"
    elif ratio >= 1.0 - NEGLIGIBLE:
        why = f"{following} without shafts run as smoothly: {percent(1.0 / ratio - 1.0)}"
    else:
        why = f"{percent(-further)}, and {percent(ratio - 1.0)} against {following} without shafts"
    return further >= NOTICEABLE and ratio < 1.0 - NEGLIGIBLE, why


def verdicts(data: xr.Dataset) -> dict[str, tuple[Verdict, ...]]:
    """Return the verdicts on the source's claims about the benefit of shafts, by name of the engine with shafts."""
    by_build: dict[str, tuple[Verdict, ...]] = {}
    engines = _engines(data)
    for name in engines:
        row = data.sel(build=name)
        says, falls, against, where = (row[f"claim{end}"].item() for end in ("", "ed_fall", "ed_against", "ed_where"))
        statement = f"{name}: against {against}" + (f" ({where})" if where else "")
        by_claim: list[Verdict] = []
        fall = 1.0 - engines[name].force / engines[against].force
        if says:
            agrees, why = _apply_rule(engines, engines[name], engines[against], says)
            by_claim.append(Verdict(statement, says, -100.0 * fall, "% of the force", agrees, why))
        if not np.isnan(falls):
            agrees, claim = abs(fall - falls) <= PRINTED_FALL, f"{-100.0 * falls:.0f} %"
            by_claim.append(Verdict(statement, claim, -100.0 * fall, "% of the force", agrees, _TOLERANCE_WORDS))
        if by_claim:
            by_build[name] = tuple(by_claim)
    return by_build


def _apply_rule(engines: Mapping[str, _Engine], engine: _Engine, against: _Engine, says: str) -> tuple[bool, str]:
    # whether a judgement holds, and by which rule
    if says == "negligible":
        maximum = 1.0 - engine.bound / against.force
        return maximum < NEGLIGIBLE, f"W1: under {100.0 * NEGLIGIBLE:.0f} %, proven for all sizes of these shafts"
    if says == "noticeable":
        return 1.0 - engine.force / against.force >= NOTICEABLE, f"W2: {100.0 * NOTICEABLE:.0f} % or more"
    if says == "better":
        return engine.force < against.bound, "its force is below the other's lower bound"
    worth, why = _worth(engines, engine)
    return worth == (says == "worth building"), f"W3: {why}"
