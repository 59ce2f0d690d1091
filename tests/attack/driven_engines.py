"""Random crank-rockers and rhombic drives in place of the slider-cranks of an engine."""

from __future__ import annotations

import math
from typing import Any

from attack import families, plain_drives
from attack.families import Generator, Table, q
from attack.openings import middle
from attack.plain_loads import number


def drawn_linkage(rng: Generator, stroke: float) -> Table:
    """Draw the keys of a crank-rocker that makes a stroke with one way out and one back."""
    while True:
        arm, end, rod = stroke * rng.uniform(0.9, 2.0), stroke * rng.uniform(0.9, 2.0), stroke * rng.uniform(1.8, 3.5)
        coupler, side = stroke * rng.uniform(1.2, 3.0), int(rng.choice([-1, 1]))
        # coupler and rocker are about square, and the rod's pin moves about along the cylinder
        direction, distance = rng.uniform(0.0, 2.0 * math.pi), math.hypot(coupler, arm) * rng.uniform(0.9, 1.1)
        pivot = distance * complex(math.cos(direction), math.sin(direction))
        lean = math.acos((distance**2 + arm**2 - coupler**2) / (2.0 * distance * arm))
        rocker = direction + math.pi - side * lean
        across = 0.5 * math.pi * rng.choice([-1, 1]) + rng.uniform(-0.25, 0.25)
        height = pivot.imag + end * math.sin(across) + stroke * rng.uniform(-0.2, 0.2)
        keys: Table = {
            "rocker_pivot_along": q(pivot.real, "m"), "rocker_pivot_across": q(pivot.imag, "m"),
            "coupler_length": q(coupler, "m"), "rocker_arm": q(arm, "m"), "rocker_end": q(end, "m"),
            "rocker_angle": float(round(math.degrees(across - rocker) % 360.0, 3)), "rocker_side": side,
            "piston_rod_length": q(rod, "m"), "offset": q(height, "m"),
        }  # fmt: skip
        links = plain_drives.linkage(number, keys)
        radius = plain_drives.rocker_radius(links, stroke)
        if math.isfinite(radius) and radius < 0.35 * min(arm, coupler):
            return keys


def rocker_engine(rng: Generator, engine: Table) -> Table:
    stroke, mass = number(engine["stroke"]), middle(engine["reciprocating_mass"])
    keys = drawn_linkage(rng, stroke)
    for name, length in (("coupler", "coupler_length"), ("rocker", "rocker_end"), ("piston_rod", "piston_rod_length")):
        if rng.random() < 0.75:
            weight, size = mass * rng.uniform(0.1, 1.5), number(keys[length])
            centre = size * rng.uniform(-0.4 if name == "rocker" else 0.1, 0.9)
            inertia = weight * size**2 * rng.uniform(0.03, 0.2)
            keys[name] = {"mass": q(weight, "kg"), "centre_of_gravity": q(centre, "m"), "inertia": q(inertia, "kg m^2")}
    rest = {key: value for key, value in engine.items() if key not in ("rod_length", "rod_inertia_deficit", "offset")}
    return {**rest, "drive": "crank-rocker", **keys}


def rhombic_engine(rng: Generator, engine: Table) -> Table:
    """Return an engine with one half at every throw, or two that turn against each other."""
    mass = middle(engine["reciprocating_mass"])
    displacer: Any = q(mass * rng.uniform(0.3, 1.5), "kg")
    if rng.random() < 0.25 and engine.get("throws") != "open":
        displacer = {"between": [q(0.2 * mass, "kg"), q(2.0 * mass, "kg")], "start": displacer}
    driven = {**engine, "drive": "rhombic", "displacer_mass": displacer}
    if engine["layout"] != "parts" or "slider_cranks" not in engine or rng.random() < 0.3:
        return driven
    lever = q(0.5 * number(engine["stroke"]) * rng.uniform(0.2, 1.2), "m")
    shafts = driven["shafts"] = [dict(shaft) for shaft in engine["shafts"]]
    rows = []
    for k, shaft in enumerate(shafts[:2]):
        if "lead" not in shaft:
            shaft["ratio"] = 1 - 2 * k
        throw = families.angle(rng) if k else 0.0
        row = {"x": q(rng.uniform(-0.02, 0.02), "m"), "throw": throw, "shaft": shaft["name"]}
        rows.append({**row, "offset": lever if k == 0 else f"-{lever}"})
    driven["slider_cranks"] = rows
    return driven


DRIVES = {"crank-rocker": rocker_engine, "rhombic": rhombic_engine}
