"""A statement of the study beside what is computed here."""

from __future__ import annotations

from dataclasses import dataclass

UNSTATED = "not in the study"
"""In place of the study's number, where ours goes beyond it."""

NEGLIGIBLE = 0.07
"""Change of a force that cannot be told apart in the bars of a printed figure, by which the study judges."""
NOTICEABLE = 0.15
"""Change that stands out in the same bars: about twice what cannot be told apart."""
PRINTED_FALL = 0.05
"""Allowed on a printed fall of the mean force: a rod ratio of 0.22 instead of 0.26 takes off four points, gas at
full load five, and the study prints neither."""


@dataclass(frozen=True)
class Verdict:
    """One statement, what the study says and what is found here, and the tolerance or the reason that decides."""

    statement: str
    paper: str
    ours: float
    unit: str
    agrees: bool
    why: str
