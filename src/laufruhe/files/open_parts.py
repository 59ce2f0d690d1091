"""Masses of pistons and levers, and leads of geared shafts, that are open: the decisions about them."""

from __future__ import annotations

from collections.abc import Sequence

from laufruhe import units
from laufruhe.files.complaints import Refused
from laufruhe.files.engine import EngineTable
from laufruhe.files.fields import Open
from laufruhe.files.rotors import CounterweightTable
from laufruhe.machine import CRANKSHAFT, SliderCrank
from laufruhe.problem.decision import Decision, Kind, NumberDrive

OPPOSED = "second crankshaft"
SECOND, RECIPROCATING = "second_reciprocating_mass", "reciprocating_mass"


def piston_masses(
    table: EngineTable, parts: Sequence[SliderCrank], weights: Sequence[CounterweightTable]
) -> list[Decision]:
    """Decisions about masses of slider-cranks: of all that give none of their own, and of those open themselves."""
    second = getattr(table, SECOND)
    found = list[Decision]()
    for key, mass in table.open_masses.items():
        own = [getattr(row, key, None) for row in table.slider_cranks] or [
            second if part.shaft != CRANKSHAFT and key == RECIPROCATING else None for part in parts
        ]
        names = [part.name for part, given in zip(parts, own, strict=True) if given is None]
        found += _decisions(key.replace("_", " "), mass, names, key)
    if isinstance(second, Open):
        names = [part.name for part in parts if part.shaft != CRANKSHAFT]
        found += _decisions("second reciprocating mass", second, names)
    for part, row in zip(parts, table.slider_cranks, strict=False):
        if isinstance(row.reciprocating_mass, Open):
            found += _decisions(f"reciprocating mass of {part.name}", row.reciprocating_mass, [part.name])
    for decision in found[:1]:
        check_factors(weights, f"counts the {decision.name}, which is open")
    return found


def _decisions(name: str, mass: Open, parts: Sequence[str], key: str = RECIPROCATING) -> list[Decision]:
    return mass.decisions(name, "kg", *(NumberDrive(Kind.PISTON, (part, key)) for part in parts))


def check_factors(weights: Sequence[CounterweightTable], rule: str) -> None:
    """Refuse weights whose size follows from masses that are open."""
    for k, weight in enumerate(weights, 1):
        if weight.factor_key is not None:
            remedy = "give the counterweights a mass, or fix the other"
            raise Refused(f"counterweights[{k}].{weight.factor_key}", None, rule, remedy)


def leads_of(table: EngineTable) -> list[Decision]:
    """A decision for every shaft whose lead is open; the layout sees where one starts, so its bounds are looked at."""
    lead, ports = table.own("crank_lead"), table.own("port_arc")
    if isinstance(lead, Open) and ports is not None and max(map(abs, lead.bounds)) >= ports:
        rule = f"goes beyond the ports, which are open for {units.shown(ports, 'rad')}"
        raise Refused("engine.crank_lead", None, rule, "narrow its bounds")
    leads = [(f"{shaft.name}.lead", shaft.name, shaft.lead) for shaft in table.shafts]
    leads += [("crank lead", OPPOSED, lead)]
    return [
        decision
        for name, shaft, own in leads
        for decision in Open.of(own).decisions(name, "rad", NumberDrive(Kind.LEAD, shaft))
    ]
