"""Sections of a result's report: functions that return tables, in the order of the report."""

from __future__ import annotations

from laufruhe.present.tables import Table
from laufruhe.report.section import EXTENSION_SECTIONS
from laufruhe.report.sections import elastic, loads, stars, values, weights
from laufruhe.solvers.result import Result

SECTIONS = (
    values.attainable, stars.crank_stars, values.objectives, values.decisions, weights.weights, weights.shafts,
    weights.factors, values.limits, loads.places, loads.gas, elastic.modes, elastic.load_cases, loads.orders,
)  # fmt: skip


def tables_of(result: Result) -> list[Table]:
    """Return the tables of a result, in the order of a report."""
    result = result.at_own_points
    core = [tables(result) for tables in SECTIONS]
    added = [section.tables(result) for section in EXTENSION_SECTIONS.values() if section.applies(result)]
    return [grid for grids in (*core, *added) for grid in grids if grid.rows]
