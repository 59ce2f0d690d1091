"""Random problems of every family, as tables of a problem file in base units, from a family's name and a seed.

Numbers are rounded: a file then says what the generator meant, and a failing one can be read.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from attack.openings import middle
from attack.plain_gear import SIZED
from attack.plain_loads import number
from attack.plain_scene import Table, norm_and_channel
from attack.star_list import even_stars

Generator = np.random.Generator
LOADS = ("mount force", "shaking force", "rocking couple", "roll moment")
NORMS = ("mean", "maximum", "rms", "peak to peak")
UNITS = {"mount force": "N", "shaking force": "N", "rocking couple": "N m", "roll moment": "N m", "mount travel": "m",
         "main-bearing force": "N", "receiver acceleration": "m/s^2", "receiver velocity": "m/s", "stored work": "J",
         **SIZED}  # fmt: skip


def q(value: float, unit: str, digits: int = 6) -> str:
    """Return a number with its unit, to so many digits."""
    return f"{float(f'{value:.{digits}g}')!r} {unit}"


def toml(table: Table) -> str:
    """Return the text of a problem file."""
    lines: list[str] = []
    tables: list[str] = []
    for key, value in table.items():
        if isinstance(value, dict):
            tables.append(_section(f"[{key}]", value, key))
        elif _is_tables(value):
            tables += [_section(f"[[{key}]]", entry, key) for entry in value]
        else:
            lines.append(f"{key} = {_inline_toml(value)}")
    return "\n".join(lines + tables) + "\n"


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(v, dict) and "between" not in v for v in value)


def _section(head: str, table: Table, name: str) -> str:
    lines, below = [head], []
    for key, value in table.items():
        if _is_tables(value):
            below += [_section(f"[[{name}.{key}]]", entry, f"{name}.{key}") for entry in value]
        else:
            lines.append(f"{key} = {_inline_toml(value)}")
    return "\n".join(lines + below)


def _inline_toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_inline_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_inline_toml(v) for v in value) + "]"
    return json.dumps(value)


# --- engines


def mechanism(rng: Generator, plain: bool = False) -> Table:
    """Return the sizes that every layout has."""
    radius = rng.uniform(0.03, 0.08)
    engine = {
        "cycle": str(rng.choice(["two-stroke", "four-stroke"])),
        "stroke": q(2.0 * radius, "m"),
        "rod_length": q(radius / rng.uniform(0.2, 0.32), "m"),
        "reciprocating_mass": q(rng.uniform(0.3, 2.0), "kg"),
        "rotating_mass": q(rng.uniform(0.0, 1.0), "kg"),
    }
    if not plain and rng.random() < 0.5:
        engine["rod_inertia_deficit"] = q(rng.uniform(-0.004, 0.004), "kg m^2")
    if not plain and rng.random() < 0.3:
        engine["offset"] = q(rng.uniform(-0.15, 0.15) * radius, "m")
    return engine


def angle(rng: Generator) -> float:
    return float(round(rng.uniform(0.0, 360.0), 3))


def throws(rng: Generator, count: int) -> list[float]:
    return [0.0] + [angle(rng) for _ in range(count - 1)]


def spaced(rng: Generator) -> Table:
    return {"cylinder_spacing": q(rng.uniform(0.08, 0.14), "m")}


def inline(rng: Generator) -> Table:
    return {"layout": "inline", **mechanism(rng), **spaced(rng), "throws": throws(rng, int(rng.integers(1, 6)))}


def vee(rng: Generator) -> Table:
    count = int(rng.integers(1, 4))
    engine = {"layout": "vee", **mechanism(rng), **spaced(rng), "throws": throws(rng, count)}
    engine["bank_angle"] = float(rng.choice([45.0, 60.0, 90.0, round(rng.uniform(20.0, 150.0), 2)]))
    if rng.random() < 0.5:
        engine["split_pin_angle"] = float(round(rng.uniform(-40.0, 60.0), 2))
    if rng.random() < 0.5:
        engine["bank_stagger"] = q(rng.uniform(-0.03, 0.03), "m")
    return engine


def boxer(rng: Generator) -> Table:
    count = 2 * int(rng.integers(1, 4))
    engine = {"layout": "boxer", **mechanism(rng), **spaced(rng), "throws": throws(rng, count)}
    return {**engine, "bank_stagger": q(rng.uniform(0.01, 0.05), "m")}


def opposed_piston(rng: Generator) -> Table:
    engine = {
        "layout": "opposed-piston",
        **mechanism(rng),
        **spaced(rng),
        "throws": throws(rng, int(rng.integers(1, 4))),
    }
    engine.pop("offset", None)
    reach = 2.0 * float(engine["rod_length"].split()[0]) + float(engine["stroke"].split()[0])
    engine |= {"crank_distance": q(reach + rng.uniform(0.05, 0.2), "m"), "crank_ratio": int(rng.choice([-1, 1]))}
    if rng.random() < 0.5:
        engine["crank_lead"] = float(round(rng.uniform(3.0, 25.0), 2))
    return engine


def radial(rng: Generator) -> Table:
    count = int(rng.choice([3, 5, 7]))
    engine = {"layout": "radial", **mechanism(rng), "cylinders": count}
    radius = 0.5 * float(engine["stroke"].split()[0])
    arm = rng.uniform(0.6, 0.95) * radius
    engine |= {"knuckle_radius": q(arm, "m"), "knuckle_mass": q(rng.uniform(0.0, 0.3), "kg")}
    if rng.random() < 0.5:
        engine["knuckle_angles"] = [float(round(360.0 * k / count + rng.uniform(-3, 3), 3)) for k in range(1, count)]
    if rng.random() < 0.5:
        engine["articulated_rod_length"] = q(
            float(engine["rod_length"].split()[0]) - arm + rng.uniform(-3e-3, 3e-3), "m"
        )
    return engine


def parts(rng: Generator) -> Table:
    """Return the slider-cranks on two geared shafts, no two alike."""
    engine = {"layout": "parts", **mechanism(rng)}
    engine["shafts"] = [
        {"name": "first", "position": ["0.0 m", "0.0 m"]},
        {
            "name": "second", "ratio": int(rng.choice([-1, 1, 2])),
            "position": [q(rng.uniform(0.1, 0.3), "m"), q(rng.uniform(-0.1, 0.1), "m")],
        },
    ]  # fmt: skip
    engine["slider_cranks"] = [
        {
            "x": q(0.11 * k + rng.uniform(-0.02, 0.02), "m"), "bank_angle": angle(rng), "throw": angle(rng),
            "shaft": str(rng.choice(["first", "second"])),
            **({"reciprocating_mass": q(rng.uniform(0.3, 2.0), "kg")} if rng.random() < 0.5 else {}),
        }
        for k in range(int(rng.integers(1, 5)))
    ]  # fmt: skip
    return engine


# --- everything else of a problem


def moving_mass(engine: Table) -> float:
    """Return the reciprocating mass times crank radius of all cylinders, about [kg m]."""
    if engine["layout"] == "rotary":
        count = engine["cylinders"] if engine["throws"] == "open" else len(engine["throws"])
        return count * number(engine["rotor_mass"]) * number(engine["eccentricity"])
    count = {"vee": 2}.get(engine["layout"], 1)
    angles = engine.get("throws")
    throw_count = len(angles) if isinstance(angles, list) else engine.get("cylinders", 1)
    if engine["layout"] == "parts":
        throw_count = len(engine["slider_cranks"])
    return count * throw_count * middle(engine["reciprocating_mass"]) * 0.5 * middle(engine["stroke"])


def rigid_mounts(rng: Generator) -> Table:
    return {
        "places": [
            {
                "name": f"m{k}",
                "position": [q(v, "m", 4) for v in (*rng.uniform(-0.4, 0.4, 2), rng.uniform(-0.3, 0.3))],
                "relative_stiffness": [0.0, 1.0, 1.0]
                if rng.random() < 0.5
                else [float(round(v, 3)) for v in rng.uniform(0.3, 2.0, 3)],
            }
            for k in range(int(rng.integers(3, 5)))
        ]
    }


def points(rng: Generator, maximum: int = 2, low: float = 50.0, high: float = 400.0) -> list[Table]:
    return [
        {
            "name": f"p{k}", "speed": q(rng.uniform(low, high), "rad/s"),
            "weight": float(round(rng.uniform(0.3, 3.0), 3)),
        }
        for k in range(int(rng.integers(1, maximum + 1)))
    ]  # fmt: skip


def counterweights(rng: Generator, size: float, count: int) -> list[Table]:
    rows = []
    for k in range(count):
        entry: Table = {
            "name": f"c{k}", "x": q(rng.uniform(-0.3, 0.3), "m", 4), "radius": "0.06 m",
            "mass": {"between": ["0.0 kg", q(size * rng.uniform(0.1, 1.2) / 0.06, "kg")]},
        }  # fmt: skip
        chance = rng.random()
        if chance < 0.7:
            entry["angle"] = {"between": [0, 360]}
        elif chance < 0.85:
            low = float(round(rng.uniform(0.0, 300.0), 2))
            entry["angle"] = {"between": [low, low + float(round(rng.uniform(20.0, 170.0), 2))]}
        else:
            entry["angle"] = angle(rng)
            if rng.random() < 0.5:
                entry["mass"]["between"][0] = q(0.3 * float(entry["mass"]["between"][1].split()[0]), "kg")
        rows.append(entry)
    return rows


def balancers(rng: Generator, size: float, count: int) -> list[Table]:
    rows = []
    for k in range(count):
        open_one = {
            "x": q(rng.uniform(-0.2, 0.2), "m", 4), "radius": "0.04 m",
            "mass": {"between": ["0.0 kg", q(size * rng.uniform(0.02, 0.4) / 0.04, "kg")]},
            "angle": {"between": [0, 360]},
        }  # fmt: skip
        shaft: Table = {
            "name": f"s{k}", "ratio": int(rng.choice([-1, 2, -2])),
            "position": [q(v, "m", 4) for v in rng.uniform(-0.2, 0.2, 2)],
        }  # fmt: skip
        if rng.random() < 0.3:
            how = str(rng.choice(["equal", "opposite", "mirrored", "mirrored opposite"]))
            second = {
                "name": "r", "x": q(rng.uniform(-0.2, 0.2), "m", 4), "coupled": {"to": f"s{k}.f", "as": how},
            }  # fmt: skip
            shaft["unbalances"] = [{"name": "f", **open_one}, second]
        else:
            shaft["unbalances"] = [open_one]
        rows.append(shaft)
    return rows


def random_term(
    rng: Generator, table: Table, channels: tuple[str, ...] = LOADS, norms: tuple[str, ...] = NORMS
) -> Table:
    """Return a quantity and what narrows it."""
    share = np.array([0.55] + [0.45 / (len(channels) - 1)] * (len(channels) - 1)) if len(channels) > 1 else [1.0]
    channel = str(rng.choice(channels, p=share))
    term: Table = {"quantity": f"{rng.choice(norms)} {channel}"}
    if rng.random() < 0.35:
        term["orders"] = [1, 2] if rng.random() < 0.5 else [int(rng.choice([1, 2]))]
    if len(table["operating_points"]) > 1 and rng.random() < 0.3:
        term["operating_points"] = ["p1"]
    if channel.startswith("mount") and rng.random() < 0.3:
        term["mounts"] = ["m0", "m2"]
    if (channel.startswith("mount") or channel == "shaking force") and rng.random() < 0.3:
        term["direction_weights"] = [float(round(v, 2)) for v in rng.uniform(0.0, 2.0, 3)]
    return term


def objective(terms: list[Table]) -> Table:
    if len(terms) == 1:
        entry = {k: v for k, v in terms[0].items() if k not in ("quantity", "weight")}
        return {"minimise": terms[0]["quantity"], **entry}
    return {"terms": terms}


def with_objective(rng: Generator, table: Table, maximum: int = 2, **kinds: Any) -> Table:
    count = int(rng.integers(1, maximum + 1))
    terms = [
        {**random_term(rng, table, **kinds), "weight": float(round(rng.uniform(0.2, 3.0), 3))} for _ in range(count)
    ]
    return {**table, "objective": objective(terms)}


def unit_of(quantity: str) -> str:
    if quantity.endswith("mass"):
        return "kg"
    return next(unit for channel, unit in UNITS.items() if quantity.endswith(channel))


Engine = Callable[[Generator], Table]


def of_unbalances(engine: Engine, most_points: int = 2) -> Callable[[Generator], Table]:
    """Return an engine on rigid mounts whose counterweights and balancer shafts are open."""

    def made(rng: Generator) -> Table:
        built = engine(rng)
        size = moving_mass(built)
        table = {"engine": built, "operating_points": points(rng, most_points), "mounts": rigid_mounts(rng)}
        table["counterweights"] = counterweights(rng, size, int(rng.integers(1, 3)))
        if shafts := balancers(rng, size, int(rng.integers(0, 3))):
            table["balancer_shafts"] = shafts
        return with_objective(rng, table)

    return made


def gas_engine(rng: Generator) -> Table:
    """Return an engine in line whose cylinders fire one after another."""
    engine = {"layout": "inline", **mechanism(rng, plain=True), **spaced(rng)}
    engine["bore"] = q(rng.uniform(0.06, 0.12), "m")
    count, turns = int(rng.integers(1, 5)), 2 if engine["cycle"] == "four-stroke" else 1
    while True:
        angles = throws(rng, count)
        laps = [0] + [int(rng.integers(0, turns)) for _ in range(count - 1)]
        at = [(-t) % 360.0 + 360.0 * lap for t, lap in zip(angles, laps, strict=True)]
        order = [int(k) for k in np.argsort(at)]
        gaps = np.diff([*np.sort(at), 360.0 * turns])
        # each fires at its first dead centre after the one before; the last gap is what is left of the cycle
        if gaps.min() > 5.0 and gaps[:-1].max(initial=0.0) < 359.0:
            break
    return {**engine, "throws": angles, "firing_order": [k + 1 for k in order]}


def with_gas(rng: Generator) -> Table:
    table = of_unbalances(gas_engine)(rng)
    table["gas"] = {
        "model": "seiliger",
        "peak_pressure": q(rng.uniform(55, 85), "bar"),
        "imep": q(rng.uniform(6.5, 10), "bar"),
    }
    if len(table["operating_points"]) > 1 and rng.random() < 0.5:
        table["operating_points"][1]["gas"] = False
    return table


def with_states(rng: Generator) -> Table:
    """Return points with cylinders that misfire or are cut, and points at which all fire; at times the worst mean."""
    table = with_gas(rng)
    count, objective = len(table["engine"]["throws"]), json.dumps(table["objective"])
    for point in table["operating_points"]:
        if point.get("gas", True) and rng.random() < 0.7:
            numbers = [int(k) + 1 for k in rng.permutation(count)]
            cut = numbers[: int(rng.integers(0, count + 1))]
            if "operating_points" not in objective and rng.random() < 0.4:
                point["misfire"], cut = "each", []
            elif numbers[len(cut) :]:
                point["misfire"] = numbers[len(cut) :][: int(rng.integers(1, 3))]
            if cut:
                point |= {"cut": cut, "cut_valves": str(rng.choice(["closed", "open"]))}
    if rng.random() < 0.5:
        table["objective"] = {"minimise": f"worst mean {rng.choice(['mount force', 'roll moment'])}"}
    return table


def yoke(rng: Generator) -> Table:
    """Return the rams in line, with levers that weigh something."""
    engine = {**mechanism(rng, plain=True), **spaced(rng), "throws": throws(rng, int(rng.integers(1, 4)))}
    del engine["rod_length"]
    pivot = rng.uniform(0.08, 0.2)
    lever = {"mass": q(rng.uniform(0.1, 1.0), "kg"), "centre_of_gravity": q(rng.uniform(0.0, 0.9) * pivot, "m")}
    entry: Table = {
        "layout": "inline", "drive": "swinging-yoke", **engine, "pivot_distance": q(pivot, "m"),
        "return_ratio": float(round(rng.uniform(1.1, 2.4), 3)),
        "lever": {**lever, "inertia": q(rng.uniform(0.0, 4e-3), "kg m^2")},
    }  # fmt: skip
    if rng.random() < 0.5:
        entry |= {"lever_weight": q(rng.uniform(0.1, 1.0), "kg"), "lever_weight_radius": q(rng.uniform(0.03, 0.1), "m")}
    return entry


def chamber(rng: Generator, count: int) -> Table:
    """Return an engine with steam or a pump at either end of some cylinders."""
    bore = rng.uniform(0.05, 0.12)
    entry: Table = {"end": str(rng.choice(["head", "crank"])), "bore": q(bore, "m")}
    if rng.random() < 0.5:
        entry["rod"] = q(rng.uniform(0.1, 0.4) * bore, "m")
    if rng.random() < 0.3:
        entry["cylinders"] = [int(rng.integers(1, count + 1))]
    if rng.random() < 0.25:
        return {**entry, "pump": {"suction": q(rng.uniform(0.5, 0.9), "bar"), "delivery": q(rng.uniform(2, 9), "bar")}}
    cut_off, lead = rng.uniform(0.1, 0.7), rng.uniform(0.0, 0.05)
    steam = {
        "admission": q(rng.uniform(5, 12), "bar"), "back_pressure": q(rng.uniform(0.3, 2.0), "bar"),
        "cut_off": float(round(cut_off, 3)), "release": float(round(rng.uniform(cut_off, 1.0), 3)),
        "compression": float(round(rng.uniform(lead, 0.3), 3)), "lead": float(round(lead, 3)),
        "clearance": float(round(rng.uniform(0.03, 0.2), 3)),
    }  # fmt: skip
    return {**entry, "steam": steam}


def with_chambers(rng: Generator) -> Table:
    """Return the engines in line or lists of parts with chambers in place of cylinders of one side."""
    table = of_unbalances(lambda source: {**inline(source), "cycle": "two-stroke"})(rng)
    count = len(table["engine"]["throws"])
    chambers = [{"name": f"k{k}", **chamber(rng, count)} for k in range(int(rng.integers(1, 4)))]
    return {**table, "gas": {"model": "chambers", "chambers": chambers}}


def crankcase(rng: Generator) -> Table:
    """Return weights with main bearings; torque, stored work, twist and irregularity as limits."""
    engine = {k: v for k, v in gas_engine(rng).items() if k != "rod_inertia_deficit"}
    size, count, distance = moving_mass(engine), len(engine["throws"]), float(engine["cylinder_spacing"].split()[0])
    table: Table = {"engine": engine, "operating_points": points(rng), "mounts": rigid_mounts(rng)}
    if rng.random() < 0.6:
        table["gas"] = {
            "model": "seiliger", "peak_pressure": q(rng.uniform(55, 85), "bar"), "imep": q(rng.uniform(6.5, 10), "bar"),
        }  # fmt: skip
    places = [(0.5 * count - k) * distance + rng.uniform(-0.2, 0.2) * distance for k in range(count + 1)]
    table["main_bearings"] = [{"x": q(x, "m")} for x in places]
    table["counterweights"] = counterweights(rng, size, int(rng.integers(1, 4)))
    inertia = q(rng.uniform(10.0, 40.0) * size, "kg m^2")
    twists = count > 1 and rng.random() < 0.5
    if twists:
        table["torsion"] = {
            "throw_inertia": q(rng.uniform(0.2, 1.0) * size * 0.1, "kg m^2"), "cylinder_damping": "2.0 N m s/rad",
            "loss_factor": 0.02, "crank": {"stiffness": q(rng.uniform(2e5, 1e6), "N m/rad")},
            "discs": [{"name": "flywheel", "end": "rear", "inertia": inertia,
                       "shaft": {"stiffness": q(rng.uniform(2e5, 1e6), "N m/rad")}}],
        }  # fmt: skip
    else:
        table["flywheel"] = {"inertia": inertia}
    # numbers come last, as results list them
    kinds = (
        ("rms crank torque", "1e6 N m"), ("peak to peak stored work", "1e7 J"), ("maximum crank-pin force", "1e8 N"),
        *([("rms shaft twist", "1.0 rad")] if twists else []), ("degree of irregularity", 1.9),
    )  # fmt: skip
    chosen = [kinds[k] for k in sorted(rng.choice(len(kinds), 2, replace=False))]
    table["constraints"] = [{"limit": name, "max": maximum, "name": name} for name, maximum in chosen]
    return with_objective(rng, table, channels=("main-bearing force", "mount force"))


INSIDE = ("main-bearing force", "crank torque", "stored work", "shaft twist", "crank-pin force", "mount force")


def uneven_crankcase(rng: Generator) -> Table:
    """Return throws between bounds in a given order, with bearings, torque, work or twist minimised."""
    table = crankcase(rng)
    wide = 0.0
    while wide < 3.0:
        table = crankcase(rng)
        angles, turns = table["engine"]["throws"], 2 if table["engine"]["cycle"] == "four-stroke" else 1
        # moving throws keep away from other firings, and from their own dead centres
        at = np.sort(np.mod(-np.array(angles), 360.0))
        gaps = np.diff([*at, at[0] + 360.0])
        wide = 0.4 * float(gaps.min()) if len(angles) > 1 else 0.0
    del turns
    for k in rng.choice(len(angles) - 1, int(rng.integers(1, min(len(angles), 3))), replace=False) + 1:
        width = min(wide, float(rng.uniform(3.0, 30.0)))
        angles[k] = {"between": [round(angles[k] - width, 3), round(angles[k] + width, 3)]}
    if rng.random() < 0.5:
        del table["counterweights"]
    limits = [x for x in table["constraints"] if x["limit"] != "degree of irregularity"]
    table["constraints"] = limits if rng.random() < 0.5 and limits else []
    if not table["constraints"]:
        del table["constraints"]
    inside = [name for name in INSIDE if name != "shaft twist" or "torsion" in table]
    objective = {"minimise": f"{rng.choice(NORMS)} {rng.choice(inside)}"}
    return {**table, "objective": objective, "search": {"boxes": 20}, "fidelity": {"samples": 240}}


def star_of(engine: Table, count: int) -> Table:
    keys = {k: v for k, v in engine.items() if k not in ("throws", "offset", "bank_stagger", "split_pin_angle")}
    return {**keys, "throws": "open", "firing_order": "open", "cylinders": count}


def star_problem(rng: Generator, engine: Table) -> Table:
    size = moving_mass(engine)
    table = {"engine": engine, "operating_points": points(rng), "mounts": rigid_mounts(rng)}
    count = int(rng.integers(0, 3))
    if count:
        table["counterweights"] = counterweights(rng, size, count)
    if shafts := balancers(rng, size, int(rng.integers(0, 2))):
        table["balancer_shafts"] = shafts
    return with_objective(rng, table, 2)


def stars(rng: Generator) -> Table:
    return star_problem(rng, star_of({"layout": "inline", **mechanism(rng), **spaced(rng)}, int(rng.integers(3, 6))))


def vees(rng: Generator) -> Table:
    """Open throws of a vee with staggered banks, split pins, bank angles or pins open; one that can fire evenly."""
    engine = vee_engine(rng)
    while next(even_stars(engine), None) is None:
        engine = vee_engine(rng)
    return star_problem(rng, engine)


def vee_engine(rng: Generator) -> Table:
    engine = star_of({"layout": "vee", **mechanism(rng), **spaced(rng)}, 2 * int(rng.integers(2, 5)))
    step = 360.0 / (engine["cylinders"] // math.gcd(2 if engine["cycle"] == "four-stroke" else 1, engine["cylinders"]))
    total = step * int(rng.integers(1, max(2, int(150.0 / step) + 1)))
    kind = rng.random()
    if kind < 0.4:
        engine["bank_angle"] = round(total, 9)
    elif kind < 0.7:
        bank = float(rng.choice([45.0, 60.0, 90.0]))
        engine |= {"bank_angle": bank, "split_pin_angle": round(total - bank, 9)}
    elif kind < 0.85:
        engine["bank_angle"] = {"between": [max(10.0, total - 20.0), total + 15.0]}
    else:
        engine |= {"bank_angle": 60.0, "split_pin_angle": {"between": [total - 70.0, total - 50.0]}}
    if rng.random() < 0.6:
        engine["bank_stagger"] = q(rng.uniform(-0.03, 0.03), "m")
    return engine


# --- elastic mounts


def block(rng: Generator) -> Table:
    return {
        "mass": q(rng.uniform(100, 250), "kg", 4),
        "centre_of_gravity": [q(v, "m", 3) for v in rng.uniform(-0.1, 0.1, 3)],
        "inertia": [q(v * rng.uniform(0.95, 1.1), "kg m^2", 3) for v in (5.0, 12.0, 10.0)],
        "inertia_products": [q(v, "kg m^2", 3) for v in rng.uniform(-0.8, 0.8, 3)],
    }


def elastic_mounts(rng: Generator) -> Table:
    """Return four different mounts, one under each corner."""
    corners = ((1, 1), (1, -1), (-1, 1), (-1, -1))
    rows = []
    for k, (along, aside) in enumerate(corners):
        at = (along * rng.uniform(0.2, 0.4), aside * rng.uniform(0.15, 0.4), rng.uniform(-0.1, 0.1))
        place: Table = {"name": f"m{k}", "position": [q(v, "m", 3) for v in at]}
        place["stiffness"] = [q(v, "N/m", 4) for v in rng.uniform(1e5, 6e5, 3)]
        if rng.random() < 0.4:
            place["damping"] = [q(v, "N s/m", 3) for v in rng.uniform(0.0, 800.0, 3)]
        if rng.random() < 0.4:
            place["turned"] = [float(round(v, 1)) for v in rng.uniform(-30.0, 30.0, 3)]
        rows.append(place)
    return {"kind": "elastic", "loss_factor": float(rng.choice([0.05, 0.1, 0.2])), "places": rows}


def opened_stiffness(rng: Generator, mounts: Table, count: int) -> None:
    """Open so many of the twelve stiffnesses, from 1/5 or 1/2 of theirs to 2 or 5 times as much."""
    for k in rng.choice(12, count, replace=False):
        stiffness, axis = mounts["places"][int(k) // 3]["stiffness"], int(k) % 3
        middle, wide = float(stiffness[axis].split()[0]), rng.choice([2.0, 5.0])
        stiffness[axis] = {
            "between": [q(middle / wide, "N/m", 4), q(middle * wide, "N/m", 4)], "start": q(middle, "N/m", 4)
        }  # fmt: skip


def elastic_scene(rng: Generator, engine: Table | None = None) -> Table:
    built = engine or inline(rng)
    return {
        "engine": built, "operating_points": points(rng, 2, 60.0, 300.0), "block": block(rng),
        "mounts": elastic_mounts(rng),
    }  # fmt: skip


ELASTIC = ("mount force", "mount travel")
SMOOTH = ("mean", "maximum", "rms")


def limits_at(rng: Generator, table: Table, choices: list[Table], share: float = 0.6) -> Table:
    """Return the limits a little under or over what a random design has, so that it, or another, keeps them."""
    from attack.openings import Openings

    if rng.random() > share:
        return table
    openings = Openings(table)
    scene = openings.scene(openings.random(rng))
    limits: list[Table] = []
    for k in rng.choice(len(choices), min(len(choices), int(rng.integers(1, 3))), replace=False):
        entry = dict(choices[int(k)])
        unit, side = entry.pop("unit"), entry.pop("side")
        if entry["limit"] == "natural frequencies":
            f = scene.mounting.frequencies  # type: ignore[union-attr]
            has = float(f.max() if side == "max" else f.min())
        else:
            has = scene.measure({**entry, "quantity": entry["limit"]})
        give = rng.uniform(1.0, 1.1) if side == "max" else rng.uniform(0.9, 1.0)
        limits.append({**entry, side: q(has * give, unit, 9) if unit else round(has * give, 9), "name": f"l{k}"})
    return {**table, "constraints": limits}


OF_MOUNTS = [
    {"limit": "static sag", "side": "max", "unit": "m"},
    {"limit": "natural frequencies", "side": "max", "unit": "Hz"},
    {"limit": "natural frequencies", "side": "min", "unit": "Hz"},
    {"limit": "total stiffness", "side": "max", "unit": "N/m"},
]
OF_FORCES = [
    {"limit": "rms mount force", "side": "max", "unit": "N"},
    {"limit": "maximum mount travel", "side": "max", "unit": "m"},
    {"limit": "transmissibility", "side": "max", "unit": "", "orders": [1]},
]


def few_stiffnesses(minimum: int, maximum: int) -> Callable[[Generator], Table]:
    def made(rng: Generator) -> Table:
        table = elastic_scene(rng)
        opened_stiffness(rng, table["mounts"], int(rng.integers(minimum, maximum + 1)))
        if rng.random() < 0.15:
            table["objective"] = {"minimise": "transmissibility", "orders": [1]}
        else:
            table = with_objective(rng, table, 1, channels=ELASTIC, norms=SMOOTH)
        return limits_at(rng, table, OF_MOUNTS + OF_FORCES)

    return made


def convex_mounts(rng: Generator) -> Table:
    """Draw measures that are convex in the stiffnesses: sag, total stiffness, torque-roll residual, frequencies."""
    table = elastic_scene(rng)
    opened_stiffness(rng, table["mounts"], int(rng.integers(2, 10)))
    table["objective"] = dict(
        [
            {"minimise": "static sag"}, {"minimise": "total stiffness"},
            {"minimise": "torque-roll residual", "frequency": q(rng.uniform(5.0, 20.0), "Hz", 4)},
        ][int(rng.integers(0, 3))]
    )  # fmt: skip
    return limits_at(rng, table, OF_MOUNTS, 1.0)


def joint(rng: Generator) -> Table:
    """Return the mounts and unbalances together."""
    table = elastic_scene(rng)
    table["counterweights"] = counterweights(rng, moving_mass(table["engine"]), 1)
    opened_stiffness(rng, table["mounts"], int(rng.integers(1, 3)))
    place = table["mounts"]["places"][1]
    if rng.random() < 0.5:
        x = float(place["position"][0].split()[0])
        place["position"][0] = {"between": [q(x - 0.1, "m"), q(x + 0.1, "m")], "start": q(x, "m")}
    elif rng.random() < 0.5:
        place["turned"] = [{"between": [-30, 30], "start": 0}, 0, 0]
    table = with_objective(rng, table, 1, channels=ELASTIC, norms=SMOOTH)
    return limits_at(rng, table, OF_MOUNTS + OF_FORCES[:2], 0.4)


def balance_on_elastic(rng: Generator) -> Table:
    """Return the unbalances on mounts that are given."""
    table = elastic_scene(rng, inline(rng) if rng.random() < 0.5 else vee(rng))
    size = moving_mass(table["engine"])
    table["counterweights"] = counterweights(rng, size, int(rng.integers(1, 3)))
    if shafts := balancers(rng, size, int(rng.integers(0, 2))):
        table["balancer_shafts"] = shafts
    return with_objective(rng, table, 2, channels=ELASTIC)


# --- throws between bounds, places of shafts


def uneven(rng: Generator) -> Table:
    """Return the throws in line, some of them between bounds of their own, and weights at times."""
    engine = {"layout": "inline", **mechanism(rng), **spaced(rng)}
    angles: list[Any] = list(throws(rng, int(rng.integers(3, 6))))
    for k in rng.choice(len(angles) - 1, int(rng.integers(1, 3)), replace=False) + 1:
        wide = rng.uniform(10.0, 60.0)
        angles[k] = {"between": [round(angles[k] - wide, 3), round(angles[k] + wide, 3)]}
    engine["throws"] = angles
    table = {"engine": engine, "operating_points": points(rng), "mounts": rigid_mounts(rng)}
    if rng.random() < 0.5:
        table["counterweights"] = counterweights(rng, moving_mass(engine), int(rng.integers(1, 3)))
    return with_objective(rng, table, 1, norms=SMOOTH)


def places(rng: Generator) -> Table:
    """Return a shaft or two whose height, side or unbalance's place is open; angles given or open."""
    built = inline(rng) if rng.random() < 0.7 else vee(rng)
    size = moving_mass(built)
    table = {"engine": built, "operating_points": points(rng), "mounts": rigid_mounts(rng)}
    shafts = balancers(rng, size, int(rng.integers(1, 3)))
    for shaft in shafts:
        entry = shaft["unbalances"][0]
        if rng.random() < 0.6:
            entry["angle"] = angle(rng)
        where = int(rng.integers(0, 3))
        bounds = {"between": ["-0.2 m", "0.2 m"]}
        if where < 2:
            shaft["position"][where] = bounds
        else:
            entry["x"] = bounds
    table["balancer_shafts"] = shafts
    return with_objective(rng, table, 1)


