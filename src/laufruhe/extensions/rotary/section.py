"""Chambers of rotors as a file of numbers."""

from __future__ import annotations

import math

import numpy as np

from laufruhe.extensions.rotary.chambers import rotor_chambers, rotors_of
from laufruhe.present.tables import Table
from laufruhe.problem.curves import STEPS
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result


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
