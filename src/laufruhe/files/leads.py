"""Leads of geared shafts that are open: the decisions about them."""

from __future__ import annotations

from laufruhe import units
from laufruhe.files.complaints import Refused
from laufruhe.files.engine import EngineTable
from laufruhe.files.fields import Open
from laufruhe.problem.decision import Decision, Kind, NumberDrive

OPPOSED = "second crankshaft"


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
