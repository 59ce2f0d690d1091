"""Torque of electric machines on crank or shaft, by order: power is torque times speed, and moments balance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from attack.plain_loads import SAMPLES, angles, number

ROLE = "e"
"""Role of an open torque among the rotors of a design."""


def largest(machine: dict[str, Any]) -> float:
    """Return the largest torque at any angle [N m]."""
    by_current = number(machine.get("max_current", math.inf)) * number(machine.get("torque_constant", 1.0))
    return min(number(machine.get("max_torque", math.inf)), by_current)


def open_torques(table: dict[str, Any]) -> Iterator[tuple[str, float, float]]:
    """Yield name, order and largest amplitude: no order of a torque within bounds has more than a square wave."""
    points = table["operating_points"]
    for machine in table.get("electric_machines", []):
        for order in machine.get("orders", []):
            for point in points if len(points) > 1 else [None]:
                name = f"{machine['name']}.order {order:g}" + (f" at {point['name']}" if point else "")
                yield name, float(order), 4.0 / math.pi * largest(machine)


def limits(table: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the limits that the keys of a machine mean."""
    rows = []
    for machine in table.get("electric_machines", []):
        one, points = {"electric_machines": [machine["name"]]}, table["operating_points"]
        if (maximum := largest(machine)) < math.inf:
            key = "max_torque" if "max_torque" in machine else "max_current"
            rows.append({"limit": "maximum electric torque", "max": maximum, "name": f"{machine['name']}.{key}", **one})
        if "max_loss" in machine:
            rms = number(machine["torque_constant"]) * math.sqrt(
                number(machine["max_loss"]) / number(machine["resistance"])
            )
            for point in points:
                place = f" at {point['name']}" if len(points) > 1 else ""
                entry = {"limit": "rms electric torque", "max": rms, "operating_points": [point["name"]], **one}
                rows.append({**entry, "name": f"{machine['name']}.max_loss{place}"})
    return rows


def torque(scene: Any, machine: dict[str, Any], point: dict[str, Any]) -> np.ndarray:
    """Return the torque of a machine over the cycle at an operating point [N m]."""
    total = np.full(SAMPLES, number(machine.get("mean_torque", 0.0)))
    rows = [
        (row["order"], number(row["torque"]) * np.exp(1j * math.radians(row.get("angle", 0.0))))
        for row in machine.get("harmonics", []) if row.get("operating_point", point["name"]) == point["name"]
    ]  # fmt: skip
    for name, *_, order, size, _, role in scene.rotors:
        if role == ROLE and name.startswith(f"{machine['name']}.order "):
            _, at, where = name.partition(" at ")
            if not at or where == point["name"]:
                rows.append((order, size))
    for order, size in rows:
        total += (size * np.exp(1j * order * angles(scene.turns))).real
    return total


def ratio_of(table: dict[str, Any], machine: dict[str, Any]) -> float:
    shafts = [*table["engine"].get("shafts", []), *table.get("balancer_shafts", [])]
    return next((float(s.get("ratio", 1)) for s in shafts if s["name"] == machine.get("shaft")), 1.0)


def on_crank_and_block(scene: Any, point: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the torque on the crank, and the roll moment on the block, of all machines."""
    crank, block = np.zeros(SAMPLES), np.zeros(SAMPLES)
    for machine in scene.table.get("electric_machines", []):
        of_machine, ratio = torque(scene, machine, point), ratio_of(scene.table, machine)
        # what the shaft drives is geared to the crank, and a stator on the block pulls it back
        driven = abs(ratio) * of_machine
        crank += driven
        block += driven - (math.copysign(1.0, ratio) * of_machine if machine.get("stator") == "ground" else 0.0)
    return crank, block
