"""Report section of the torque of the crankshaft and of the evenness of its speed (T1-T4, T13, T15)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from itertools import starmap
from typing import Any

import numpy as np

from laufruhe.extensions.flywheel.channels import IRREGULARITY
from laufruhe.extensions.flywheel.torque import TorqueFacts, swing_of, torque_facts, torque_parts, turning_torque
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.torque import excess_torque, turning_inertia
from laufruhe.present.measures import has_loads
from laufruhe.present.numbers import DASH, RPM, number
from laufruhe.present.pictures import ResultPicture
from laufruhe.present.tables import Table
from laufruhe.problem.curves import STEPS
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result
from laufruhe.units import readable

NOTE = (
    "Torque of gas, pistons and rods, less the friction of [friction]. Stored: energy that the flywheel must store. "
    "Irregularity: largest less smallest speed over the mean. To turn: largest torque that turns the crank slowly, "
    "without combustion and friction."
)
EVEN = (
    "Speeds at which this flywheel keeps the limit with the same torque of gas and load; the ranges are proven (T13)."
)


def uses_torque(result: Result) -> bool:
    """Return True with a flywheel, or for measures inside the crankcase."""
    problem = result.problem
    is_requested = any(measure.is_inside for measure in problem.measures)
    return is_requested or turning_inertia(result.final.engine, problem.fidelity) is not None


def has_curves(result: Result) -> bool:
    """Return True if the result shows the torque of the crankshaft and has loads."""
    return uses_torque(result) and has_loads(result)


def _point_record(result: Result, k: int) -> Mapping[str, Any]:
    engine, point, fidelity = result.final.engine, result.problem.points[k], result.problem.fidelity
    turning, facts = turning_torque(engine, point, fidelity), asdict(torque_facts(engine, point, fidelity))
    return {"torque": {"least": facts.pop("minimum"), **facts, "turning": turning and asdict(turning)}}


def _tables(result: Result) -> list[Table]:
    """Return a table of the crank's torque by operating point, and the speeds that keep limits."""
    engine, problem = result.final.engine, result.problem
    rows, (unit, factor), (power_unit, _) = [], readable("N m"), readable("W", "kW")
    for point in problem.points:
        cells = _torque_cells(torque_facts(engine, point, problem.fidelity))
        turning = turning_torque(engine, point, problem.fidelity)
        rows.append((point.name, *cells, DASH if turning is None else number(factor * turning.torque)))
    head = (
        "at", f"mean [{unit}]", f"power [{power_unit}]", f"least [{unit}]", f"largest [{unit}]", "stored [J]",
        "irregularity", f"to turn [{unit}]",
    )  # fmt: skip
    return [
        Table(head, rows, title="Torque of the crankshaft", note=NOTE, file="crankshaft-torque"),
        *_even_speeds(result),
    ]


def _even_speeds(result: Result) -> list[Table]:
    """Return the speeds that keep a limit on the degree of irregularity, by limit and operating point."""
    engine, fidelity = result.final.engine, result.problem.fidelity
    inertia = turning_inertia(engine, fidelity)
    rows = []
    for limit in result.problem.limits:
        for point in result.problem.points:
            if limit.measure.channel is IRREGULARITY and inertia is not None and limit.measure.includes_point(point):
                ranges = swing_of(engine, point, fidelity).speed_ranges(limit.maximum, inertia)
                rows.append((limit.name, point.name, "; ".join(starmap(_range_text, ranges)) or DASH))
    head = ("limit", "gas and load of", "speeds [rpm]")
    return [Table(head, rows, title="Speeds that keep the limit", note=EVEN, file="even-speeds")] if rows else []


def _range_text(low: float, high: float) -> str:
    if math.isinf(high):
        return f"from {number(low * RPM, 5)}" if low else "all"
    return f"{number(low * RPM, 5)} to {number(high * RPM, 5)}"


def _torque_cells(facts: TorqueFacts) -> list[str]:
    factor, of_power = readable("N m")[1], readable("W", "kW")[1]
    size, uneven = factor * max(abs(facts.minimum), abs(facts.largest)), facts.irregularity
    values = factor * facts.mean, of_power * facts.power, factor * facts.minimum, factor * facts.largest
    numbers = [number(value, scale=size) for value in values]
    even = DASH if uneven is None else "0" if not uneven else f"{number(uneven, 3)} (1/{1.0 / uneven:.4g})"
    return [*numbers, number(facts.excursion), even]


def _curves(result: Result) -> Table:
    points, fidelity = result.problem.points, result.problem.fidelity
    angles = result.final.engine.cycle.angle * np.arange(STEPS) / STEPS
    columns_by_point = [
        {f"{name}: {column}": values for name, design in result.designs.items()
         for column, values in _torques(design.engine, point, fidelity, angles).items()}
        for point in points
    ]  # fmt: skip
    # an operating point may lack gas
    names = list(dict.fromkeys(name for columns in columns_by_point for name in columns))
    rows = [
        [point.name, *row]
        for point, columns in zip(points, columns_by_point, strict=True)
        for row in np.column_stack([np.degrees(angles), *(columns.get(name, 0.0 * angles) for name in names)]).tolist()
    ]
    return Table(["point", "angle [deg]", *names], rows)


def _torques(engine: Engine, point: OperatingPoint, fidelity: Fidelity, angles: Array) -> dict[str, Array]:
    # a crank that would stop has no speed
    parts = torque_parts(engine, point, fidelity)
    work = excess_torque(engine, point, fidelity).integral.values(angles)
    columns = {f"torque of {part} [N m]": torque.values(angles) for part, torque in parts.items()}
    columns["work stored [J]"] = work - work.min()
    swing, inertia = swing_of(engine, point, fidelity), turning_inertia(engine, fidelity)
    if inertia is not None and swing.irregularity(inertia) <= 1.0:
        speeds = RPM * swing.speeds(inertia)[: len(swing.work)]
        speed_angles = engine.cycle.angle * np.arange(len(speeds)) / len(speeds)
        columns["speed [rpm]"] = np.interp(angles, speed_angles, speeds, period=engine.cycle.angle)
    return columns


SECTION = Section(
    "torque", uses_torque, _tables, point_record=_point_record, printed=("crankshaft-torque", "even-speeds"),
    number_tables={"torque": (has_curves, _curves)},
)  # fmt: skip
TORQUE = ResultPicture(
    "torque",
    "Torque of gas, pistons and rods, its work and orders, and the crank speed with the flywheel.",
    "laufruhe.extensions.flywheel.picture",
)
