"""Designs, limits and figures as a page is told of them: JSON that every browser reads."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any

from laufruhe.present.numbers import figure, price_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.report.strict_json import finite
from laufruhe.solvers.conclusion import decision_values
from laufruhe.solvers.values import LimitValue


def as_text(found: dict[str, Any]) -> str:
    """As JSON; a model is JSON already, and what is no finite number is null."""
    told = {key: entry for key, entry in found.items() if key not in ("model", "engine")}
    text = json.dumps(finite(told), allow_nan=False)
    drawn = {"model": found.get("model"), "engine": json.dumps(found["engine"]) if "engine" in found else None}
    return "".join([text[:-1], *(f', "{key}": {entry}' for key, entry in drawn.items() if entry is not None), "}"])


def figures(value: float, problem: Problem) -> dict[str, Any]:
    """A value of the objective, in SI and as it is read."""
    unit = problem.objective_unit or ""
    return {"name": problem.objective_name, "value": value, "unit": unit, "text": figure(value, unit, 5)}


def optimum(
    problem: Problem, values: Sequence[Value], value: float, bound: float, gap: float, proof: str
) -> dict[str, Any]:
    """A design with what bounds it."""
    entries = [e for d, v in zip(problem.decisions, values, strict=False) for e in decision_values(d, v)]
    return {
        **figures(value, problem),
        "design": {entry.name: entry.value for entry in entries},
        "bound": bound,
        "boundText": figure(bound, problem.objective_unit or "", 5),
        "gap": gap,
        "proof": proof,
    }


def limits(found: Iterable[LimitValue], problem: Problem) -> list[dict[str, Any]]:
    """How a design stands to its limits, and what they cost."""
    return [
        {
            **{key: getattr(limit, key) for key in ("name", "value", "limit", "unit", "side", "active")},
            "price": limit.shadow_price,
            "text": figure(limit.value, limit.unit),
            "limitText": figure(limit.limit, limit.unit),
            "priceText": price_of(limit.shadow_price, problem.objective_unit or "", limit.unit),
        }
        for limit in found
    ]
