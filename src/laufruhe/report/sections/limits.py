"""Table of limits."""

from __future__ import annotations

from laufruhe.present.measures import is_changed, is_met, limits_of, objective_unit
from laufruhe.present.numbers import DASH, number, prices_of, with_unit
from laufruhe.present.tables import Table
from laufruhe.solvers.result import Result
from laufruhe.solvers.values import LimitValue
from laufruhe.units import readable

PRICES = "Shadow price: decrease of the objective per unit by which the limit is relaxed."
BOTH = "Second price: increase of the objective per unit by which the limit is tightened."

STATED_ERROR = 1e-5
"""Relative error of a value from which the note states it."""


def tables(result: Result) -> list[Table]:
    """Return a row per limit."""
    limits = limits_of(result)
    decided = result.certificate is not None
    rows = tuple(_row(limit, objective_unit(result), decided) for limit in limits)
    sides = {limit.side for limit in limits}
    head = ("limit", "value", sides.pop() if len(sides) == 1 else "bound", "state", "shadow price")
    title = "Limits" if is_changed(result) else "Limits, for the initial design"
    notes = [PRICES] if decided and any(limit.shadow_price or limit.tightening_price for limit in limits) else []
    notes += [BOTH] if any(limit.tightening_price is not None for limit in limits) else []
    notes += [
        f"Error of '{limit.name}' from sampling the cycle: at most {100.0 * limit.error_estimate:.1g} %."
        for limit in limits
        if limit.error_estimate > STATED_ERROR
    ]
    return [Table(head, rows, title=title, note=" ".join(notes))]


def _row(limit: LimitValue, unit: str, decided: bool) -> tuple[str, ...]:
    name, factor = readable(limit.unit)
    state = "broken" if not is_met(limit) else "active" if limit.active else "slack"
    value = f"{number(limit.value * factor, scale=limit.limit * factor)} {name}"
    side = "" if limit.side == "at most" else f"{limit.side} "
    bound = side + with_unit(limit.limit, limit.unit)
    return limit.name, value, bound, state, prices_of(limit, unit, limit.active) if decided else DASH
