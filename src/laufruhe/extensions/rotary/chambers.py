"""Working chambers of a rotor: their numbers for the picture, and the file of numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.machine import Engine, OperatingPoint, SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.physics.cylinder_volume import chamber_volume
from laufruhe.physics.gas_cycle import thrust_at
from laufruhe.physics.gas_loads import chamber_torque
from laufruhe.present.pictures import ResultPicture
from laufruhe.present.tables import Table
from laufruhe.problem.curves import STEPS
from laufruhe.problem.problem import Problem
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result

PICTURE = ResultPicture(
    "chambers",
    "Volume, pressure and torque of each chamber of a rotor over three turns of the shaft.",
    "laufruhe.extensions.rotary.chambers_picture",
)


def rotors_of(engine: Engine) -> Sequence[SliderCrank]:
    """Return the rotors of an engine."""
    return [part for part in engine.slider_cranks if len(part.swept.lags) > 1]


@dataclass(frozen=True)
class RotorChambers:
    """Chambers of one rotor, a row each, over the shaft angles in which each completes its cycle.

    Attributes
    ----------
    volume
        Over the least [m3].
    pressure, torque
        Over the crankcase [Pa], and on the shaft [N m]; None without gas.
    """

    angles: Array
    volume: Array
    pressure: Array | None
    torque: Array | None


def rotor_chambers(problem: Problem, part: SliderCrank, point: OperatingPoint, count: int) -> RotorChambers:
    """Return volume, pressure and torque of every chamber of a rotor (Y3, Y4)."""
    gas, lags = problem.fidelity.gas_of(point), part.swept.lags
    turns = math.tau * len(lags)
    angles = np.linspace(0.0, turns, count)
    since = [np.mod(angles - lag, turns) for lag in lags]
    volume = np.array([chamber_volume(part, angle) for angle in since])
    if gas is None:
        return RotorChambers(angles, volume, None, None)
    cycle = problem.engine.cycle
    pressure = np.array([-thrust_at(gas, part, cycle, angle) / part.piston_area for angle in since])
    return RotorChambers(
        angles, volume, pressure, np.array([chamber_torque(gas, part, cycle, angle) for angle in since])
    )


def _chambers(result: Result) -> Table:
    """Return volume, pressure and torque of every chamber of every rotor, of the final design."""
    rows = []
    for point in result.problem.points:
        for part in rotors_of(result.final.engine):
            chambers = rotor_chambers(result.problem, part, point, STEPS * len(part.swept.lags) + 1)
            undefined = np.full_like(chambers.volume, math.nan)
            pressure, torque = (
                undefined if quantity is None else quantity for quantity in (chambers.pressure, chambers.torque)
            )
            for k, columns in enumerate(zip(chambers.volume, pressure, torque, strict=True)):
                values = np.column_stack([np.degrees(chambers.angles), *columns]).tolist()
                rows += [[point.name, part.name, k + 1, *row] for row in values]
    head = ["point", "rotor", "chamber", "angle [deg]", "volume over the least [m^3]",
            "pressure over the crankcase [Pa]", "torque [N m]"]  # fmt: skip
    return Table(head, rows)


def _has_rotors(result: Result) -> bool:
    return bool(rotors_of(result.final.engine))


SECTION = Section("rotary", _has_rotors, number_tables={"chambers": (_has_rotors, _chambers)})
