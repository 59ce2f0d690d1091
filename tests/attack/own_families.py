"""Random problems of all that may be open on elastic mounts, which the own model judges.

Limits stand a little over what a random design has, so that it keeps them, or at what few of many designs have.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable

import numpy as np

from attack.driven_engines import DRIVES
from attack.families import (
    Generator,
    balancers,
    block,
    boxer,
    counterweights,
    gas_engine,
    inline,
    moving_mass,
    q,
    vee,
)  # fmt: skip
from attack.own_loads import si
from attack.own_problem import Designs, OwnModel, open_numbers_of
from attack.own_runs import MEASURES as OF_RUNS
from attack.plain_scene import Table

UNITS = {
    "force": "N", "travel": "m", "sag": "m", "stiffness": "N/m", "twist": "rad", "raw torque-roll residual": "N m/rad",
}  # fmt: skip


def unit_of(quantity: str) -> str:
    return next((unit for name, unit in UNITS.items() if quantity.endswith(name)), "")


def scene(rng: Generator, most_points: int, plain: bool, drive: str = "") -> Table:
    """Return the engine, gas, points and a block on mounts, all given; `plain` has nothing that no bound knows."""
    chance = rng.random()
    engine = gas_engine(rng) if chance < 0.5 else (inline, vee, boxer)[int(rng.integers(3))](rng)
    mass = block(rng)
    mirrored = rng.random() < 0.25
    if mirrored:
        mass["centre_of_gravity"][1] = "0.0 m"
        mass["inertia_products"] = ["0.0 kg m^2", mass["inertia_products"][1], "0.0 kg m^2"]
    if rng.random() < 0.25:
        mass["turning_inertia"] = q(rng.uniform(0.05, 0.4), "kg m^2", 3)
    points = [
        {
            "name": f"p{k}", "speed": q(math.exp(rng.uniform(math.log(60.0), math.log(420.0))), "rad/s"),
            "weight": float(round(rng.uniform(0.3, 3.0), 3)),
        }
        for k in range(int(rng.integers(1, most_points + 1)))
    ]  # fmt: skip
    table: Table = {"engine": engine, "operating_points": points, "block": mass, "mounts": mounts(rng, mirrored, plain)}
    if drive:
        table["engine"] = without_gas(DRIVES[drive](rng, engine))
    elif chance < 0.42:
        table["gas"] = gas(rng)
        if len(points) > 1 and rng.random() < 0.5:
            points[1] |= {"gas": False} if rng.random() < 0.5 else {"motored": True}
    return table


def without_gas(engine: Table) -> Table:
    """Return an engine without bore, with its displacer mass at the start."""
    rest = {key: value for key, value in engine.items() if key != "bore"}
    displacer = engine.get("displacer_mass")
    return {**rest, "displacer_mass": displacer["start"]} if isinstance(displacer, dict) else rest


def gas(rng: Generator) -> Table:
    if rng.random() < 0.5:
        return {
            "model": "seiliger",
            "peak_pressure": q(rng.uniform(55, 85), "bar"),
            "imep": q(rng.uniform(6.5, 10), "bar"),
        }
    return {
        "model": "wiebe", "imep": q(rng.uniform(2, 9), "bar"), "start": float(round(rng.uniform(-15, 2), 1)),
        "duration": float(round(rng.uniform(35, 70), 1)), "compression_ratio": float(round(rng.uniform(10, 18), 2)),
    }  # fmt: skip


def mounts(rng: Generator, mirrored: bool, plain: bool) -> Table:
    corners = [(1.0, 1.0), (-1.0, 1.0)] if mirrored else [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)]
    places = []
    for k, (along, aside) in enumerate(corners[: int(rng.integers(3, 5))]):
        at = (along * rng.uniform(0.2, 0.4), aside * rng.uniform(0.15, 0.4), rng.uniform(-0.1, 0.1))
        places.append({"name": f"m{k}", "position": [q(v, "m", 3) for v in at], **springs(rng, plain or mirrored)})
        if mirrored:
            places.append({"name": f"m{k}r", "mirror_of": f"m{k}"})
    if not mirrored and rng.random() < 0.12:
        places.append({"name": "mj", "joined_to": "m1", **springs(rng, True)})
    table: Table = {"kind": "elastic", "loss_factor": float(rng.choice([0.03, 0.05, 0.1, 0.2])), "places": places}
    if not plain and rng.random() < 0.2:
        table["damping_per_stiffness"] = q(rng.uniform(1e-4, 1.5e-3), "s", 3)
    return table


def springs(rng: Generator, plain: bool) -> Table:
    table: Table = {"stiffness": [q(v, "N/m", 4) for v in np.exp(rng.uniform(math.log(6e4), math.log(7e5), 3))]}
    if rng.random() < 0.4:
        table["damping"] = [q(v, "N s/m", 3) for v in rng.uniform(0, 900, 3)]
    if rng.random() < 0.45:
        table["turned"] = [float(round(v, 1)) for v in rng.uniform(-40, 40, 3) * (rng.random(3) < 0.7)]
    if rng.random() < 0.2:
        table["loss_factor"] = float(round(rng.uniform(0.02, 0.3), 3))
    if not plain and rng.random() < 0.1:
        table["fluid_track"] = {
            "axis": "z", "mass": q(rng.uniform(10, 60), "kg", 3), "bulge_stiffness": q(rng.uniform(1e5, 3e5), "N/m", 3),
            "chamber_stiffness": q(rng.uniform(2e3, 1e4), "N/m", 3), "damping": q(rng.uniform(200, 1500), "N s/m", 3),
        }  # fmt: skip
    return table


def open_numbers(rng: Generator, table: Table, kinds: list[str]) -> None:
    """Open one number of each kind, at any mount that has this number; open ones stay."""
    places = [place for place in table["mounts"]["places"] if "stiffness" in place]
    for kind in kinds:
        place, axis = places[int(rng.integers(len(places)))], int(rng.integers(3))
        if kind == "stiffness" and isinstance(place["stiffness"][axis], str):
            value, wide = si(place["stiffness"][axis]), float(rng.choice([1.6, 2.5, 5.0, 8.0]))
            middle = value * wide ** rng.uniform(-0.5, 0.5)
            place["stiffness"][axis] = _between(middle / wide, middle * wide, value, "N/m")
        elif kind == "position" and isinstance(place.get("position", [None] * 3)[axis], str):
            value, wide = si(place["position"][axis]), rng.uniform(0.03, 0.15)
            place["position"][axis] = _between(value - wide, value + wide, value, "m")
        elif kind == "turned" and not isinstance(place.setdefault("turned", [0.0] * 3)[axis], dict):
            value = place["turned"][axis]
            low, high = (round(value + side * rng.uniform(5, 60), 1) for side in (-1.0, 1.0))
            place["turned"][axis] = {"between": [float(low), float(high)], "start": value}
        elif kind == "loss" and not isinstance(place.get("loss_factor"), dict):
            place["loss_factor"] = {"between": [0.02, 0.35], "start": 0.1}
        elif kind == "damping" and not isinstance(place.setdefault("damping", ["0.0 N s/m"] * 3)[axis], dict):
            place["damping"][axis] = _between(0.0, rng.uniform(300, 3000), 100.0, "N s/m")
        elif kind == "lag" and not isinstance(place.get("damping_per_stiffness"), dict):
            place["damping_per_stiffness"] = _between(0.0, 2e-3, 5e-4, "s")


def _between(low: float, high: float, start: float, unit: str) -> Table:
    return {"between": [q(low, unit), q(high, unit)], "start": q(start, unit)}


def load_cases(rng: Generator, table: Table) -> None:
    if rng.random() < 0.7:
        table["mounts"]["stop"] = {
            "gap": q(rng.uniform(2e-3, 8e-3), "m", 3),
            "stiffness": q(rng.uniform(5e5, 3e6), "N/m", 3),
        }
    table["load_cases"] = [{"name": "bump", "times_weight": [0, 0, -float(round(rng.uniform(1, 4), 2))]}]
    if rng.random() < 0.6:
        table["load_cases"].append({"name": "pull", "torque": q(rng.uniform(-600, 600), "N m", 3)})
    if rng.random() < 0.4:
        force, place = rng.uniform(-3000, 3000, 3), rng.uniform(-0.3, 0.3, 3)
        hit = {"name": "hit", "force": [q(v, "N", 4) for v in force], "place": [q(v, "m", 3) for v in place]}
        table["load_cases"].append(hit)


def random_load(rng: Generator, table: Table) -> Table:
    channel = str(rng.choice(["mount force", "mount travel"], p=[0.7, 0.3]))
    term: Table = {"quantity": f"{rng.choice(['mean', 'maximum', 'rms'])} {channel}"}
    if rng.random() < 0.3:
        term["orders"] = [1, 2] if rng.random() < 0.5 else [int(rng.choice([1, 2]))]
    if len(table["operating_points"]) > 1 and rng.random() < 0.25:
        term["operating_points"] = ["p1"]
    names = [place["name"] for place in table["mounts"]["places"] if "joined_to" not in place]
    if rng.random() < 0.2:
        term["mounts"] = [names[0], names[-1]]
    if rng.random() < 0.2:
        term["direction_weights"] = [float(round(v, 2)) for v in rng.uniform(0.1, 2, 3)]
    return term


def random_number(rng: Generator, table: Table) -> Table:
    """Draw a measure of block and mounts; measures of one stiffness need mounts without a fluid."""
    terms: list[Table] = [{"quantity": "transmissibility"}, {"quantity": "transmissibility", "orders": [1]}]
    terms.append({"quantity": "static sag"})
    if "fluid_track" not in json.dumps(table["mounts"]):
        terms += [
            {"quantity": "torque-roll residual", "frequency": q(rng.uniform(5, 20), "Hz", 4)},
            {"quantity": "raw torque-roll residual"},
            {"quantity": "raw torque-roll residual", "frequency": {"between": ["6.0 Hz", "14.0 Hz"]}},
            {"quantity": "decoupling shortfall", "wanted": float(round(rng.uniform(0.7, 1), 2))},
            {"quantity": "decoupling shortfall", "motions": ["roll", "bounce"], "wanted": 0.95},
        ]
    if "load_cases" in table:
        terms += [{"quantity": "static travel"}, {"quantity": "static mount force", "load_cases": ["bump"]}] * 2
    return dict(terms[int(rng.integers(len(terms)))])


def limits(rng: Generator, table: Table, count: int) -> list[Table]:
    model = OwnModel(table, 512, 1e-9)
    low, high = model.box.T
    one, many = (model.designs(low + (high - low) * rng.random((n, len(low)))) for n in (1, 60))
    hard, rows = rng.random() < 0.3, []
    for k in range(count):
        chance = rng.random()
        if chance < 0.3 and "fluid_track" not in json.dumps(table["mounts"]):
            entry = frequency_limit(rng, one, many, hard)
        else:
            entry = random_load(rng, table) if chance < 0.6 else random_number(rng, table)
            maximum = float(one.measure(entry)[0]) * rng.uniform(1.0, 1.08)
            if hard and rng.random() < 0.6:
                maximum = float(many.measure(entry).min()) * rng.uniform(0.85, 1.01)
            if maximum < 1e-9:
                continue
            unit = unit_of(entry["quantity"])
            entry = {
                "limit": entry.pop("quantity"),
                **entry,
                "max": q(maximum, unit, 9) if unit else float(f"{maximum:.9g}"),
            }
        rows.append({**entry, "name": f"l{k}"})
    return rows


def frequency_limit(rng: Generator, one: Designs, many: Designs, hard: bool) -> Table:
    """Return a limit above, below or between natural frequencies of a design, or on a share of a motion."""
    f, every, chance = np.sort(one.blocks.modes[0][0]), many.blocks.modes[0], rng.random()
    if chance < 0.2:
        motions = [str(m) for m in rng.choice(["roll", "bounce", "pitch", "lateral"], 2, replace=False)]
        entry: Table = {"quantity": "kinetic-energy decoupling", "motions": motions}
        minimum = (
            float(many.measure(entry).max()) * 1.01 if hard else float(one.measure(entry)[0]) * rng.uniform(0.92, 1.0)
        )
        return {"limit": entry.pop("quantity"), **entry, "min": float(f"{min(minimum, 0.999):.9g}")}
    if chance < 0.45:
        minimum = every.min(axis=1).max() * rng.uniform(0.98, 1.05) if hard else f[0] * rng.uniform(0.93, 1.0)
        return {"limit": "natural frequencies", "min": q(minimum, "Hz", 9)}
    if chance < 0.7:
        maximum = every.max(axis=1).min() * rng.uniform(0.95, 1.02) if hard else f[-1] * rng.uniform(1.0, 1.07)
        return {"limit": "natural frequencies", "max": q(maximum, "Hz", 9)}
    k, share = int(np.argmax(np.diff(f))), rng.uniform(0.0, 0.2)
    inset = share * (f[k + 1] - f[k])
    return {"limit": "natural frequencies", "outside": [q(f[k] + inset, "Hz", 9), q(f[k + 1] - inset, "Hz", 9)]}


def objective(entry: Table) -> Table:
    return {"minimise": entry["quantity"], **{key: value for key, value in entry.items() if key != "quantity"}}


def any_mounts(rng: Generator, drive: str = "") -> Table:
    """Return a problem with any open numbers of mounts and weights, any quantity, and up to three limits."""
    plain = rng.random() < 0.5
    table = scene(rng, 3, plain, drive)
    if rng.random() < 0.3:
        load_cases(rng, table)
    allowed = ["stiffness", "position", "turned", "weight", "loss", "damping", "lag"]
    shares = [0.5, 0.2, 0.2, 0.1, 0.0, 0.0, 0.0] if plain else [0.4, 0.16, 0.16, 0.1, 0.05, 0.08, 0.05]
    count = int(rng.integers(1, 6))
    kinds = ["stiffness"] * count if rng.random() < 0.35 else [str(k) for k in rng.choice(allowed, count, p=shares)]
    open_numbers(rng, table, kinds)
    if "weight" in kinds:
        table["counterweights"] = counterweights(rng, moving_mass(table["engine"]), 1)
        if rng.random() < 0.3:
            table["balancer_shafts"] = balancers(rng, moving_mass(table["engine"]), 1)
    if not open_numbers_of(table):
        open_numbers(rng, table, ["stiffness"])
    table["objective"] = objective(random_load(rng, table) if rng.random() < 0.7 else random_number(rng, table))
    if rows := limits(rng, table, int(rng.integers(0, 4))):
        table["constraints"] = rows
    return {**table, "search": {"boxes": 20, "starts": 5}}


def run_ups(rng: Generator, drive: str = "") -> Table:
    """Return a problem with a run-up limited or minimised, with stiffness or a weight open."""
    table = scene(rng, 1, True, drive)
    top = si(table["operating_points"][0]["speed"])
    durations = {key: q(rng.uniform(0.3, 0.8), "s", 3) for key in ("time", "shut_down_time")}
    table["run_up"] = {"up_to": q(min(top, 250.0) * rng.uniform(0.6, 1.0), "rad/s"), **durations}
    if rng.random() < 0.3:
        weight = counterweights(rng, moving_mass(table["engine"]), 1)[0]
        table["counterweights"] = [{**weight, "angle": {"between": [0, 360]}}]
        weight["mass"]["between"][0] = "0.0 kg"
    else:
        open_numbers(rng, table, ["stiffness"] * int(rng.integers(1, 4)))
    measure = str(rng.choice(OF_RUNS))
    if rng.random() < 0.3:
        table["objective"] = {"minimise": measure}
    else:
        model = OwnModel(table, 256, 1e-9)
        low, high = model.box.T
        has = model.designs(low + (high - low) * rng.random((12, len(low)))).measure({"quantity": measure})
        maximum = has[0] * rng.uniform(1.0, 1.05) if rng.random() < 0.6 else has.min() * rng.uniform(0.8, 1.02)
        table["objective"] = {"minimise": f"{rng.choice(['mean', 'maximum', 'rms'])} mount force"}
        table["constraints"] = [{"limit": measure, "max": q(float(maximum), unit_of(measure), 9), "name": "l0"}]
    return {**table, "search": {"boxes": 60, "starts": 3}}


def driven(made: Callable[[Generator, str], Table]) -> Callable[[Generator], Table]:
    """Return the same problem with pistons that a linkage drives."""
    return lambda rng: made(rng, str(rng.choice(list(DRIVES))))


OWN_FAMILIES = {
    "any mounts": any_mounts, "run-ups": run_ups, "driven mounts": driven(any_mounts),
    "driven run-ups": driven(run_ups),
}  # fmt: skip
