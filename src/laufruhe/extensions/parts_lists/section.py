"""Report section of a choice from lists: the chosen rows, the next best ones, and what bounds exclude."""

from __future__ import annotations

import math
from typing import Any

from laufruhe.extensions.parts_lists.lists import Choices, Outcome
from laufruhe.present.measures import objective_unit
from laufruhe.present.numbers import figure, number
from laufruhe.present.tables import Table
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result

MAX_ROWS = 8
"""Number of combinations that the report shows."""


def _outcome(result: Result) -> Outcome | None:
    choices = result.problem.extra(Choices)
    return choices.outcome if choices is not None else None


def _tables(result: Result) -> list[Table]:
    outcome, unit = _outcome(result), objective_unit(result)
    assert outcome is not None
    best = outcome.solved[0]
    heads = list(dict.fromkeys(head for parts in outcome.lists for head in parts.sheet.heads[1:]))
    rows = []
    for parts, row in zip(outcome.lists, best.rows, strict=True):
        cells = dict(zip(parts.sheet.heads, parts.sheet.rows[row], strict=True))
        rows.append(
            [
                parts.sheet.name,
                parts.sheet.rows[row][0],
                f"{row + 1} of {len(parts.sheet.rows)}",
                *(cells.get(h, "-") for h in heads),
            ]
        )
    total = sum(parts.prices[row] for parts, row in zip(outcome.lists, best.rows, strict=True))
    note = f"Price of all parts that are bought: {number(total, 6)}." if total else ""
    chosen = Table(["list", "row", "line", *heads], rows, title="Chosen parts", left=2, note=note, file="chosen-parts")
    next_rows = [
        [*(parts.sheet.rows[row][0] for parts, row in zip(outcome.lists, known.rows, strict=True)),
         figure(known.value, unit, 6) if math.isfinite(known.value) else "-",
         figure(known.bound, unit, 6) if math.isfinite(known.bound) else "-", known.proof]
        for known in outcome.solved
    ]  # fmt: skip
    rest = outcome.whole - len(outcome.solved) - outcome.excluded
    counts = (
        f"Of {outcome.whole:,} combinations {len(outcome.solved):,} were solved, and bounds of subsets exclude "
        f"{outcome.excluded:,}, which are no better than the best one" + (f"; {rest:,} are left." if rest else ".")
    )
    head = [*(parts.sheet.name for parts in outcome.lists), "objective", "lower bound", "proof"]
    ranked = Table(
        head, next_rows[:MAX_ROWS], title="Best combinations", left=len(outcome.lists), note=counts,
        file="combinations", omitted=max(len(next_rows) - MAX_ROWS, 0),
    )  # fmt: skip
    return [chosen, ranked]


def _record(result: Result) -> dict[str, Any]:
    outcome = _outcome(result)
    assert outcome is not None

    def named(rows: tuple[int, ...]) -> dict[str, str]:
        return {parts.sheet.name: parts.sheet.rows[row][0] for parts, row in zip(outcome.lists, rows, strict=True)}

    solved = [
        {"rows": named(known.rows), "value": known.value if math.isfinite(known.value) else None,
         "lower_bound": known.bound if math.isfinite(known.bound) else None, "proof": known.proof}
        for known in outcome.solved
    ]  # fmt: skip
    return {"rows": named(outcome.solved[0].rows), "combinations": outcome.whole, "excluded": outcome.excluded,
            "solved": solved}  # fmt: skip


SECTION = Section(
    "choices", lambda result: _outcome(result) is not None, _tables, _record, ("chosen-parts", "combinations")
)
