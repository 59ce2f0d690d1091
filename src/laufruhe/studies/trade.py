"""Speed against accuracy of every fidelity, measured on one problem (F13, F14)."""

from __future__ import annotations

import math
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError, SolverError
from laufruhe.fidelity.automatic import ladder
from laufruhe.fidelity.error_bounds import REFERENCE_SAMPLES, Scale, reference
from laufruhe.fidelity.mount_knobs import TIME_ORDERS, TIME_SAMPLES
from laufruhe.load_models.affine import AffineModel, AffineNorm
from laufruhe.load_models.run_look import asks_runs
from laufruhe.machine import Engine
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import passed
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import forget, shaking_loads
from laufruhe.physics.time_mounting import TimeMounting, viscous_forces
from laufruhe.physics.uneven_speed import crank_motion
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import Kind
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.nothing import nothing_of
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.result import Status

REFERENCE_STEPS = 1440
"""Steps over the period at which the optimum beside which a regret is counted is solved."""
REFERENCE_NAME = f"exact, every order, {REFERENCE_SAMPLES} steps"
STARTS_OF_MOUNTS, STARS_ON_OPEN_MOUNTS, STARS_OF_OPEN_THROWS = 3, 2, 2
"""Each of them takes a search, at every fidelity."""
_LEAST_TIME, _MOST_REPEATS = 0.02, 50


@dataclass(frozen=True)
class Row:
    """One fidelity on one problem.

    Attributes
    ----------
    error, estimate
        Of the objective of the design as given, and what it is said not to exceed; relative to the reference.
    evaluation, gradient, solve, fresh
        Seconds; another design with the scene prepared (from nothing where that cannot
        be prepared), its gradient with it, an optimum, and an evaluation from nothing. NaN
        where nothing is open, or this fidelity cannot decide it.
    memory
        Largest of an evaluation from nothing [byte].
    regret
        Reference objective of this fidelity's optimum over the reference optimum, less one; NaN as above.
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
    integration, loss
        Largest difference from the same equations in the frequency domain, and from
        hysteretic loss, which has no law in time (E26).
    """

    point: str
    integration: float
    loss: float


@dataclass(frozen=True)
class Trade:
    """All fidelities on one problem, and what they were compared with.

    Attributes
    ----------
    value, optimum
        Reference objective of the design as given, and of the reference optimum [SI]; NaN where nothing is open.
    flywheel
        Crank inertia at which the constant speed was priced [kg m2], and the relative
        change of the objective that the uneven speed makes; None where no load is asked.
    time_domain
        None where mounts are rigid.
    whole
        Whether time was enough for all fidelities.
    """

    problem: Problem
    rows: tuple[Row, ...]
    value: float
    optimum: float
    flywheel: tuple[float, float] | None
    time_domain: TimeDomain | None
    whole: bool = True


def trade(problem: Problem, say: Callable[[str], None] = lambda _: None) -> Trade:
    """Measure every fidelity, by the first of several objectives; `ModelError` where the problem has none."""
    if not problem.objective:
        raise ModelError("a trade needs an objective; add [objective]")
    if problem.ranks:
        problem = problem.changed(ranks=())
    best = reference(problem)
    truth = objective_value(problem, best)
    least = math.nan
    if is_open(problem):
        say("solving the reference")
        engine = optimum(problem.at(Fidelity(samples=REFERENCE_STEPS)), REFERENCE_STEPS)
        least = math.nan if engine is None else objective_value(problem, reference(problem, engine))
        # what cancels has no share by which another design is worse
        least = 0.0 if engine is not None and least <= nothing_of(problem, engine) else least
    scale = Scale(problem, best)
    rows, whole, known = [], False, dict[tuple[Fidelity, int], Row]()
    for name, own in ladder(problem):
        say(name)
        # several tolerances may come to the same physics
        physics = replace(own.fidelity, tolerance=None), len(own.points)
        row = replace(known[physics], name=name) if physics in known else _row(name, own, scale, truth, least)
        known[physics] = row
        if passed():
            # what a limit may have cut short is no measurement
            break
        rows.append(row)
    else:
        whole = True
    if not rows:
        raise SolverError("the time limit is over before any fidelity was measured; raise it")
    say("uneven crank speed")
    even_only = any(measure.is_inside for measure in problem.measures)
    flywheel = _price_of_constant_speed(problem) if problem.load_terms and not even_only else None
    return Trade(problem, tuple(rows), truth, least, flywheel, _price_of_time(problem), whole)


