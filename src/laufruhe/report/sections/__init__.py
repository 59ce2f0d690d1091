"""Sections of a result's report, a module each with a function `tables`."""

from __future__ import annotations

from laufruhe.present.tables import Table
from laufruhe.report.section import EXTENSION_SECTIONS
from laufruhe.report.sections import (
    decisions,
    limits,
    load_cases,
    modes,
    mounts,
    orders,
    ranks,
    reach,
    stars,
    torque,
    weights,
)
from laufruhe.solvers.result import Result

SECTIONS = (
    reach, stars, ranks, decisions, weights, limits, mounts, torque, modes, load_cases,
    orders,
)  # fmt: skip


def tables_of(result: Result) -> list[Table]:
    """Return the tables of a result, in the order of a report."""
    core = [section.tables(result) for section in SECTIONS]
    added = [section.tables(result) for section in EXTENSION_SECTIONS.values() if section.applies(result)]
    return [grid for grids in (*core, *added) for grid in grids if grid.rows]