def leads(rng: Generator) -> Table:
    """Return cranks geared to, or coupled with, another one at open angles, at times with weights."""
    engine, gas = {"layout": "parts", **mechanism(rng, plain=True), "cycle": "two-stroke"}, rng.random() < 0.5
    count, turning = int(rng.integers(1, 3)), float(rng.choice([-1, 1]))
    engine["shafts"] = [
        {
            "name": f"led {k}", "ratio": 1.0 if gas else turning, "lead": {"between": [0, 360]},
            "position": ["0.0 m", "0.0 m"] if gas else [q(v, "m") for v in rng.uniform(-0.3, 0.3, 2)],
        }
        for k in range(count)
    ]  # fmt: skip
    # with gas upright: of torque the plain model knows these alone
    on = ["crankshaft", *(shaft["name"] for shaft in engine["shafts"]), *["crankshaft"] * int(rng.integers(0, 2))]
    engine["slider_cranks"] = [
        {
            # at x = 0 no couple of a crank's would be left
            "x": q(0.15 * k + 0.04, "m"),
            "throw": angle(rng),
            "bank_angle": angle(rng) if not gas and rng.random() < 0.3 else 0.0,
            "shaft": name,
        }
        for k, name in enumerate(on)
    ]
    table: Table = {
        "engine": engine, "operating_points": points(rng), "mounts": rigid_mounts(rng), "fidelity": {"samples": 360}
    }  # fmt: skip
    if gas:
        engine |= {"bore": q(rng.uniform(0.06, 0.1), "m"), "fires_together": True}
        table["gas"] = {
            "model": "seiliger", "peak_pressure": q(rng.uniform(55, 85), "bar"),
            "imep": q(rng.uniform(4.0, 8.0), "bar"),
        }  # fmt: skip
        table["flywheel"] = {"inertia": q(rng.uniform(20.0, 80.0) * moving_mass(engine), "kg m^2")}
    if count == 1 and rng.random() < 0.4:
        table["counterweights"] = counterweights(rng, moving_mass(engine), 1)
        table["counterweights"][0] |= {"shaft": "led 0", "angle": {"between": [0, 360]}}
        table["counterweights"][0]["mass"]["between"][0] = "0.0 kg"
    turning_alone = ["degree of irregularity", "peak to peak stored work", "rms crank torque"]
    if gas and "counterweights" not in table and rng.random() < 0.4:
        table["objective"] = {"minimise": str(rng.choice(turning_alone))}
    else:
        table = with_objective(rng, table, 1)
    return limits_at(rng, table, [{"limit": "rms shaking force", "side": "max", "unit": "N"},
                                  {"limit": "mean roll moment", "side": "max", "unit": "N m"}], 0.4)  # fmt: skip


