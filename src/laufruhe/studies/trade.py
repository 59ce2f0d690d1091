"""Speed against accuracy of every fidelity, measured on one problem (F13, F14)."""

from __future__ import annotations

import math
import time
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError, SolverError
from laufruhe.fidelity.automatic import TIME_ORDERS, TIME_SAMPLES, ladder
from laufruhe.fidelity.error_bounds import REFERENCE_SAMPLES, ErrorReference, reference
from laufruhe.load_models.affine import AffineModel
from laufruhe.machine import Engine
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over
from laufruhe.numerics.workers import SERIAL, working_on
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import forget, shaking_loads
from laufruhe.physics.steady_state import TimeMounting, viscous_forces
from laufruhe.physics.uneven_speed import crank_motion
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import FEASIBLE
from laufruhe.solvers.result import Result
from laufruhe.solvers.warm_start import first_search, is_convex, reoptimise, solve_by_cones

REFERENCE_STEPS = 1440
"""Steps over the period for the optimum from which a regret is measured."""
REFERENCE_NAME = f"exact, every order, {REFERENCE_SAMPLES} steps"
KEEPS = 1e-3
"""Largest relative violation of a limit, at the reference, with which a design counts as a decision."""
_MIN_TIME, _LONG, _MAX_REPEATS = 0.02, 0.1, 50


@dataclass(frozen=True)
class TradeRow:
    """Measurements of one fidelity on one problem.

    Attributes
    ----------
    error, estimate
        Error of the objective of the initial design relative to the reference, and its bound.
    evaluation, gradient, solve, fresh
        Times [s]: the objective of another design with the problem prepared (with all preparation if that is not
        possible), the same with its gradient, an optimum (processor time), and the objective with all preparation.
        NaN where nothing is open, or this fidelity cannot decide the problem.
    memory
        Largest memory of an evaluation with all preparation [byte].
    optimum, violation
        Reference objective of the design that this fidelity decides, and the largest relative violation of a limit by
        this design at the reference; NaN as above.
    regret
        Relative excess of `optimum` over the best known objective; NaN as above, and for an objective of zero.
    """

    name: str
    error: float
    estimate: float
    evaluation: float
    gradient: float
    solve: float
    fresh: float
    memory: int
    optimum: float
    violation: float
    regret: float = math.nan

    @property
    def decides(self) -> bool:
        """True if its design keeps the limits."""
        return self.violation <= KEEPS


