"""Tables of objectives in order, and of the equal optima that each objective leaves."""

from __future__ import annotations

from laufruhe.present.numbers import DASH, figure, price_of, trimmed
from laufruhe.present.tables import Table
from laufruhe.solvers.result import Result
from laufruhe.solvers.values import RankValue
from laufruhe.units import readable

HEAD = ("objective", "initial", "minimum", "lower bound", "proof", "final", "price")
ORDER = (
    "Each objective is minimised over the designs that the objectives above it leave optimal, within their tolerance. "
    "Price: decrease of the last objective per unit by which this one may be exceeded."
)
EQUAL = (
    "A range means that both ends give the same values of the objectives so far. The next objective selects one design."
)


def tables(result: Result) -> list[Table]:
    """Return a row per objective; and a row per decision with its range after each objective."""
    ranks = result.ranks
    if not ranks:
        return []
    rows = tuple(_row(k, rank, ranks[-1]) for k, rank in enumerate(ranks, 1))
    names = [entry.name for entry in ranks[0].designs] if any(rank.equal for rank in ranks) else []
    ends = tuple((name, *(_ends(rank, name) for rank in ranks)) for name in names)
    head = ("decision", *(f"after objective {k}" if k == 1 else f"after 1 to {k}" for k in range(1, len(ranks) + 1)))
    return [
        Table(HEAD, rows, title="Objectives in order", note=ORDER, file="objectives-in-order"),
        Table(head, ends, title="Equal optima", note=EQUAL, file="equal-optima"),
    ]


def _row(number: int, rank: RankValue, last: RankValue) -> tuple[str, ...]:
    scale = rank.initial
    values = (figure(value, rank.unit, scale=scale) for value in (rank.initial, rank.minimum, rank.lower_bound))
    price = DASH if rank is last else price_of(rank.price, last.unit, rank.unit)
    return f"{number} {rank.name}", *values, str(rank.proof), figure(rank.final, rank.unit, scale=scale), price


def _ends(rank: RankValue, name: str) -> str:
    entry = next((decision_range for decision_range in rank.designs if decision_range.name == name), None)
    if entry is None:
        return DASH
    unit, factor = readable(entry.unit)
    is_open = any(entry is decision_range for decision_range in rank.equal)
    # values below this are roundings
    minimum = 1e-3 * max(abs(decision_range.high) for decision_range in rank.designs)
    values = (entry.low, entry.high) if is_open else (0.5 * (entry.low + entry.high),)
    ends = (trimmed(0.0 if abs(value) <= minimum else factor * value, 3) for value in values)
    return f"{' to '.join(ends)} {unit}".rstrip()
