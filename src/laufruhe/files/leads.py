"""Leads of geared shafts that are open: the decisions about them."""

from __future__ import annotations

from laufruhe.files.engine import EngineTable
from laufruhe.files.fields import Open
from laufruhe.problem.decision import Decision, LeadDrive
from laufruhe.problem.sets import Interval

OPPOSED = "second crankshaft"


def leads_of(table: EngineTable) -> list[Decision]:
    """A decision for every shaft whose lead is open."""
    leads = [(f"{shaft.name}.lead", shaft.name, shaft.lead) for shaft in table.shafts]
    leads += [("crank lead", OPPOSED, table.own("crank_lead"))]
    return [
        Decision(name, "rad", Interval(*lead.bounds), lead.start, (LeadDrive(shaft),))
        for name, shaft, lead in leads
        if isinstance(lead, Open) and lead.is_open
    ]