@dataclass(frozen=True)
class TimeDomain:
    """Difference between mount forces in the time and frequency domains, relative to their peak.

    `integration` compares the same equations, `loss` hysteretic loss, which has no law in time (E26).
    """

    point: str
    integration: float
    loss: float


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
    time_domain
        Difference of mount forces between time and frequency domain; None for rigid mounts.
    left_out
        Sentences about parts of the problem that a trade does not include.
    """

    problem: Problem
    rows: tuple[TradeRow, ...]
    value: float
    optimum: float
    flywheel: tuple[float, float] | None
    time_domain: TimeDomain | None
    left_out: tuple[str, ...] = ()
    is_complete: bool = True


def trade(problem: Problem, say: Callable[[str], None] = lambda _: None) -> Trade:
    """Return time, error and regret of every model fidelity for a problem; `ModelError` without an objective.

    The first of several objectives counts.
    """
    if not problem.objective:
        raise ModelError("the comparison of fidelities needs an objective; add [objective]")
    left_out = [f"The trade takes the drawing, without {extra.words}." for extra in problem.extras]
    if len(problem.ranks) > 1:
        left_out.insert(0, f"The trade takes the first of {len(problem.ranks)} objectives.")
    problem = traded_part(problem)
    scale = ErrorReference.of(problem)
    say("solving the reference")
    decided = _Decided(scale)
    rows, is_complete, measured = [], False, dict[tuple[Fidelity, int], TradeRow]()
    for name, variant in ladder(scale):
        say(name)
        # several tolerances may select the same physics
        physics = replace(variant.fidelity, tolerance=None), len(variant.points)
        row = replace(measured[physics], name=name) if physics in measured else _row(name, variant, scale, decided)
        measured[physics] = row
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
    return Trade(
        problem, tuple(decided.regretted(row) for row in rows), decided.initial_value, decided.minimum, flywheel,
        _price_of_time(problem), tuple(left_out), is_complete,
    )  # fmt: skip


def traded_part(problem: Problem) -> Problem:
    """Return the problem that a trade measures: one with the first objective only."""
    return problem.changed(ranks=(), extras=())


def is_open(problem: Problem) -> bool:
    """Return True if a problem leaves anything to decide."""
    return bool(problem.decisions or problem.phasing)


def is_local(problem: Problem) -> bool:
    """Return True if the optimum may be one of many, and is searched for."""
    return is_open(problem) and not is_convex(problem)


def effort(problem: Problem) -> tuple[bool, int]:
    """Return a sort key for the duration of a trade: searches last, then by the number of decisions."""
    return is_local(problem), len(problem.decisions)


class _Decided:
    """Designs of the reference and of each fidelity, which start from it (F14).

    `initial_value` is the reference objective of the initial design. `minimum` is the reference objective of the best
    known design that keeps the limits. It is zero for an objective that cancels, and NaN if no design is known.
    """

    def __init__(self, scale: ErrorReference) -> None:
        self._problem = problem = scale.problem
        self.initial_value, self.minimum = objective_value(problem, scale.best), math.nan
        self._known: Result | None = None
        sampled = problem.at(Fidelity(samples=REFERENCE_STEPS))
        engine = None
        with suppress(SolverError, ModelError):
            if is_open(problem) and is_convex(problem):
                engine = solve_by_cones(sampled, REFERENCE_STEPS)
            elif is_open(problem):
                self._known = first_search(sampled)
                engine = None if self._known is None else self._known.final.engine
        if engine is not None:
            self.of(engine)

    def of(self, engine: Engine) -> tuple[float, float]:
        """Return the objective of a design by the reference model, and its largest relative violation of a limit."""
        problem = self._problem
        final = reference(problem, engine)
        value, violation = objective_value(problem, final), final.violation(problem.limits)
        if violation <= FEASIBLE and not self.minimum <= value:
            # a zero objective has no relative regret
            self.minimum = 0.0 if value <= numerical_zero(problem, engine) else value
        return value, violation

    def by(self, variant: Problem) -> Engine | None:
        """Return the design that is optimal at a fidelity; None if no design within the limits is found."""
        # a tolerance would choose modes anew for every design of open mounts
        variant = variant.at(replace(variant.fidelity, tolerance=None))
        with working_on(SERIAL), suppress(SolverError, ModelError):
            if is_convex(variant):
                return solve_by_cones(variant)
            return None if self._known is None else reoptimise(variant, self._known)
        return None

    def regretted(self, row: TradeRow) -> TradeRow:
        """Return a row with its regret; call it after all designs are known."""
        return replace(row, regret=row.optimum / self.minimum - 1.0) if self.minimum > 0.0 else row


def _row(name: str, variant: Problem, scale: ErrorReference, decided: _Decided) -> TradeRow:
    """Return time and error of a fidelity; its regret needs the best design of all and follows later."""
    evaluation, truth = evaluate(variant), decided.initial_value
    value = objective_value(variant, evaluation)
    prepared, gradient = _prepared_times(variant)
    solve_time = optimum = violation = math.nan
    if is_open(variant) and variant.fidelity.mounts != "time":
        started = time.process_time()
        engine = decided.by(variant)
        if engine is not None:
            solve_time = time.process_time() - started
            optimum, violation = decided.of(engine)

    def from_scratch() -> None:
        forget()
        objective_value(variant, evaluate(variant))

    fresh = seconds(from_scratch)
    tracemalloc.start()
    try:
        from_scratch()
        memory = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    return TradeRow(
        name=name,
        error=abs(value - truth) / truth if truth > 0.0 else 0.0,
        # the bound is relative to the computed value; the table states it relative to the reference
        estimate=scale.error_of(evaluation) * value / truth if truth > 0.0 else 0.0,
        evaluation=fresh if math.isnan(prepared) else prepared,
        gradient=gradient,
        solve=solve_time,
        fresh=fresh,
        memory=memory,
        optimum=optimum,
        violation=violation,
    )


def _prepared_times(variant: Problem) -> tuple[float, float]:
    if not variant.load_terms or variant.fidelity.mounts == "time":
        return math.nan, math.nan
    model = AffineModel(variant)
    affine = model.at(model.full_samples)
    x = affine.start

    def value_and_gradient() -> tuple[float, Array]:
        value, gradient = 0.0, np.zeros(len(x))
        for weight, norm in affine.terms:
            rows = norm.rows(x)
            z = norm.norm.subgradient(norm.grid, rows)
            value += weight * float(np.vdot(z, rows))
            gradient += weight * (z.reshape(-1) @ norm.slope.reshape(-1, len(x)))
        return value, gradient

    gradient = seconds(value_and_gradient) if variant.unbalances else math.nan
    return seconds(lambda: affine.objective(x)), gradient


def _price_of_time(problem: Problem) -> TimeDomain | None:
    """Return how mount forces integrated in time differ from the frequency domain, at the first operating point."""
    if problem.engine.block is None or not mounting_in(problem.engine).dynamic.has_law:
        return None
    point, mounting = problem.points[0], mounting_in(problem.engine)
    wrench = shaking_loads(problem.engine, point, Fidelity(samples=TIME_SAMPLES, orders=TIME_ORDERS))
    in_time, viscous, hysteretic = (
        forces.sample(TIME_SAMPLES)
        for forces in (
            TimeMounting(mounting, TIME_SAMPLES).forces(wrench, point.speed),
            viscous_forces(mounting, wrench, point.speed),
            mounting.forces(wrench, point.speed),
        )
    )
    peak = float(np.abs(viscous).max())
    return TimeDomain(
        point.name,
        *(float(np.abs(in_time - reference_forces).max()) / peak for reference_forces in (viscous, hysteretic)),
    )


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


def seconds(work: Callable[[], object]) -> float:
    """Return the shortest time of a call [s]."""
    times: list[float] = []
    while sum(times) < _LONG and (len(times) <= 3 or (sum(times) < _MIN_TIME and len(times) <= _MAX_REPEATS)):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)
