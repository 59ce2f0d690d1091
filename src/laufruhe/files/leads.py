"""Leads of geared shafts that are open: the decisions about them."""

from __future__ import annotations

from laufruhe import units
from laufruhe.files.complaints import Refused
from laufruhe.files.engine import EngineTable
from laufruhe.files.fields import Open
from laufruhe.problem.decision import Decision, Kind, NumberDrive

OPPOSED = "second crankshaft"


def leads_of(table: EngineTable) -> list[Decision]:
    """A decision for every shaft whose lead is open."""
    _check_ports(table)
    leads = [(f"{shaft.name}.lead", shaft.name, shaft.lead) for shaft in table.shafts]
    leads += [("crank lead", OPPOSED, table.own("crank_lead"))]
    return [
        decision
        for name, shaft, lead in leads
        for decision in Open.of(lead).decisions(name, "rad", NumberDrive(Kind.LEAD, shaft))
    ]


def _check_ports(table: EngineTable) -> None:
    """Refuse bounds of a lead that go beyond the ports: the layout sees where it starts."""
    lead, ports = table.own("crank_lead"), table.own("port_arc")
    if isinstance(lead, Open) and ports is not None and max(map(abs, lead.bounds)) >= ports:
        rule = f"goes beyond the ports, which are open for {units.shown(ports, 'rad')}"
        raise Refused("engine.crank_lead", None, rule, "narrow its bounds")
