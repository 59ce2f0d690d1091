"""Run-up and shut-down of a design under its loads (E28)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Literal

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.run_ups.linear_run import Sweep
from laufruhe.extensions.run_ups.machine import Run
from laufruhe.extensions.run_ups.stopped_run import responses_to
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import ElasticMounting, elastic_mounting
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.speed_map import split_loads
from laufruhe.physics.steady_state import integrated, motion_rates, static_size
from laufruhe.physics.time_model import time_model

HIGHEST = 12.0
"""Highest order of the loads in a run; higher ones move the block by less than the error between steps."""
STRETCHES, FOLLOWED, RESOLVED = 60, 1e-4, 1e-6
"""Intervals of an envelope, and relative tolerances of the integrator for stiff and for other mounts."""
MAX_SWINGS = 2e3
"""Most vibrations of a mode in a run that an explicit integrator resolves."""
COARSEST = 4.0
"""Largest factor by which steps may be longer than usual."""
STEPS_PER_PERIOD = 24
"""Time steps in a period of the highest order at the highest speed."""
MIN_STEPS, MAX_STEPS = 16, 4000
"""Fewest and most steps in an interval of the envelope."""


@dataclass(frozen=True, eq=False)
class RunUp:
    """Envelope of run-up or shut-down through resonance.

    Attributes
    ----------
    speeds
        Crank speed at the end of each interval [rad/s], shape (n,).
    force, travel, twist
        Maximum in the interval: force on any mount [N], travel of any mount [m], roll of the block [rad]; shape (n,).
    """

    speeds: Array
    force: Array
    travel: Array
    twist: Array

    @property
    def worst(self) -> tuple[float, float, float]:
        """Largest force [N], travel [m] and roll [rad] of the run."""
        return float(self.force.max()), float(self.travel.max()), float(self.twist.max())


def point_of(run: Run, points: Sequence[OperatingPoint]) -> OperatingPoint:
    """Return the operating point whose gas drives the run; the slowest by default."""
    named = [point for point in points if point.name == run.point]
    return named[0] if named else min(points, key=lambda point: point.speed)


def runs_of(engine: Engine, point: OperatingPoint, fidelity: Fidelity, run: Run) -> tuple[RunUp, RunUp]:
    """Return run-up and shut-down under the inertia loads of each speed and the gas loads of one operating point.

    Raises
    ------
    ModelError
        If the engine has no elastic mounts.
    """
    return _cached_runs(replace(engine, extras=()), point, fidelity, run)


@lru_cache(maxsize=32)
def _cached_runs(engine: Engine, point: OperatingPoint, fidelity: Fidelity, run: Run) -> tuple[RunUp, RunUp]:
    if engine.block is None:
        raise ModelError("a run-up through resonance needs elastic mounts")
    mounting, engine_alone = elastic_mounting(engine.block, engine.mounts), replace(engine, block=None, mounts=())

    def through(first: float, last: float, seconds: float) -> RunUp:
        sweep = sweep_of(first, last, seconds)
        if sweep is not None:
            (response,) = responses_to([time_model(mounting)], sweep, [_wrenches(sweep, engine_alone, point, fidelity)])
            if response is not None:
                signals = (response.force, response.travel, response.twist)
                edges = np.arange(0, sweep.count + 1, sweep.count // STRETCHES)
                sizes = [np.linalg.norm(signal, axis=-1).max(axis=-1) for signal in signals]
                maximum = [np.array([size[a : b + 1].max() for a, b in pairwise(edges)]) for size in sizes]
                return RunUp(first + (last - first) * edges[1:] / edges[-1], *maximum)
        # modes that vibrate too often for an explicit method need a stiff integrator
        is_stiff = seconds * mounting.modes.frequencies[-1] > MAX_SWINGS
        integrator: tuple[Literal["DOP853", "Radau"], float] = ("Radau", FOLLOWED) if is_stiff else ("DOP853", RESOLVED)
        return run_through(
            mounting, *_loads(engine_alone, point, fidelity), first, last, seconds, STRETCHES, *integrator
        )

    return through(0.0, run.speed, run.up), through(run.speed, 0.0, run.down)


def sweep_of(first: float, last: float, seconds: float, coarser: int = 1) -> Sweep | None:
    """Return equal time steps of a run, `coarser` times as long as in a final evaluation; None if too many."""
    fastest = max(first, last) * HIGHEST
    needed_steps = STEPS_PER_PERIOD * fastest * (seconds / STRETCHES) / math.tau
    if needed_steps > COARSEST * MAX_STEPS:
        return None
    count = STRETCHES * max(int(min(max(needed_steps + 1.0, MIN_STEPS), MAX_STEPS)) // coarser, MIN_STEPS)
    return Sweep(first, (last - first) / seconds, seconds / count, count)


def missed_share(run: Run) -> float:
    """Return the largest relative error of a maximum between steps, for orders up to the highest (E28)."""
    needed_steps = STEPS_PER_PERIOD * run.speed * HIGHEST * (max(run.up, run.down) / STRETCHES) / math.tau
    steps = STEPS_PER_PERIOD * min(1.0, MAX_STEPS / needed_steps)
    return 1.0 / math.cos(math.pi / steps) - 1.0 if steps > 2.0 else math.inf


def run_loads(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> tuple[Spectrum, Spectrum | None]:
    """Return the wrench of inertia per squared crank speed, and of the gas or None, for the orders of a run (E28)."""
    inertia, gas = split_loads(engine, point, fidelity)
    return inertia.truncated(HIGHEST), None if gas is None else gas.truncated(HIGHEST)


# designs with other mounts share the loads
_loads = lru_cache(maxsize=8)(run_loads)


@lru_cache(maxsize=8)
def _wrenches(sweep: Sweep, engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Array:
    parts = [part for part in _loads(engine, point, fidelity) if part is not None]
    return sweep.wrenches([(part.orders, part.coefficients) for part in parts])


def run_through(
    mounting: ElasticMounting,
    inertia: Spectrum,
    gas: Spectrum | None,
    first: float,
    last: float,
    duration: float,
    stretches: int = 200,
    method: Literal["DOP853", "RK45", "Radau"] = "DOP853",
    tolerance: float = 1e-6,
) -> RunUp:
    """Return a run-up or shut-down at constant acceleration, from rest at speed `first`, integrated by SciPy (E28).

    Parameters
    ----------
    inertia
        Wrench per squared crank speed [N s2, N m s2].
    gas
        Wrench that is independent of speed [N, N m]; None for a motored engine.
    first, last
        Crank speeds [rad/s].
    duration
        Time of the run [s].
    stretches
        Count of intervals of the envelope.
    method, tolerance
        Integrator of SciPy, and its relative tolerance.

    Raises
    ------
    ModelError
        If the run has no duration.
    """
    if not duration > 0.0 or first < 0.0 or last < 0.0:
        raise ModelError("a run-up needs a duration and speeds that are not negative")
    model, gain = time_model(mounting), (last - first) / duration
    loads = [(part.orders, part.coefficients @ model.load.T) for part in (inertia, gas) if part is not None]

    def load(t: float) -> Array:
        # the first load is inertia, in proportion to the square of the speed
        speed, angle = first + gain * t, first * t + 0.5 * gain * t * t
        parts = [(np.exp(1j * orders * angle) @ coefficients).real for orders, coefficients in loads]
        return np.asarray(sum(parts[1:], speed * speed * parts[0]))

    rates = motion_rates(model, load)
    fastest = max(first, last) * float(max(orders.max(initial=0.0) for orders, _ in loads))
    state, edges = np.zeros(2 * model.size), np.linspace(0.0, duration, stretches + 1)
    force, travel, twist = np.zeros((3, stretches))
    absolute = 1e-3 * tolerance * static_size(model, loads[0][1] * max(first, last) ** 2)
    count = int(STEPS_PER_PERIOD * fastest * (duration / stretches) / (2.0 * np.pi)) + 1
    for k, (start, end) in enumerate(pairwise(edges)):
        times = np.linspace(start, end, min(max(count, MIN_STEPS), MAX_STEPS))
        states = integrated(rates, (start, end), state, method, t_eval=times, rtol=tolerance, atol=absolute)
        y, rate = np.split(states, 2)
        signals = model.mount_forces(y, rate), model.mount_travels(y)
        force[k], travel[k] = (np.linalg.norm(signal, axis=-1).max() for signal in signals)
        twist[k] = np.abs(model.roll @ y).max()
        state = states[:, -1]
    return RunUp(first + gain * edges[1:], force, travel, twist)
