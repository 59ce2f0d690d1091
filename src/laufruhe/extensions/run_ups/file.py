"""[run_up] of a problem file: run-up and shut-down of the engine."""

from __future__ import annotations

from dataclasses import replace

from laufruhe.extensions.run_ups.machine import Run
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, nearest
from laufruhe.files.fields import Table
from laufruhe.files.problem_file import ExtensionContext, Key
from laufruhe.machine.dynamic import FluidTrack
from laufruhe.machine.mount import every_spring
from laufruhe.problem.problem import Problem


class RunUpTable(Table):
    """Run from rest to a speed and back, through resonance."""

    up_to: f.Speed
    time: f.Time = f.optional("Time in which the engine runs up from rest.", 3.0)
    shut_down_time: f.Time | None = f.optional("Time in which the engine is shut down; by default that of the run-up.")
    operating_point: str | None = f.optional(
        "Operating point whose gas drives the engine during the run; the slowest by default."
    )


def _read(table: RunUpTable, problem: Problem, __: ExtensionContext) -> Problem:
    """Return the problem with the run-up and shut-down that the table [run_up] describes."""
    engine, points = problem.engine, [point.name for point in problem.points]
    if engine.block is None:
        raise Refused(
            "run_up",
            None,
            "needs elastic mounts, because rigid mounts have no resonance",
            'add [mounts] with kind = "elastic"',
        )
    for _, spring in every_spring(engine.mounts):
        if any(not isinstance(law, FluidTrack) for law in spring.dynamic):
            rule = f"has no equation in time for mount '{spring.name}', whose stiffness was measured over frequency"
            raise Refused("run_up", None, rule, "give the hydraulic mount a fluid_track, or remove run_up")
    if table.operating_point is not None and table.operating_point not in points:
        raise Refused(
            "run_up.operating_point",
            table.operating_point,
            "is not the name of an operating point of this problem",
            nearest(table.operating_point, points),
        )
    run = Run(table.up_to, table.time, table.shut_down_time or table.time, table.operating_point or "")
    return replace(problem, engine=engine.with_extra(run))


KEY = Key("run_up", RunUpTable, _read)