def shared_leads(rng: Generator) -> Table:
    """Return the opposed pistons with gas between them, the lead of one crank open."""
    engine = opposed_piston(rng)
    engine.pop("rod_inertia_deficit", None)
    minimum = -float(round(rng.uniform(1.0, 25.0), 1)) if rng.random() < 0.5 else 0.0
    engine |= {
        "cycle": "two-stroke", "bore": q(rng.uniform(0.06, 0.1), "m"), "throws": throws(rng, int(rng.integers(1, 3))),
        "crank_lead": {"between": [minimum, float(round(rng.uniform(10.0, 40.0), 1))]},
    }  # fmt: skip
    peak = rng.uniform(75.0, 110.0)
    table: Table = {
        "engine": engine, "operating_points": points(rng, 2), "mounts": rigid_mounts(rng), "tolerance": 1e-3,
        "gas": {
            "model": "seiliger", "compression_ratio": float(round(rng.uniform(12.0, 16.0), 2)),
            "peak_pressure": q(peak, "bar"), "imep": q(peak * rng.uniform(0.14, 0.25), "bar"),
        },
    }  # fmt: skip
    table = with_objective(rng, table, 1, channels=("mount force", "roll moment"))
    return limits_at(rng, table, [{"limit": "rms shaking force", "side": "max", "unit": "N"}], 0.3)


