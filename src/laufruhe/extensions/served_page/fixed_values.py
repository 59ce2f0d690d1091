"""Values of a solution that stay fixed while sliders move affine numbers: cranks and all others."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from laufruhe.errors import InputError
from laufruhe.extensions.served_page.controls import as_typed
from laufruhe.extensions.served_page.page_state import STAR, Edit
from laufruhe.files.complaints import Refused
from laufruhe.present.numbers import figure
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.ranking import RankedOrder, RankedStar

_DIGITS = 9
"""Decimals of an angle in degrees, enough to recover steps of a turn."""


def fixing_edits(result: Result, tables: Mapping[str, Any]) -> list[list[Any]]:
    """Return edits that fix the numbers that are not affine; empty without any, or if one cannot be fixed."""
    fixes: list[list[Any]] = []
    if result.phasing is not None and result.phasing.ranking:
        star = result.phasing.ranking[0]
        fixes.append(["star", STAR, star_value(result, star, star.firing_orders[0] if star.firing_orders else None)])
    values = {entry.name: entry for entry in result.decisions}
    for decision in result.problem.decisions:
        if decision.is_affine or decision.name not in values:
            continue
        edit = Edit("fix", decision.name, as_typed(values[decision.name].value, decision.unit))
        try:
            edit(tables)
        except (Refused, InputError):
            return []
        fixes.append([edit.what, edit.name, edit.value])
    return fixes


def star_value(result: Result, star: RankedStar, order: RankedOrder | None) -> dict[str, Any]:
    """Return a star as the page may request it again."""
    phasing = result.problem.phasing
    optional = [name for names in phasing.shafts.optional for name in names] if phasing is not None else []
    return {
        "throws": [_degrees(angle) for angle in star.throws],
        "firing_order": None if order is None else list(order.order),
        "bank_angle": None if star.bank_angle is None else _degrees(star.bank_angle),
        "split_pin_angle": None if star.split_pin is None else _degrees(star.split_pin),
        "without": [name for name in optional if name not in star.shafts],
    }


def ranking_of(result: Result) -> list[dict[str, Any]]:
    """Return the stars of a result with firing orders, best first, in words and as requests."""
    if result.phasing is None:
        return []
    unit = result.problem.objective_unit or ""
    return [
        {
            "throws": ", ".join(f"{math.degrees(angle):.6g}" for angle in star.throws),
            "bank": "" if star.bank_angle is None else f"{math.degrees(star.bank_angle):.6g}",
            "value": star.value,
            "text": figure(star.value, unit, 5),
            "bound": figure(star.lower_bound, unit, 5),
            "proven": star.proven,
            "orders": [
                {"text": "-".join(map(str, order.order)), "star": star_value(result, star, order)}
                for order in star.firing_orders
            ]
            or [{"text": "", "star": star_value(result, star, None)}],
        }
        for star in result.phasing.ranking
    ]


def _degrees(angle: float) -> float:
    return round(math.degrees(angle), _DIGITS)
