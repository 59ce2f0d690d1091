"""Tables and curves of a result as numbers: one CSV file each, and a workbook."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

import numpy as np

from laufruhe.machine.mount import every_spring
from laufruhe.physics.willans import FrictionTest
from laufruhe.present.curves import (
    transmissibility_of,
    transmissibility_speeds,
)
from laufruhe.present.measures import (
    designs_with_loads,
    has_loads,
    has_ranking,
    limits_of,
    objective_unit,
    places_of,
    ranking_of,
)
from laufruhe.present.mounting import critical_speed, facts_of, is_elastic
from laufruhe.present.numbers import RPM
from laufruhe.present.tables import Table
from laufruhe.problem.channels import MOUNT_TRAVEL
from laufruhe.problem.curves import STEPS, forces_of, modes_of, orders_with_phases
from laufruhe.problem.evaluation import place_measures
from laufruhe.report import files
from laufruhe.report.section import EXTENSION_SECTIONS, NumberTables
from laufruhe.report.sections import tables_of as printed_tables
from laufruhe.report.table_files import write_book, write_csv
from laufruhe.solvers.result import Result
from laufruhe.solvers.values import DecisionValue, LimitValue
from laufruhe.units import readable

MAX_ROWS = 20 * STEPS


def number_tables(result: Result) -> dict[str, Table]:
    """Return the tables of a result by file name: SI, degrees and rpm where the heads say so, others as printed."""
    groups = [_TABLES, *(section.number_tables for section in EXTENSION_SECTIONS.values())]
    tables = {name: fill(result) for group in groups for name, (applies, fill) in group.items() if applies(result)}
    for printed in printed_tables(result):
        if printed.file:
            head = [printed.head[0] or printed.title, *printed.head[1:]]
            tables[printed.file] = Table(head, [[_as_number(cell) for cell in row] for row in printed.rows])
    return {name: table for name, table in tables.items() if table.rows}


def _as_number(cell: str) -> str | float:
    try:
        return float(cell)
    except ValueError:
        return cell


def _values(entries: Sequence[DecisionValue | LimitValue]) -> Table:
    # both sides of a limit are one cell
    cells = [[" to ".join(map(str, cell)) if isinstance(cell, tuple) else cell for cell in astuple(entry)]
             for entry in entries]  # fmt: skip
    return Table([field.name for entry in entries[:1] for field in fields(entry)], cells)


def _measures(result: Result) -> Table:
    rows = [
        [load.display.title, point.name, design, name, cycle.mean, cycle.max, cycle.rms, load.unit]
        for load in places_of(result)
        for k, point in enumerate(result.problem.points)
        for design, evaluation in designs_with_loads(result).items()
        for name, cycle in zip(
            load.places(evaluation.engine), place_measures(evaluation, k, load), strict=True
        )
    ]  # fmt: skip
    return Table(["quantity", "point", "design", "place", "mean", "maximum", "rms", "unit"], rows)


def _transmissibility(result: Result) -> Table:
    speeds, orders = transmissibility_speeds(result), facts_of(result.final).orders
    columns = [
        (f"{design}, {point.name}: order {orders[k]:g}", curve)
        for design, evaluation in designs_with_loads(result).items()
        for point in result.problem.points
        for k, curve in transmissibility_of(evaluation, point, speeds, orders)
    ]
    rows = np.column_stack([RPM * speeds, *(curve for _, curve in columns)]).tolist() if columns else []
    return Table(["speed [rpm]", *(head for head, _ in columns)], rows)


def _rankings(result: Result) -> Table:
    rows = [
        [rank, star.value, star.lower_bound, star.proven, _degrees(star.throws), ", ".join(star.shafts),
         "-".join(map(str, order.order)), _degrees(order.intervals), order.neighbours, order.roll_content,
         *(free for pair in zip(star.forces, star.couples, strict=True) for free in pair)]
        for rank, star in enumerate(ranking_of(result).ranking, 1)
        for order in star.firing_orders
    ]  # fmt: skip
    unit = result.objective.unit if result.objective else ""
    head = ["rank", f"objective [{unit or '-'}]", f"lower bound [{unit or '-'}]", "proven", "throws [deg]", "shafts",
            "firing order", "intervals [deg]", "neighbours", "roll content"]  # fmt: skip
    for order in ranking_of(result).ranking[0].orders:
        # forces are relative to the force of one throw, couples to that times the spacing
        head += [f"free force of order {order} [-]", f"free couple of order {order} [-]"]
    return Table(head, rows)


def _degrees(angles: Iterable[float]) -> str:
    return " ".join(f"{math.degrees(angle):.6g}" for angle in angles)


def _orders(result: Result) -> Table:
    designs = designs_with_loads(result)
    table = Table.from_fields(orders_with_phases(designs))
    # point, order and the frequency of each design say nothing about the amplitudes
    return Table(table.head, [row for row in table.rows if row[1] == 0.0 or any(row[2 : -len(designs)])])


def _uneven_firing(result: Result) -> Table:
    unit = objective_unit(result) or "-"
    rows = [
        [math.degrees(p.allowed), math.degrees(p.deviation), p.value, p.lower_bound] for p in ranking_of(result).trade
    ]
    return Table(["allowed deviation [deg]", "deviation [deg]", f"objective [{unit}]", f"lower bound [{unit}]"], rows)


def _willans(result: Result) -> Table:
    rows = [row for test in result.problem.friction for row in _test_rows(test)]
    head = ["point", "kind", "brake mean pressure [Pa]", "speed [rpm]", "fuel, as measured", "drag [Pa]",
            "least squares, as measured", "standard deviation [Pa]"]  # fmt: skip
    return Table(head, rows)


def _test_rows(test: FrictionTest) -> Iterator[list[Any]]:
    (intercept, slope), none = test.line, math.nan
    friction = test.friction
    for x, y in zip(test.x, test.y, strict=True):
        places = (none, RPM * x, none, y) if test.is_motored else (x, none, y, none)
        yield [test.at, "measured", *places, intercept + slope * x, none]
    target, line = test.target, intercept + slope * test.target
    yield [test.at, "requested", *((none, RPM * target) if test.is_motored else (target, none)), none, none, line, none]
    friction_row = (none, RPM * target, none, friction.mean) if test.is_motored else (-friction.mean, none, 0.0, none)
    yield [test.at, "friction", *friction_row, line if test.is_motored else 0.0, friction.deviation]


def _mount_criticals(result: Result) -> Table:
    rows = []
    for name, design in designs_with_loads(result).items():
        facts = facts_of(design)
        for j, (mode, frequency) in enumerate(zip(facts.modes.names, facts.modes.frequencies.tolist(), strict=True)):
            rows += [
                [name, j + 1, mode, frequency, j in facts.excited, order, RPM * critical_speed(frequency, order)]
                for order in facts.orders
            ]
    head = ["design", "mode", "name", "natural frequency [Hz]", "excited", "order", "critical speed [rpm]"]
    return Table(head, rows)


def _mounts(result: Result) -> Table:
    (length, millimetres), (per_length, stiffer), rows = readable("m"), readable("N/m"), []
    points = result.problem.points
    for name, design in result.designs.items():
        facts = facts_of(design)
        travels = [place_measures(design, k, MOUNT_TRAVEL) for k in range(len(points))]
        for m, spring in every_spring(design.engine.mounts):
            rows.append([
                name, spring.name, *(millimetres * along for along in spring.position),
                *(stiffer * along for along in spring.stiffness), spring.loss_factor,
                millimetres * float(facts.mount_sag[m]), *(millimetres * travel[m].max for travel in travels),
            ])  # fmt: skip
    head = ["design", "mount", *(f"{axis} [{length}]" for axis in "xyz"),
            *(f"stiffness {axis} [{per_length}]" for axis in "xyz"), "loss factor [-]", f"sag [{length}]",
            *(f"largest travel at {point.name} [{length}]" for point in points)]  # fmt: skip
    return Table(head, rows)


def _mounting(result: Result) -> Table:
    (length, millimetres), rows = readable("m"), []
    for name, design in result.designs.items():
        facts = facts_of(design)
        rows.append([name, millimetres * facts.sag, millimetres * facts.torque_travel, *facts.torque_roll_axis.tolist(),
                     facts.torque_roll_coupling, facts.torque_roll_frequency])  # fmt: skip
    head = ["design", f"sag of the centre of gravity [{length}]", f"largest travel by the mean torque [{length}]",
            *(f"torque-roll axis {axis} [-]" for axis in "xyz"), "torque-roll coupling [-]",
            "torque-roll frequency [Hz]"]  # fmt: skip
    return Table(head, rows)


_TABLES: NumberTables = {
    "decisions": (lambda result: result.decisions, lambda result: _values(result.decisions)),
    "limits": (limits_of, lambda result: _values(limits_of(result))),
    "measures": (places_of, _measures),
    "forces": (
        has_loads,
        lambda result: Table.from_fields(
            forces_of(designs_with_loads(result), max(min(STEPS, MAX_ROWS // len(result.problem.points)), 36))
        ),
    ),
    "orders": (has_loads, _orders),
    "modes": (is_elastic, lambda result: Table.from_fields(modes_of(result.designs))),
    "transmissibility": (is_elastic, _transmissibility),
    "rankings": (has_ranking, _rankings),
    "uneven-firing": (has_ranking, _uneven_firing),
    "willans": (lambda result: result.problem.friction, _willans),
    "mount-critical-speeds": (is_elastic, _mount_criticals),
    "mounts": (is_elastic, _mounts),
    "mounting": (is_elastic, _mounting),
}


def write_tables(result: Result, folder: Path) -> None:
    """Write a CSV file for every table, and a workbook, into an existing folder."""
    tables = number_tables(result.at_own_points)
    for name, table in tables.items():
        write_csv(table, folder / f"{name}.csv")
    if tables:
        write_book(tables, folder / files.BOOK)
