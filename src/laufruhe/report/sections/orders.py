"""Table of load amplitudes by order, initial and final."""

from __future__ import annotations

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.present.measures import (
    evaluations_with_loads,
    hardest_point,
    has_loads,
    has_mounts,
    moment_orders,
    mount_orders,
    pad_orders,
    shaking_orders,
)
from laufruhe.present.numbers import aligned
from laufruhe.present.tables import Table
from laufruhe.problem.loads import PointLoads
from laufruhe.solvers.result import Result

MAX_ORDERS = 8
SHARE = 0.005


def tables(result: Result) -> list[Table]:
    """Return the orders above a small share of the largest, at the hardest operating point."""
    if not has_loads(result):
        return []
    k, designs = hardest_point(result), evaluations_with_loads(result)
    pairs = zip(*(_columns(design.loads[k]) for design in designs), strict=True)
    series = [column for pair in pairs for column in pair]
    length = max(len(column) for column in series)
    table = np.stack([pad_orders(column, length) for column in series], axis=1)
    # a quantity has one scale, before and after
    scale = np.repeat(table.max(axis=0).reshape(-1, len(designs)).max(axis=1), len(designs))
    weight = (table / np.where(scale > 0.0, scale, 1.0)).max(axis=1)
    present = np.flatnonzero(weight > SHARE)
    largest = sorted(sorted(present, key=lambda j: -weight[j])[:MAX_ORDERS])
    base = float(result.initial.loads[k].wrench.base)
    cells = ([aligned(value, top) for value, top in zip(table[j], scale, strict=True)] for j in largest)
    rows = tuple((f"{j * base:g}", *row) for j, row in zip(largest, cells, strict=True))
    names = ("mount force", "shaking force", "roll moment", "rocking couple")[0 if has_mounts(result) else 1 :]
    sides = ("",) if len(designs) == 1 else (", initial", ", final")
    head = ("order", *(f"{name}{side}" for name in names for side in sides))
    selection = f"the largest {MAX_ORDERS} of {len(present)} orders" if len(present) > len(largest) else "all orders"
    note = f"Amplitudes: {selection} with at least {100.0 * SHARE:g} % of the maximum. result.json has every order."
    return [Table(head, rows, title=f"Orders at {result.problem.points[k].name} [N, N m]", note=note)]


def _columns(loads: PointLoads) -> list[Array]:
    shaking = [shaking_orders(loads.wrench)[0], *moment_orders(loads.wrench)]
    return shaking if loads.mount_forces is None else [mount_orders(loads.mount_forces).mean(axis=1), *shaking]