def banks(rng: Generator) -> Table:
    """Return a vee twin whose bank angle or split pin is open, and weights on its crank."""
    engine = {
        "layout": "vee",
        **mechanism(rng),
        **spaced(rng),
        "cylinders": 2,
        "firing_order": [1, 2],
        "throws": "open",
    }
    engine.pop("offset", None)
    bounds = {"between": [float(round(rng.uniform(20.0, 60.0), 1)), float(round(rng.uniform(80.0, 150.0), 1))]}
    if rng.random() < 0.6:
        engine |= {"bank_angle": bounds}
    else:
        engine |= {"bank_angle": float(rng.choice([45.0, 60.0, 90.0])), "split_pin_angle": {"between": [-40.0, 70.0]}}
    if rng.random() < 0.6:
        engine["bank_stagger"] = q(rng.uniform(-0.03, 0.03), "m")
    table: Table = {"engine": engine, "operating_points": points(rng), "mounts": rigid_mounts(rng)}
    table["phasing"] = {"intervals": {"min": 1.0, "max": 719.0}}
    if rng.random() < 0.6:
        table["counterweights"] = counterweights(rng, moving_mass({**engine, "throws": [0.0]}), 1)
        # the throw follows the bank: a weight of any angle is the same beside both
        table["counterweights"][0] |= {"angle": {"between": [0, 360]}}
        table["counterweights"][0]["mass"]["between"][0] = "0.0 kg"
    return with_objective(rng, table, 1, norms=SMOOTH)


