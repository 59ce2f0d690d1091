"""Run-up and shut-down of a design under its own loads (E28)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Literal

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint, Run
from laufruhe.physics.elastic_mounts import elastic_mounting
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.run_up import RunUp, run_through
from laufruhe.physics.speed_map import split_loads

HIGHEST = 12.0
"""Last order of the loads that is followed: those beyond shake the block by less than what the steps leave open."""
STRETCHES, TOLERANCE = 60, 1e-4
MOST_SWINGS = 2e3


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
    return _found_runs(replace(engine, bearings=(), flywheel=None, torsion=None, run=None), point, fidelity, run)


@lru_cache(maxsize=32)
def _found_runs(engine: Engine, point: OperatingPoint, fidelity: Fidelity, run: Run) -> tuple[RunUp, RunUp]:
    if engine.block is None:
        raise ModelError("a run-up through resonance needs elastic mounts")
    mounting = elastic_mounting(engine.block, engine.mounts)
    inertia, gas = split_loads(engine, point, fidelity)
    loads = inertia.kept(HIGHEST), None if gas is None else gas.kept(HIGHEST)

    def through(first: float, last: float, seconds: float) -> RunUp:
        # a mode that swings a million times in a run is followed, not resolved
        stiff = seconds * mounting.modes.frequencies[-1] > MOST_SWINGS
        method: Literal["RK45", "Radau"] = "Radau" if stiff else "RK45"
        return run_through(mounting, *loads, first, last, seconds, STRETCHES, method, TOLERANCE)

    return through(0.0, run.speed, run.up), through(run.speed, 0.0, run.down)
