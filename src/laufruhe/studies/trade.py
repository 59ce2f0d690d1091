"""Speed against accuracy of every fidelity, measured on one problem (F13, F14)."""

from __future__ import annotations

import math
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError, SolverError
from laufruhe.numerics import mixed_norms
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.automatic import choose
from laufruhe.problem.error_bounds import REFERENCE_SAMPLES, error_bound, reference
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value
from laufruhe.problem.model import Problem
from laufruhe.solvers.affine import AffineModel, AffineNorm
from laufruhe.studies.digits import rigid_part_error

Array = NDArray[np.float64]

AUTO = (1e-2, 1e-3, 1e-4)
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
        That the error is said not to exceed.
    evaluation, gradient, solve
        Seconds; another design with the scene prepared, its gradient with it, and an
        optimum from nothing. NaN where nothing is open.
    fresh
        Seconds of an evaluation from nothing.
    memory
        Largest memory of an evaluation from nothing [byte].
    regret
        Reference objective of this fidelity's optimum over the reference optimum, less
        one; NaN where nothing is open.
    """

    name: str
    fidelity: Fidelity
    error: float
    estimate: float
    evaluation: float
    gradient: float
    solve: float
    fresh: float
    memory: int
    regret: float


@dataclass(frozen=True)
class Trade:
    """All fidelities on one problem, and what they were compared with.

    Attributes
    ----------
    value
        Reference objective of the design as given [SI].
    optimum
        Reference objective of the reference optimum [SI]; NaN where nothing is open.
    rigid_part_error
        Relative disagreement of the reference's order coefficients with 50 digits.
    flywheel
        Crank inertia at which the constant speed was priced [kg m2], and the relative
        change of the objective that the uneven speed makes.
    """

    problem: Problem
    rows: tuple[Row, ...]
    value: float
    optimum: float
    rigid_part_error: float
    flywheel: tuple[float, float]


def ladder(problem: Problem) -> list[tuple[str, Fidelity]]:
    """Every fidelity that differs on this problem, cheap ones first."""
    has_gas = any(point.gas is not None for point in problem.points)
    has_rod = any(part.rod_inertia_deficit != 0.0 for part in problem.engine.slider_cranks)
    gas = 1440 if has_gas else None
    found = [("two-order, 48 steps", Fidelity("two-order", 48, gas_samples=gas))]
    if has_gas:
        found.append(("exact without gas, 720 steps", Fidelity(samples=720, gas=False)))
    if has_rod:
        found.append(("exact, rod of two masses, 720 steps", Fidelity(samples=720, rod="mass-only")))
    found.append(("two-order, 720 steps", Fidelity("two-order", 720)))
    found += [
        (f"orders to {orders}, {samples} steps", Fidelity(samples=samples, orders=orders, gas_samples=gas))
        for orders, samples in ((4, 96), (8, 192), (24, 360))
    ]
    found += [(f"exact, {samples} steps", Fidelity(samples=samples)) for samples in (720, 1440, 2880)]
    if problem.objective:
        found += [(f"auto {tolerance:g}", choose(problem, tolerance).fidelity) for tolerance in AUTO]
    return found


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
    value = objective_value(problem, best)
    model = AffineModel(replace(problem, fidelity=best.fidelity)) if problem.decisions else None
    optimum = math.nan
    if model is not None:
        say("solving the reference")
        optimum = _reference_value(problem, _optimum(model, REFERENCE_STEPS))
    rows = []
    for name, fidelity in ladder(problem):
        say(name)
        rows.append(_row(problem, name, fidelity, best, optimum))
    say("uneven crank speed")
    return Trade(
        problem, tuple(rows), value, optimum, rigid_part_error(problem.engine), _price_of_constant_speed(problem)
    )


def _row(problem: Problem, name: str, fidelity: Fidelity, best: Evaluation, optimum: float) -> Row:
    own = replace(problem, fidelity=fidelity)
    evaluation = evaluate(own)
    value, truth = objective_value(own, evaluation), objective_value(problem, best)
    model = AffineModel(own)
    affine = model.at(model.full_samples)
    x = np.concatenate([d.columns_of(d.decision.start) for d in affine.domains]) if affine.domains else np.zeros(0)
    solve, regret = math.nan, math.nan
    if problem.decisions:
        started = time.perf_counter()
        found = _optimum(AffineModel(own), model.full_samples)
        solve = time.perf_counter() - started
        regret = _reference_value(problem, found) / optimum - 1.0 if optimum > 0.0 else math.nan
    return Row(
        name=name,
        fidelity=fidelity,
        error=abs(value - truth) / truth if truth > 0.0 else 0.0,
        estimate=error_bound(own, evaluation, best),
        evaluation=seconds(lambda: affine.objective(x)),
        gradient=seconds(lambda: _value_and_gradient(affine.terms, x)) if problem.decisions else math.nan,
        solve=solve,
        fresh=seconds(lambda: objective_value(own, evaluate(own))),
        memory=_memory(lambda: objective_value(own, evaluate(own))),
        regret=regret,
    )


def _value_and_gradient(terms: tuple[tuple[float, AffineNorm], ...], x: Array) -> tuple[float, Array]:
    """Objective and a subgradient of it: B^T Z at the rows' own directions (P2)."""
    value, gradient = 0.0, np.zeros(len(x))
    for weight, norm in terms:
        rows = norm.rows(x)
        z = mixed_norms.subgradient(norm.norm, norm.weights, rows)
        value += weight * float(np.vdot(z, rows))
        gradient += weight * (z.reshape(-1) @ norm.slope.reshape(-1, len(x)))
    return value, gradient


def _optimum(model: AffineModel, samples: int) -> list[complex]:
    """Decisions that are best at this model's samples, no refinement."""
    from laufruhe.solvers.conic import ConicProgram

    solution = ConicProgram(model.at(samples)).solve()
    if solution.x is None:
        raise SolverError("the limits cannot be met together; a regret needs a design")
    return [domain.complex_value(solution.x) for domain in model.domains]


def _reference_value(problem: Problem, values: list[complex]) -> float:
    return objective_value(problem, reference(problem, problem.design(values)))


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