def rotary(rng: Generator) -> Table:
    """Draw one to four rotors: phases fixed, open on even steps, or between bounds; end weights, gas in chambers."""
    count, e = int(rng.integers(1, 5)), rng.uniform(0.008, 0.018)
    engine: Table = {
        "layout": "rotary", "cycle": "four-stroke", "eccentricity": q(e, "m"),
        "rotor_radius": q(e * rng.uniform(5.8, 8.5), "m"), "rotor_width": q(rng.uniform(0.05, 0.09), "m"),
        "rotor_mass": q(rng.uniform(2.0, 6.0), "kg"), "rotor_inertia": q(rng.uniform(0.0, 0.03), "kg m^2"),
        "rotating_mass": q(rng.uniform(0.0, 2.0), "kg"), **spaced(rng),
    }  # fmt: skip
    chance = rng.random()
    if count > 1 and chance < 0.4:
        engine |= {"throws": "open", "firing_order": "open", "cylinders": count}
    else:
        engine["throws"] = throws(rng, count)
    table: Table = {"engine": engine, "operating_points": points(rng, 2, 200.0, 900.0), "mounts": rigid_mounts(rng)}
    if rng.random() < 0.6:
        peak = rng.uniform(45.0, 70.0)
        table["gas"] = {
            "model": "seiliger", "compression_ratio": float(round(rng.uniform(7.5, 9.5), 2)),
            "peak_pressure": q(peak, "bar"), "imep": q(peak * rng.uniform(0.18, 0.3), "bar"),
        }  # fmt: skip
    out = 0.5 * count * number(engine["cylinder_spacing"]) + rng.uniform(0.0, 0.05)
    table["main_bearings"] = [{"x": q(out, "m")}, {"x": q(-out, "m")}]
    size = moving_mass(engine)
    table["counterweights"] = counterweights(rng, size, int(rng.integers(1, 4)))
    if shafts := balancers(rng, size, int(rng.integers(0, 2))):
        table["balancer_shafts"] = shafts
    table["flywheel"] = {"inertia": q(rng.uniform(0.05, 0.5), "kg m^2")}
    kinds = [
        ("apex speed", "1e3 m/s"), ("apex acceleration", "1e6 m/s^2"), ("rms crank torque", "1e6 N m"),
        ("maximum crank-pin force", "1e8 N"), ("degree of irregularity", 1.99),
    ]  # fmt: skip
    kinds = kinds if "gas" in table else kinds[:2]
    chosen = [kinds[k] for k in sorted(rng.choice(len(kinds), 2, replace=False))]
    table["constraints"] = [{"limit": name, "max": maximum, "name": name} for name, maximum in chosen]
    if rng.random() < 0.25:
        # remaining force and couple, by the least mass
        table["objective"] = {"minimise": "counterweight mass"}
        whole = size * number(table["operating_points"][0]["speed"]) ** 2
        part = rng.uniform(0.05, 0.6)
        table["constraints"].append(
            {"limit": "maximum shaking force", "max": q(part * whole, "N"), "name": "force left"}
        )
        return table
    return with_objective(rng, table, channels=(*LOADS, "main-bearing force"))


