"""Running gear by its sizes: what it weighs, what presses its sections, and stresses, each from its plain formula.

A shank is a straight rod of three points of mass that have its momentum and its energy; what presses its pins follows
from force and moment on it. A piece of the crankshaft between two bearings is a beam on two supports.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from attack import plain_crankcase
from attack.plain_loads import Machine, Mechanism, number

SIZED = {
    "crank-pin bending stress": "Pa", "web stress": "Pa", "journal torsion stress": "Pa", "rod stress": "Pa",
    "share of the buckling load": "", "crank-pin pressure": "Pa", "main-bearing pressure": "Pa",
    "piston-pin bending stress": "Pa",
}  # fmt: skip
"""Channels, and their units."""


def disc(diameter: float, bore: float = 0.0) -> float:
    return math.pi / 4.0 * (diameter**2 - bore**2)


def modulus(diameter: float, bore: float = 0.0) -> float:
    return math.pi / 32.0 * (diameter**4 - bore**4) / diameter


def part(table: dict[str, Any], name: str) -> dict[str, float]:
    """Return the numbers of a part of the running gear."""
    return {key: number(value) for key, value in table["running_gear"][name].items()}


def end(table: dict[str, Any]) -> tuple[float, float]:
    """Return the diameter and width of the crank pins."""
    entry = table["engine"]["big_end"]
    return number(entry["diameter"]), number(entry["width"])


def weighed(table: dict[str, Any]) -> dict[str, Any]:
    """Return the [engine] with the masses of its running gear."""
    gear, engine = table.get("running_gear", {}), table["engine"]
    if "density" not in gear:
        return engine
    density, radius = number(gear["density"]), 0.5 * number(engine["stroke"])
    shank, pin, webs = (part(table, name) for name in ("rod", "piston_pin", "webs"))
    across, width = end(table)
    journal = min(number(b["diameter"]) for b in table["main_bearings"])
    block = webs["width"] * webs["thickness"]
    # both webs reach from the journal's middle to beyond the pin, and as far the other way as the journal
    outer, inner = radius + 0.5 * across, 0.5 * journal
    throw = disc(across) * width * radius + 2.0 * block * 0.5 * (outer**2 - inner**2)
    return {
        **engine,
        "shank": density * disc(shank["diameter"], shank.get("bore", 0.0)) * number(engine["rod_length"]),
        "at_piston": density * disc(pin["diameter"], pin.get("bore", 0.0)) * pin["length"],
        "at_throw": density * throw / radius,
    }


def mass(table: dict[str, Any], machine: Machine) -> float:
    """Return the mass of pins, webs, shanks and piston pins [kg]."""
    density, radius = number(table["running_gear"]["density"]), machine.mechanisms[0].radius
    webs, (across, width) = part(table, "webs"), end(table)
    journal = min(number(b["diameter"]) for b in table["main_bearings"])
    throw = disc(across) * width
    throw += 2.0 * webs["width"] * webs["thickness"] * (radius + 0.5 * across + 0.5 * journal)
    parts = weighed(table)
    return len(machine.mechanisms) * (density * throw + parts["shank"] + parts["at_piston"])


def clearance(table: dict[str, Any], machine: Machine) -> float:
    """Return the room that pin, web and half a journal leave between the middles of pin and bearing [m]."""
    thickness, (_, width) = part(table, "webs")["thickness"], end(table)
    distances = []
    for m in machine.mechanisms:
        for bearing in _neighbours(table, m):
            room = abs(number(bearing["x"]) - m.x) - 0.5 * width - 0.5 * number(bearing["width"])
            distances.append(room - thickness)
    return min(distances)


def _neighbours(table: dict[str, Any], m: Mechanism) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the bearings before a throw and behind it."""
    ahead = [b for b in table["main_bearings"] if number(b["x"]) > m.x]
    behind = [b for b in table["main_bearings"] if number(b["x"]) < m.x]
    return min(ahead, key=lambda b: number(b["x"])), max(behind, key=lambda b: number(b["x"]))


