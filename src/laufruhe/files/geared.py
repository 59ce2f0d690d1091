"""[[geared_inertias]] of a problem file: inertia on shafts that are geared to the crank (L8)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, TypeAlias

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused
from laufruhe.files.fields import Name, Open, Table
from laufruhe.machine import GearedInertia
from laufruhe.problem.decision import Decision, Kind, NumberDrive

OpenShare: TypeAlias = Annotated[float | Open, f.Number("", least=0.0, most=1.0, openable=True)]
_ROUNDING = 1e-12


class GearedInertiaTable(Table):
    """A second crank, or a flywheel on a shaft of its own."""

    name: Name
    ratio: f.Ratio = f.told("Speed over crank speed; negative runs against the crank.", -1.0)
    share: OpenShare = f.needed("Share of the inertia of all that turns, reduced to the crank.")


def geared_of(tables: Sequence[GearedInertiaTable]) -> tuple[tuple[GearedInertia, ...], list[Decision]]:
    """The geared inertias, and the decisions about their shares."""
    found, decisions = [], list[Decision]()
    for table in tables:
        share = Open.of(table.share)
        found.append(GearedInertia(table.name, table.ratio, share.start))
        decisions += share.decisions(f"{table.name}.share", "", NumberDrive(Kind.SHARE, table.name))
    most = sum(Open.of(table.share).upper for table in tables)
    if most > 1.0 + _ROUNDING:
        rule = f"add up to {most:g}, and the inertia of all that turns is one"
        raise Refused("geared_inertias", None, rule, "let shares, and the largest of open ones, add up to 1 at most")
    return tuple(found), decisions
