"""Designs, limits, claims and crank stars as JSON for the page, and edits that fix the values of a solution."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from laufruhe.errors import InputError
from laufruhe.extensions.served_page.claims import Claim, ClaimKind
from laufruhe.extensions.served_page.controls import as_typed
from laufruhe.extensions.served_page.live.model import sides_of
from laufruhe.extensions.served_page.page_state import STAR, Edit
from laufruhe.files.complaints import Refused
from laufruhe.present.measures import is_met
from laufruhe.present.numbers import figure, price_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.report.strict_json import finite
from laufruhe.solvers.conclusion import decision_values
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.ranking import RankedOrder, RankedStar
from laufruhe.solvers.values import LimitValue

_DIGITS = 9
"""Decimals of an angle in degrees, enough to recover steps of a turn."""


def as_text(answer: dict[str, Any]) -> str:
    """Return an answer as JSON text; its model is JSON already, and numbers that are not finite become null."""
    plain = {key: entry for key, entry in answer.items() if key not in ("model", "engine")}
    text = json.dumps(finite(plain), allow_nan=False)
    texts = {"model": answer.get("model"), "engine": json.dumps(answer["engine"]) if "engine" in answer else None}
    return "".join([text[:-1], *(f', "{key}": {entry}' for key, entry in texts.items() if entry is not None), "}"])


def answer(
    claim: Claim, limit_values: Iterable[LimitValue], problem: Problem, conflict: Sequence[str]
) -> dict[str, Any]:
    """Return a claim, the limit values of its design, and the names of conflicting limits."""
    is_estimate = claim.kind in (ClaimKind.ESTIMATE, ClaimKind.SIMPLIFIED)
    return {"claim": asdict(claim), "limits": limits(limit_values, problem, is_estimate), "conflict": list(conflict)}


def design(problem: Problem, values: Sequence[Value]) -> dict[str, float]:
    """Return sizes and angles of a design by name [SI]."""
    return {e.name: e.value for d, v in zip(problem.decisions, values, strict=True) for e in decision_values(d, v)}


def limits(values: Iterable[LimitValue], problem: Problem, is_estimate: bool = False) -> list[dict[str, Any]]:
    """Return value, side, state and shadow price of each limit as JSON data, in words and numbers."""
    edges = {limit.name: limit for limit in problem.limits}
    return [
        {
            "name": limit.name,
            "value": limit.value,
            "sides": [(limit.side, limit.limit)]
            if (edge := edges.get(limit.name)) is None or edge.outside is not None
            else sides_of(edge),
            "broken": not is_met(limit),
            "active": limit.active,
            "price": limit.shadow_price,
            "words": _words(limit, problem, is_estimate),
        }
        for limit in values
    ]


def _words(limit: LimitValue, problem: Problem, is_estimate: bool) -> str:
    value = figure(limit.value, limit.unit)
    if not is_met(limit):
        return f"broken: {value}, {limit.side} {figure(limit.limit, limit.unit)}"
    if not limit.active:
        return f"is {value}; has room"
    if not limit.shadow_price > 0.0:
        return f"is {value}; price not known" if math.isnan(limit.shadow_price) else f"is {value}; no price"
    price = price_of(limit.shadow_price, problem.objective_unit or "", limit.unit)
    return f"is {value}; price {'about ' if is_estimate else ''}{price}"


def fixing_edits(result: Result, tables: Mapping[str, Any]) -> list[list[Any]]:
    """Return edits of the problem file that fix all numbers in which loads are not affine; empty if one cannot be."""
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
    """Return a crank star and firing order as the value with which the page can request it again."""
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
    """Return the crank stars of a result with firing orders, best first, in words and as requests of the page."""
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
