"""Tables of loads: forces by place, amplitudes by order, and gas pressure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.physics.mount_forces import CycleMeasures
from laufruhe.present.gas_figures import gas_head, gas_note, gas_rows
from laufruhe.present.measures import (
    evaluations_with_loads,
    hardest_point,
    has_loads,
    has_mounts,
    moment_orders,
    mount_orders,
    pad_orders,
    places_of,
    shaking_orders,
)
from laufruhe.present.numbers import DASH, aligned, number, percent
from laufruhe.present.tables import Table
from laufruhe.problem.channels import LoadChannel
from laufruhe.problem.evaluation import place_measures
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Measure
from laufruhe.solvers.result import Result
from laufruhe.units import readable, usual_unit

MAX_ORDERS, SHARE = 8, 0.005


def places(result: Result) -> list[Table]:
    """Return a row per mount, bearing or pin at every operating point, initial and final; a table of each kind."""
    return [_at_places(result, load) for load in places_of(result)]


def _at_places(result: Result, load: LoadChannel) -> Table:
    points, designs = result.problem.points, evaluations_with_loads(result)
    names = load.places(result.problem.engine)
    measures = [
        ((point.name, name) if len(points) > 1 else (name,), by_design)
        for k, point in enumerate(points)
        for name, *by_design in zip(names, *(place_measures(design, k, load) for design in designs), strict=True)
    ]
    largest = max((by_design[0].max for _, by_design in measures), default=0.0)
    unit, factor = readable(load.unit, usual_unit(largest, load.unit))
    scale = factor * largest
    rows = [(*lead, *_cells([values.times(factor) for values in by_design], scale)) for lead, by_design in measures]
    at, first = (
        ("", ("at", load.display.place)) if len(points) > 1 else (f" at {points[0].name}", (load.display.place,))
    )
    note = f"The initial design has no finite loads: {result.initial.resonance}. " if result.initial.resonance else ""
    note = (note + load.display.note(result.problem)).rstrip()
    if load.sums_places:
        sums = [number(factor * design.value(Measure(load))) for design in designs]
        note = f"Sum, mean over the cycle: {' initial, '.join(sums)}{' final' if len(sums) > 1 else ''}."
    two = ("initial mean", "final mean", "change", "initial max", "final max")
    head = (*first, *(two if len(designs) > 1 else ("mean", "max", "rms")))
    return Table(head, rows, title=f"{load.display.title}{at} [{unit}]", note=note, left=len(first))


def _cells(measures: list[CycleMeasures], scale: float) -> list[str]:
    a, b = measures[0], measures[-1]
    if len(measures) == 1:
        return [number(value, scale=scale) for value in (b.mean, b.max, b.rms)]
    change = percent(b.mean / a.mean - 1.0) if a.mean > 1e-9 * scale else DASH
    means, maximum = ([number(value, scale=scale) for value in pair] for pair in ((a.mean, b.mean), (a.max, b.max)))
    return [*means, change, *maximum]


def orders(result: Result) -> list[Table]:
    """Return tables of load amplitudes by order at the operating point with the largest loads.

    Orders below a small share of the largest are left out.
    """
    if not has_loads(result):
        return []
    names = ("mount force", "shaking force", "roll moment", "rocking couple")[0 if has_mounts(result) else 1 :]
    whole = _orders(result, names, _amplitudes, "Orders")
    tables, k = [whole], hardest_point(result)
    wrenches = [design.loads[k].wrench for design in evaluations_with_loads(result)]
    forces = [np.abs(wrench.coefficients[:, 1:3]) for wrench in wrenches]
    # a force that turns, or acts along one axis, is that of the table above
    if any(min(f.max(axis=0).min(), np.ptp(f, axis=1).max()) > SHARE * f.max() for f in forces):
        names = ("horizontal force (y)", "vertical force (z)")
        tables.append(_orders(result, names, partial(_components, 1), "Shaking force by axis"))
    rolling, rocking = (max(float(moment_orders(wrench)[j].max()) for wrench in wrenches) for j in range(2))
    if rocking > SHARE * rolling:
        names = ("pitching, about y", "yawing, about z")
        tables.append(_orders(result, names, partial(_components, 4), "Rocking couple by axis"))
    return tables


def _orders(
    result: Result, names: Sequence[str], amplitudes: Callable[[PointLoads], Sequence[Array]], title: str
) -> Table:
    k, designs = hardest_point(result), evaluations_with_loads(result)
    pairs = zip(*(amplitudes(design.loads[k]) for design in designs), strict=True)
    series = [column for pair in pairs for column in pair]
    length = max(len(column) for column in series)
    units_of_names = [readable("N" if "force" in name else "N m") for name in names]
    factors = np.repeat([factor for _, factor in units_of_names], len(designs))
    table = factors * np.stack([pad_orders(column, length) for column in series], axis=1)
    # a quantity has one scale, before and after
    scale = np.repeat(table.max(axis=0).reshape(-1, len(designs)).max(axis=1), len(designs))
    shares = table / np.where(scale > 0.0, scale, 1.0)
    present = np.flatnonzero(shares.max(axis=1) > SHARE)
    largest = sorted(_ranked(shares)[:MAX_ORDERS])
    base = float(result.initial.loads[k].wrench.base)
    cells = ([aligned(value, top) for value, top in zip(table[j], scale, strict=True)] for j in largest)
    rows = [(f"{j * base:g}", *row) for j, row in zip(largest, cells, strict=True)]
    sides = ("",) if len(designs) == 1 else (", initial", ", final")
    head = ("order", *(f"{name}{side}" for name in names for side in sides))
    selection = "all orders" if len(present) == len(largest) else f"{len(largest)} of {len(present)} orders"
    note = f"Amplitudes: {selection} with at least {100.0 * SHARE:g} % of the maximum"
    note += ". " if len(present) == len(largest) else ", with the largest of every column. "
    note += "orders.csv has every order at every operating point."
    units = ", ".join(dict.fromkeys(unit for unit, _ in units_of_names))
    return Table(head, rows, title=f"{title} at {result.problem.points[k].name} [{units}]", note=note)


def _ranked(shares: Array) -> list[int]:
    # orders by their best place in any column, then by their largest share of a column's maximum
    places = np.argsort(np.argsort(-shares, axis=0, kind="stable"), axis=0)
    best = np.where(shares > SHARE, places, len(shares)).min(axis=1)
    return [int(j) for j in np.lexsort((-shares.max(axis=1), best)) if best[j] < len(shares)]


def _components(first: int, loads: PointLoads) -> list[Array]:
    return [np.abs(loads.wrench.coefficients[:, component]) for component in (first, first + 1)]


def _amplitudes(loads: PointLoads) -> list[Array]:
    shaking = [shaking_orders(loads.wrench)[0], *moment_orders(loads.wrench)]
    return shaking if loads.mount_forces is None else [mount_orders(loads.mount_forces).mean(axis=1), *shaking]


def gas(result: Result) -> list[Table]:
    """Return a row of key figures per operating point with gas."""
    rows, note = gas_rows(result.problem), " ".join(gas_note(result.problem))
    # without friction the last two columns have zeros
    last = None if any(point.fmep for point in result.problem.points) else -2
    head, rows = gas_head()[:last], [row[:last] for row in rows]
    return [Table(head, rows, title="Gas pressure", note=note, file="gas-pressure")]
