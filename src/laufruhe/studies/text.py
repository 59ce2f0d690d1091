"""What a report says of a study part: paragraphs and tables, as data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from laufruhe.studies.verdict import Verdict

NOTHING = "–"


@dataclass(frozen=True)
class Rows:
    """A table: cells as text under their heads, and how many rows the CSV file has where these are its first."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    whole: int = 0


Text: TypeAlias = str | Rows


def number(value: float, digits: int = 5) -> str:
    """A number of a table; a dash where there is none."""
    return NOTHING if value != value else f"{value:.{digits}g}"


def said(found: Sequence[Verdict]) -> list[Text]:
    """What a source says, confirmed or not; nothing where it says nothing."""
    if not found:
        return []
    rows = [[v.statement, v.paper, _ours(v), "yes" if v.agrees else "**no**", v.why] for v in found]
    return [Rows(["what was said of", "said", "here", "confirmed", "why"], rows)]


def _ours(verdict: Verdict) -> str:
    signed = "+" if "%" in verdict.unit else ""
    return f"{verdict.ours:{signed}.3g} {verdict.unit}"
