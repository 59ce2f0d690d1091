"""Controls of a page for numbers that loads are not affine in, with the ranges of their sliders."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from laufruhe import units
from laufruhe.extensions.served_page.page_state import CRANK, OBJECTIVE, STAR
from laufruhe.files import edits
from laufruhe.files.complaints import Refused
from laufruhe.files.measures import SIDES, limit_name
from laufruhe.problem.problem import Problem

_OF_ENGINE = {
    "rod_ratio": ("Rod ratio", 0.4, 1.6),
    "rod_length": ("Rod length", 0.6, 2.0),
    "bank_angle": ("Bank angle", 0.0, 180.0),
    "split_pin_angle": ("Split pins", 0.0, 60.0),
}
_WHOLE_TURN = ("bank_angle", "split_pin_angle")
_OF_POINT = {
    "speed": "Engine speed", "mean_piston_speed": "Engine mean piston speed", "imep": "Load, indicated mean pressure",
    "bmep": "Load, brake mean pressure", "brake_torque": "Load, torque at the brake",
}  # fmt: skip
_NARROW, _WIDE, _STEPS = 0.25, 2.0, 200


@dataclass(frozen=True)
class Control:
    """Number with a slider: an edit of the kind `way` with the name `name` moves it; `unit` is that of the file.

    A number that is `open` is decided, unless the page fixes it. `limit` is the name of the limit that has the number.
    """

    way: str
    name: str
    group: str
    label: str
    value: float
    low: float
    high: float
    unit: str
    open: bool = False
    limit: str = ""

    @property
    def step(self) -> float:
        """Round step, about 1/200 of the range."""
        return _round_step((self.high - self.low) / _STEPS)


def _round_step(rough: float) -> float:
    size = 10.0 ** math.floor(math.log10(rough))
    return float(f"{next(times * size for times in (1, 2, 5, 10) if times * size >= 0.999 * rough):.1g}")


def controls_of(tables: Mapping[str, Any], problem: Problem) -> list[Control]:
    """Return the controls of a problem as its file defines it."""
    return [*_of_points(tables), *_of_engine(tables), *_of_decisions(tables, problem), *_of_mounts(tables),
            *_of_limits(tables)]  # fmt: skip


def offered_by(tables: Mapping[str, Any], problem: Problem) -> list[str]:
    """Return the names that edits may have: controls, open numbers, and whole-problem edits."""
    decided = [decision.name for decision in problem.decisions]
    return [STAR, CRANK, OBJECTIVE, *(control.name for control in controls_of(tables, problem)), *decided]


def _number(entry: Any) -> tuple[float, str] | None:
    # a text has a number and a unit, a plain number no unit; anything else is no number
    if isinstance(entry, int | float) and not isinstance(entry, bool):
        return float(entry), ""
    if not isinstance(entry, str):
        return None
    unit = units.unit_of(entry)
    try:
        number = float(entry.removesuffix(unit).strip() if unit else entry)
    except ValueError:
        return None
    return (number, unit) if math.isfinite(number) else None


def _around(name: str, group: str, label: str, entry: Any, low: float = _NARROW, high: float = _WIDE) -> list[Control]:
    parsed = _number(entry)
    if parsed is None or parsed[0] <= 0.0:
        return []
    value, unit = parsed
    step = _round_step((high - low) * value / _STEPS)
    ends = [float(f"{round(share * value / step) * step:.10g}") for share in (low, high)]
    return [Control("set", name, group, label, value, ends[0], ends[1], unit)]


def _of_points(tables: Mapping[str, Any]) -> Iterator[Control]:
    points, gas = tables.get("operating_points", []), tables.get("gas", {})
    for k, point in enumerate(points):
        at = f", {point.get('name') or f'point {k + 1}'}" if len(points) > 1 else ""
        for key, label in _OF_POINT.items():
            yield from _around(f"operating_points.{k + 1}.{key}", "Engine", f"{label}{at}", point.get(key))
    yield from _around("gas.imep", "Engine", "Load, indicated mean pressure", gas.get("imep"))


def _of_engine(tables: Mapping[str, Any]) -> Iterator[Control]:
    engine = tables["engine"]
    for key, (label, low, high) in _OF_ENGINE.items():
        parsed = _number(engine.get(key))
        if parsed is not None and key in _WHOLE_TURN:
            yield Control("set", f"engine.{key}", "Engine", label, parsed[0], low, high, parsed[1] or "deg")
        elif parsed is not None:
            yield from _around(f"engine.{key}", "Engine", label, engine.get(key), low, high)


def _of_decisions(tables: Mapping[str, Any], problem: Problem) -> Iterator[Control]:
    """Yield controls of open numbers, which the page may fix at a value."""
    for decision in problem.decisions:
        try:
            edits.keys_by_name(tables, decision.name)
        except Refused:
            continue
        if not decision.is_affine and decision.set.width == 1:
            unit, factor = typed(decision.unit)
            value, low, high = (
                float(f"{factor * x:.10g}") for x in (decision.real_start, decision.lower, decision.upper)
            )
            yield Control("fix", decision.name, "Open numbers", decision.name, value, low, high, unit, open=True)


def typed(unit: str) -> tuple[str, float]:
    """Return the unit in which a number is typed, and its factor on SI."""
    _, factor = units.readable(unit)
    return units.quantity_text(1.0, unit).partition(" ")[2], factor


def as_typed(value: float, unit: str) -> str | float:
    """Return an SI number as a file writes it."""
    name, factor = typed(unit)
    return f"{factor * value!r} {name}" if name else factor * value


def _of_mounts(tables: Mapping[str, Any]) -> Iterator[Control]:
    mounts = tables.get("mounts", {})
    places = [(f"mounts.places.{k}", m.get("name", str(k)), m) for k, m in enumerate(mounts.get("places", []), 1)]
    for path, name, table in (("mounts", "All mounts", mounts), *places):
        for k, (axis, entry) in enumerate(zip("xyz", table.get("stiffness") or [], strict=False), 1):
            yield from _around(f"{path}.stiffness.{k}", "Mounts", f"{name}, stiffness {axis}", entry)


def _of_limits(tables: Mapping[str, Any]) -> Iterator[Control]:
    for k, entry in enumerate(tables.get("constraints", [])):
        name = limit_name(entry) or ""
        for key, words in SIDES.items():
            controls = _around(f"constraints.{k + 1}.{key}", "Limits", f"{name} {words}", entry.get(key), 0.05)
            yield from (replace(control, limit=name) for control in controls)
        for end, edge in enumerate(entry.get("outside") or []):
            words = "band ends" if end else "band begins"
            path = f"constraints.{k + 1}.outside.{end + 1}"
            controls = _around(path, "Limits", f"{name}, {words} at", edge, 0.5, 1.5)
            yield from (replace(control, limit=name) for control in controls)
