"""[load_torque] of a problem file: torque that the driven machine takes over the crank angle (T12)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np

from laufruhe.files import fields as f
from laufruhe.files.complaints import errors_at_key
from laufruhe.files.recorded_file import Column, OverAngleTable, Quantity, RecordedFile, smooth_values
from laufruhe.machine import Cycle, LoadTorque, SliderCrank

TORQUE = Quantity("torque", "N m", "N m", 1.0, "torque of the load")


class LoadTorqueTable(OverAngleTable):
    """Torque of the driven machine over the crank angle, in place of a constant one."""

    records = TORQUE

    torque_column: Annotated[list[Column], f.ListOrSingle(Column)] | None = f.optional(
        "Name or number of the column of torques, or several that are cycles of the machine."
    )
    torque_unit: str | None = f.optional("Unit of the torques, if it is not in the file; N m by default.")
    angle_zero: f.Angle = f.optional(
        "Crank angle at which the file counts zero, after the firing dead centre of cylinder 1.", 0.0
    )


def load_torque_of(
    table: LoadTorqueTable | None, folder: Path, cycle: Cycle, cylinders: Sequence[SliderCrank]
) -> LoadTorque | None:
    """Return the torque of the driven machine; None without [load_torque]."""
    if table is None:
        return None
    where = "load_torque"
    file = RecordedFile(table, folder, where)
    angles, (torques, _) = file.angles(), file.read()
    # a file of one turn, or of one blade, repeats within the cycle
    extent = float(np.ptp(angles) + 0.5 * np.abs(np.median(np.diff(angles))))
    periods = max(round(cycle.angle / extent), 1) if extent else 1
    angles, mean = smooth_values(file, angles, torques, cycle, periods)
    text = f"Load torque {TORQUE.text(mean.min())} to {TORQUE.text(mean.max())}"
    repeated = f", {periods} times in each cycle" if periods > 1 else ""
    file.said.append(f"{text}{repeated}; its mean is replaced by the mean torque of the engine.")
    with errors_at_key(f"{where}.file", table.file):
        # with throws of the file, cylinder 1 does not fire at crank angle zero (C5)
        fires = cylinders[0].firing_angle if cylinders else 0.0
        at = tuple((angles + table.angle_zero + fires).tolist())
        return LoadTorque(at, tuple(mean.tolist()), periods, tuple(file.said))
