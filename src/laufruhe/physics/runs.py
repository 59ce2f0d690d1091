"""Run-up and shut-down of a design under its own loads (E28)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Literal

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint, Run
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import ElasticMounting, elastic_mounting
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.linear_run import Response, Sweep
from laufruhe.physics.run_up import LEAST_STEPS, MOST_STEPS, STEPS_PER_PERIOD, RunUp, run_through
from laufruhe.physics.speed_map import split_loads
from laufruhe.physics.stopped_run import responses_to
from laufruhe.physics.time_model import time_model

HIGHEST = 12.0
"""Last order of the loads that is followed: those beyond shake the block by less than what the steps leave open."""
STRETCHES, FOLLOWED, RESOLVED = 60, 1e-4, 1e-6
MOST_SWINGS = 2e3
COARSEST = 4.0
"""Times as long as usual that steps may be."""


def point_of(run: Run, points: Sequence[OperatingPoint]) -> OperatingPoint:
    """The operating point whose gas drives the engine meanwhile."""
    named = [point for point in points if point.name == run.point]
    return named[0] if named else min(points, key=lambda point: point.speed)


def runs_of(engine: Engine, point: OperatingPoint, fidelity: Fidelity, run: Run) -> tuple[RunUp, RunUp]:
    """Up and down, under the inertia loads of every speed and the gas of one operating point.

    Raises
    ------
    ModelError
        If the engine stands on no elastic mounts.
    """
    return _found_runs(replace(engine, bearings=(), flywheel=None, extras=(), run=None), point, fidelity, run)


@lru_cache(maxsize=32)
def _found_runs(engine: Engine, point: OperatingPoint, fidelity: Fidelity, run: Run) -> tuple[RunUp, RunUp]:
    mounting, driven = _elastic(engine), replace(engine, block=None, mounts=())

    def through(first: float, last: float, seconds: float) -> RunUp:
        sweep = sweep_of(first, last, seconds)
        if sweep is not None:
            (response,) = responses_to([time_model(mounting)], sweep, [_wrenches(sweep, driven, point, fidelity)])
            if response is not None:
                return _envelope(response, first, last)
        # a mode that swings a million times in a run is followed, not resolved
        stiff = seconds * mounting.modes.frequencies[-1] > MOST_SWINGS
        followed: tuple[Literal["DOP853", "Radau"], float] = ("Radau", FOLLOWED) if stiff else ("DOP853", RESOLVED)
        return run_through(mounting, *_loads(driven, point, fidelity), first, last, seconds, STRETCHES, *followed)

    return through(0.0, run.speed, run.up), through(run.speed, 0.0, run.down)


def sweep_of(first: float, last: float, seconds: float, coarser: int = 1) -> Sweep | None:
    """Equal steps of a run, so many times as long as they are for the last word; None where these are too many."""
    fastest = max(first, last) * HIGHEST
    wanted = STEPS_PER_PERIOD * fastest * (seconds / STRETCHES) / math.tau
    if wanted > COARSEST * MOST_STEPS:
        return None
    count = STRETCHES * max(int(min(max(wanted + 1.0, LEAST_STEPS), MOST_STEPS)) // coarser, LEAST_STEPS)
    return Sweep(first, (last - first) / seconds, seconds / count, count)


def missed_share(run: Run) -> float:
    """Share of a largest value that may stand between steps, of motion without orders beyond the highest (E28)."""
    wanted = STEPS_PER_PERIOD * run.speed * HIGHEST * (max(run.up, run.down) / STRETCHES) / math.tau
    steps = STEPS_PER_PERIOD * min(1.0, MOST_STEPS / wanted)
    return 1.0 / math.cos(math.pi / steps) - 1.0 if steps > 2.0 else math.inf


def _elastic(engine: Engine) -> ElasticMounting:
    if engine.block is None:
        raise ModelError("a run-up through resonance needs elastic mounts")
    return elastic_mounting(engine.block, engine.mounts)


def run_loads(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> tuple[Spectrum, Spectrum | None]:
    """Wrench of inertia per square of crank speed, and that of the gas, of the orders that a run follows (E28)."""
    inertia, gas = split_loads(engine, point, fidelity)
    return inertia.kept(HIGHEST), None if gas is None else gas.kept(HIGHEST)


# what stands on other mounts is driven by the same loads
_loads = lru_cache(maxsize=8)(run_loads)


@lru_cache(maxsize=8)
def _wrenches(sweep: Sweep, engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Array:
    parts = [part for part in _loads(engine, point, fidelity) if part is not None]
    return sweep.wrenches([(part.orders, part.coefficients) for part in parts])


def _envelope(response: Response, first: float, last: float) -> RunUp:
    signals = (response.force, response.travel, response.twist)
    edges = np.arange(0, len(response.twist), (len(response.twist) - 1) // STRETCHES)
    sizes = [np.linalg.norm(signal, axis=-1).max(axis=-1) for signal in signals]
    most = [np.array([own[a : b + 1].max() for a, b in itertools.pairwise(edges)]) for own in sizes]
    speeds = first + (last - first) * edges[1:] / edges[-1]
    return RunUp(speeds, *most)
