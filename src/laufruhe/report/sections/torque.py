"""Table of crankshaft torque, stored work and degree of irregularity."""

from __future__ import annotations

from laufruhe.physics.torque import TorqueFacts, torque_facts
from laufruhe.present.measures import uses_torque
from laufruhe.present.numbers import DASH, number
from laufruhe.present.tables import Table
from laufruhe.solvers.result import Result

NOTE = (
    "Torque of gas, pistons and rods, without friction. Stored: energy that the flywheel must store. "
    "Irregularity: largest less smallest speed over the mean."
)
HEAD = ("at", "mean [N m]", "power [kW]", "least [N m]", "largest [N m]", "stored [J]", "irregularity")


def tables(result: Result) -> list[Table]:
    """Return a row per operating point, if the problem asks for torque or has a flywheel."""
    engine, problem = result.final.engine, result.problem
    if not uses_torque(result):
        return []
    facts = ((point.name, torque_facts(engine, point, problem.fidelity)) for point in problem.points)
    rows = tuple(_row(*pair) for pair in facts)
    return [Table(HEAD, rows, title="Torque of the crankshaft", note=NOTE, file="crankshaft-torque")]


def _row(name: str, facts: TorqueFacts) -> tuple[str, ...]:
    size = max(abs(facts.minimum), abs(facts.largest))
    numbers = [number(value, scale=size) for value in (facts.mean, 1e-3 * facts.power, facts.minimum, facts.largest)]
    uneven = facts.irregularity
    even = DASH if uneven is None else "0" if not uneven else f"{number(uneven, 3)} (1/{1.0 / uneven:.4g})"
    return name, *numbers, number(facts.excursion), even
