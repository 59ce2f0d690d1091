"""Speed against accuracy of every fidelity, measured on one problem (F13, F14)."""

from __future__ import annotations

import math
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.fidelity.automatic import ladder
from laufruhe.fidelity.error_bounds import REFERENCE_SAMPLES, error_bound, reference
from laufruhe.fidelity.knobs import TIME_ORDERS, TIME_SAMPLES
from laufruhe.load_models.affine import AffineModel, AffineNorm
from laufruhe.machine import Engine
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import forget, shaking_loads
from laufruhe.physics.time_mounting import TimeMounting, viscous_forces
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.studies.rigid_digits import RigidPart, rigid_part
from laufruhe.studies.trade_optima import is_open, optimum

Array = NDArray[np.float64]

REFERENCE_STEPS = 1440
"""Steps over the period at which the optimum beside which a regret is counted is solved."""
_LEAST_TIME, _MOST_REPEATS = 0.02, 50


@dataclass(frozen=True)
class Row:
    """One fidelity on one problem.

    Attributes
    ----------
    name
        As a table shows it.
    error
        Of the objective of the design as given, relative to the reference.
    estimate
        That the error is said not to exceed, relative to the reference too.
    evaluation, gradient, solve
        Seconds; another design with the scene prepared (from nothing where that cannot
        be prepared), its gradient with it, and an optimum from nothing. NaN where
        nothing is open, or this fidelity cannot decide it.
    fresh
        Seconds of an evaluation from nothing.
    memory
        Largest memory of an evaluation from nothing [byte].
    regret
        Reference objective of this fidelity's optimum over the reference optimum, less
        one; NaN as above.
    """

    name: str
    error: float
    estimate: float
    evaluation: float
    gradient: float
    solve: float
    fresh: float
    memory: int
    regret: float


@dataclass(frozen=True)
class TimeDomain:
    """Mount forces integrated in time beside those of the frequency domain, over their peak.

    Attributes
    ----------
    point
        Operating point.
    integration
        Largest difference from the same equations in the frequency domain.
    loss
        Largest difference from hysteretic loss, which has no law in time (E26).
    """

    point: str
    integration: float
    loss: float


@dataclass(frozen=True)
class Trade:
    """All fidelities on one problem, and what they were compared with.

    Attributes
    ----------
    value
        Reference objective of the design as given [SI].
    optimum
        Reference objective of the reference optimum [SI]; NaN where nothing is open.
    rigid_part
        Disagreement of the rigid reference with 50 digits.
    flywheel
        Crank inertia at which the constant speed was priced [kg m2], and the relative
        change of the objective that the uneven speed makes; None where no load is asked.
    time_domain
        Elastic mounts in time beside the frequency domain; None where mounts are rigid.
    """

    problem: Problem
    rows: tuple[Row, ...]
    value: float
    optimum: float
    rigid_part: RigidPart
    flywheel: tuple[float, float] | None
    time_domain: TimeDomain | None


def trade(problem: Problem, say: Callable[[str], None] = lambda _: None) -> Trade:
    """Measure every fidelity.

    Raises
    ------
    ModelError
        If the problem has no objective.
    """
    if not problem.objective:
        raise ModelError("a trade needs an objective; add [objective]")
    best = reference(problem)
    truth = objective_value(problem, best)
    least = math.nan
    if is_open(problem):
        say("solving the reference")
        engine = optimum(problem.at(Fidelity(samples=REFERENCE_STEPS)), REFERENCE_STEPS)
        least = math.nan if engine is None else _reference_value(problem, engine)
    rows = []
    for name, own in ladder(problem):
        say(name)
        rows.append(_row(name, own, best, truth, least))
    say("uneven crank speed")
    return Trade(
        problem, tuple(rows), truth, least, rigid_part(problem),
        _price_of_constant_speed(problem) if problem.load_terms else None, _price_of_time(problem),
    )  # fmt: skip


