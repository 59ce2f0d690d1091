"""Tables of a block on elastic mounts: natural modes, mounts, and static load cases."""

from __future__ import annotations

import numpy as np

from laufruhe.machine.mount import every_spring
from laufruhe.physics.modes import MOTIONS
from laufruhe.physics.static_cases import settled
from laufruhe.present.measures import is_changed
from laufruhe.present.mounting import MountingFacts, critical_speed, facts_of, is_elastic
from laufruhe.present.numbers import DASH, RPM, figure, fixed, number, trimmed
from laufruhe.present.tables import Table
from laufruhe.problem.channels import MOUNT_TRAVEL, mounting_in
from laufruhe.problem.evaluation import place_measures
from laufruhe.solvers.result import Result
from laufruhe.units import readable


def modes(result: Result) -> list[Table]:
    """Return tables of natural modes of both designs, and of the final elastic mounts; empty for rigid mounts."""
    if not is_elastic(result):
        return []
    facts_by_design = [facts_of(design) for design in result.designs.values()]
    words = (" of the initial design", " of the final design") if is_changed(result) else ("",)
    tables = [_modes(facts, f"Natural modes{which}") for facts, which in zip(facts_by_design, words, strict=True)]
    return [*tables, _mounts(result, facts_by_design[-1])]


def _modes(facts: MountingFacts, title: str) -> Table:
    order = facts.orders[0] if facts.orders else 0.0
    rows = []
    for j, (name, frequency) in enumerate(zip(facts.modes.names, facts.modes.frequencies, strict=True)):
        driven = j in facts.excited
        critical = critical_speed(frequency, order) * RPM if order and driven else 0.0
        shares = [fixed(100.0 * share, 1) for share in facts.modes.energy[:, j]]
        rows.append(
            (name, number(frequency), "yes" if driven else "no", number(critical) if critical else DASH, *shares)
        )
    still = [name for j, name in enumerate(facts.modes.names) if j not in facts.excited]
    remark = "The loads excite all modes."
    if still:
        remark = f"No load moves the block in {', '.join(still)}, so forces and travel have no part of these modes."
    note = f"Kinetic energy in %. {remark}"
    if facts.depends_on_frequency:
        together = ", ".join(number(frequency) for frequency in facts.with_fluid)
        fluid = f"; block and fluid tracks together, undamped: {together} Hz" if together else ""
        note += f" The modes use the stiffness at rest{fluid}."
    head = ("mode", "Hz", "excited", f"order {order:g} at rpm" if order else "critical rpm", *MOTIONS)
    return Table(head, rows, title=title, note=note)


def _mounts(result: Result, facts: MountingFacts) -> Table:
    rows, points, (unit, factor) = [], result.problem.points, readable("m")
    slowest = min(range(len(points)), key=lambda k: points[k].speed)
    travels = place_measures(result.final, slowest, MOUNT_TRAVEL)
    for k, spring in every_spring(result.final.engine.mounts):
        stiffness = " / ".join(trimmed(1e-3 * k) for k in spring.stiffness)
        place = ", ".join(trimmed(factor * c) for c in spring.position)
        sag, largest_travel = number(factor * facts.mount_sag[k]), number(factor * travels[k].max)
        rows.append((spring.name, place, stiffness, trimmed(spring.loss_factor), sag, largest_travel))
    axis = ", ".join(fixed(c, 3) for c in facts.torque_roll_axis)
    note = (
        f"The centre of gravity sags {figure(facts.sag, 'm')}; the mean torque moves a mount by at most "
        f"{figure(facts.torque_travel, 'm', scale=facts.sag)}. "
        "Travel: the largest at the slowest operating point. "
        f"Turning about the torque-roll axis ({axis}) is {100.0 * facts.torque_roll_coupling:.3g} % from being a mode; "
        f"best fit at {facts.torque_roll_frequency:.3g} Hz."
    )
    head = ("mount", f"place [{unit}]", "stiffness along its axes [N/mm]", "loss factor", f"sag [{unit}]",
            f"travel at {points[slowest].name} [{unit}]")  # fmt: skip
    return Table(head, rows, title="Mounts", left=3, note=note)


def load_cases(result: Result) -> list[Table]:
    """Return a table of travel and force of every mount under each static load case."""
    if not is_elastic(result) or not result.final.engine.load_cases:
        return []
    mounting, rows = mounting_in(result.final.engine), []
    (length, millimetres), (unit, factor) = readable("m"), readable("N")
    for case in result.final.engine.load_cases:
        state = settled(mounting, case)
        for mount, travel, force in zip(mounting.mounts, state.travel, state.force, strict=True):
            travels = (number(millimetres * along) for along in travel)
            on_stop = "yes" if mount.name in state.on_stops else DASH
            rows.append((case.name, mount.name, *travels, number(factor * float(np.linalg.norm(force))), on_stop))
    head = (
        "load case",
        "mount",
        *(f"{axis} [{length}]" for axis in ("travel x", "y", "z")),
        f"force [{unit}]",
        "on its stop",
    )
    note = "Travel is measured from the position without these loads."
    return [Table(head, rows, title="Load cases", left=2, note=note, file="load-cases")]
