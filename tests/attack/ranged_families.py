"""Random problems with ranges of speed: the worst value over a range minimised, or under a limit that is a curve.

A range is judged at speeds of our own: its problem at some speeds is one with so many operating points, and a value at
many speeds, with its peaks between them, says what a design is worth.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from attack import crossings, families
from attack.families import Generator, unit_of
from attack.openings import Openings
from attack.plain_loads import number
from attack.plain_scene import Scene, Table, norm_and_channel
from attack.rivals import Rival, best_star, convex_rival, least_broken, local_rival

SPEEDS, COARSE, AT_ONCE, ROUNDS = 120, 12, 40, 2
"""Speeds at which a design is looked at, those of a program, those that are computed at once, and rounds of peaks."""
WORST = {"mean": "worst mean", "worst mean": "worst mean", "rms": "worst rms", "rmq": "worst rmq"}
LOADS = ("force", "couple", "moment", "travel")
INSIDE = 1e-5
"""Share of a limit that rivals keep away from it."""
QUICK: Table = {"search": {"boxes": 10, "starts": 2}, "fidelity": {"samples": 240}}
"""Keys of problems that are not convex: their claims count, not how far a search came."""


# --- problems


def on_springs(rng: Generator) -> Table:
    """Return weights on mounts with little damping."""
    table = families.balance_on_elastic(rng)
    table["mounts"]["loss_factor"] = float(rng.choice([0.01, 0.03, 0.1]))
    return table


CHOICES: dict[str, tuple[float, Callable[[Generator], Table]]] = {
    "on springs": (5.0, on_springs), "inline": (2.0, families.FAMILIES["inline"]),
    "vee": (1.0, families.FAMILIES["vee"]), "gas": (2.0, families.FAMILIES["gas"]),
    "elastic-few": (2.0, families.FAMILIES["elastic-few"]), "joint": (1.0, families.FAMILIES["joint"]),
    "stars": (1.0, families.FAMILIES["stars"]), "uneven": (1.0, families.FAMILIES["uneven"]),
    "places": (1.0, families.FAMILIES["places"]), "leads": (1.0, families.FAMILIES["leads"]),
    "sizes": (0.5, families.FAMILIES["sizes"]), "crankcase": (1.0, families.FAMILIES["crankcase"]),
    **{name: (0.6, crossings.CROSSINGS[name]) for name in (
        "stars on mounts", "uneven throws and stiffness", "optional shafts and uneven throws", "pistons and stars",
        "robust and star", "ranks with limits",
    )},
}  # fmt: skip
CONVEX = ("on springs", "inline", "vee", "gas")


def ranged(names: tuple[str, ...]) -> Callable[[Generator], Table]:
    def made(rng: Generator) -> Table:
        shares = np.array([CHOICES[name][0] for name in names])
        family = str(rng.choice(names, p=shares / shares.sum()))
        table = with_ranges(rng, CHOICES[family][1](rng))
        quick = {} if family in CONVEX else QUICK
        return {**table, **quick, "title": f"ranges with {family}"}

    return made


def with_ranges(rng: Generator, table: Table) -> Table:
    """Add one range or two; limits stand around what the design as given has."""
    table, points = copy.deepcopy(table), table["operating_points"]
    low = rng.uniform(30.0, 150.0)
    span = {
        "name": "r0", "speeds": [families.q(low, "rad/s"), families.q(low * rng.uniform(1.3, 5.0), "rad/s")],
        "operating_point": str(rng.choice([p["name"] for p in points])),
    }  # fmt: skip
    objective = table["objective"]
    single = isinstance(objective, dict) and "minimise" in objective
    ranges = []
    if single and rng.random() < 0.75:
        norm, channel = norm_and_channel(objective["minimise"])
        if norm == "peak to peak" or norm == "rmq":
            objective["minimise"] = f"{rng.choice(['mean', 'rms', 'maximum'])} {channel}"
        if norm:
            objective.pop("operating_points", None)
            ranges.append({**span, "minimise": True})
    if not ranges or rng.random() < 0.4:
        ranges.append({**span, "name": "r1", **limit_over(rng, table, span)})
    if rng.random() < 0.3:
        ranges[0]["time_shares"] = [[span["speeds"][0], 3.0], [span["speeds"][1], float(round(rng.uniform(0, 2), 2))]]
    return {**table, "speed_ranges": ranges}


def limit_over(rng: Generator, table: Table, span: Table) -> Table:
    """Return a curve of one to three values about those of a random or of the initial design."""
    elastic = table["mounts"].get("kind") == "elastic"
    channels = ["mount force", "mount travel"] if elastic else ["mount force", "shaking force", "roll moment"]
    quantity = f"{rng.choice(['mean', 'rms', 'maximum', 'peak to peak'])} {rng.choice(channels)}"
    entry: Table = {"quantity": quantity, **({"orders": [1]} if rng.random() < 0.2 else {})}
    low, high = (number(v) for v in span["speeds"])
    knots = np.sort(rng.uniform(low, high, int(rng.integers(1, 4))))
    values = np.array([low, high])
    try:
        openings = Openings(at_speeds({**table, "objective": {}}, [{**span, **entry}], {"r0": values}))
        star = families.even_stars(table["engine"]) if table["engine"].get("throws") == "open" else iter([{}])
        scene = openings.scene(openings.random(rng), next(star))
        has = max(scene.measure({**entry, "operating_points": ["r0 0", "r0 1"]}), 1e-9)
    except (KeyError, ValueError, StopIteration, np.linalg.LinAlgError):
        has = 1000.0
    unit = unit_of(quantity)
    if len(knots) == 1:
        return {**entry, "max": families.q(has * rng.uniform(0.6, 1.6), unit, 7)}
    return {**entry, "max": [[families.q(k, "rad/s", 7), families.q(has * rng.uniform(0.5, 1.8), unit, 7)]
                             for k in knots]}  # fmt: skip


FAMILIES = {
    "speed ranges": ranged(CONVEX),
    "speed ranges crossed": ranged(tuple(name for name in CHOICES if name not in CONVEX)),
}


# --- the same at some speeds


def curve(span: Table, speeds: np.ndarray) -> np.ndarray:
    """Return the limit at speeds."""
    if isinstance(span["max"], str):
        return np.full(len(speeds), number(span["max"]))
    knots, values = np.array([[number(v) for v in pair] for pair in span["max"]]).T
    return np.interp(speeds, knots, values)


def entry_of(table: Table, span: Table) -> Table:
    """Return the measure of a range as a term."""
    keys = ("orders", "mounts", "direction_weights")
    source = {**span, "minimise": span["quantity"]} if "quantity" in span else table["objective"]
    norm, channel = norm_and_channel(source["minimise"])
    return {"quantity": f"{WORST.get(norm, norm)} {channel}", **{k: source[k] for k in keys if k in source}}


def own_points(table: Table, entry: Table) -> Table:
    """Return the measure with all operating points named, so that no speed range counts."""
    name = entry.get("quantity", entry.get("limit", entry.get("minimise")))
    if "operating_points" in entry or not norm_and_channel(name)[0]:
        return entry
    return {**entry, "operating_points": [point["name"] for point in table["operating_points"]]}


def at_speeds(table: Table, ranges: list[Table], speeds: dict[str, np.ndarray], give: float = 0.0) -> Table:
    """Return the problem with its ranges at some speeds [rad/s], with limits lowered by a share."""
    points = {point["name"]: point for point in table["operating_points"]}
    out = {key: value for key, value in table.items() if key != "speed_ranges"}
    out["operating_points"], limits = list(points.values()), [own_points(table, c) for c in out.get("constraints", [])]
    objective = out.get("objective", {})
    if "terms" in objective:
        objective = {"terms": [own_points(table, term) for term in objective["terms"]]}
    elif objective:
        objective = own_points(table, objective)
    for span in ranges:
        at = speeds[span["name"]]
        names = [f"{span['name']} {k}" for k in range(len(at))]
        load = points[span["operating_point"]]
        out["operating_points"] = out["operating_points"] + [
            {**load, "name": name, "speed": f"{speed!r} rad/s", "weight": 1.0}
            for name, speed in zip(names, at.tolist(), strict=True)
        ]
        entry = {**entry_of(table, span), "operating_points": names}
        if span.get("minimise"):
            objective = {**{k: v for k, v in entry.items() if k != "quantity"}, "minimise": entry["quantity"]}
        if "max" in span:
            over = {"over": curve(span, at).tolist(), "max": 1.0 - give, "name": f"curve {span['name']}"}
            limits.append({**{k: v for k, v in entry.items() if k != "quantity"}, "limit": entry["quantity"], **over})
    return {**out, "objective": objective, **({"constraints": limits} if limits else {})}


@dataclass(frozen=True)
class Worth:
    """Objective and largest excess of limits of one design, and where its ranges have peaks."""

    objective: float
    over: float
    peaks: dict[str, np.ndarray]


def worth(table: Table, vector: np.ndarray, star: Table) -> Worth:
    """Return the worth of a design over all speeds."""
    base = Openings(at_speeds(table, [], {}))
    scene = base.scene(vector, star)
    objective, over = None, scene.worst
    peaks: dict[str, np.ndarray] = {}
    for span in table["speed_ranges"]:
        value = over_speed(table, span, vector, star)
        low, high = (number(v) for v in span["speeds"])
        at = np.geomspace(low, high, SPEEDS)
        values, tops = value(at), set[float]()
        # both the largest value and the largest share of a limit count
        for limited in [True, False] if "max" in span else [False]:
            ratios = values / curve(span, at) if limited else values
            height = partial(_height, value, span if limited else None)
            tops |= {_refined(height, at, k) for k in _local(ratios)}
        at_peaks = np.array(sorted(tops))
        peaks[span["name"]] = at_peaks
        if span.get("minimise"):
            objective = float(max(values.max(), value(at_peaks).max()))
        if "max" in span:
            over = max(over, float((value(at_peaks) / curve(span, at_peaks)).max()) - 1.0)
    return Worth(scene.objective if objective is None else objective, over, peaks)


def _height(value: Callable[[np.ndarray], np.ndarray], span: Table | None, speed: float) -> float:
    at = np.array([speed])
    return float((value(at) / (1.0 if span is None else curve(span, at)))[0])


def _local(ratios: np.ndarray) -> list[int]:
    padded = np.concatenate([[-math.inf], ratios, [-math.inf]])
    top = (ratios >= padded[:-2]) & (ratios >= padded[2:]) & (ratios > 0.7 * ratios.max())
    return sorted(np.flatnonzero(top).tolist(), key=lambda k: -ratios[k])[:3]


def _refined(height: Callable[[float], float], at: np.ndarray, k: int) -> float:
    low, high = at[max(k - 1, 0)], at[min(k + 1, len(at) - 1)]
    bounds = {"bounds": (low, high), "method": "bounded", "options": {"xatol": 1e-7 * high, "maxiter": 30}}
    best = minimize_scalar(lambda s: -height(float(s)), **bounds)
    return float(best.x) if -best.fun > height(float(at[k])) else float(at[k])


def over_speed(table: Table, span: Table, vector: np.ndarray, star: Table) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function of speeds with the value of a design at each."""
    plain = {key: value for key, value in table.items() if key != "constraints"}

    def value(speeds: np.ndarray) -> np.ndarray:
        rows = []
        for start in range(0, len(speeds), AT_ONCE):
            part = speeds[start : start + AT_ONCE]
            entry = entry_of(table, span)
            scene: Scene = Openings(at_speeds(plain, [span], {span["name"]: part})).scene(vector, star)
            rows.append(
                scene.values_at_points({**entry, "operating_points": [f"{span['name']} {k}" for k in range(len(part))]})
            )
        return np.concatenate(rows)

    return value


