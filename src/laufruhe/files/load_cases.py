"""[[load_cases]] of a problem file: loads that are held."""

from __future__ import annotations

from collections.abc import Sequence

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, all_different
from laufruhe.files.fields import Name, Table
from laufruhe.machine import Block
from laufruhe.machine.load_case import LoadCase


class LoadCaseTable(Table):
    """A load that is held: weight, a bump, a torque. Travel counts from where the engine stands without it."""

    name: Name
    times_weight: f.Three[f.Factor] | None = f.told("The weight of the block, so many times along x, y and z.")
    torque: f.Moment | None = f.told("Moment about x, as that of the crank on the block.")
    force: f.Three[f.SignedForce] | None = f.told("A force along x, y and z.")
    place: f.Three[f.Length] | None = f.told("Where the force acts.")


def load_cases_of(tables: Sequence[LoadCaseTable], block: Block | None) -> tuple[LoadCase, ...]:
    """Loads that are held."""
    if tables and block is None:
        rule = "needs elastic mounts, that give way"
        raise Refused("load_cases", None, rule, 'add [mounts] with kind = "elastic", and [block]')
    all_different([table.name for table in tables], "load_cases", "load cases have one name")
    found = []
    for k, table in enumerate(tables, 1):
        if not any((*(table.times_weight or ()), table.torque, *(table.force or ()))):
            raise Refused(f"load_cases[{k}]", table.name, "is no load", "give times_weight, torque or force")
        if table.place is not None and table.force is None:
            raise Refused(f"load_cases[{k}].place", table.place, "is of no force", "give the force, or leave it out")
        weight, force, place = (
            (three[0], three[1], three[2]) if three else (0.0, 0.0, 0.0)
            for three in (table.times_weight, table.force, table.place)
        )  # fmt: skip
        found.append(LoadCase(table.name, weight, force, place, (table.torque or 0.0, 0.0, 0.0)))
    return tuple(found)