def sizes(rng: Generator) -> Table:
    """Return the sizes of the running gear and weights together, under stresses that a random design nearly has."""
    count = int(rng.integers(1, 3))
    engine = gas_engine(rng)
    while len(engine["throws"]) > 2:
        engine = gas_engine(rng)
    count, stroke = len(engine["throws"]), float(engine["stroke"].split()[0])
    size = 1.5 * moving_mass(engine)
    engine["cylinder_spacing"] = q(rng.uniform(1.8, 2.4) * stroke, "m")
    distance = float(engine["cylinder_spacing"].split()[0])
    engine["big_end"] = {
        "diameter": q(rng.uniform(0.5, 0.7) * stroke, "m"),
        "width": q(rng.uniform(0.3, 0.4) * stroke, "m"),
    }
    table: Table = {"engine": engine, "operating_points": points(rng), "mounts": rigid_mounts(rng)}
    if rng.random() < 0.5:
        table["gas"] = {
            "model": "seiliger", "peak_pressure": q(rng.uniform(55, 85), "bar"), "imep": q(rng.uniform(6.5, 10), "bar"),
        }  # fmt: skip
    table["main_bearings"] = [
        {"name": f"b{k}", "x": q((0.5 * count - k) * distance + rng.uniform(-0.05, 0.05) * distance, "m"),
         "diameter": q(rng.uniform(0.55, 0.75) * stroke, "m"), "width": q(rng.uniform(0.2, 0.35) * stroke, "m")}
        for k in range(count + 1)
    ]  # fmt: skip
    table["running_gear"] = {
        "density": "7850.0 kg/m^3",
        "webs": {"width": q(rng.uniform(0.8, 1.2) * stroke, "m"), "thickness": q(rng.uniform(0.15, 0.3) * stroke, "m")},
        "rod": {"diameter": q(rng.uniform(0.15, 0.3) * stroke, "m")},
        "piston_pin": {
            "diameter": q(rng.uniform(0.25, 0.35) * stroke, "m"), "bore": q(rng.uniform(0.1, 0.2) * stroke, "m"),
            "length": q(rng.uniform(0.6, 0.9) * stroke, "m"),
        },
    }  # fmt: skip
    gear = table["running_gear"]
    choices = [(engine["big_end"], "diameter"), (engine["big_end"], "width"), (gear["webs"], "thickness"),
             (gear["rod"], "diameter"), (gear["piston_pin"], "diameter")]  # fmt: skip
    for k in rng.choice(len(choices), int(rng.integers(1, 4)), replace=False):
        part, key = choices[int(k)]
        drawn = float(part[key].split()[0])
        part[key] = {
            "between": [q(0.75 * drawn, "m"), q(1.5 * drawn, "m")],
            "start": q(1.2 * drawn, "m"),
        }
    weights, shafts = int(rng.integers(0, 3)), int(rng.integers(0, 2))
    if weights:
        table["counterweights"] = counterweights(rng, size, weights)
    if shafts:
        table["balancer_shafts"] = balancers(rng, size, shafts)
    table["fidelity"], table["search"] = {"samples": 240}, {"boxes": 60}
    if rng.random() < 0.1:
        table["objective"] = {"minimise": "running-gear mass"}
    else:
        kinds = ("shaking force", "mount force", "main-bearing force", "crank-pin force")
        table = with_objective(rng, table, channels=kinds, norms=SMOOTH)
        # masses that turn with the throws have no second order, and do not load the pins
        for term in table["objective"].get("terms", [table["objective"]]):
            key = "quantity" if "quantity" in term else "minimise"
            term[key] = term[key].replace("crank-pin force", "main-bearing force")
            if term.get("orders") == [2]:
                del term["orders"]
    stresses = [{"limit": f"maximum {name}", "side": "max", "unit": unit} for name, unit in SIZED.items()]
    stresses.append({"limit": "throw clearance", "side": "min", "unit": "m"})
    stresses += [{"limit": f"{norm} main-bearing force", "side": "max", "unit": "N"} for norm in ("mean", "rms")]
    if weights:
        stresses.append({"limit": "counterweight mass", "side": "max", "unit": "kg"})
    return limits_at(rng, table, stresses, 0.9)


