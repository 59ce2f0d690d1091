"""[[measurements]] of a problem file, and the files of orders that they name."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, cast

import numpy as np

from laufruhe import units
from laufruhe.errors import Complaint, ModelError
from laufruhe.extensions.identification.measurement import Measurement
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, nearest, require_distinct, si_value
from laufruhe.files.csv_rows import MAX_ROWS, named_columns, table_of, take_complex
from laufruhe.files.fields import Table
from laufruhe.files.problem_file import ExtensionContext, Key
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.problem.channels import CHANNELS, LoadChannel
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem

SAME_SPEED = 0.01
"""Largest relative difference of a measured speed from that of its operating point."""


class MeasurementTable(Table):
    """Orders that were measured in one run, to identify the open numbers of the file."""

    file: str = f.required("File with one row for each order: order, speed, and the amplitudes by place and direction.")
    quantity: str = f.optional("Load that was measured, such as mount force or receiver acceleration.", "mount force")
    unit: str | None = f.optional("Unit of the amplitudes; by default the SI unit of the quantity.")
    amplitude: Literal["peak", "rms"] = f.optional("What the amplitudes of the file are.", "peak")
    deviation: str | float | None = f.optional(
        "Standard deviation of the real and the imaginary part of an amplitude; by default it is estimated."
    )
    values: dict[str, str | float] = f.optional(
        "Numbers of the engine that differ in this run, such as a trial weight.", {}
    )


def _read(tables: list[MeasurementTable], problem: Problem, context: ExtensionContext) -> Problem:
    # measurements change nothing of the engine; the command reads them
    require_distinct([(table.file, table.quantity) for table in tables], "measurements", "measurements are the same")
    for k, table in enumerate(tables, 1):
        _channel(table, f"measurements[{k}]")
        if not (context.folder / table.file).is_file():
            raise Refused(f"measurements[{k}].file", table.file, "does not exist", "give a file beside the problem")
    rule, remedy = "are used by laufruhe identify alone", "remove them to design the engine"
    return replace(problem, warnings=(*problem.warnings, Complaint("measurements", "", rule, remedy)))


def _channel(table: MeasurementTable, where: str) -> LoadChannel:
    loads = {name: cast(LoadChannel, channel) for name, channel in CHANNELS.items() if channel.is_load}
    channel = loads.get(table.quantity)
    if channel is None:
        raise Refused(f"{where}.quantity", table.quantity, "is no load", nearest(table.quantity, list(loads)))
    return channel


def measurements_of(problem: Problem, tables: list[MeasurementTable], folder: Path) -> list[Measurement]:
    """Return the measurements of a file; raise `Refused` for one that cannot be read.

    Parameters
    ----------
    problem
        Problem of the file.
    tables
        Tables [[measurements]] of the file.
    folder
        Folder of the file.
    """
    return [_measurement(problem, table, folder, f"measurements[{k}]") for k, table in enumerate(tables, 1)]


def _measurement(problem: Problem, table: MeasurementTable, folder: Path, where: str) -> Measurement:
    channel, at = _channel(table, where), f"{where}.file"
    if not channel.needs.of(problem.engine):
        raise Refused(f"{where}.quantity", table.quantity, f"needs {channel.needs.what}", channel.needs.remedy)
    deviation = None if table.deviation is None else si_value(table.deviation, channel.unit, f"{where}.deviation")
    if deviation is not None and deviation <= 0.0:
        raise Refused(f"{where}.deviation", str(table.deviation), "must be more than 0", "leave it out if unknown")
    run = problem.with_values(table.values) if table.values else problem
    if [decision.name for decision in run.decisions] != [decision.name for decision in problem.decisions]:
        raise Refused(f"{where}.values", None, "fix an open number", "give other numbers, such as a trial weight")
    numbers = table_of(table.file, folder / table.file, at)
    if not any(numbers.names) or not 1 <= len(numbers.lines) <= MAX_ROWS:
        rule = f"has no headings, no rows, or more than {MAX_ROWS}"
        raise Refused(at, table.file, rule, "write a heading and rows of numbers")
    columns = named_columns(table.file, numbers, at)
    factor = _unit_factor(table, channel, numbers.names, where) * (math.sqrt(2.0) if table.amplitude == "rms" else 1.0)
    orders = columns.pop("order", None)
    if orders is None or not np.all(orders > 0.0):
        raise Refused(at, table.file, "has no column 'order' with orders above 0", "add it: multiples of crank speed")
    points = _points(run, columns.pop("speed", None), len(orders), table.file, at)
    values, names = _amplitudes(run, channel, columns, len(orders))
    if columns or np.isnan(values).all():
        stray = f"has a column '{next(iter(columns))}' of unknown meaning" if columns else "has no amplitude"
        remedy = f"name columns as '{names[-1]} amplitude' and '{names[-1]} phase [deg]', or as real and imaginary"
        raise Refused(at, table.file, stray, remedy)
    directions = values.shape[2]
    named = tuple(tuple(names[k : k + directions]) for k in range(0, len(names), directions))
    return Measurement(table.file, run, channel, points, tuple(orders.tolist()), factor * values, deviation, named)


def _unit_factor(table: MeasurementTable, channel: LoadChannel, headings: Sequence[str], where: str) -> float:
    """Return the factor of amplitudes to SI: by the key `unit`, or by the unit that all headings have."""
    of_loads = [name for name in headings if not re.match(r"\s*(order|speed)\b|.*\bphase\b", name, re.IGNORECASE)]
    texts = [text for name in of_loads for text in re.findall(r"[\[(](.+?)[\])]", name)]
    # "m/s2" is "m/s^2"
    units_of_headings = dict.fromkeys(re.sub(r"(?<=[a-z])([23])$", r"^\1", text.strip()) for text in texts)
    if len(units_of_headings) > 1:
        raise Refused(f"{where}.file", table.file, "has headings with several units", "give amplitudes one unit")
    heading = next(iter(units_of_headings), None)
    factors = [
        si_value(f"1 {unit}", channel.unit, f"{where}.{key}", unit)
        for key, unit in (("unit", table.unit), ("file", heading))
        if unit is not None
    ]
    if len(factors) == 2 and not math.isclose(*factors):
        raise Refused(f"{where}.unit", table.unit, f"differs from {heading} in the headings", "correct one of them")
    return factors[0] if factors else 1.0


def _points(problem: Problem, speeds: Array | None, rows: int, file: str, where: str) -> tuple[int, ...]:
    known = np.array([point.speed for point in problem.points])
    if speeds is None:
        if len(known) > 1:
            raise Refused(where, file, "has no column 'speed [rpm]'", "add it, because the file has several points")
        return (0,) * rows
    speeds = speeds * units.parse("1 rpm", "rad/s")
    nearest_point = np.argmin(np.abs(known - speeds[:, None]), axis=1)
    wrong = np.flatnonzero(~(np.abs(known[nearest_point] / speeds - 1.0) <= SAME_SPEED))
    if wrong.size:
        text = units.quantity_text(float(speeds[wrong[0]]), "rad/s")
        raise Refused(where, file, f"has {text}, which is no operating point", "add it to [[operating_points]]")
    return tuple(nearest_point.tolist())


def _amplitudes(
    problem: Problem, channel: LoadChannel, columns: dict[str, Array], rows: int
) -> tuple[ComplexArray, list[str]]:
    """Return the amplitudes, shape (rows, places, d), and the names of their columns; those are taken out."""
    try:
        shape = evaluate(problem).signals(channel)[0].coefficients.shape[1:]
    except ModelError as error:
        raise Refused("measurements", None, str(error), "correct the engine") from None
    places = list(channel.places(problem.engine))
    axes = ("",) if shape[1] == 1 else "xyz"[-shape[1] :]
    values, names = np.full((rows, *shape), complex(math.nan, math.nan)), []
    for j, place in enumerate(places or [""] * shape[0]):
        for i, axis in enumerate(axes):
            names.append(f"{place} {axis}".strip())
            column = take_complex(names[-1], columns)
            if column is not None:
                values[:, j, i] = column
    return values, names


MEASUREMENTS = Key("measurements", list[MeasurementTable], _read)
