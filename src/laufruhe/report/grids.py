"""The tables of a result as text, for the screen and the report alike."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from laufruhe.present.measures import (
    changed,
    hardest_point,
    is_met,
    limits_of,
    load_designs,
    mount_measures,
    mount_orders,
    padded,
    shaking_orders,
)
from laufruhe.present.numbers import DASH, aligned, number, percent, trimmed, with_unit
from laufruhe.report.grid import Grid
from laufruhe.report.mode_grids import mode_grids
from laufruhe.report.ranking import phasing_grids
from laufruhe.solvers.result import DecisionValue, LimitValue, Result
from laufruhe.units import readable

Array = NDArray[np.float64]

ORDERS_SHOWN = 8
ORDER_SHARE = 0.005


def grids_of(result: Result) -> list[Grid]:
    """Every table that this result fills."""
    candidates = [_decisions(result), _limits(result), _mounts(result), *mode_grids(result), _orders(result)]
    return [grid for grid in [*phasing_grids(result), *candidates] if grid.rows]


def _decisions(result: Result) -> Grid:
    unit = result.objective.unit if result.objective else ""
    pairs = pairwise([None, *result.decisions])
    rows = tuple(_decision_row(size, d, unit) for size, d in pairs if d is not None)
    return Grid("Decisions", ("open", "as given", "decided", "bounds", "at bound", "shadow price"), rows)


def _decision_row(before: DecisionValue | None, d: DecisionValue, unit: str) -> tuple[str, ...]:
    name, factor = readable(d.unit)
    bounds = f"{trimmed(d.lower * factor)} to {trimmed(d.upper * factor)} {name}".rstrip()
    is_angle = d.name.endswith(".angle") and before is not None
    if is_angle and before is not None and is_nothing(before):
        return d.name, _given_angle(before, d), DASH, bounds, DASH, DASH
    given = _given_angle(before, d) if is_angle and before is not None else with_unit(d.initial, d.unit)
    scale = max(abs(d.lower), abs(d.upper)) * factor
    value = f"{number(d.value * factor, scale=scale)} {name}".rstrip()
    price = priced(d.shadow_price, unit, d.unit)
    return d.name, given, value, bounds, _bound_mark(d), price


def _given_angle(size: DecisionValue, angle: DecisionValue) -> str:
    return with_unit(angle.initial, angle.unit) if size.initial else DASH


def _bound_mark(d: DecisionValue) -> str:
    if not d.at_bound:
        return DASH
    return "upper" if abs(d.value - d.upper) <= abs(d.value - d.lower) else "lower"


def priced(price: float, unit: str, of: str) -> str:
    """A shadow price in readable units: N per kg; N alone for a plain number."""
    if not price:
        return DASH
    (name, factor), (of_name, of_factor) = readable(unit), readable(of)
    units = f"{name} per {of_name}".strip() if of_name else name
    return f"{number(price * factor / of_factor)} {units}".rstrip()


def _limits(result: Result) -> Grid:
    unit = result.objective.unit if result.objective else ""
    rows = tuple(_limit_row(limit, unit) for limit in limits_of(result))
    priced = any(limit.shadow_price for limit in limits_of(result))
    note = (
        "Shadow price: by how much the objective falls for each unit by which the limit is relaxed." if priced else ""
    )
    sides = {limit.side for limit in limits_of(result)}
    head = ("limit", "value", sides.pop() if len(sides) == 1 else "bound", "state", "shadow price")
    return Grid("Limits" if changed(result) else "Limits, and the design as given", head, rows, note=note)


def _limit_row(limit: LimitValue, unit: str) -> tuple[str, ...]:
    name, factor = readable(limit.unit)
    state = "broken" if not is_met(limit) else "active" if limit.active else "slack"
    price = priced(limit.shadow_price, unit, limit.unit)
    value = f"{number(limit.value * factor, scale=limit.limit * factor)} {name}"
    side = "" if limit.side == "at most" else f"{limit.side} "
    return limit.name, value, side + with_unit(limit.limit, limit.unit), state, price


def _mounts(result: Result) -> Grid:
    measures = mount_measures(result)
    several = len(result.problem.points) > 1
    compared = len(load_designs(result)) > 1
    scale = max((m.initial.max if compared else m.final.max for m in measures), default=0.0)
    rows = []
    for m in measures:
        lead = (m.point, m.mount) if several else (m.mount,)
        if compared:
            change = percent(m.final.mean / m.initial.mean - 1.0) if m.initial.mean > 1e-9 * scale else DASH
            values = (m.initial.mean, m.final.mean), (m.initial.max, m.final.max)
            (a, b), (c, d) = ((number(x, scale=scale) for x in pair) for pair in values)
            rows.append((*lead, a, b, change, c, d))
        else:
            rows.append((*lead, *(number(x, scale=scale) for x in (m.final.mean, m.final.max, m.final.rms))))
    head = ("mean before", "mean after", "change", "max before", "max after") if compared else ("mean", "max", "rms")
    at = "" if several else f" at {result.problem.points[0].name}"
    note = f"The design as given has none: {result.initial.resonance}." if result.initial.resonance else ""
    first = ("at", "mount") if several else ("mount",)
    return Grid(f"Mount forces{at} [N]", (*first, *head), tuple(rows), note=note, left=len(first))


def _orders(result: Result) -> Grid:
    """Orders that make at least a small share of the largest, of the hardest operating point."""
    k = hardest_point(result)
    columns, names = _order_columns(result, k)
    length = max(len(column) for column in columns)
    table = np.stack([padded(column, length) for column in columns], axis=1)
    scale = table.max(axis=0)
    pairs = scale.reshape(len(names), -1).max(axis=1)
    scale = np.repeat(pairs, len(scale) // len(names))
    weight = (table / np.where(scale > 0.0, scale, 1.0)).max(axis=1)
    present = np.flatnonzero(weight > ORDER_SHARE)
    kept = sorted(present, key=lambda j: -weight[j])[:ORDERS_SHOWN]
    base = float(result.initial.loads[k].wrench.base)
    rows = tuple(
        (f"{j * base:g}", *(aligned(value, top) for value, top in zip(table[j], scale, strict=True)))
        for j in sorted(kept)
    )
    when = (" before", " after") if len(load_designs(result)) > 1 else ("",)
    head = [f"{name}{side}" for name in names for side in when]
    note = f"Amplitudes; the largest {ORDERS_SHOWN} of {len(present)} orders." if len(present) > len(kept) else ""
    return Grid(f"Orders at {result.problem.points[k].name}", ("order", *head), rows, note=note)


def _order_columns(result: Result, k: int) -> tuple[list[Array], list[str]]:
    """Amplitudes by order, before and after where the design changed."""
    designs = load_designs(result)
    columns: list[list[Array]] = []
    names = ["shaking force [N]", "moment [N m]"]
    for design in designs:
        loads = design.loads[k]
        found = list(shaking_orders(loads.wrench))
        if loads.mount_forces is not None:
            found.insert(0, mount_orders(loads.mount_forces).mean(axis=1))
        columns.append(found)
    if len(columns[0]) > len(names):
        names.insert(0, "mount force [N]")
    return [design[c] for c in range(len(names)) for design in columns], names


def is_nothing(decision: DecisionValue) -> bool:
    """Whether a decided size is none, so that its angle means nothing."""
    return abs(decision.value) <= 1e-5 * max(abs(decision.lower), abs(decision.upper))