def worst_means(rng: Generator) -> Table:
    """Return a problem of another family at several operating points, with the worst mean of them."""
    family = FAMILIES[str(rng.choice(OF_WORST_MEANS))]
    while len((table := family(rng))["operating_points"]) < 2:
        pass
    entry = dict(table["objective"])
    terms = [entry] if "minimise" in entry else [dict(term) for term in entry["terms"]]
    for term in terms:
        key = "minimise" if "minimise" in term else "quantity"
        _, channel = norm_and_channel(term[key])
        if channel in (*LOADS, *ELASTIC):
            term[key] = f"worst mean {channel}"
            term.pop("operating_points", None)
    return {**table, "objective": terms[0] if "minimise" in entry else {"terms": terms}}


def root_mean_quads(rng: Generator) -> Table:
    """Return a problem of another family with root mean quads in place of its norms."""
    table = FAMILIES[str(rng.choice(OF_ROOT_MEAN_QUADS))](rng)
    objective = dict(table["objective"])
    terms = [objective] if "minimise" in objective else [dict(term) for term in objective["terms"]]
    for term in terms:
        key = "minimise" if "minimise" in term else "quantity"
        norm, channel = norm_and_channel(term[key])
        if norm and channel in (*LOADS, *ELASTIC):
            term[key] = f"rmq {channel}"
    return {**table, "objective": terms[0] if "minimise" in objective else {"terms": terms}}


