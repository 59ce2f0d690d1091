"""Hydraulic mounts of a problem file: a fluid track, or stiffness that was measured over frequency (E50, E51)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal

import numpy as np

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, blamed_on, measured
from laufruhe.files.csv_rows import rows_of
from laufruhe.files.fields import Table
from laufruhe.machine.dynamic import Dynamic, FluidTrack, MeasuredStiffness

_AXES = ("x", "y", "z")


class FluidTrackTable(Table):
    """The fluid of a hydraulic mount, all referred to its travel by the area of the piston."""

    axis: Literal["x", "y", "z"] = f.told("Own axis of the mount along which it acts.", "z")
    mass: f.PositiveMass = f.needed("Effective mass of the fluid in the track: its inertance times the area squared.")
    bulge_stiffness: f.Stiffness = f.needed("Stiffness of the rubber against swelling: area squared over compliance.")
    chamber_stiffness: f.Stiffness = f.told("Of the lower chamber.", 0.0)
    damping: f.Damping = f.told("Of the flow through the track.", 0.0)


class DynamicStiffnessTable(Table):
    """Complex stiffness along an own axis from a CSV file: frequency, stiffness, and loss or its angle."""

    axis: Literal["x", "y", "z"] = f.told("Own axis of the mount along which it acts.", "z")
    file: str = f.needed("CSV file beside the problem.")
    frequency_unit: str = f.told("Unit of the first column.", "Hz")
    stiffness_unit: str = f.told("Unit of the stiffness.", "N/mm")
    columns: Literal["stiffness and loss", "amount and angle"] = f.told(
        "What follows the frequency: storage and loss stiffness, or its amount and its loss angle in degrees.",
        "amount and angle",
    )


def dynamic_of(
    track: FluidTrackTable | None, told: DynamicStiffnessTable | None, folder: Path, where: str
) -> tuple[Dynamic, ...]:
    """Springs of a mount whose stiffness depends on frequency."""
    found: list[Dynamic] = []
    if track is not None:
        if track.bulge_stiffness == 0.0:
            raise Refused(f"{where}.fluid_track.bulge_stiffness", None, "is zero, and moves no fluid", "give a value")
        axis = _AXES.index(track.axis)
        found.append(FluidTrack(axis, track.mass, track.bulge_stiffness, track.chamber_stiffness, track.damping))
    if told is not None:
        found.append(_measured(told, folder, f"{where}.dynamic_stiffness"))
    return tuple(found)


def _measured(table: DynamicStiffnessTable, folder: Path, where: str) -> MeasuredStiffness:
    hertz = measured(f"1 {table.frequency_unit}", "Hz", f"{where}.frequency_unit", table.frequency_unit)
    unit = measured(f"1 {table.stiffness_unit}", "N/m", f"{where}.stiffness_unit", table.stiffness_unit)
    by_angle = table.columns == "amount and angle"
    names = ("frequency", *(("stiffness", "loss angle") if by_angle else ("stiffness", "loss stiffness")))
    rows = rows_of(table.file, folder / table.file, f"{where}.file", names)
    if len(rows) < 2:
        raise Refused(f"{where}.file", table.file, "has fewer than two rows", "measure more frequencies")
    values = []
    for k, (_, amount, other) in enumerate(rows, 1):
        if by_angle and not 0.0 <= other < 180.0:
            rule = f"has a loss angle of {other:g} deg in row {k}"
            raise Refused(f"{where}.file", table.file, rule, "give it from 0 to 180, or set columns")
        value = amount * np.exp(1j * math.radians(other)) if by_angle else complex(amount, other)
        values.append(complex(unit * value))
    with blamed_on(f"{where}.file", table.file):
        return MeasuredStiffness(
            _AXES.index(table.axis), tuple(math.tau * hertz * row[0] for row in rows), tuple(values)
        )