def _row(name: str, own: Problem, best: Evaluation, truth: float, least: float) -> Row:
    evaluation = evaluate(own)
    value = objective_value(own, evaluation)
    prepared, gradient = _prepared_times(own)
    solve, regret = math.nan, math.nan
    if is_open(own) and own.fidelity.mounts != "time":
        started = time.perf_counter()
        engine = optimum(own)
        if engine is not None:
            solve = time.perf_counter() - started
            whole = replace(own, points=tuple(loads.point for loads in best.loads))
            regret = _reference_value(whole, engine) / least - 1.0 if least > 0.0 else math.nan
    fresh = seconds(lambda: _from_nothing(own))
    return Row(
        name=name,
        error=abs(value - truth) / truth if truth > 0.0 else 0.0,
        # the bound is over what was computed, a table compares with the reference
        estimate=error_bound(own, evaluation, best) * value / truth if truth > 0.0 else 0.0,
        evaluation=fresh if math.isnan(prepared) else prepared,
        gradient=gradient,
        solve=solve,
        fresh=fresh,
        memory=_memory(lambda: _from_nothing(own)),
        regret=regret,
    )


def _from_nothing(own: Problem) -> float:
    forget()
    return objective_value(own, evaluate(own))


def _prepared_times(own: Problem) -> tuple[float, float]:
    """Seconds of another design and of its gradient; NaN where loads are not asked or not linear."""
    if not own.load_terms or own.fidelity.mounts == "time":
        return math.nan, math.nan
    model = AffineModel(own)
    affine = model.at(model.full_samples)
    x = np.concatenate([d.columns_of(d.decision.start) for d in affine.domains]) if affine.domains else np.zeros(0)
    gradient = seconds(lambda: _value_and_gradient(affine.terms, x)) if own.unbalances else math.nan
    return seconds(lambda: affine.objective(x)), gradient


def _value_and_gradient(terms: tuple[tuple[float, AffineNorm], ...], x: Array) -> tuple[float, Array]:
    """Objective and a subgradient of it: B^T Z at the rows' own directions (P2)."""
    value, gradient = 0.0, np.zeros(len(x))
    for weight, norm in terms:
        rows = norm.rows(x)
        z = norm.norm.subgradient(norm.grid, rows)
        value += weight * float(np.vdot(z, rows))
        gradient += weight * (z.reshape(-1) @ norm.slope.reshape(-1, len(x)))
    return value, gradient


def _reference_value(problem: Problem, engine: Engine) -> float:
    return objective_value(problem, reference(problem, engine))


def _price_of_time(problem: Problem) -> TimeDomain | None:
    """Elastic mounts by integration beside the frequency domain, at the first operating point."""
    if problem.engine.block is None:
        return None
    point, mounting = problem.points[0], mounting_in(problem.engine)
    wrench = shaking_loads(problem.engine, point, Fidelity(samples=TIME_SAMPLES, orders=TIME_ORDERS))
    found = TimeMounting(mounting, TIME_SAMPLES).forces(wrench, point.speed).sample(TIME_SAMPLES)
    same, own = (
        spectrum.sample(TIME_SAMPLES)
        for spectrum in (viscous_forces(mounting, wrench, point.speed), mounting.forces(wrench, point.speed))
    )
    peak = float(np.abs(same).max())
    return TimeDomain(point.name, *(float(np.abs(found - other).max()) / peak for other in (same, own)))


def _price_of_constant_speed(problem: Problem) -> tuple[float, float]:
    """A flywheel that leaves the speed some 2 % uneven, and what that changes of the objective."""
    from laufruhe.physics.uneven_speed import crank_motion

    inertia = 30.0 * max(_reciprocating_inertia(problem), 1e-12)
    for _ in range(12):
        uneven = Fidelity(samples=360, crank_inertia=inertia)
        try:
            most = max(crank_motion(problem.engine, point, uneven).unevenness for point in problem.points)
        except ModelError:
            inertia *= 4.0
            continue
        if most < 1e-9 or 0.019 < most < 0.021:
            break
        inertia *= most / 0.02
    even = objective_value(problem, evaluate(replace(problem, fidelity=Fidelity(samples=360))))
    changed = objective_value(problem, evaluate(replace(problem, fidelity=uneven)))
    return inertia, (changed - even) / even if even > 0.0 else 0.0


def _reciprocating_inertia(problem: Problem) -> float:
    return sum(p.reciprocating_mass * p.crank_radius**2 for p in problem.engine.slider_cranks)


def seconds(work: Callable[[], object]) -> float:
    """Least time of one call, of as many as fit into a moment."""
    work()
    times: list[float] = []
    while len(times) < 3 or (sum(times) < _LEAST_TIME and len(times) < _MOST_REPEATS):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)


def _memory(work: Callable[[], object]) -> int:
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


REFERENCE_NAME = f"exact, every order, {REFERENCE_SAMPLES} steps"
