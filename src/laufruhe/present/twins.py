"""What turns forward and backward of the first and second order of a twin."""

from __future__ import annotations

from typing import TypeAlias

from laufruhe.machine import Engine
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.wrench import turning_parts
from laufruhe.present.measures import has_loads
from laufruhe.solvers.result import Result

ORDERS = {1: "primary", 2: "secondary"}
KINDS = {"force": ((1, 2), "N"), "couple": ((4, 5), "N m")}
"""Lateral and vertical columns of the wrench, and unit."""
Parts: TypeAlias = dict[tuple[str, int], tuple[complex, complex]]


def is_twin(result: Result) -> bool:
    """Whether two cylinders fire, and the loads are known."""
    return len(result.final.engine.cylinders) == 2 and has_loads(result)


def parts_of(result: Result, engine: Engine, k: int) -> Parts:
    """Forward and backward part of force and couple of every order at an operating point."""
    wrench = shaking_loads(engine, result.problem.points[k], result.problem.fidelity)
    return {
        (kind, order): turning_parts(*wrench.at(order)[list(columns)])
        for kind, (columns, _) in KINDS.items()
        for order in ORDERS
    }