# --- judge


def rival_over(table: Table, speeds: dict[str, np.ndarray], start: np.ndarray, star: Table, calls: int,
               rng: Generator, target: float) -> Rival | None:  # fmt: skip
    openings = Openings(at_speeds(table, table["speed_ranges"], speeds, INSIDE))
    if any(shaft.get("optional") for shaft in table.get("balancer_shafts", [])):
        return crossings.best_of_choices(openings.table, rng, (start, star), calls, target)
    if openings.numbers:
        return local_rival(openings, rng, [openings.nearest(start)], calls, star)
    if table["engine"].get("throws") == "open":
        return best_star(openings, max(calls // 10, 1), target)
    return convex_rival(openings, start, star, target)


def judge(verdict: Any, table: Table, result: Any, rng: Generator, maximum: int, reading: float) -> None:
    """Add complaints about a result with speed ranges."""
    base = Openings(at_speeds(table, [], {}))
    verdict.status = result.status.value
    if verdict.status == "failed":
        verdict.wrong.append(f"failed: {result.message[:150]}")
    coarse = {
        span["name"]: np.geomspace(*(number(v) for v in span["speeds"]), COARSE) for span in table["speed_ranges"]
    }  # fmt: skip
    if result.certificate is None:
        openings = Openings(at_speeds(table, table["speed_ranges"], coarse, INSIDE))
        if openings.numbers or any(shaft.get("optional") for shaft in table.get("balancer_shafts", [])):
            rival = local_rival(openings, rng, [openings.nearest(np.zeros(openings.size))], 60 * maximum)
        else:
            rival = least_broken(openings, 10 * maximum)
        if rival is not None and rival.violation < -INSIDE:
            over = worth(table, rival.vector, rival.star).over
            if over < -2 * INSIDE:
                verdict.wrong.append(f"{verdict.status}, but a rival keeps every limit with {-over:.2e} to spare")
        return
    verdict.kind, verdict.gap = result.certificate.kind.value, result.certificate.gap
    vector, star = base.read(result.final.engine, {d.name: d.value for d in result.decisions})
    design_worth, value, bound = worth(table, vector, star), result.objective.value, result.certificate.lower_bound
    reading += 1.5 * result.error_estimate
    floor = 1e-9 * max(result.objective.initial if np.isfinite(result.objective.initial) else 0.0, 1e-9)
    if abs(design_worth.objective - value) > reading * max(value, design_worth.objective) + floor:
        verdict.wrong.append(
            f"worst value {value:.9g} is {design_worth.objective:.9g}, error estimate {result.error_estimate:.1e}"
        )
    if design_worth.over > 3e-5 + (1e-4 if "gas" in table else 0.0):
        verdict.wrong.append(f"a limit is passed by {design_worth.over:.2e} of itself, peaks {design_worth.peaks}")
    starts = {d.name: d.initial for d in result.decisions}
    initial = worth(table, *base.read(result.initial.engine, starts))
    if initial.over <= 0.0 and value > initial.objective * (1.0 + reading) + floor:
        verdict.wrong.append(f"value {value:.9g} is worse than {initial.objective:.9g} as given")
    best, speeds = design_worth.objective if design_worth.over <= 0.0 else math.inf, coarse
    for design in (design_worth, initial):
        speeds = {name: np.union1d(at, design.peaks[name]) for name, at in speeds.items()}
    for _ in range(ROUNDS):
        rival = rival_over(table, speeds, vector, star, 60 * maximum, rng, value * (1.0 - 2e-5))
        if rival is None:
            break
        verdict.rivals += rival.looked_at
        there = worth(table, rival.vector, {**star, **rival.star})
        if there.over <= 0.0:
            best = min(best, there.objective)
        if rival.value > value * (1.0 - 2e-5):
            break
        speeds = {name: np.union1d(at, there.peaks[name]) for name, at in speeds.items()}
    if bound > best * (1.0 + reading) + floor:
        verdict.wrong.append(f"bound {bound:.9g}, a rival has {best:.9g}")
    passed = 1e-4 + reading + (2e-3 if any("max" in span for span in table["speed_ranges"]) else 0.0)
    if verdict.kind == "global" and value - best > passed * best + floor:
        verdict.wrong.append(f"global {value:.9g}, a rival has {best:.9g}")
    elif verdict.kind != "global" and np.isfinite(best):
        verdict.beaten = max(0.0, (value - best) / max(best, 1e-300))
        if verdict.gap and best < value * (1.0 - verdict.gap) * (1.0 - reading) - floor:
            verdict.wrong.append(f"gap {verdict.gap:.3g}, but a rival has {best:.9g}, not {value:.9g}")
