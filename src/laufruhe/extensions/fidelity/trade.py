"""Speed against accuracy of every fidelity, measured by the calls that users make (F13, F14)."""

from __future__ import annotations

import math
import time
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import count, islice
from pathlib import Path
from typing import TypeVar

import numpy as np

import laufruhe
from laufruhe.errors import ModelError, SolverError, plural, refused
from laufruhe.extensions.fidelity.choice import GAS, ROD
from laufruhe.extensions.fidelity.reference import Reference, reference
from laufruhe.files.reader import load
from laufruhe.load_models.batch import prepare
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over
from laufruhe.numerics.workers import SERIAL, working_on
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.shaking_loads import forget
from laufruhe.physics.uneven_speed import crank_motion
from laufruhe.problem.error_bounds import REFERENCE_SAMPLES
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import FEASIBLE
from laufruhe.solvers.many import values_of_columns
from laufruhe.studies.solved import solve_scene

T = TypeVar("T")
REFERENCE_NAME = f"exact, every order, {REFERENCE_SAMPLES} steps"
KEEPS = 1e-3
"""Largest relative violation of a limit, at the reference, with which a design counts as a decision."""
DESIGNS = 10_000
"""Number of designs of the batch."""
FASTER, SCENES = 1.001, 6
"""Factor between the speeds of two scenes of a sweep, and number of scenes whose mean time counts."""
TRIED = (1e-2, 1e-3, 1e-4)
"""Tolerances at which a trade tries the automatic choice."""
TWO_ORDER, NO_GAS, RIGID = "two-order, 720 steps", "exact without gas, 720 steps", "rigid mounts, 720 steps"
"""Names of fidelities that reports mention."""
GAS_ORDERS = 12
"""Last order of the gas in the fidelity with fewer orders of gas."""
TIME_ORDERS, TIME_SAMPLES = 12, 360
"""Orders and samples in the time domain; more orders take minutes."""
_REPEATED, _MAX_REPEATS, _LONG = 0.3, 50, 2.0
"""Time [s] and number of calls after which a call is not repeated, and time of a first call that is the only one."""


@dataclass(frozen=True)
class TradeRow:
    """Measurements of one fidelity on one problem; NaN where a call is not possible, or takes too long to repeat.

    Attributes
    ----------
    error, estimate
        Error of the objective of the initial design relative to the reference, and its estimate.
    evaluation, solve, scene, batch
        Processor time [s] of a further call of `laufruhe.evaluate`, of `laufruhe.solve`, of a mean scene of a sweep,
        and of `laufruhe.evaluate_many` with `DESIGNS` designs.
    batch_error
        Largest relative error of the objective of a design of the batch.
    memory
        Largest memory of `solve`, or of `evaluate` if nothing is open, by tracemalloc [byte].
    optimum, violation
        Reference objective of the design that this fidelity decides, and the largest relative violation of a limit by
        this design at the reference.
    regret, regret_bound
        Relative excess of `optimum` over the best known objective, and the bound that `solve` states.
    """

    name: str
    error: float
    estimate: float
    evaluation: float
    solve: float
    scene: float
    batch: float
    batch_error: float
    memory: float
    optimum: float
    violation: float
    regret_bound: float
    regret: float = math.nan

    @property
    def decides(self) -> bool:
        """True if its design keeps the limits."""
        return self.violation <= KEEPS


@dataclass(frozen=True)
class Trade:
    """Measurements of all fidelities on one problem, and the reference.

    Attributes
    ----------
    value, optimum
        Reference objective of the initial design, and of the best design known [SI]; NaN where nothing is open.
    flywheel
        Crank inertia with which uneven speed was computed [kg m2], and the relative
        change of the objective that the uneven speed makes; None if no measure is of a load.
    left_out
        Sentences about parts of the problem that a trade does not include.
    """

    problem: Problem
    rows: tuple[TradeRow, ...]
    value: float
    optimum: float
    flywheel: tuple[float, float] | None
    left_out: tuple[str, ...] = ()
    is_complete: bool = True


def problem_with_objective(path: Path) -> Problem:
    """Read a problem, and refuse one without an objective."""
    problem = load(path)
    if not problem.objective:
        rule = "is missing, and the accuracy of a fidelity is that of the objective"
        raise refused("objective", "", rule, "add [objective] or mounts", path)
    return problem


