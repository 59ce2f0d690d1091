"""[[geared_inertias]] of a problem file, and the decisions about their shares (L8)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, TypeAlias

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused
from laufruhe.files.fields import Name, Open, Table
from laufruhe.machine import GearedInertia
from laufruhe.problem.decision import Decision, Kind, NumberDrive

OpenShare: TypeAlias = Annotated[float | Open, f.Number("", minimum=0.0, maximum=1.0, openable=True)]
_ROUNDING = 1e-12


class GearedInertiaTable(Table):
    """A second crank, or a flywheel on a shaft of its own."""

    name: Name
    ratio: f.Ratio = f.optional("Speed over crank speed; negative runs against the crank.", -1.0)
    share: OpenShare = f.required("Share of the inertia of all that turns, reduced to the crank.")


def geared_of(tables: Sequence[GearedInertiaTable]) -> tuple[tuple[GearedInertia, ...], list[Decision]]:
    """Return the geared inertias, and the decisions about their shares (L8)."""
    inertias, decisions = [], list[Decision]()
    for table in tables:
        share = Open.from_value(table.share)
        inertias.append(GearedInertia(table.name, table.ratio, share.start))
        decisions += share.decisions(f"{table.name}.share", "", NumberDrive(Kind.SHARE, table.name))
    maximum = sum(Open.from_value(table.share).upper for table in tables)
    if maximum > 1.0 + _ROUNDING:
        rule = f"have shares with the sum {maximum:g}, more than the whole inertia"
        raise Refused("geared_inertias", None, rule, "give shares of the geared inertias that add up to at most 1")
    return tuple(inertias), decisions