def stress(scene: Any, machine: Machine, channel: str, k: int) -> np.ndarray:
    """Return an array (places, samples, d) at an operating point."""
    table, speed, gas = scene.table, scene.speeds[k], plain_crankcase.gas_at(scene, k)
    across, width = end(table)
    if channel == "crank-pin pressure":
        return plain_crankcase.at(scene, machine, "crank-pin force", k) / (across * width)
    if channel == "main-bearing pressure":
        sizes = [number(b["diameter"]) * number(b["width"]) for b in table["main_bearings"]]
        return plain_crankcase.at(scene, machine, "main-bearing force", k) / np.array(sizes)[:, None, None]
    if channel == "journal torsion stress":
        return _torsion(table, machine, speed, gas)
    if channel in ("rod stress", "share of the buckling load", "piston-pin bending stress"):
        pressed = [plain_crankcase.pressing_rod(m, machine.turns, speed, gas) for m in machine.mechanisms]
        return np.array([np.stack([p.real, p.imag], axis=-1) for p in pressed]) * _rod_factor(table, channel)
    forces = []
    for m in machine.mechanisms:
        front, rear = _neighbours(table, m)
        a, b = number(front["x"]), number(rear["x"])
        inside = [(x, f) for x, f in _loads(scene, machine, speed, gas) if b < x < a]
        if channel == "crank-pin bending stress":
            shares = [(a - x) * (m.x - b) if x >= m.x else (x - b) * (a - m.x) for x, _ in inside]
            moment = sum(s / (a - b) * f for s, (_, f) in zip(shares, inside, strict=True))
            forces.append(moment / modulus(across))
            continue
        webs = part(table, "webs")
        for support, far in ((a, b), (b, a)):
            carried = sum((far - x) / (far - support) * f for x, f in inside)
            lever = max(abs(support - m.x) - 0.5 * width - 0.5 * webs["thickness"], 0.0)
            bent = lever / (webs["width"] * webs["thickness"] ** 2 / 6.0)
            forces.append(carried * (bent + 1.0 / (webs["width"] * webs["thickness"])))
    return np.array([np.stack([force.imag, force.real], axis=-1) for force in forces])


def _loads(scene: Any, machine: Machine, speed: float, gas: dict[str, Any] | None) -> list[tuple[float, np.ndarray]]:
    """Return the loads on the crankshaft, each with its place."""
    pins = [plain_crankcase.on_pin(m, machine.turns, speed, gas) for m in machine.mechanisms]
    return plain_crankcase.on_shaft(scene, machine, pins, speed)


def _torsion(table: dict[str, Any], machine: Machine, speed: float, gas: dict[str, Any] | None) -> np.ndarray:
    """Return the torque of all throws before each journal [N m]."""
    torques = [(m.x, plain_crankcase.torque_of(m, machine.turns, speed, gas)) for m in machine.mechanisms]
    rows = []
    for bearing in table["main_bearings"]:
        through = sum((t for x, t in torques if x > number(bearing["x"])), np.zeros(len(torques[0][1])))
        rows.append(through / (2.0 * modulus(number(bearing["diameter"]))))
    return np.array(rows)[:, :, None]


def _rod_factor(table: dict[str, Any], channel: str) -> float:
    shank = part(table, "rod")
    if channel == "rod stress":
        return 1.0 / disc(shank["diameter"], shank.get("bore", 0.0))
    if channel == "piston-pin bending stress":
        pin = part(table, "piston_pin")
        span = pin["length"] * (1.0 - 0.5 * 0.5)
        return 2.0 / 3.0 * span / 4.0 / modulus(pin["diameter"], pin.get("bore", 0.0))
    bending = math.pi / 64.0 * (shank["diameter"] ** 4 - shank.get("bore", 0.0) ** 4)
    return number(table["engine"]["rod_length"]) ** 2 / (math.pi**2 * 210e9 * bending)
