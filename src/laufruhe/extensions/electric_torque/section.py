"""Report section of electric machines: torque by order, largest torque and current, copper loss, electric power."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from laufruhe.extensions.electric_torque.channels import ELECTRIC_TORQUE
from laufruhe.extensions.electric_torque.machine import ElectricMachines, machines_of
from laufruhe.present.measures import decided_design
from laufruhe.present.numbers import figure, number, with_unit
from laufruhe.present.tables import Table
from laufruhe.problem.evaluation import evaluate
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result

STEPS = 2880


def has_machines(result: Result) -> bool:
    """Return True if the engine of a result has electric machines."""
    return bool(machines_of(result.final.engine)) and bool(result.problem.points)


def _record(result: Result) -> Mapping[str, Any]:
    """Return the torques of every machine of the final design at every operating point [SI] (T16)."""
    record: dict[str, list[Mapping[str, Any]]] = {}
    for point in result.problem.points:
        for machine in machines_of(result.final.engine):
            torque = machine.torque(point.name, result.final.engine.cycle.base_order)
            pairs = zip(torque.orders.tolist(), torque.coefficients.tolist(), strict=True)
            largest = float(np.abs(torque.sample(STEPS)).max())
            # Parseval
            rms = math.sqrt(machine.mean**2 + 0.5 * float(np.sum(np.abs(torque.coefficients[1:]) ** 2)))
            constant = machine.torque_constant
            loss = None if machine.resistance is None or not constant else machine.resistance * (rms / constant) ** 2
            record.setdefault(machine.name, []).append({
                "point": point.name,
                "orders": [
                    {"order": order, "torque": abs(value), "angle": float(np.angle(value)) % math.tau}
                    for order, value in pairs if order and value
                ],
                "largest_torque": largest,
                "rms_torque": rms,
                "largest_current": None if not constant else largest / constant,
                "copper_loss": loss,
                "electric_power": machine.mean * abs(machine.ratio) * point.speed + (loss or 0.0),
            })  # fmt: skip
    return record


def _tables(result: Result) -> list[Table]:
    columns = {"largest_torque": "N m", "largest_current": "A", "copper_loss": "W", "electric_power": "W"}
    rows = []
    for name, facts in ((name, facts) for name, points in _record(result).items() for facts in points):
        words = ", ".join(
            f"{number(one['torque'], 3)} N m of order {one['order']:g} at {number(math.degrees(one['angle']), 3)} deg"
            for one in facts["orders"]
        )
        sizes = ("" if facts[key] is None else figure(facts[key], unit) for key, unit in columns.items())
        rows.append((facts["point"], name, words or "none", *sizes))
    note = (
        f"{decided_design(result).capitalize()}: amplitude a and angle b stand for a cos(order x crank angle + b). "
        "Electric power: mechanical power of the mean torque, and copper loss. "
        "An alternating torque takes and gives back equal energy."
    )
    of_limits = "; ".join(_limit_words(result))
    note += f" Limits of the torque: {of_limits}." if of_limits else ""
    for name in _without_effect(result):
        note += f" {name} acts on nothing that is minimised or limited beside its own torque."
    head = ("at", "machine", "alternating torque", *(key.replace("_", " ") for key in columns))
    return [Table(head, tuple(rows), title="Electric machines", left=3, note=note, file="electric-machines")]


def _without_effect(result: Result) -> list[str]:
    # machines whose torque changes no measure, such as one on the crank whose stator stands on the ground
    engine, names = result.final.engine, list[str]()
    measures = {measure for measure in result.problem.measures if measure.channel is not ELECTRIC_TORQUE}
    extra = engine.extra(ElectricMachines) or ElectricMachines()
    for one in extra.machines if not result.final.resonance else ():
        moved = extra.moved({(one.name, k): 1.0 for k in range(len(one.harmonics))}, (), ())
        other = evaluate(result.problem, engine.with_extra(moved), result.final.samples)
        if one.harmonics and all(other.value(measure) == result.final.value(measure) for measure in measures):
            names.append(one.name)
    return names


def _limit_words(result: Result) -> Iterator[str]:
    # the torque of a limit, and the current or loss that its key states
    limits = {limit.name: limit.maximum for limit in result.problem.limits}
    for one in machines_of(result.final.engine):
        constant, points = one.torque_constant or math.nan, ["", *(f" at {p.name}" for p in result.problem.points)]
        if (torque := limits.get(f"{one.name}.max_current")) is not None:
            yield f"{one.name}.max_current of {with_unit(torque / constant, 'A')} is {with_unit(torque, 'N m')}"
        for torque in [limits[name] for place in points if (name := f"{one.name}.max_loss{place}") in limits][:1]:
            loss = (one.resistance or math.nan) * (torque / constant) ** 2
            yield f"{one.name}.max_loss of {with_unit(loss, 'W')} is {with_unit(torque, 'N m')} rms"


SECTION = Section("electric_machines", has_machines, _tables, _record, ("electric-machines",))
