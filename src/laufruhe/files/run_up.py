"""[run_up] of a problem file: how the engine is run up and shut down."""

from __future__ import annotations

from collections.abc import Sequence

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, nearest
from laufruhe.files.fields import Table
from laufruhe.machine import Block, Mount, Run
from laufruhe.machine.dynamic import FluidTrack
from laufruhe.machine.mount import every_spring


class RunUpTable(Table):
    """From rest to a speed and back, through resonance."""

    up_to: f.Speed
    time: f.Time = f.told("Time in which the engine runs up from rest.", 3.0)
    shut_down_time: f.Time | None = f.told("Time in which the engine is shut down; by default that of the run-up.")
    operating_point: str | None = f.told(
        "Operating point whose gas drives the engine during the run; the slowest by default."
    )


def run_of(table: RunUpTable | None, block: Block | None, mounts: Sequence[Mount], points: Sequence[str]) -> Run | None:
    """How the engine is run up and shut down."""
    if table is None:
        return None
    if block is None:
        raise Refused(
            "run_up", None, "needs elastic mounts, that have resonances", 'add [mounts] with kind = "elastic"'
        )
    for _, spring in every_spring(mounts):
        if any(not isinstance(law, FluidTrack) for law in spring.dynamic):
            rule = f"has no law for mount '{spring.name}', whose stiffness was measured over frequency"
            raise Refused("run_up", None, rule, "give it a fluid_track, or leave run_up out")
    if table.operating_point is not None and table.operating_point not in points:
        raise Refused(
            "run_up.operating_point", table.operating_point, "is none here", nearest(table.operating_point, points)
        )
    return Run(table.up_to, table.time, table.shut_down_time or table.time, table.operating_point or "")
