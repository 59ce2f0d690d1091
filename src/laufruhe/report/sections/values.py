"""Tables of decisions, of limits and how far conflicting ones can be met, and of objectives in order."""

from __future__ import annotations

from itertools import pairwise

from laufruhe.present.measures import is_changed, is_met, limits_of, objective_unit
from laufruhe.present.numbers import (
    DASH,
    between,
    figure,
    in_grams,
    number,
    price_of,
    prices_of,
    share,
    trimmed,
    with_unit,
)
from laufruhe.present.tables import Table
from laufruhe.solvers.result import Result
from laufruhe.solvers.values import (
    AttainableLimit,
    DecisionValue,
    LimitValue,
    NearestDesign,
    RankValue,
    relevant_decisions,
)
from laufruhe.units import readable, usual_unit

STATED_ERROR = 1e-5
"""Relative error of a value from which the note states it."""
PRICES = "Shadow price: decrease of the objective per unit by which the limit is relaxed."
BOTH = "Second price: increase of the objective per unit by which the limit is tightened."
ATTAINABLE = "Each column is a design that breaks the limit in its heading, so no column is a solution."
ORDER = (
    "Each objective is minimised over the designs that the objectives above it leave optimal, within their tolerance. "
    "Price: decrease of the last objective per unit by which this one may be exceeded."
)
EQUAL = (
    "A range means that both ends give the same values of the objectives so far. The next objective selects one design."
)


def decisions(result: Result) -> list[Table]:
    """Return a table of the decisions: initial and final value, bounds and shadow price, a row for each."""
    pairs = pairwise([None, *result.decisions])
    rows = [_decision(before, d, objective_unit(result)) for before, d in pairs if d is not None]
    head, note = ("decision", "initial", "final", "bounds", "at bound", "shadow price"), ""
    if result.free:
        ends = (f"{d.name} from {with_unit(d.low, d.unit)} to {with_unit(d.high, d.unit)}" for d in result.free)
        note = "The optimum is not unique. With the other decisions adapted, designs whose objective is equal within "
        note += f"{share(result.problem.tolerance, 1)} have {', '.join(ends)}."
    return [Table(head, rows, title="Decisions", note=note)]


def _decision(before: DecisionValue | None, d: DecisionValue, unit: str) -> tuple[str, ...]:
    maximum = max(abs(d.lower), abs(d.upper))
    bounds = between(d.lower, d.upper, d.unit)
    # the angle of a zero size is meaningless
    size = before if d.name.endswith(".angle") else None
    initial = DASH if size and not size.initial else with_unit(d.initial, d.unit)
    if size and size.is_zero:
        return d.name, initial, DASH, bounds, DASH, DASH
    upper = abs(d.value - d.upper) <= abs(d.value - d.lower)
    mark = DASH if not d.at_bound else "upper" if upper else "lower"
    decided = figure(d.value, d.unit, scale=maximum) + in_grams(d.value, d.unit, maximum)
    return d.name, initial, decided, bounds, mark, prices_of(d, unit)


def limits(result: Result) -> list[Table]:
    """Return a table of the limits: value, bound and shadow price, a row for each."""
    values, decided, unit = limits_of(result), result.certificate is not None, objective_unit(result)
    sides = {"bound" if limit.window else limit.side for limit in values}
    head = ("limit", "value", sides.pop() if len(sides) == 1 else "bound", "state", "shadow price")
    title = "Limits" if is_changed(result) else "Limits, for the initial design"
    notes = [PRICES] if decided and any(limit.shadow_price or limit.tightening_price for limit in values) else []
    notes += [BOTH] if any(limit.tightening_price is not None for limit in values) else []
    notes += [
        f"Error of '{limit.name}' from sampling the cycle: at most {100.0 * limit.error_estimate:.1g} %."
        for limit in values
        if limit.error_estimate > STATED_ERROR
    ]
    return [Table(head, [_limit(limit, unit, decided) for limit in values], title=title, note=" ".join(notes))]


def _limit(limit: LimitValue, unit: str, decided: bool) -> tuple[str, ...]:
    name, factor = readable(limit.unit, usual_unit(limit.value, limit.unit))
    state = "broken" if not is_met(limit) else "active" if limit.active else "slack"
    value = f"{number(limit.value * factor, scale=limit.limit * factor)} {name}"
    bound = ("" if limit.side == "at most" else f"{limit.side} ") + with_unit(limit.limit, limit.unit)
    if limit.window:
        low, high = (trimmed(edge * factor) for edge in limit.window)
        bound = f"{low} to {high} {name}"
    return limit.name, value, bound, state, prices_of(limit, unit, limit.active) if decided else DASH


def attainable(result: Result) -> list[Table]:
    """Return a table of the designs nearest to each conflicting limit, with the other limits met."""
    designs: list[tuple[str, AttainableLimit | NearestDesign]] = [
        (f"nearest to '{design.name}'", design) for design in result.reached if design.decisions
    ]
    designs += [("nearest to all limits", result.nearest)] if result.nearest is not None else []
    columns = [
        {d.name: figure(d.value, d.unit, scale=max(abs(d.lower), abs(d.upper)))
         for d in relevant_decisions(design.decisions)}
        for _, design in designs
    ]  # fmt: skip
    names = dict.fromkeys(name for column in columns for name in column)
    rows = [(name, *(column.get(name, DASH) for column in columns)) for name in names]
    first = ("value reached", *(figure(design.value, design.unit) for _, design in designs))
    head, title = ("", *(words for words, _ in designs)), "Attainable values of the limits"
    return [Table(head, [first, *rows] if rows else [], title=title, note=ATTAINABLE, file="reach")]


def objectives(result: Result) -> list[Table]:
    """Return tables of several objectives in order, and of the range of each decision after each objective."""
    ranks = result.ranks
    if not ranks:
        return []
    rows = [_objective(k, rank, ranks[-1]) for k, rank in enumerate(ranks, 1)]
    names = [entry.name for entry in ranks[0].designs] if any(rank.equal for rank in ranks) else []
    ends = [(name, *(_range_of(rank, name) for rank in ranks)) for name in names]
    head = ("decision", *(f"after objective {k}" if k == 1 else f"after 1 to {k}" for k in range(1, len(ranks) + 1)))
    order = ("objective", "initial", "minimum", "lower bound", "proof", "final", "price")
    return [
        Table(order, rows, title="Objectives in order", note=ORDER, file="objectives-in-order"),
        Table(head, ends, title="Equal optima", note=EQUAL, file="equal-optima"),
    ]


def _objective(k: int, rank: RankValue, last: RankValue) -> tuple[str, ...]:
    scale = rank.initial
    values = (figure(value, rank.unit, scale=scale) for value in (rank.initial, rank.minimum, rank.lower_bound))
    price = DASH if rank is last else price_of(rank.price, last.unit, rank.unit)
    return f"{k} {rank.name}", *values, str(rank.proof), figure(rank.final, rank.unit, scale=scale), price


def _range_of(rank: RankValue, name: str) -> str:
    entry = next((entry for entry in rank.designs if entry.name == name), None)
    if entry is None:
        return DASH
    unit, factor = readable(entry.unit)
    is_open = any(entry is equal for equal in rank.equal)
    # smaller values are rounding errors
    minimum = 1e-3 * max(abs(other.high) for other in rank.designs)
    values = (entry.low, entry.high) if is_open else (0.5 * (entry.low + entry.high),)
    ends = (trimmed(0.0 if abs(value) <= minimum else factor * value, 3) for value in values)
    return f"{' to '.join(ends)} {unit}".rstrip()