def trade(problem: Problem, say: Callable[[str], None] = lambda _: None) -> Trade:
    """Return time, error and regret of every model fidelity for a problem; `ModelError` without an objective.

    The first of several objectives counts.
    """
    if not problem.objective:
        raise ModelError("the comparison of fidelities needs an objective; add [objective]")
    left_out = [f"The trade takes the drawing, without {extra.words}." for extra in problem.extras]
    if len(problem.ranks) > 1:
        left_out.insert(0, f"The trade takes the first of {len(problem.ranks)} objectives.")
    problem = problem.changed(ranks=(), extras=())
    scale, rows, is_complete = Reference(problem), list[TradeRow](), False
    batch = Batch(problem)
    with working_on(SERIAL):
        for name, variant in ladder(scale):
            say(name)
            row = measured(name, variant, scale, batch)
            if is_time_over():
                # a time limit may have cut the last row short
                break
            rows.append(row)
        else:
            is_complete = True
    if not rows:
        raise SolverError("the time limit ended before any fidelity was measured; raise the time limit")
    say("uneven crank speed")
    even_only = any(measure.is_inside for measure in problem.measures)
    flywheel = _price_of_constant_speed(problem) if problem.load_terms and not even_only else None
    minimum = min((row.optimum for row in rows if row.violation <= FEASIBLE), default=math.nan)
    if minimum <= numerical_zero(problem):
        # a zero objective has no relative regret
        minimum = 0.0
    elif minimum > 0.0:
        rows = [replace(row, regret=row.optimum / minimum - 1.0) for row in rows]
    value = objective_value(problem, scale.best)
    return Trade(problem, tuple(rows), value, minimum, flywheel, tuple(left_out), is_complete)


def ladder(scale: Reference) -> list[tuple[str, Problem]]:
    """Return the fidelities that a trade compares, as pairs (name, problem at this fidelity) (F13).

    `scale` is the reference of the problem.
    """
    problem, mounting = scale.problem, scale.mounting
    has_gas = GAS.is_there(problem)
    gas_samples = EXACT.samples if has_gas else None
    variants = [
        ("two-order, 48 steps", Fidelity("two-order", 48, gas_samples=gas_samples)),
        (TWO_ORDER, Fidelity("two-order", 720)),
    ]
    if ROD.is_there(problem):
        variants.append(("exact, rod of two masses, 720 steps", Fidelity(samples=720, **ROD.less)))
    if has_gas:
        variants.append((NO_GAS, Fidelity(samples=720, **GAS.less)))
        variants.append((f"exact, gas to order {GAS_ORDERS}, 720 steps", Fidelity(samples=720, gas_orders=GAS_ORDERS)))
    for orders, samples in ((4, 96), (8, 192), (24, 360)):
        fidelity = Fidelity(samples=samples, orders=orders, gas_samples=gas_samples)
        variants.append((f"orders to {orders}, {samples} steps", fidelity))
    if any(term.measure.is_inside for term in scale.terms):
        is_beam = problem.fidelity.crankshaft == "beam"
        beam = "crankshaft as a beam", Fidelity(crankshaft="beam")
        variants.append(("crankshaft cut", Fidelity()) if is_beam else beam)
    if mounting is not None and scale.terms:
        variants.append((RIGID, Fidelity(samples=720, mounts="rigid")))
        cut, words = Fidelity(samples=TIME_SAMPLES, orders=TIME_ORDERS), f"orders to {TIME_ORDERS}"
        variants.append((f"{words}, {TIME_SAMPLES} steps", cut))
        if mounting.dynamic.has_law:
            variants.append((f"in time, {words}", replace(cut, mounts="time")))
        # the one and the three modes of largest response
        by_strength = sorted(scale.mode_contributions, key=lambda mode: -scale.mode_contributions[mode])
        for count in (1, 3):
            if count < len(by_strength):
                modes = tuple(sorted(by_strength[:count]))
                name = f"{plural('mode', len(modes))} {', '.join(map(str, modes))}, 720 steps"
                variants.append((name, Fidelity(samples=720, modes=modes)))
    variants += [(f"exact, {samples} steps", Fidelity(samples=samples)) for samples in (720, 1440, 2880)]
    rungs = [(name, problem.at(fidelity)) for name, fidelity in variants]
    if not problem.load_terms and not any(term.measure.channel.simulation for term in problem.objective):
        return [("mounts alone, no loads", replace(problem, points=())), *rungs]
    return [
        *rungs,
        *((f"auto {tolerance:g}", problem.at(replace(EXACT, tolerance=tolerance))) for tolerance in TRIED),
    ]


def is_open(problem: Problem) -> bool:
    """Return True if a problem leaves anything to decide."""
    return bool(problem.decisions or problem.phasing)


