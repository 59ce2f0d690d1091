"""Report section of a choice from lists: the chosen rows, the next best ones, and what bounds exclude."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from laufruhe.errors import counted
from laufruhe.extensions.parts_lists.lists import RANKED, Outcome
from laufruhe.present.measures import objective_unit
from laufruhe.present.numbers import figure, number
from laufruhe.present.tables import Table
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result


def _outcome(result: Result) -> Outcome | None:
    return result.details if isinstance(result.details, Outcome) else None


def _tables(result: Result) -> list[Table]:
    outcome, unit = _outcome(result), objective_unit(result)
    assert outcome is not None
    pairs = list(zip(outcome.lists, outcome.solved[0].rows, strict=True))
    heads = list(dict.fromkeys(head for parts in outcome.lists for head in parts.heads[1:]))
    cells = [dict(zip(parts.heads, parts.rows[row], strict=True)) for parts, row in pairs]
    rows = [
        [parts.name, parts.rows[row][0], f"{row + 1} of {len(parts.rows)}", *(texts.get(head, "-") for head in heads)]
        for (parts, row), texts in zip(pairs, cells, strict=True)
    ]
    price = sum(parts.prices[row] for parts, row in pairs)
    note = f"Price of all parts that are bought: {number(price, 6)}." if price else ""
    rest = outcome.whole - len(outcome.solved) - outcome.excluded
    counts = (
        f"Of {counted(outcome.whole, 'combination')} {len(outcome.solved):,} were solved. Bounds of subsets exclude "
        f"{outcome.excluded:,}: none of these is better than those shown" + (f"; {rest:,} are left." if rest else ".")
    )
    ranked = _combinations(result)
    best = [
        [cell if isinstance(cell, str) else figure(cell, unit, 6) if math.isfinite(cell) else "-" for cell in row]
        for row in ranked.rows[:RANKED]
    ]
    return [
        Table(["list", "part", "row", *heads], rows, "Chosen parts", 2, note, file="chosen-parts"),
        replace(ranked, rows=best, title="Best combinations", note=counts),
    ]


def _combinations(result: Result) -> Table:
    outcome = _outcome(result)
    assert outcome is not None
    rows = [[*outcome.names(known), known.value, known.bound, known.proof] for known in outcome.solved]
    head = [*(parts.name for parts in outcome.lists), "objective", "lower bound", "proof"]
    return Table(head, rows, left=len(outcome.lists))


def _record(result: Result) -> dict[str, Any]:
    outcome = _outcome(result)
    assert outcome is not None
    solved = [
        {
            "rows": dict(zip((parts.name for parts in outcome.lists), outcome.names(known), strict=True)),
            "value": known.value if math.isfinite(known.value) else None,
            "lower_bound": known.bound if math.isfinite(known.bound) else None,
            "proof": known.proof,
        }
        for known in outcome.solved
    ]
    return {"combinations": outcome.whole, "excluded": outcome.excluded, "rows": outcome.rows, "solved": solved}


SECTION = Section(
    "choices", lambda result: _outcome(result) is not None, _tables, _record, ("chosen-parts",),
    {"combinations": (lambda result: _outcome(result) is not None, _combinations)},
)  # fmt: skip
