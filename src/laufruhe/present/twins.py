"""What turns forward and backward of the first and second order of a twin."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from laufruhe.machine import Engine
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.wrench import turning_parts
from laufruhe.present.measures import hardest_point, has_loads
from laufruhe.solvers.result import Result

ORDERS = {1: "primary", 2: "secondary"}
KINDS = {"force": ((1, 2), "N"), "couple": ((4, 5), "N m")}
"""Lateral and vertical columns of the wrench, and unit."""
NEXT_TO_NOTHING = 1e-6
Parts: TypeAlias = dict[tuple[str, int], tuple[complex, complex]]


def is_twin(result: Result) -> bool:
    """Return True for two cylinders with loads of first or second order."""
    engine = result.final.engine
    if len(engine.cylinders) != 2 or not has_loads(result):
        return False
    k = hardest_point(result)
    initial, final = (abs(np.array([*parts_of(result, each, k).values()])) for each in (result.initial.engine, engine))
    return bool(final.max() > NEXT_TO_NOTHING * max(initial.max(), final.max()))


def parts_of(result: Result, engine: Engine, k: int) -> Parts:
    """Return forward and backward part of force and couple by order, at an operating point."""
    wrench = shaking_loads(engine, result.problem.points[k], result.problem.fidelity)
    return {
        (kind, order): turning_parts(*wrench.at(order)[list(columns)])
        for kind, (columns, _) in KINDS.items()
        for order in ORDERS
    }