class Batch:
    """Random designs of a problem whose decisions are unbalances, with their objectives by the exact model."""

    def __init__(self, problem: Problem) -> None:
        self._exact: Array | None = None
        with suppress(ModelError):
            if problem.decisions and problem.load_terms:
                designs = prepare(problem.at(EXACT.exact(REFERENCE_SAMPLES)))
                rng = np.random.default_rng(0)
                sizes, turns = rng.random((2, DESIGNS, len(problem.decisions)))
                self.columns: dict[str, Array] = {}
                for k, decision in enumerate(problem.decisions):
                    (low, high), s = decision.set.angles, decision.set
                    self.columns[decision.name] = s.lower + (s.upper - s.lower) * sizes[:, k]
                    if s.width > 1:
                        self.columns[decision.angle_name] = low + (high - low) * turns[:, k]
                values, _ = values_of_columns(problem.decisions, self.columns, DESIGNS)
                self._exact = designs.objective(values)

    def by(self, variant: Problem) -> tuple[float, float]:
        """Return the time of the batch at a fidelity [s], and its largest relative error."""
        if self._exact is None or variant.fidelity.mounts == "time":
            return math.nan, math.nan
        table, spent = timed(lambda: laufruhe.evaluate_many(variant, self.columns))
        values = table["objective"].to_numpy()
        return spent, float(np.max(np.abs(values - self._exact) / np.where(self._exact > 0.0, self._exact, math.inf)))


def measured(name: str, variant: Problem, scale: Reference, batch: Batch) -> TradeRow:
    """Measure a fidelity, all but its regret."""
    truth = objective_value(variant, scale.best)
    initial = evaluate_start(variant)
    value = objective_value(variant, initial)
    evaluate_time = solve_time = scene_time = optimum = violation = bound = math.nan
    with suppress(ModelError):
        # the design may stand on an undamped resonance
        evaluate_time = timed(lambda: laufruhe.evaluate(variant))[1]
    if is_open(variant) and variant.fidelity.mounts != "time":
        with suppress(SolverError, ModelError):
            result, solve_time = timed(lambda: laufruhe.solve(variant))
            bound = math.nan if result.regret_bound is None else result.regret_bound
            if result.status.has_design:
                best = reference(variant, result.final.engine)
                optimum, violation = objective_value(variant, best), best.violation(variant.limits)
            if solve_time < _LONG and variant.points:
                # a sweep has each speed once, so loads of another speed help no scene
                scenes = (_times_faster(variant, FASTER**k) for k in count(1))
                scene_time = timed(lambda: [solve_scene(scene) for scene in islice(scenes, SCENES)])[1] / SCENES
    memory = math.nan
    if not solve_time >= _LONG:
        with suppress(SolverError, ModelError):
            memory = peak_memory(lambda: laufruhe.solve(variant) if solve_time < _LONG else laufruhe.evaluate(variant))
    spent, batch_error = batch.by(variant)
    return TradeRow(
        name=name,
        error=abs(value - truth) / truth if truth > 0.0 else 0.0,
        # the error is relative to the computed value; the table states it relative to the reference
        estimate=scale.error_of(initial) * value / truth if truth > 0.0 else 0.0,
        evaluation=evaluate_time,
        solve=solve_time,
        scene=scene_time,
        batch=spent,
        batch_error=batch_error,
        memory=memory,
        optimum=optimum,
        violation=violation,
        regret_bound=bound,
    )


def _times_faster(problem: Problem, times: float) -> Problem:
    return replace(problem, points=tuple(replace(point, speed=times * point.speed) for point in problem.points))


def _price_of_constant_speed(problem: Problem) -> tuple[float, float]:
    """Return a flywheel inertia at which speed varies by 2 %, and the change of the objective with that variation."""
    reciprocating = sum(p.reciprocating_mass * p.crank_radius**2 for p in problem.engine.slider_cranks)
    inertia = 30.0 * max(reciprocating, 1e-12)
    for _ in range(12):
        uneven = Fidelity(samples=360, crank_inertia=inertia)
        try:
            maximum = max(crank_motion(problem.engine, point, uneven).unevenness for point in problem.points)
        except ModelError:
            inertia *= 4.0
            continue
        if maximum < 1e-9 or 0.019 < maximum < 0.021:
            break
        inertia *= maximum / 0.02
    even, changed = (
        objective_value(problem, evaluate(replace(problem, fidelity=f))) for f in (Fidelity(samples=360), uneven)
    )
    return inertia, (changed - even) / even if even > 0.0 else 0.0


def timed(work: Callable[[], T]) -> tuple[T, float]:
    """Return what a call returns, and its least processor time of several calls [s], or of one that takes over 2 s."""
    times: list[float] = []
    while sum(times) < (_REPEATED if len(times) > 1 else _LONG) and len(times) < _MAX_REPEATS:
        started = time.process_time()
        result = work()
        times.append(time.process_time() - started)
    return result, min(times)


def peak_memory(work: Callable[[], object]) -> int:
    """Return the largest memory of a call in Python and NumPy by tracemalloc [byte], without cached loads."""
    forget()
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
