"""Masses of pistons and levers that are open: the decisions about them."""

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
    """Decisions about masses of all slider-cranks that give none of their own, where these are open."""
    found = []
    for key, mass in table.open_masses.items():
        check_factors(weights, f"counts the {key.replace('_', ' ')}, which is open")
        own = [getattr(row, key, None) is None for row in table.slider_cranks] or [True] * len(parts)
        drives = tuple(MassDrive(part.name, key) for part, follows in zip(parts, own, strict=True) if follows)
        found.append(Decision(key.replace("_", " "), "kg", Interval(*mass.bounds), mass.start, drives))
    return found


def check_factors(weights: Sequence[CounterweightTable], rule: str) -> None:
    """Refuse weights whose size follows from masses that are open."""
    for k, weight in enumerate(weights, 1):
        if weight.factor_key is not None:
            remedy = "give the counterweights a mass, or fix the other"
            raise Refused(f"counterweights[{k}].{weight.factor_key}", None, rule, remedy)
