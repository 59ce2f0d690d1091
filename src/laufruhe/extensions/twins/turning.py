"""Forces and couples of a twin, divided into parts that turn forward and backward."""

from __future__ import annotations

import cmath
import math
from typing import TypeAlias

import numpy as np

from laufruhe.machine import Engine
from laufruhe.physics.rigid_body import turning_parts
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.present.measures import designs_with_loads, hardest_point, has_loads
from laufruhe.present.pictures import ResultPicture
from laufruhe.present.tables import Table
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result

PICTURE = ResultPicture(
    "twins",
    "Firings of a twin, and the parts of its first and second order that turn forward and backward.",
    "laufruhe.extensions.twins.picture",
)
ORDERS = {1: "primary", 2: "secondary"}
KINDS = {"force": ((1, 2), "N"), "couple": ((4, 5), "N m")}
"""Lateral and vertical columns of the wrench, and unit."""
NEXT_TO_NOTHING = 1e-6
Parts: TypeAlias = dict[tuple[str, int], tuple[complex, complex]]


def is_twin(result: Result) -> bool:
    """Return True for a twin: an engine of two cylinders with loads of first or second order."""
    engine = result.final.engine
    if len(engine.cylinders) != 2 or not has_loads(result):
        return False
    k = hardest_point(result)
    initial, final = (
        abs(np.array([*parts_of(result, design_engine, k).values()]))
        for design_engine in (result.initial.engine, engine)
    )
    return bool(final.max() > NEXT_TO_NOTHING * max(initial.max(), final.max()))


def parts_of(result: Result, engine: Engine, k: int) -> Parts:
    """Return the parts of force and couple that turn forward and backward, by order, at an operating point."""
    wrench = shaking_loads(engine, result.problem.points[k], result.problem.fidelity)
    return {
        (kind, order): turning_parts(*wrench.at(order)[list(columns)])
        for kind, (columns, _) in KINDS.items()
        for order in ORDERS
    }


def _turning(result: Result) -> Table:
    rows = [
        [name, point.name, kind, order, abs(forward), math.degrees(cmath.phase(forward)), abs(backward),
         math.degrees(cmath.phase(backward)), KINDS[kind][1]]
        for name, design in designs_with_loads(result).items()
        for k, point in enumerate(result.problem.points)
        for (kind, order), (forward, backward) in parts_of(result, design.engine, k).items()
    ]  # fmt: skip
    head = ["design", "point", "load", "order", "forward", "forward angle [deg]", "backward", "backward angle [deg]",
            "unit"]  # fmt: skip
    return Table(head, rows)


SECTION = Section("twins", is_twin, number_tables={"turning-parts": (is_twin, _turning)})
