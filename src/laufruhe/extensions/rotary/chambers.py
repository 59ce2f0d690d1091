"""Working chambers of a rotor: their numbers for the picture, and the file of numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from laufruhe.machine import Engine, OperatingPoint, SliderCrank
from laufruhe.machine.gas.charge import chamber_volume
from laufruhe.numerics.arrays import Array
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


def rotor_chambers(problem: Problem, part: SliderCrank, point: OperatingPoint, count: int) -> tuple[Array, Array]:
    """Return shaft angles (n,) in which every chamber completes its cycle, and values (k, chambers, n) (Y3, Y4).

    The values are volume above the least [m3] and, with gas, pressure over the crankcase [Pa] and torque [N m].
    """
    gas, lags, cycle = problem.fidelity.gas_of(point), part.swept.lags, problem.engine.cycle
    turns = math.tau * len(lags)
    angles = np.linspace(0.0, turns, count)
    since = [np.mod(angles - lag, turns) for lag in lags]
    values = [[chamber_volume(part, angle) for angle in since]]
    if gas is not None:
        values.append([-gas.thrust(part, cycle, angle) / part.piston_area for angle in since])
        values.append([chamber_torque(gas, part, cycle, angle) for angle in since])
    return angles, np.array(values)


def _chambers(result: Result) -> Table:
    """Return volume, pressure and torque of every chamber of every rotor, of the final design."""
    rows = []
    for point in result.problem.points:
        for part in rotors_of(result.final.engine):
            angles, values = rotor_chambers(result.problem, part, point, STEPS * len(part.swept.lags) + 1)
            columns = np.full((3, *values.shape[1:]), math.nan)
            columns[: len(values)] = values
            for k, chamber in enumerate(columns.swapaxes(0, 1)):
                numbers = np.column_stack([np.degrees(angles), *chamber]).tolist()
                rows += [[point.name, part.name, k + 1, *row] for row in numbers]
    head = ["point", "rotor", "chamber", "angle [deg]", "volume over the least [m^3]",
            "pressure over the crankcase [Pa]", "torque [N m]"]  # fmt: skip
    return Table(head, rows)


def _has_rotors(result: Result) -> bool:
    return bool(rotors_of(result.final.engine))


SECTION = Section("rotary", _has_rotors, number_tables={"chambers": (_has_rotors, _chambers)})
