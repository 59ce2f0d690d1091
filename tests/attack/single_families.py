"""Random engines whose cylinders differ, in random numberings of their makers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from attack import families as f
from attack.plain_loads import dead_centres, machine, number
from attack.plain_scene import Table

Generator = np.random.Generator


def numbering(rng: Generator, count: int, banks: int, along: bool = False) -> Table:
    """Return the keys that number the cylinders; a list only where numbers need not run along the crank."""
    keys: Table = {}
    kind = str(rng.choice(["usual", "alternating", "list"]))
    if kind == "list" and not along:
        keys["numbering"] = [int(k) + 1 for k in rng.permutation(count)]
    else:
        if kind == "alternating" and banks > 1:
            keys["numbering"] = "alternating"
        if banks > 1 and rng.random() < 0.5:
            keys["first_bank"] = "right"
        if rng.random() < 0.4:
            keys["first_end"] = "flywheel"
    if rng.random() < 0.4:
        keys["rotation"] = "counter-clockwise"
    return keys


def weighed(rng: Generator, engine: Table, keys: list[str], share: float = 0.6) -> list[Table]:
    """Return the rows of single cylinders, near the numbers of the engine."""
    near = {
        "reciprocating_mass": (0.8, 1.2, "kg"), "rotating_mass": (0.0, 1.0, "kg"), "bore": (0.95, 1.0, "m"),
        "stroke": (0.9, 1.1, "m"), "rod_length": (0.95, 1.1, "m"), "second_reciprocating_mass": (0.8, 1.2, "kg"),
        "knuckle_mass": (0.5, 1.5, "kg"), "rod_inertia_deficit": (-1.0, 1.0, "kg m^2"), "offset": (-1.0, 1.0, "m"),
    }  # fmt: skip
    sizes = {"rod_inertia_deficit": 3e-3, "offset": 0.1 * 0.5 * number(engine["stroke"]), "rotating_mass": 1.0}
    rows = []
    for n in range(1, count_of(engine) + 1):
        chosen = [key for key in keys if rng.random() < 0.5]
        if rng.random() < share and chosen:
            row: Table = {"cylinders": [n] if rng.random() < 0.5 else n}
            for key in chosen:
                low, high, unit = near[key]
                size = sizes.get(key) or number(engine.get(key, engine["reciprocating_mass"]))
                row[key] = f.q(size * rng.uniform(low, high), unit)
            rows.append(row)
    return rows


def count_of(engine: Table) -> int:
    throws = engine.get("throws")
    per_throw = 2 if engine["layout"] == "vee" else 1
    return len(throws) * per_throw if isinstance(throws, list) else int(engine["cylinders"])


def uneven_spacing(rng: Generator, places: int) -> Table:
    spaces = [f.q(rng.uniform(0.08, 0.16), "m") for _ in range(places - 1)]
    return {"cylinder_spacing": spaces if places > 1 and rng.random() < 0.6 else f.q(rng.uniform(0.08, 0.14), "m")}


def banked(rng: Generator) -> Table:
    """Return an engine in line, a vee or a boxer, at times with narrow rows."""
    layout = str(rng.choice(["inline", "vee", "boxer"]))
    throws = {"inline": (1, 6), "vee": (1, 4), "boxer": (1, 3)}[layout]
    count = int(rng.integers(*throws)) * (2 if layout == "boxer" else 1)
    banks = 1 if layout == "inline" else 2
    engine = {"layout": layout, **f.mechanism(rng), "throws": f.throws(rng, count)}
    cylinders = count_of(engine)
    engine |= {**numbering(rng, cylinders, banks), **uneven_spacing(rng, cylinders // banks)}
    if layout == "vee":
        engine["bank_angle"] = float(round(rng.uniform(20.0, 150.0), 2))
        if rng.random() < 0.5:
            engine["split_pin_angle"] = float(round(rng.uniform(-40.0, 60.0), 2))
    if banks == 2 and (layout == "boxer" or rng.random() < 0.5):
        engine["bank_stagger"] = f.q(rng.uniform(0.01, 0.05), "m")
    if layout != "boxer" and rng.random() < 0.3:
        engine["row_angle"] = float(round(rng.uniform(-20.0, 20.0), 2))
    keys = ["reciprocating_mass", "rotating_mass", "rod_inertia_deficit", "offset", "rod_length"]
    keys += ["stroke"] if layout != "vee" else []
    # a rod or offset of its own beside a stroke on a shared pin would need another crank
    if layout == "vee" and "offset" in engine:
        keys.remove("rod_length")
    rows = weighed(rng, engine, keys)
    return {**engine, "single_cylinders": rows} if rows else engine


def opposed(rng: Generator) -> Table:
    engine = f.opposed_piston(rng)
    rows = weighed(rng, engine, ["reciprocating_mass", "rotating_mass", "second_reciprocating_mass"])
    return {**engine, "single_cylinders": rows} if rows else engine


def radial(rng: Generator) -> Table:
    engine = f.radial(rng)
    rows = weighed(rng, engine, ["reciprocating_mass", "knuckle_mass"])
    for row in rows:
        # the master rod has no knuckle pin
        if row["cylinders"] in (1, [1]):
            row.pop("knuckle_mass", None)
    rows = [row for row in rows if len(row) > 1]
    return {**engine, "single_cylinders": rows} if rows else engine


def fired(rng: Generator, engine: Table) -> Table | None:
    """Return an order of firing at angles that no two share, and who never fires; None where the throws have none."""
    count, turns = count_of(engine), 2 if engine["cycle"] == "four-stroke" else 1
    idle = {int(k) + 1 for k in rng.permutation(count)[: int(rng.random() < 0.3)]} if count > 2 else set()
    rows = {n: row for row in engine.get("single_cylinders", []) for n in [row["cylinders"]]}
    driving = [
        row for row in engine.get("single_cylinders", []) if row["cylinders"] not in [*idle, *([n] for n in idle)]
    ]
    idle_rows = [{**_row(rows, n), "cylinders": n, "bore": "0.0 m"} for n in idle]
    engine = {**engine, "single_cylinders": driving + idle_rows}
    own_mechanisms = machine({k: v for k, v in engine.items() if k != "bore"}).mechanisms[:count]
    tops = dead_centres(list(own_mechanisms))
    firing = [n for n in range(1, count + 1) if n not in idle]
    lag = [math.degrees(m.bank - m.throw + top) % 360.0 for m, top in zip(own_mechanisms, tops, strict=True)]
    laps = {n: 360.0 * int(rng.integers(0, turns)) for n in firing}
    at = {n: (lag[n - 1] - lag[firing[0] - 1]) % 360.0 + (0.0 if n == firing[0] else laps[n]) for n in firing}
    order = sorted(firing, key=lambda n: at[n])
    gaps = np.diff([*sorted(at.values()), 360.0 * turns])
    if gaps.min() < 5.0 or gaps[:-1].max(initial=0.0) > 355.0:
        return None
    working = {**engine, "firing_order": order}
    if not working["single_cylinders"]:
        del working["single_cylinders"]
    return working


def _row(rows: dict[Any, Table], n: int) -> Table:
    return next((row for numbers, row in rows.items() if numbers in (n, [n])), {}) if rows else {}


def gas_of(rng: Generator, engine: Table) -> Table:
    """Return the gas that differs, and a pump on a piston that never fires."""
    gas: Table = {
        "model": "seiliger", "peak_pressure": f.q(rng.uniform(60, 85), "bar"), "imep": f.q(rng.uniform(6.5, 9), "bar"),
    }  # fmt: skip
    idle = [row["cylinders"] for row in engine.get("single_cylinders", []) if row.get("bore") == "0.0 m"]
    rows = []
    for n in range(1, count_of(engine) + 1):
        if n not in idle and rng.random() < 0.4:
            row: Table = {"cylinders": [n], "imep": f.q(number(gas["imep"]) / 1e5 * rng.uniform(0.9, 1.05), "bar")}
            if rng.random() < 0.5:
                row["peak_pressure"] = f.q(number(gas["peak_pressure"]) / 1e5 * rng.uniform(0.95, 1.1), "bar")
            rows.append(row)
    if rows:
        gas["single_cylinders"] = rows
    if idle and rng.random() < 0.7:
        chamber = {**f.chamber(rng, 1), "cylinders": idle}
        gas["chambers"] = [{**chamber, "name": "beside"}]
    return gas


def gas(rng: Generator) -> Table:
    """Return the cylinders of own masses, bores and gas, one that never fires at times."""
    while True:
        engine = banked(rng)
        engine["bore"] = f.q(rng.uniform(0.06, 0.1), "m")
        for row in engine.get("single_cylinders", []):
            row["cylinders"] = row["cylinders"] if isinstance(row["cylinders"], int) else row["cylinders"][0]
            if rng.random() < 0.3:
                row["bore"] = f.q(number(engine["bore"]) * rng.uniform(0.9, 1.0), "m")
        working = fired(rng, engine)
        if working is not None:
            break
    table = f.of_unbalances(lambda _: working)(rng)
    return {**table, "gas": gas_of(rng, working)}


def stars(rng: Generator) -> Table:
    """Return the weighed cylinders on open throws in line, at times with rows, offsets and gas of their own."""
    count = int(rng.integers(3, 6))
    engine = f.star_of({"layout": "inline", **f.mechanism(rng, plain=True)}, count)
    engine |= {**numbering(rng, count, 1, along=True), **uneven_spacing(rng, count)}
    if rng.random() < 0.3:
        engine["row_angle"] = float(round(rng.uniform(-20.0, 20.0), 2))
    keys = ["reciprocating_mass", "rotating_mass", "stroke", "offset"]
    while "single_cylinders" not in engine:
        if rows := weighed(rng, engine, keys, 0.8):
            engine["single_cylinders"] = rows
    table = f.star_problem(rng, engine)
    if rng.random() < 0.5:
        engine["bore"] = f.q(rng.uniform(0.06, 0.1), "m")
        table["gas"] = gas_of(rng, engine)
    return table


FAMILIES = {
    "single cylinders": f.of_unbalances(banked),
    "single opposed pistons": f.of_unbalances(opposed),
    "single radial cylinders": f.of_unbalances(radial),
    "single gas": gas,
    "single stars": stars,
}
