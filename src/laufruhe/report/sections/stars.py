"""Tables of ranked stars, their firing orders, and the objective against deviation from even firing."""

from __future__ import annotations

import math
from collections.abc import Container

from laufruhe.errors import counted
from laufruhe.machine.crank_names import name_of_crank
from laufruhe.present.measures import objective_unit, ranking_of
from laufruhe.present.numbers import DASH, number, percent, trimmed
from laufruhe.present.tables import Table
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.ranking import PhasingResult, RankedStar
from laufruhe.units import readable

ORDERS_SHOWN = 6


def crank_stars(result: Result) -> list[Table]:
    """Return tables of the best crank stars, their firing orders, and the objective against even firing."""
    if result.phasing is None:
        return []
    phasing = ranking_of(result)
    return [_stars(result, phasing), _orders(phasing), *([_trade(result, phasing)] if len(phasing.trade) > 1 else [])]


def _degrees(angle: float, digits: int = 4) -> str:
    return trimmed(math.degrees(angle), digits)


def _stars(result: Result, phasing: PhasingResult) -> Table:
    unit, factor = readable(objective_unit(result))
    scale = factor * (result.objective.initial if result.objective else 0.0)
    built = any(star.shafts for star in phasing.ranking)
    rows, decided = [], {decision.name for decision in result.decisions}
    for k, star in enumerate(phasing.ranking):
        pairs = [f"{number(f, 3, 1.0)} / {number(c, 3, 1.0)}" for f, c in zip(star.forces, star.couples, strict=True)]
        name = f"{k + 1}" + (" proven" if star.proven else "")
        shafts = (", ".join(star.shafts) or DASH,) if built else ()
        intervals = star.firing_orders[0].intervals if star.firing_orders else (math.nan,)
        span = " to ".join(dict.fromkeys(_degrees(end(intervals)) for end in (min, max)))
        rows.append((name, _angles(star, decided), *shafts, number(factor * star.value, scale=scale), *pairs, span))
    objective = f"objective [{unit}]" if unit else "objective"
    orders = (f"order {h}" for h in phasing.ranking[0].orders)
    head = ("rank", "throws [deg]", *(("shafts",) if built else ()), objective, *orders, "intervals [deg]")
    note = (
        "Free force / couple of the star alone by order, in forces of one throw and that times the throw spacing. "
        f"{counted(phasing.designs, 'star')} to choose from; {phasing.method}."
    )
    return Table(head, rows, title="Crank stars", left=3 if built else 2, note=note)


def _angles(star: RankedStar, decided: Container[str]) -> str:
    text = " ".join(_degrees(angle, 5) for angle in star.throws)
    named = (("bank", "bank angle", star.bank_angle), ("split", "split pin angle", star.split_pin))
    angles = [f"{word} {_degrees(value)}" for word, name, value in named if value is not None and name in decided]
    extra = ", ".join(filter(None, [name_of_crank(star.throws), *angles]))
    return text + (f" ({extra})" if extra else "")


def _orders(phasing: PhasingResult) -> Table:
    rows = tuple(
        (f"{k + 1}", "-".join(map(str, order.order)), f"{order.neighbours}", _degrees(order.longest_gap),
         number(order.roll_content, 3, 1.0), f"{star.order_count}")
        for k, star in enumerate(phasing.ranking)
        for order in star.firing_orders[: ORDERS_SHOWN if k == 0 else 1]
    )  # fmt: skip
    head = ("star", "firing order", "neighbours", "longest gap [deg]", "roll content", "orders")
    note = (
        "Neighbours: firings in succession on one throw or on throws side by side. Longest gap: crank angle in which "
        "one bank does not fire. Roll content: largest torque order below the firing order. Orders: number of firing "
        "orders of the star."
    )
    return Table(head, rows, title="Firing orders", left=2, note=note)


def _trade(result: Result, phasing: PhasingResult) -> Table:
    even = phasing.trade[0].value
    rows = tuple(
        (f"{_degrees(p.allowed)} deg", _degrees(p.deviation), number(p.value, scale=even),
         number(p.lower_bound, scale=even), percent(p.value / even - 1.0).replace("-", "−") if even else DASH,
         f"{p.kkt_residual:.0e}" if p.kkt_residual else DASH)
        for p in phasing.trade
    )  # fmt: skip
    objective = f"objective [{objective_unit(result)}]"
    head = ("deviation allowed", "used [deg]", objective, "lower bound", "change", "KKT residual")
    note = "The best local optimum found for each deviation; no design with that deviation is below its bound."
    return Table(head, rows, title="Objective against even firing", note=note)
