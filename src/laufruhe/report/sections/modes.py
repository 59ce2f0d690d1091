"""Tables of natural modes and of the mounts."""

from __future__ import annotations

from laufruhe.machine.mount import every_spring
from laufruhe.physics.modes import MOTIONS
from laufruhe.present.measures import is_changed
from laufruhe.present.mounting import MountingFacts, critical_speed, facts_of, is_elastic
from laufruhe.present.numbers import DASH, RPM, figure, fixed, number, trimmed
from laufruhe.present.tables import Table
from laufruhe.problem.channels import MOUNT_TRAVEL
from laufruhe.problem.evaluation import place_measures
from laufruhe.solvers.result import Result


def tables(result: Result) -> list[Table]:
    """Return the modes of the initial and the final design, and the final mounts; empty for rigid mounts."""
    if not is_elastic(result):
        return []
    facts_by_design = [facts_of(design) for design in result.designs.values()]
    words = (" of the initial design", " of the final design") if is_changed(result) else ("",)
    modes = [_modes(facts, f"Natural modes{which}") for facts, which in zip(facts_by_design, words, strict=True)]
    return [*modes, _mounts(result, facts_by_design[-1])]


def _modes(facts: MountingFacts, title: str) -> Table:
    order = facts.orders[0] if facts.orders else 0.0
    rows = []
    for j, (name, frequency) in enumerate(zip(facts.modes.names, facts.modes.frequencies, strict=True)):
        driven = j in facts.excited
        critical = critical_speed(frequency, order) * RPM if order and driven else 0.0
        shares = [fixed(100.0 * share, 1) for share in facts.modes.energy[:, j]]
        critical_text = number(critical) if critical else DASH
        rows.append((name, number(frequency), "yes" if driven else "no", critical_text, *shares))
    unexcited = 6 - len(facts.excited)
    remark = f"{unexcited} of 6 modes are not excited and not computed" if unexcited else "all modes are excited"
    head = ("mode", "Hz", "excited", f"order {order:g} at rpm" if order else "critical rpm", *MOTIONS)
    return Table(head, tuple(rows), title=title, note=f"Kinetic energy in %; {remark}.{_of_fluid(facts)}")


def _of_fluid(facts: MountingFacts) -> str:
    if not facts.depends_on_frequency:
        return ""
    together = ", ".join(number(frequency) for frequency in facts.with_fluid)
    fluid = f"; block and fluid tracks together, undamped: {together} Hz" if together else ""
    return f" The modes use the stiffness at rest{fluid}."


def _mounts(result: Result, facts: MountingFacts) -> Table:
    rows, points = [], result.problem.points
    slowest = min(range(len(points)), key=lambda k: points[k].speed)
    travels = place_measures(result.final, slowest, MOUNT_TRAVEL)
    for k, spring in every_spring(result.final.engine.mounts):
        stiffness = " / ".join(trimmed(1e-3 * k) for k in spring.stiffness)
        place = ", ".join(trimmed(1e3 * c) for c in spring.position)
        sags, largest_travel = number(1e3 * facts.mount_sag[k]), number(1e3 * travels[k].max)
        rows.append((spring.name, place, stiffness, trimmed(spring.loss_factor), sags, largest_travel))
    axis = ", ".join(fixed(c, 3) for c in facts.torque_roll_axis)
    note = (
        f"The centre of gravity sags {figure(facts.sag, 'm')}; the mean torque moves a mount by at most "
        f"{figure(facts.torque_travel, 'm', scale=facts.sag)}. "
        "Travel: the largest at the slowest operating point. "
        f"Turning about the torque-roll axis ({axis}) is {100.0 * facts.torque_roll_coupling:.3g} % from being a mode; "
        f"best fit at {facts.torque_roll_frequency:.3g} Hz."
    )
    head = ("mount", "place [mm]", "stiffness along its axes [N/mm]", "loss factor", "sag [mm]",
            f"travel at {points[slowest].name} [mm]")  # fmt: skip
    return Table(head, tuple(rows), title="Mounts", left=3, note=note)
