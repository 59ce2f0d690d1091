"""Designs, limits and claims as JSON for the page."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

from laufruhe.extensions.served_page.claims import Claim, ClaimKind, is_broken
from laufruhe.present.numbers import figure, price_of
from laufruhe.problem.measure import Limit
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.report.strict_json import finite
from laufruhe.solvers.conclusion import decision_values
from laufruhe.solvers.values import LimitValue


def as_text(answer: dict[str, Any]) -> str:
    """Return JSON; a model is JSON already, numbers that are not finite become null."""
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
    """Return values, sides, state and prices of limits, in words and numbers."""
    edges = {limit.name: limit for limit in problem.limits}
    return [
        {
            "name": limit.name,
            "value": limit.value,
            "sides": _sides(limit, edges.get(limit.name)),
            "broken": is_broken(limit),
            "active": limit.active,
            "price": limit.shadow_price,
            "words": _words(limit, problem, is_estimate),
        }
        for limit in values
    ]


def _sides(value: LimitValue, limit: Limit | None) -> list[tuple[str, float]]:
    if limit is None or limit.outside is not None:
        return [(value.side, value.limit)]
    ends = (("at least", limit.minimum), ("at most", limit.maximum))
    return [(sense, edge) for sense, edge in ends if math.isfinite(edge)]


def _words(limit: LimitValue, problem: Problem, is_estimate: bool) -> str:
    value = figure(limit.value, limit.unit)
    if is_broken(limit):
        return f"broken: {value}, {limit.side} {figure(limit.limit, limit.unit)}"
    if not limit.active:
        return f"is {value}; has room"
    if not limit.shadow_price > 0.0:
        return f"is {value}; price not known" if math.isnan(limit.shadow_price) else f"is {value}; no price"
    price = price_of(limit.shadow_price, problem.objective_unit or "", limit.unit)
    return f"is {value}; price {'about ' if is_estimate else ''}{price}"
