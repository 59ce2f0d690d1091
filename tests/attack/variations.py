"""Pairs of problems of which one must have an equal or no better optimum: prices, monotony, invariance.

Each takes a table and gives complaints. If a result claims no optimum, a difference is a note.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from attack.claims import solved
from attack.families import q
from attack.openings import is_open
from attack.plain_loads import number
from attack.plain_scene import Table, terms_of

STEP = 0.01
"""Share by which a limit is moved."""
READING = 2e-5
"""Relative accuracy of a value: two results need not have the same samples of a cycle."""
Complaints = list[str]


def is_global(result: Any) -> bool:
    return result.certificate is not None and result.certificate.kind.value == "global"


def doubt(*results: Any) -> float:
    """Return the sum of gaps and errors of the values; a vanishing value has the rounding of the initial one."""
    left = sum((r.certificate.gap + r.error_estimate) * r.objective.value for r in results)
    start = max(r.objective.initial for r in results if np.isfinite(r.objective.initial))
    return left + READING * max(r.objective.value for r in results) + 1e-9 * start


def prices(table: Table, rng: np.random.Generator, folder: Path) -> Complaints:
    """Return complaints about prices outside the gain of a looser and the loss of a tighter limit."""
    result = solved(table, folder)
    if result.objective is None or not is_global(result) or not result.objective.value:
        return []
    wrong = []
    for k, entry in enumerate(table.get("constraints", [])):
        side = "max" if "max" in entry else "min"
        priced = next(limit for limit in result.limits if limit.name == entry["name"])
        sign, maximum = (1.0 if side == "max" else -1.0), number(entry[side])
        looser, tighter = (solved(_moved(table, k, side, 1.0 + sign * s), folder) for s in (STEP, -STEP))
        step, unit = STEP * maximum, result.objective.value / maximum
        slack = doubt(result) / step + 0.02 * priced.shadow_price
        low = (result.objective.value - looser.objective.value - doubt(looser)) / step
        high = (
            np.inf
            if tighter.objective is None
            else (tighter.objective.value + doubt(tighter) - result.objective.value) / step
        )
        if not low - slack <= priced.shadow_price <= high + slack:
            wrong.append(
                f"price of {entry['limit']} is {priced.shadow_price / unit:.5g} of value by limit, "
                f"differences say {low / unit:.5g} to {high / unit:.5g}"
            )
    return wrong


def _moved(table: Table, k: int, side: str, factor: float) -> Table:
    other = copy.deepcopy(table)
    bound = other["constraints"][k][side]
    other["constraints"][k][side] = _times(bound, factor)
    return other


def _times(text: Any, factor: float) -> Any:
    if not isinstance(text, str):
        return text * factor
    value, _, unit = text.partition(" ")
    return f"{float(value) * factor!r} {unit}"


def monotony(table: Table, rng: np.random.Generator, folder: Path) -> Complaints:
    """Return complaints if a looser limit or one more weight makes the optimum worse."""
    result = solved(table, folder)
    wider = copy.deepcopy(table)
    wider.setdefault("counterweights", []).append(
        {
            "name": "more", "x": q(rng.uniform(-0.3, 0.3), "m", 4), "radius": "0.06 m",
            "mass": {"between": ["0.0 kg", q(rng.uniform(0.05, 1.0), "kg")]}, "angle": {"between": [0, 360]},
        }
    )  # fmt: skip
    others = {"one more weight": wider}
    for k, entry in enumerate(table.get("constraints", [])):
        side = "max" if "max" in entry else "min"
        others[f"{entry['limit']} loosened"] = _moved(table, k, side, 1.05 if side == "max" else 0.95)
    return [line for what, other in others.items() for line in _no_worse(result, solved(other, folder), what)]


def _no_worse(result: Any, other: Any, what: str) -> Complaints:
    if result.objective is None:
        return []
    if other.objective is None:
        return [f"{what}: {other.status.value} in place of {result.objective.value:.9g}"]
    if other.objective.value > result.objective.value + doubt(result, other):
        note = "" if is_global(other) else "note: local: "
        return [f"{note}{what}: {other.objective.value:.9g} in place of {result.objective.value:.9g}"]
    return []


# --- invariance

DIMENSIONS = {
    "kg": (1, 0, 0), "m": (0, 1, 0), "kg m": (1, 1, 0), "kg m^2": (1, 2, 0), "rad/s": (0, 0, -1), "Hz": (0, 0, -1),
    "N": (1, 1, -2), "N m": (1, 2, -2), "N/m": (1, 0, -2), "N s/m": (1, 0, -1),
}  # fmt: skip
"""Powers of mass, length and time."""


def rescaled(value: Any, sizes: tuple[float, float, float]) -> Any:
    """Return a table with all its numbers in other units."""
    if isinstance(value, dict):
        return {k: rescaled(v, sizes) for k, v in value.items()}
    if isinstance(value, list):
        return [rescaled(v, sizes) for v in value]
    if isinstance(value, str):
        first, _, unit = value.partition(" ")
        if unit in DIMENSIONS:
            return f"{float(first) * factor_of(unit, sizes)!r} {unit}"
    return value


def factor_of(unit: str, sizes: tuple[float, float, float]) -> float:
    return float(np.prod([s**p for s, p in zip(sizes, DIMENSIONS[unit], strict=True)]))


def relabelled(table: Table, rng: np.random.Generator) -> Table:
    """Return the same parts in another order, under names of their own."""
    other = copy.deepcopy(table)
    for holder, key in ((other, "counterweights"), (other, "balancer_shafts"), (other["mounts"], "places")):
        if key in holder:
            holder[key] = [holder[key][k] for k in rng.permutation(len(holder[key]))]
    return other


def mirrored(table: Table) -> Table:
    """Return the front and back swapped: an engine in line."""
    other = copy.deepcopy(table)
    if isinstance(other["engine"].get("throws"), list):
        other["engine"]["throws"].reverse()
    if "firing_order" in other["engine"] and isinstance(other["engine"]["firing_order"], list):
        count = len(other["engine"]["firing_order"])
        other["engine"]["firing_order"] = [count + 1 - k for k in other["engine"]["firing_order"]]
    for weight in other.get("counterweights", []):
        weight["x"] = negated(weight["x"])
    for shaft in other.get("balancer_shafts", []):
        for unbalance in shaft["unbalances"]:
            unbalance["x"] = negated(unbalance["x"])
    for place in other["mounts"]["places"]:
        place["position"][0] = negated(place["position"][0])
        if "turned" in place:
            place["turned"][1:] = [negated(v) for v in place["turned"][1:]]
    if "block" in other:
        other["block"]["centre_of_gravity"][0] = negated(other["block"]["centre_of_gravity"][0])
        other["block"]["inertia_products"][:2] = [negated(v) for v in other["block"]["inertia_products"][:2]]
    return other


def negated(value: Any) -> Any:
    if is_open(value):
        low, high = (negated(v) for v in value["between"])
        return {"between": [high, low], **({"start": negated(value["start"])} if "start" in value else {})}
    return _times(value, -1.0)


def invariance(table: Table, rng: np.random.Generator, folder: Path) -> Complaints:
    """Return complaints if a relabelled, mirrored or rescaled problem has another value or kind of proof."""
    result = solved(table, folder)
    others: dict[str, tuple[Table, float]] = {"relabelled": (relabelled(table, rng), 1.0)}
    if table["engine"]["layout"] == "inline" and "gas" not in table:
        others["mirrored"] = (mirrored(table), 1.0)
    sags = any(entry.get("limit", entry.get("minimise")) == "static sag" for entry in _measures_of(table))
    units = {_unit(term["quantity"]) for term in terms_of(table)}
    if "gas" not in table and len(units) == 1 and None not in units:
        unit = units.pop()
        for sizes in ((10.0 ** rng.uniform(-6, 6), 1.0, 1.0), (1.0, *(10.0 ** rng.uniform(-2, 2, 2)))):
            if sags and sizes[1] != 1.0:
                continue
            name = "rescaled by " + ", ".join(f"{s:.3g}" for s in sizes)
            others[name] = (rescaled(table, sizes), factor_of(unit, sizes) if unit else 1.0)
    wrong: Complaints = []
    for what, (other, factor) in others.items():
        try:
            answer = solved(other, folder)
        except ValueError as refused:
            # no engine has such sizes: a file may say so
            if "too large for any engine" not in str(refused):
                raise
            continue
        wrong += _as_good(result, answer, factor, what)
    return wrong


def _measures_of(table: Table) -> list[Table]:
    return [*table.get("constraints", []), table.get("objective", {})]


def _unit(quantity: str) -> str | None:
    units = {
        "force": "N", "couple": "N m", "moment": "N m", "travel": "m", "sag": "m", "total stiffness": "N/m",
        "transmissibility": "", "residual": "",
    }  # fmt: skip
    return next((unit for word, unit in units.items() if quantity.endswith(word)), None)


def _as_good(result: Any, other: Any, factor: float, what: str) -> Complaints:
    if (result.objective is None) != (other.objective is None):
        return [f"{what}: {other.status.value} in place of {result.status.value}"]
    if result.objective is None:
        return []
    value, target = other.objective.value / factor, result.objective.value
    floor = 1e-9 * result.objective.initial
    wrong: Complaints = []
    note = "" if is_global(result) and is_global(other) else "note: local: "
    if abs(value - target) > doubt(result) + doubt(other) / factor + floor:
        wrong.append(f"{note}{what}: {value:.9g} in place of {target:.9g}")
    if result.certificate.kind != other.certificate.kind:
        gaps = f"{other.certificate.gap:.1e} for {result.certificate.gap:.1e}"
        wrong.append(f"{what}: {other.certificate.kind.value} in place of {result.certificate.kind.value} (gap {gaps})")
    return wrong


VARIATIONS: dict[str, Callable[[Table, np.random.Generator, Path], Complaints]] = {
    "prices": prices,
    "monotony": monotony,
    "invariance": invariance,
}
