"""A statement of the study beside what is computed here."""

from __future__ import annotations

from dataclasses import dataclass

UNSTATED = "not in the study"
"""In place of the study's number, where ours goes beyond it."""


@dataclass(frozen=True)
class Verdict:
    """One statement, confirmed or not.

    Attributes
    ----------
    statement
        What is claimed.
    paper
        The study's number or judgement.
    ours
        The same quantity here.
    unit
        Of `ours`.
    agrees
        Whether the statement is confirmed.
    why
        The tolerance that was allowed, or what explains the difference.
    """

    statement: str
    paper: str
    ours: float
    unit: str
    agrees: bool
    why: str
