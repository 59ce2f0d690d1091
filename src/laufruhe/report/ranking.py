"""Ranked stars and firing orders as tables and as part of `result.json`."""

from __future__ import annotations

import math
from typing import Any

from laufruhe.present.numbers import DASH, number, percent, trimmed
from laufruhe.report.grid import Grid
from laufruhe.solvers.ranking import PhasingResult, RankedOrder, RankedStar
from laufruhe.solvers.result import Result
from laufruhe.units import readable

ORDERS_SHOWN = 6


def phasing_grids(result: Result) -> list[Grid]:
    """Tables of stars, firing orders, and of the trade against even firing."""
    if result.phasing is None:
        return []
    phasing = result.phasing
    grids = [_stars(result, phasing), _orders(phasing)]
    if len(phasing.trade) > 1:
        grids.append(_trade(result, phasing))
    return grids


def _stars(result: Result, phasing: PhasingResult) -> Grid:
    unit, factor = readable(result.objective.unit if result.objective else "")
    scale = factor * (result.objective.initial if result.objective else 0.0)
    first = phasing.ranking[0]
    built = any(star.shafts for star in phasing.ranking)
    rows = []
    for k, star in enumerate(phasing.ranking):
        pairs = [f"{number(f, 3, 1.0)} / {number(c, 3, 1.0)}" for f, c in zip(star.forces, star.couples, strict=True)]
        name = f"{k + 1}" + (" proven" if star.proven else "")
        shafts = (", ".join(star.shafts) or DASH,) if built else ()
        intervals = _span(star.firing_orders[0].intervals) if star.firing_orders else DASH
        rows.append((name, _angles(star), *shafts, number(factor * star.value, scale=scale), *pairs, intervals))
    head = (
        "rank",
        "throws [deg]",
        *(("shafts",) if built else ()),
        f"objective [{unit}]" if unit else "objective",
        *(f"order {h}" for h in first.orders),
        "intervals [deg]",
    )
    note = (
        "Free force / couple of the star alone by order, in forces of one throw and that times the throw spacing. "
        f"{phasing.designs} star(s) to choose from; {phasing.method}."
    )
    return Grid("Crank stars", head, tuple(rows), left=3 if built else 2, note=note)


def _angles(star: RankedStar) -> str:
    text = " ".join(trimmed(math.degrees(angle), 5) for angle in star.throws)
    extra = [
        f"{name} {trimmed(math.degrees(value), 4)}"
        for name, value in (("bank", star.bank_angle), ("split", star.split_pin))
        if value
    ]
    return text + (f" ({', '.join(extra)})" if extra else "")


def _span(intervals: tuple[float, ...]) -> str:
    low, high = math.degrees(min(intervals)), math.degrees(max(intervals))
    return trimmed(low) if high - low < 1e-6 else f"{trimmed(low)} to {trimmed(high)}"


def _orders(phasing: PhasingResult) -> Grid:
    rows = [
        (
            f"{k + 1}",
            "-".join(map(str, order.order)),
            f"{order.neighbours}",
            trimmed(math.degrees(order.longest_gap)),
            number(order.roll_content, 3, 1.0),
            f"{star.order_count}",
        )
        for k, star in enumerate(phasing.ranking)
        for order in star.firing_orders[: ORDERS_SHOWN if k == 0 else 1]
    ]
    head = ("star", "firing order", "neighbours", "longest gap [deg]", "roll content", "orders")
    note = (
        "Neighbours: firings in succession on one throw or on throws side by side. Longest gap: in which one bank does "
        "not fire. Roll content: what is left of the largest torque order below the firing order. Orders: how many "
        "belong to the star."
    )
    return Grid("Firing orders", head, tuple(rows), left=2, note=note)


def _trade(result: Result, phasing: PhasingResult) -> Grid:
    unit = result.objective.unit if result.objective else ""
    even = phasing.trade[0].value
    rows = tuple(
        (
            f"{trimmed(math.degrees(p.allowed))} deg",
            trimmed(math.degrees(p.deviation)),
            number(p.value, scale=even),
            number(p.lower_bound, scale=even),
            percent(p.value / even - 1.0).replace("-", "−") if even else DASH,
            f"{p.kkt_residual:.0e}" if p.kkt_residual else DASH,
        )
        for p in phasing.trade
    )
    head = ("deviation allowed", "used [deg]", f"objective [{unit}]", "not under", "change", "KKT residual")
    return Grid(
        "Objective against even firing",
        head,
        rows,
        note="Local optima, the best found of every freedom; no design with that freedom goes under the bound.",
    )


def phasing_record(result: Result) -> dict[str, Any]:
    """What `result.json` holds of it: `ranking` and `phasing` beside the other keys."""
    if result.phasing is None:
        return {}
    phasing = result.phasing
    return {
        "ranking": [_star_record(k, star) for k, star in enumerate(phasing.ranking)],
        "phasing": {
            "designs": phasing.designs,
            "looked_at": phasing.looked_at,
            "method": phasing.method,
            "even_value": phasing.even_value,
            "trade": [
                {
                    "allowed": p.allowed,
                    "deviation": p.deviation,
                    "value": p.value,
                    "lower_bound": p.lower_bound,
                    "throws": list(p.throws),
                    "kkt_residual": p.kkt_residual,
                }
                for p in phasing.trade
            ],
        },
    }


def _star_record(k: int, star: RankedStar) -> dict[str, Any]:
    return {
        "rank": k + 1,
        "throws": list(star.throws),
        "bank_angle": star.bank_angle,
        "split_pin_angle": star.split_pin,
        "shafts": list(star.shafts),
        "objective": star.value,
        "lower_bound": star.lower_bound,
        "proven": star.proven,
        "orders": list(star.orders),
        "free_force": list(star.forces),
        "free_couple": list(star.couples),
        "even": star.even,
        "firing_order_count": star.order_count,
        "firing_orders": [_order_record(order) for order in star.firing_orders],
    }


def _order_record(order: RankedOrder) -> dict[str, Any]:
    return {
        "order": list(order.order),
        "neighbours": order.neighbours,
        "longest_gap": order.longest_gap,
        "roll_content": order.roll_content,
        "intervals": list(order.intervals),
    }