OF_ROOT_MEAN_QUADS = (
    "inline", "vee", "boxer", "radial", "points", "gas", "crankcase", "stars", "open-vees", "elastic-few", "joint",
    "elastic-balance", "uneven", "places", "leads", "bank angle", "shared leads", "sizes",
)  # fmt: skip

OF_WORST_MEANS = ("inline", "vee", "boxer", "radial", "points", "gas", "elastic-balance")
"""Unbalances alone are decided for it."""

FAMILIES: dict[str, Callable[[Generator], Table]] = {
    "inline": of_unbalances(inline),
    "vee": of_unbalances(vee),
    "boxer": of_unbalances(boxer),
    "opposed-piston": of_unbalances(opposed_piston),
    "radial": of_unbalances(radial),
    "parts": of_unbalances(parts),
    "points": of_unbalances(inline, 5),
    "gas": with_gas,
    "states": with_states,
    "crankcase": crankcase,
    "yokes": of_unbalances(yoke),
    "chambers": with_chambers,
    "rotary": rotary,
    "stars": stars,
    "open-vees": vees,
    "elastic-few": few_stiffnesses(1, 2),
    "elastic-many": few_stiffnesses(3, 4),
    "convex-mounts": convex_mounts,
    "joint": joint,
    "elastic-balance": balance_on_elastic,
    "uneven": uneven,
    "uneven crankcase": uneven_crankcase,
    "places": places,
    "leads": leads,
    "bank angle": banks,
    "shared leads": shared_leads,
    "sizes": sizes,
    "worst means": worst_means,
    "root mean quads": root_mean_quads,
}


def with_limits(rng: Generator, table: Table, share: float = 0.6) -> Table:
    """Return limits between the best design without them and the initial one, or below both."""
    from attack.openings import Openings
    from attack.rivals import convex_rival, stars_of

    openings = Openings(table)
    if (
        isinstance(table["objective"], list)
        or "speed_ranges" in table
        or openings.numbers
        or "constraints" in table
        or rng.random() > share
    ):
        return table
    star = next(iter(stars_of(openings)), None)
    if star is None:
        return table
    zero = np.zeros(openings.size)
    best, initial = openings.scene(convex_rival(openings, zero, star).vector, star), openings.scene(zero, star)
    limits: list[Table] = []
    for k in range(int(rng.integers(1, 3))):
        if rng.random() < 0.35:
            ask, high = {"quantity": "added mass"}, best.mass("added mass")
            maximum = high * rng.uniform(0.3, 0.9)
        else:
            ask = random_term(rng, table)
            low, high = best.measure(ask), initial.measure(ask)
            maximum = low * rng.uniform(0.8, 0.98) if rng.random() < 0.5 else low + (high - low) * rng.uniform(0.1, 0.6)
        # a load that vanishes by itself is no limit
        if maximum > 1e-4 * high > 1e-7:
            narrowed = {key: value for key, value in ask.items() if key != "quantity"}
            quantity = ask["quantity"]
            limits.append({"limit": quantity, "max": q(maximum, unit_of(quantity), 9), "name": f"l{k}", **narrowed})
    return {**table, "constraints": limits} if limits else table


def family_of(name: str) -> Callable[[Generator], Table]:
    """Return the function that makes the problems of a family."""
    from attack.driven_families import FAMILIES as DRIVEN
    from attack.newer_families import FAMILIES as NEWER
    from attack.ranged_families import FAMILIES as RANGED
    from attack.single_families import FAMILIES as SINGLE

    return {**FAMILIES, **SINGLE, **DRIVEN, **RANGED, **NEWER}[name]


def problem(family: str, seed: int) -> tuple[Table, Generator]:
    """Return a problem, and the generator that goes on from there."""
    rng = np.random.default_rng([*family.encode(), seed])
    return with_limits(rng, {"title": f"{family} {seed}", **family_of(family)(rng)}), rng
