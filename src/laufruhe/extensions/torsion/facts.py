"""Torsional data for tables, files and pictures: modes, critical speeds, and torque over speed."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.torsion.channels import FACTORS, HIGHEST
from laufruhe.extensions.torsion.physics import (
    TorsionalModes,
    chain_of,
    critical_modes,
    critical_speed,
    has_torsion,
    main_orders,
    natural_modes,
    receptances,
    section_stiffness,
    shaft_torque,
    throw_torques,
    vector_sums,
)
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.roots import bisect_property
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Limit, load_rows
from laufruhe.solvers.result import Result

# speeds of a curve; ends of the speed range, over the slowest and the fastest operating point; steps of bisection
SPEEDS = 120
_SLOWEST, _FASTEST = 0.3, 1.25
_HALVINGS = 10


@dataclass(frozen=True)
class Critical:
    """Crank speed at which an order meets a natural frequency.

    Attributes
    ----------
    speed
        Crank speed [rad/s].
    mode
        Number of the mode among those that the order meets; 1 is the lowest.
    vector_sum
        Vector sum of this order and mode (V6).
    is_main
        True if the vector sum is the same for every firing order.
    torque
        Largest amplitude of this order in any section at that speed [N m]; None without damping.
    """

    speed: float
    order: float
    mode: int
    vector_sum: float
    is_main: bool
    torque: float | None


@dataclass(frozen=True)
class Barred:
    """Range of crank speeds in which a limit is exceeded [rad/s]."""

    limit: str
    lowest: float
    highest: float


@dataclass(frozen=True, eq=False)
class TorsionFacts:
    """Torsional vibration of one design in numbers, for reports: modes, vector sums and critical speeds.

    Attributes
    ----------
    modes
        Modes at the highest operating speed, which sets the stiffness of pendulums.
    orders, met, sums
        Orders up to the highest that counts, the modes that each meets, and their vector sums.
    main
        Main orders among them.
    criticals
        Critical speeds in the speed range, the largest torque first.
    """

    modes: TorsionalModes
    orders: tuple[float, ...]
    met: tuple[TorsionalModes, ...]
    sums: tuple[Array, ...]
    main: tuple[float, ...]
    criticals: tuple[Critical, ...]


def is_twisted(result: Result) -> bool:
    """Return True if the crankshaft of this result has discs and shafts."""
    return has_torsion(result.problem.engine, result.problem.fidelity)


def speed_range(result: Result) -> tuple[float, float]:
    """Return the speed range of tables and pictures [rad/s]: of the file, or around the operating points."""
    limits = chain_of(result.final.engine).speeds
    speeds = [point.speed for point in result.problem.points]
    return limits or (_SLOWEST * min(speeds), _FASTEST * max(speeds))


@lru_cache(maxsize=8)
def facts_of(design: Evaluation, low: float, high: float) -> TorsionFacts:
    """Return modes, vector sums, and the critical speeds between two crank speeds [rad/s]."""
    engine, chain = design.engine, chain_of(design.engine)
    fastest = max((loads.point for loads in design.loads), key=lambda point: point.speed)
    modes, turns = natural_modes(chain, fastest.speed), engine.cycle.turns
    orders = tuple(k / turns for k in range(1, int(HIGHEST * turns) + 1))
    met = tuple(critical_modes(chain, order) for order in orders)
    sums = tuple(vector_sums(engine, [order], modes_at)[0] for order, modes_at in zip(orders, met, strict=True))
    main, criticals = main_orders(engine, HIGHEST), []
    for order, modes_at, weights in zip(orders, met, sums, strict=True):
        for m, (frequency, weight) in enumerate(zip(modes_at.frequencies, weights, strict=True)):
            speed, torque = critical_speed(float(frequency), order), None
            if low <= speed <= high:
                torques = throw_torques(engine, replace(fastest, speed=speed), design.fidelity).at(order)
                # without damping the torque has no bound
                with suppress(ModelError):
                    flexible = receptances(chain, np.array([order]), speed)[0]
                    stiff = section_stiffness(chain, np.array([order]), speed)[0]
                    torque = float(np.abs(stiff * (flexible @ torques)).max())
                criticals.append(Critical(speed, order, m + 1, float(weight), order in main, torque))
    criticals.sort(key=lambda entry: -np.inf if entry.torque is None else -entry.torque)
    return TorsionFacts(modes, orders, met, sums, main, tuple(criticals))


def speeds_between(design: Evaluation, low: float, high: float) -> Array:
    """Return equally spaced crank speeds [rad/s] and the critical speeds between two speeds."""
    critical = [entry.speed for entry in facts_of(design, low, high).criticals]
    return np.unique([*np.linspace(low, high, SPEEDS), *critical])


def torque_over_speed(design: Evaluation, speeds: Array) -> Array:
    """Return half the peak to peak torque of each shaft section at crank speeds [N m], shape (speeds, sections).

    The load is that of the operating point with the largest mean torque.
    """
    points = [loads.point for loads in design.loads]
    means = [throw_torques(design.engine, point, design.fidelity).coefficients[0].real.sum() for point in points]
    point = points[int(np.argmax(means))]
    torques = np.full((len(speeds), len(chain_of(design.engine).sections)), np.inf)
    for k, speed in enumerate(speeds):
        try:
            torque = shaft_torque(design.engine, replace(point, speed=float(speed)), design.fidelity)
        except ModelError:
            continue
        torques[k] = 0.5 * np.ptp(torque.sample(design.samples), axis=0)
    return torques


def barred_ranges(result: Result, design: Evaluation) -> tuple[Barred, ...]:
    """Return the speed ranges in which the design breaks a limit on twist, torque or stress; ends by bisection."""
    return _barred(design, result.problem.limits, *speed_range(result))


@lru_cache(maxsize=8)
def _barred(design: Evaluation, limits: tuple[Limit, ...], low: float, high: float) -> tuple[Barred, ...]:
    barred = []
    for limit in limits:
        if limit.measure.channel in FACTORS:
            ranges = _ranges(_exceeds(design, limit), speeds_between(design, low, high))
            barred += [Barred(limit.name, *ends) for ends in ranges]
    return tuple(barred)


def _exceeds(design: Evaluation, limit: Limit) -> Callable[[float], bool]:
    """Return a function that tests at a speed [rad/s] if the limit is broken, for the load of any of its points."""
    counted = [load for load in design.loads if limit.measure.includes_point(load.point)]
    # operating points that differ in speed alone count as one
    loads = {load.point.gas: load for load in counted}.values()

    def at(speed: float) -> bool:
        for load in loads:
            point = replace(load.point, speed=speed)
            try:
                moved = PointLoads(point, load.wrench, None, None, design.engine, design.fidelity)
                signals = [limit.measure.load.signal(moved)]
            except ModelError:
                return True
            measure = replace(limit.measure, points=None)
            if load_rows(measure, [point], signals, design.engine, design.samples).value > limit.maximum:
                return True
        return False

    return at


def _ranges(is_barred: Callable[[float], bool], speeds: Array) -> list[tuple[float, float]]:
    state = [is_barred(float(speed)) for speed in speeds]
    ends = [float(speeds[0])] if state[0] else []
    for k in range(1, len(speeds)):
        if state[k] != state[k - 1]:
            edge = bisect_property(
                lambda speed, was=state[k - 1]: is_barred(speed) == was,  # type: ignore[misc]
                float(speeds[k - 1]), float(speeds[k]), _HALVINGS,
            )  # fmt: skip
            ends.append(edge[0] if state[k] else edge[1])
    ends += [float(speeds[-1])] if state[-1] else []
    return list(zip(ends[::2], ends[1::2], strict=True))