def is_open(problem: Problem) -> bool:
    """Whether a problem leaves anything to be decided."""
    return bool(problem.decisions or problem.phasing)


def is_local(problem: Problem) -> bool:
    """Whether its optimum is one of many: mounts decided for loads, searched from the design as given alone."""
    return bool(problem.mount_decisions and problem.load_terms)


def optimum(problem: Problem, samples: int | None = None) -> Engine | None:
    """The best engine at a fidelity; None where it decides nothing, or finds no design within the limits (F14).

    Unbalances alone are decided at `samples` steps over the period of the loads, without
    refinement. Open stars and mounts are solved as `solve` does, of the latter a few starts, of
    both together the stars that rank first. Boxes that prove no more than a design are left out.
    """
    try:
        plain = problem.phasing is None and not asks_runs(problem)
        if plain and len(problem.unbalances) == len(problem.decisions):
            model = AffineModel(problem)
            x = solve_cones(model.at(samples or model.full_samples)).x
            return None if x is None else problem.design([domain.complex_value(x) for domain in model.domains])
        boxes = problem.search.boxes if any(d.kind is Kind.PLACE for d in problem.decisions) else 0
        starts = min(problem.search.starts, STARTS_OF_MOUNTS)
        one = replace(problem, search=replace(problem.search, starts=starts, boxes=boxes))
        if one.phasing is not None and one.mount_decisions:
            one = replace(one, phasing=replace(one.phasing, best=STARS_ON_OPEN_MOUNTS))
        elif one.phasing is not None and one.phasing.continuous:
            few = min(one.phasing.best, STARS_OF_OPEN_THROWS)
            one = replace(one, phasing=replace(one.phasing, best=few, thorough=False))
        result = solve(one)
    except (SolverError, ModelError):
        # cheap physics may leave nothing that solves: it is no choice for deciding then
        return None
    return result.final.engine if result.status in (Status.OPTIMAL, Status.FEASIBLE) else None


def _row(name: str, own: Problem, scale: Scale, truth: float, least: float) -> Row:
    evaluation = evaluate(own)
    value = objective_value(own, evaluation)
    prepared, gradient = _prepared_times(own)
    solve_time, regret = math.nan, math.nan
    if is_open(own) and own.fidelity.mounts != "time":
        started = time.perf_counter()
        engine = optimum(own)
        if engine is not None:
            solve_time = time.perf_counter() - started
            whole = replace(own, points=tuple(loads.point for loads in scale.best.loads))
            found = objective_value(whole, reference(whole, engine))
            regret = found / least - 1.0 if least > 0.0 else math.nan
    fresh = seconds(lambda: _from_nothing(own))
    return Row(
        name=name,
        error=abs(value - truth) / truth if truth > 0.0 else 0.0,
        # the bound is over what was computed, a table compares with the reference
        estimate=scale.error_of(evaluation) * value / truth if truth > 0.0 else 0.0,
        evaluation=fresh if math.isnan(prepared) else prepared,
        gradient=gradient,
        solve=solve_time,
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
    x = affine.start
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


def _price_of_time(problem: Problem) -> TimeDomain | None:
    """Elastic mounts by integration beside the frequency domain, at the first operating point."""
    if problem.engine.block is None or not mounting_in(problem.engine).dynamic.has_law:
        return None
    point, mounting = problem.points[0], mounting_in(problem.engine)
    wrench = shaking_loads(problem.engine, point, Fidelity(samples=TIME_SAMPLES, orders=TIME_ORDERS))
    found, same, own = (
        forces.sample(TIME_SAMPLES)
        for forces in (
            TimeMounting(mounting, TIME_SAMPLES).forces(wrench, point.speed),
            viscous_forces(mounting, wrench, point.speed),
            mounting.forces(wrench, point.speed),
        )
    )
    peak = float(np.abs(same).max())
    return TimeDomain(point.name, *(float(np.abs(found - other).max()) / peak for other in (same, own)))


def _price_of_constant_speed(problem: Problem) -> tuple[float, float]:
    """A flywheel that leaves the speed some 2 % uneven, and what that changes of the objective."""
    reciprocating = sum(p.reciprocating_mass * p.crank_radius**2 for p in problem.engine.slider_cranks)
    inertia = 30.0 * max(reciprocating, 1e-12)
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
    even, changed = (
        objective_value(problem, evaluate(replace(problem, fidelity=f))) for f in (Fidelity(samples=360), uneven)
    )
    return inertia, (changed - even) / even if even > 0.0 else 0.0


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
