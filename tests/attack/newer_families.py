"""Random problems with electric machines, with receivers, and with limits on the motion of pistons."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np

from attack import crossings, families, plain_motion
from attack.driven_engines import DRIVES
from attack.families import Generator, moving_mass, q, with_objective
from attack.openings import Openings
from attack.plain_loads import Machine, number, turns_of
from attack.plain_scene import Scene, Table, machine_of
from attack.ranged_families import QUICK, with_ranges
from attack.star_list import even_stars

RESPONSES = {"receiver acceleration": "m/s^2", "receiver velocity": "m/s"}


# --- electric machines


def machine(rng: Generator, table: Table, name: str, shafts: list[str]) -> Table:
    """Open torques of some orders, single ones that are given, and limits of torque and loss."""
    engine, speed = table["engine"], number(table["operating_points"][0]["speed"])
    size = moving_mass(engine) * 0.5 * number(engine["stroke"]) * speed**2
    turns = turns_of(engine)
    largest, constant = size * 10.0 ** rng.uniform(-1.5, 0.3), rng.uniform(0.2, 1.0)
    orders = sorted(int(k) / turns for k in rng.choice(range(1, 6 * turns), int(rng.integers(1, 4)), replace=False))
    one: Table = {"name": name, "orders": orders}
    if shafts and rng.random() < 0.4:
        one["shaft"] = str(rng.choice(shafts))
    if rng.random() < 0.4:
        one["stator"] = "ground"
    if rng.random() < 0.4:
        one["mean_torque"] = q(-0.2 * largest, "N m")
    if rng.random() < 0.5:
        one |= {"torque_constant": q(constant, "N m/A"), "max_current": q(largest / constant, "A")}
        if rng.random() < 0.7:
            loss = 0.05 * (largest * rng.uniform(0.3, 0.8) / constant) ** 2
            one |= {"resistance": "0.05 ohm", "max_loss": q(loss, "W")}
    else:
        one["max_torque"] = q(largest, "N m")
    if rng.random() < 0.3:
        free = [k / turns for k in range(1, 8 * turns) if k / turns not in orders]
        row: Table = {"order": float(rng.choice(free)), "torque": q(0.3 * largest, "N m"), "angle": families.angle(rng)}
        if rng.random() < 0.5:
            row["operating_point"] = table["operating_points"][0]["name"]
        one["harmonics"] = [row]
    return one


ELECTRIC = {
    "inline": families.FAMILIES["inline"], "gas": families.FAMILIES["gas"], "vee": families.FAMILIES["vee"],
    "elastic-balance": families.FAMILIES["elastic-balance"],
}  # fmt: skip
CROSSED = {
    "stars": families.FAMILIES["stars"], "elastic-few": families.FAMILIES["elastic-few"],
    "uneven": families.FAMILIES["uneven"], "places": families.FAMILIES["places"],
    "ranks with limits": crossings.CROSSINGS["ranks with limits"],
    "robust and star": crossings.CROSSINGS["robust and star"],
    "optional shafts and uneven throws": crossings.CROSSINGS["optional shafts and uneven throws"],
}  # fmt: skip


def electric(rng: Generator) -> Table:
    """Draw one or two machines on the crank or on shafts, with weights mostly."""
    is_crossed = rng.random() < 0.25
    family = str(rng.choice(list(CROSSED if is_crossed else ELECTRIC)))
    table = copy.deepcopy({**ELECTRIC, **CROSSED}[family](rng))
    if rng.random() < 0.25 and not isinstance(table["engine"].get("throws"), str):
        table["engine"] = DRIVES[str(rng.choice(list(DRIVES)))](rng, table["engine"])
    shafts = [shaft["name"] for shaft in table.get("balancer_shafts", [])]
    names = ["g0", "g1"][: int(rng.integers(1, 3))]
    table["electric_machines"] = [machine(rng, table, name, shafts) for name in names]
    if not is_crossed and rng.random() < 0.3:
        table.pop("counterweights", None)
        if not any("shaft" in one for one in table["electric_machines"]):
            table.pop("balancer_shafts", None)
    if not is_crossed:
        channels = ("roll moment", "mount force") if "block" not in table else ("mount force", "mount travel")
        table = with_objective(rng, table, 2, channels=channels)
        if rng.random() < 0.25:
            table |= {"flywheel": {"inertia": q(30.0 * moving_mass(table["engine"]), "kg m^2")}}
            table["objective"] = {"minimise": f"{rng.choice(families.NORMS)} stored work"}
    return {**table, **(QUICK if is_crossed else {}), "title": f"electric machines with {family}"}


# --- receivers


def receivers(rng: Generator, frame: bool) -> list[Table]:
    rows = []
    for k in range(int(rng.integers(1, 3))):
        row: Table = {"name": f"seat{k}", "point": [q(v, "m", 3) for v in rng.uniform(-0.6, 0.6, 3)]}
        row["unit"] = str(rng.choice(["m/s^2", "m/s"])) if k else "m/s^2"
        if frame and rng.random() < 0.7:
            row["on"] = "frame"
        names = ["none", "Wk", "Wd", "Wh"]
        row["weighting"] = str(rng.choice(names)) if rng.random() < 0.6 else [str(n) for n in rng.choice(names, 3)]
        if rng.random() < 0.3:
            low = rng.uniform(1.0, 12.0)
            row["band"] = [q(low, "Hz"), q(low * rng.uniform(4.0, 30.0), "Hz")]
        rows.append(row)
    return rows


def frame(rng: Generator) -> Table:
    springs = [
        {
            "position": [q(v, "m", 3) for v in (along * rng.uniform(0.5, 1.5), aside * rng.uniform(0.4, 0.9), -0.4)],
            "stiffness": [q(v, "N/m", 4) for v in rng.uniform(4e4, 4e5, 3)],
            "damping": [q(v, "N s/m", 3) for v in rng.uniform(200.0, 3000.0, 3)],
            "loss_factor": float(round(rng.uniform(0.0, 0.1), 3)),
        }
        for along in (1, -1) for aside in (1, -1)
    ]  # fmt: skip
    return {
        "mass": q(rng.uniform(200.0, 1500.0), "kg", 4),
        "centre_of_gravity": [q(v, "m", 3) for v in rng.uniform(-1, 1, 3)],
        "inertia": [q(v, "kg m^2", 3) for v in rng.uniform(150.0, 240.0, 3)],
        "inertia_products": [q(v, "kg m^2", 3) for v in rng.uniform(-15.0, 15.0, 3)],
        "springs": springs if rng.random() < 0.8 else [],
    }  # fmt: skip


SHAKEN = (*["elastic-balance"] * 6, "elastic-few", "joint")


def at_receivers(rng: Generator) -> Table:
    """Minimise or limit the response of receivers, with weights and mounts open, ranges and drives at times."""
    family = str(rng.choice(SHAKEN)) if rng.random() < 0.95 else "stars on mounts"
    table = copy.deepcopy({**families.FAMILIES, **crossings.CROSSINGS}[family](rng))
    if rng.random() < 0.3 and table["engine"].get("throws") != "open":
        table["engine"] = DRIVES[str(rng.choice(list(DRIVES)))](rng, table["engine"])
    has_frame = rng.random() < 0.6
    table["receivers"] = receivers(rng, has_frame)
    if has_frame:
        table["frame"] = frame(rng)
    units = {row["unit"] for row in table["receivers"]}
    channels = tuple(name for name, unit in RESPONSES.items() if unit in units)
    table.pop("constraints", None)
    norms = families.NORMS if "counterweights" in table else families.SMOOTH
    table = with_objective(rng, table, 2 if family == "elastic-balance" else 1, channels=channels, norms=norms)
    for term in table["objective"].get("terms", [table["objective"]]):
        if rng.random() < 0.4:
            term["direction_weights"] = [1.4, 1.4, 1.0]
    if rng.random() < 0.3:
        table = with_ranges(rng, table)
    elif rng.random() < 0.5:
        openings = Openings(table)
        star = next(even_stars(table["engine"])) if table["engine"].get("throws") == "open" else {}
        has = openings.scene(openings.random(rng), star).measure({"quantity": "rms mount force"})
        table["constraints"] = [
            {"limit": "rms mount force", "max": q(has * rng.uniform(0.9, 1.2), "N", 9), "name": "l"}
        ]
    quick = {} if family == "elastic-balance" else QUICK
    return {**table, **quick, "title": f"receivers with {family}"}


# --- motion of pistons


def motions(rng: Generator) -> Table:
    """Return sizes of slider-cranks or weights of a drive, with the motion of pistons limited or minimised."""
    sized = rng.random() < 0.6
    family = "inline" if sized else str(rng.choice(["inline", "vee", "opposed-piston", "parts", "yokes", "stars"]))
    table = copy.deepcopy(families.FAMILIES[family](rng))
    engine = table["engine"]
    if not sized and family != "yokes" and rng.random() < 0.6:
        table["engine"] = engine = DRIVES[str(rng.choice(list(DRIVES)))](rng, engine)
    names = [name for name in plain_motion.QUANTITIES if "rod" not in name and "side" not in name]
    if engine.get("drive", "slider-crank") == "slider-crank" and family != "yokes":
        names = list(plain_motion.QUANTITIES) if family == "inline" else [*names, "rod angle", "rod length"]
    if sized:
        stroke, rod = number(engine["stroke"]), number(engine["rod_length"])
        sizes: dict[str, tuple[float, float, float]] = {
            "stroke": (0.8 * stroke, 1.2 * stroke, stroke), "rod_length": (0.9 * rod, 1.3 * rod, rod),
            "offset": (-0.1 * stroke, 0.1 * stroke, number(engine.get("offset", 0.0))),
        }  # fmt: skip
        for key in rng.choice(list(sizes), int(rng.integers(1, 3)), replace=False).tolist():
            low, high, start = sizes[key]
            engine[key] = {"between": [q(low, "m"), q(high, "m")], "start": q(start, "m")}
        if rng.random() < 0.6:
            table.pop("counterweights", None)
            table.pop("balancer_shafts", None)
        else:
            table["counterweights"] = table["counterweights"][:1]
            table.pop("balancer_shafts", None)
        table = with_objective(rng, table, 1, norms=families.SMOOTH)
        if rng.random() < 0.3:
            table["objective"] = {"minimise": str(rng.choice([n for n in names if n != "rod length"]))}
    openings = Openings(table)
    star = next(even_stars(engine)) if engine.get("throws") == "open" else {}
    scene, at_start = openings.scene(openings.random(rng), star), openings.scene(np.zeros(openings.size), star)
    rows: list[Table] = []
    for name in rng.choice(names, int(rng.integers(1, 3)), replace=False).tolist():
        if name == table["objective"].get("minimise"):
            continue
        entry: dict[str, Any] = {"quantity": name}
        if rng.random() < 0.3 and len(table["operating_points"]) > 1 and name not in ("rod length",):
            entry["operating_points"] = ["p1"]
        has = scene.measure(entry) if sized else at_start.measure(entry)
        if has <= 0.0 or not math.isfinite(has):
            continue
        unit, share = plain_motion.QUANTITIES[name], rng.uniform(0.995, 1.08)
        # planes of a convex program are those of largest values
        is_least = sized and name in ("piston travel", "rod length") and rng.random() < 0.5
        side, gives = ("min", 2.0 - share) if is_least else ("max", share)
        value = (min if side == "min" else max)(plain_motion.numbers(*_of(scene if sized else at_start, entry)))
        rest = {key: part for key, part in entry.items() if key != "quantity"}
        rows.append({"limit": name, side: q(value * gives, unit, 9), "name": f"m{len(rows)}", **rest})
    table |= {"constraints": rows, **(QUICK if sized else {})}
    return {**{k: v for k, v in table.items() if v != []}, "title": f"piston motion with {family}"}


def _of(scene: Scene, entry: Table) -> tuple[Scene, Machine, Table, str]:
    return scene, machine_of(scene.key, scene.order), entry, entry["quantity"]


FAMILIES = {"electric machines": electric, "receivers": at_receivers, "piston motion": motions}
