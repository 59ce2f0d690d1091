"""Text of a study part in a report: paragraphs, tables, and statements of a source with verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from laufruhe.present.numbers import trimmed
from laufruhe.present.tables import Table

DASH = "–"


Text: TypeAlias = str | Table
"""A paragraph or a table of a report."""

UNSTATED = "not in the study"
"""Replaces the study's number for values that it does not state."""

NEGLIGIBLE = 0.07
"""Change of a force that is invisible in the bars of a printed figure, by which the study judges."""
NOTICEABLE = 0.15
"""Change that stands out in the same bars: about twice the invisible change."""
PRINTED_FALL = 0.05
"""Tolerance of a printed fall of the mean force.

A rod ratio of 0.22 instead of 0.26 takes four percentage points off the fall, and a compression ratio of 20.5 instead
of 17 takes five. The study prints neither ratio."""


@dataclass(frozen=True)
class Verdict:
    """Statement of a source with the value computed here, with the tolerance or reason that decides."""

    statement: str
    paper: str
    computed: float
    unit: str
    agrees: bool
    why: str


def marked_table(head: Sequence[str], rows: Sequence[Sequence[str]], omitted: int = 0) -> Table:
    """Return a table without a title, its cells marked as in Markdown."""
    return Table(head, rows, left=None, marked=True, omitted=omitted)


def number(value: float, digits: int = 5) -> str:
    """Return a number of a table; a dash for NaN."""
    return DASH if value != value else trimmed(value, digits)


def statement_table(verdicts: Sequence[Verdict]) -> list[Text]:
    """Return the table of a source's statements; empty without statements."""
    if not verdicts:
        return []
    computed = [f"{v.computed:{'+' if '%' in v.unit else ''}.3g} {v.unit}" for v in verdicts]
    rows = [
        [v.statement, v.paper, value, "yes" if v.agrees else "**no**", v.why]
        for v, value in zip(verdicts, computed, strict=True)
    ]
    return [marked_table(["statement", "source", "computed", "confirmed", "reason"], rows)]
