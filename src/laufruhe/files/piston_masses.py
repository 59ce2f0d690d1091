"""Reciprocating masses that are open: the decisions about them."""

from __future__ import annotations

from collections.abc import Sequence

from laufruhe.files.complaints import Refused
from laufruhe.files.engine import EngineTable
from laufruhe.files.rotors import CounterweightTable
from laufruhe.machine import SliderCrank
from laufruhe.problem.decision import Decision, MassDrive
from laufruhe.problem.sets import Interval


def piston_masses(
    table: EngineTable, parts: Sequence[SliderCrank], weights: Sequence[CounterweightTable]
) -> list[Decision]:
    """The decision about the reciprocating mass of all that give none of their own, if it is open."""
    mass = table.piston_mass
    if not mass.is_open:
        return []
    check_factors(weights, "counts the reciprocating mass, which is open")
    own = [row.reciprocating_mass is None for row in table.slider_cranks] or [True] * len(parts)
    drives = tuple(MassDrive(part.name) for part, follows in zip(parts, own, strict=True) if follows)
    return [Decision("reciprocating mass", "kg", Interval(*mass.bounds), mass.start, drives)]


def check_factors(weights: Sequence[CounterweightTable], rule: str) -> None:
    """Refuse weights whose size follows from masses that are open."""
    for k, weight in enumerate(weights, 1):
        if weight.factor_key is not None:
            remedy = "give the counterweights a mass, or fix the other"
            raise Refused(f"counterweights[{k}].{weight.factor_key}", None, rule, remedy)
