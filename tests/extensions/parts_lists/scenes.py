"""Random problems with lists of parts, and the best of all rows by brute force.

Brute force writes the numbers of each combination into the tables of the file itself, and solves each file alone.
"""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from laufruhe.errors import LaufruheError
from laufruhe.files.reader import load
from laufruhe.files.toml_text import toml_text
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from laufruhe.solvers.result import Status

Random: TypeAlias = np.random.Generator
Put: TypeAlias = Callable[[dict[str, Any], Any], None]
"""Function that writes one number into the tables of a file."""


@dataclass(frozen=True)
class Lists:
    """A list: heads, units, rows of numbers, functions that write them, and the table [[choices]] of the file."""

    name: str
    columns: tuple[tuple[str, str, Put], ...]
    rows: tuple[tuple[float, ...], ...]
    keys: Mapping[str, Any] = field(default_factory=dict)

    @property
    def csv(self) -> str:
        """Return the text of the CSV file."""
        heads = [f"{name} [{unit}]" if unit else name for name, unit, _ in self.columns]
        lines = [", ".join(["name", *heads])]
        lines += [", ".join([f"{self.name} {k}", *map(repr, row)]) for k, row in enumerate(self.rows, 1)]
        return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Scene:
    """Tables of a file, and its lists."""

    tables: dict[str, Any]
    lists: tuple[Lists, ...]

    def load(self, folder: Path) -> Problem:
        """Write the file with its lists, and return its problem."""
        choices = []
        for k, parts in enumerate(self.lists):
            (folder / f"list-{k}.csv").write_text(parts.csv, encoding="utf-8")
            choices.append({"name": parts.name, "file": f"list-{k}.csv", **parts.keys})
        (folder / "scene.toml").write_text(toml_text({**self.tables, "choices": choices}), encoding="utf-8")
        return load(folder / "scene.toml")

    def combinations(self) -> list[tuple[tuple[int, ...], dict[str, Any]]]:
        """Return the rows and the tables of every combination."""
        combinations = []
        for rows in itertools.product(*(range(len(parts.rows)) for parts in self.lists)):
            tables = copy.deepcopy(self.tables)
            if "parts_price" in tables:
                tables["parts_price"]["total"] = 0.0
            for parts, row in zip(self.lists, rows, strict=True):
                for (_, unit, put), value in zip(parts.columns, parts.rows[row], strict=True):
                    put(tables, f"{value!r} {unit}" if unit else value)
            combinations.append((rows, tables))
        return combinations

    def values(self) -> dict[tuple[int, ...], float]:
        """Return the optimum of every combination, infinite without a design, NaN without a result."""
        values = {}
        for rows, tables in self.combinations():
            try:
                result = solve(load(tables))
            except LaufruheError:
                values[rows] = math.nan
                continue
            if result.status.has_design and result.objective is not None:
                values[rows] = result.objective.value
            else:
                values[rows] = math.inf if result.status is Status.INFEASIBLE else math.nan
        return values


def _put(*place: Any) -> Put:
    def put(tables: dict[str, Any], value: Any) -> None:
        node: Any = tables
        for key in place[:-1]:
            node = node[key]
        node[place[-1]] = value

    return put


def _add_price(count: int) -> Put:
    def put(tables: dict[str, Any], value: Any) -> None:
        if "parts_price" in tables:
            tables["parts_price"]["total"] += count * value

    return put


def _engine(random: Random) -> dict[str, Any]:
    throws, order = [
        ([0], [1]), ([0, 180], [1, 2]), ([0, 240, 120], [1, 2, 3]), ([0, 180, 180, 0], [1, 3, 4, 2]),
    ][random.integers(4)]  # fmt: skip
    return {
        "title": "Random engine with parts from lists",
        "engine": {
            "layout": "inline", "cycle": "four-stroke", "bore": "80 mm", "stroke": "86 mm",
            "rod_ratio": float(random.uniform(0.24, 0.32)),
            "reciprocating_mass": f"{random.uniform(0.4, 0.7)!r} kg",
            "rotating_mass": f"{random.uniform(0.3, 0.6)!r} kg",
            "cylinder_spacing": "90 mm", "throws": throws, "firing_order": order,
        },
        "gas": {
            "model": "wiebe", "imep": f"{random.uniform(2.0, 6.0)!r} bar", "start": -8, "duration": 55,
            "compression_ratio": 10.0,
        },
        "operating_points": [{"name": "idle", "speed": f"{random.uniform(700.0, 1200.0)!r} rpm"}],
    }  # fmt: skip


def _points(random: Random, tables: dict[str, Any]) -> None:
    # a second speed, or a cylinder that misfires
    if random.random() < 0.5:
        tables["operating_points"].append({"name": "fast", "speed": f"{random.uniform(2000.0, 4000.0)!r} rpm"})
    elif tables["engine"]["firing_order"] != [1]:
        tables["operating_points"].append({"name": "one out", "speed": "900 rpm", "misfire": "each"})


def _weights(random: Random, tables: dict[str, Any], chosen: int, opened: int) -> list[Lists]:
    """Add counterweights: `chosen` ones from lists, `opened` ones with open mass and angle."""
    throws, lists = len(tables["engine"]["throws"]), list[Lists]()
    weights = tables.setdefault("counterweights", [])
    for k in range(chosen + opened):
        name = f"web {k + 1}"
        weight: dict[str, Any] = {"name": name, "opposite_throw": int(random.integers(throws)) + 1, "radius": "60 mm"}
        if k >= chosen:
            weight["mass"] = {"between": ["0 kg", "2 kg"]}
            if random.random() < 0.5:
                weight["angle"] = {"between": [0, 360]}
        else:
            weight |= {"mass": "1 kg", "angle": float(random.uniform(-20.0, 20.0))}
        weights.append(weight)
        if k < chosen:
            place = ("counterweights", len(weights) - 1)
            rows = [
                (float(random.uniform(0.2, 3.0)), float(random.uniform(40.0, 90.0)), float(random.uniform(5, 50)))
                for _ in range(random.integers(2, 7))
            ]
            columns = (("mass", "kg", _put(*place, "mass")), ("radius", "mm", _put(*place, "radius")),
                       ("price", "", _add_price(1)))  # fmt: skip
            if random.random() < 0.6:
                columns, rows = (columns[0], columns[2]), [(a, c) for a, _, c in rows]
            lists.append(Lists(f"weight {k + 1}", columns, tuple(rows), {"parts": [name]}))
    return lists


def _elastic(random: Random, tables: dict[str, Any], count: int) -> list[Lists]:
    """Add a block on elastic mounts, of which `count` groups come from lists."""
    tables["block"] = {
        "mass": "140 kg", "centre_of_gravity": ["-40 mm", "0 mm", "60 mm"],
        "inertia": ["5 kg m^2", "11 kg m^2", "9.5 kg m^2"],
    }  # fmt: skip
    names = ["front left", "front right", "rear left", "rear right"]
    places = [
        {"name": name, "position": [f"{x} mm", f"{y} mm", "20 mm"], "loss_factor": 0.12,
         "stiffness": ["90 N/mm", "80 N/mm", "250 N/mm"]}
        for name, x, y in zip(names, (220, 220, -300, -300), (210, -190, 180, -200), strict=True)
    ]  # fmt: skip
    tables["mounts"] = {"kind": "elastic", "places": places}
    groups = [[0, 1, 2, 3]] if count == 1 else [[0, 1], [2, 3]] if count == 2 else [[0, 1], [2], [3]]
    return [_mount_list(random, tables, group, k) for k, group in enumerate(groups)]


def _mount_list(random: Random, tables: dict[str, Any], group: Sequence[int], k: int) -> Lists:
    """Return a list of mounts for the places in a group, of one to five columns."""
    names = [tables["mounts"]["places"][j]["name"] for j in group]

    def to(*key: Any) -> Put:
        def put(tables: dict[str, Any], value: Any) -> None:
            for j in group:
                _put("mounts", "places", j, *key)(tables, value)

        return put

    columns: list[tuple[str, str, Put]] = [("stiffness.z", "N/mm", to("stiffness", 2))]
    draws: list[Callable[[float], float]] = [lambda size: 120.0 * size]
    if random.random() < 0.5:
        columns += [("stiffness.x", "N/mm", to("stiffness", 0)), ("stiffness.y", "N/mm", to("stiffness", 1))]
        draws += [lambda size: 60.0 * size * random.uniform(0.8, 1.2), lambda size: 50.0 * size]
    if random.random() < 0.4:
        columns.append(("loss_factor", "", to("loss_factor")))
        draws.append(lambda size: 0.04 + 0.03 * size)
    keys: dict[str, Any] = {"parts": names}
    if random.random() < 0.5:
        limits = tables.setdefault("constraints", [])
        limits.append({"name": f"rating {k}", "limit": "static sag", "max": "9 mm"})
        columns.append(("sag", "mm", _put("constraints", len(limits) - 1, "max")))
        draws.append(lambda size: float(random.uniform(2.0, 9.0)))
        keys["sets"] = {"sag": f"constraints.rating {k}.max"}
    columns.append(("price", "", _add_price(len(group))))
    draws.append(lambda size: 10.0 + 4.0 * size)
    sizes = random.uniform(0.5, 4.0, size=random.integers(2, 7))
    rows = tuple(tuple(float(draw(size)) for draw in draws) for size in sizes)
    return Lists(f"mounts {k}", tuple(columns), rows, keys)


def _torsion(random: Random, tables: dict[str, Any], count: int) -> list[Lists]:
    """Add a torsional system, of which up to three parts come from lists."""
    if len(tables["engine"]["throws"]) == 1:
        tables["engine"] |= {"throws": [0, 180, 180, 0], "firing_order": [1, 3, 4, 2]}
    tables["torsion"] = {
        "throw_inertia": "0.006 kg m^2", "cylinder_damping": "0.3 N m s/rad", "loss_factor": 0.01,
        "crank": {"stiffness": "4e5 N m/rad", "diameter": "48 mm"},
        "discs": [
            {"name": "pulley", "end": "front", "inertia": "0.008 kg m^2",
             "shaft": {"stiffness": "1.2e5 N m/rad", "diameter": "36 mm"}},
            {"name": "flywheel", "end": "rear", "inertia": "0.14 kg m^2",
             "shaft": {"stiffness": "6e5 N m/rad", "diameter": "58 mm"}},
        ],
        "absorbers": [{"name": "damper", "on": "pulley", "inertia": "0.004 kg m^2", "damping": "3 N m s/rad"}],
    }  # fmt: skip
    disc, absorber = ("torsion", "discs", 1), ("torsion", "absorbers", 0)
    kinds = [
        ("coupling", [("stiffness", "N m/rad", _put(*disc, "shaft", "stiffness"), 2e5, 9e5)],
         {"parts": ["torsion.discs.flywheel.shaft"]}),
        ("damper", [("inertia", "kg m^2", _put(*absorber, "inertia"), 2e-3, 8e-3),
                    ("damping", "N m s/rad", _put(*absorber, "damping"), 0.5, 20.0)],
         {"parts": ["torsion.absorbers.damper"]}),
        ("flywheel", [("inertia", "kg m^2", _put(*disc, "inertia"), 0.08, 0.3)],
         {"parts": ["torsion.discs.flywheel"]}),
    ]  # fmt: skip
    lists = []
    for k in random.permutation(3)[:count]:
        name, numbers, keys = kinds[k]
        rows = tuple(
            (*(float(random.uniform(low, high)) for *_, low, high in numbers), float(random.uniform(5.0, 50.0)))
            for _ in range(random.integers(2, 7))
        )
        columns = (*(tuple(number[:3]) for number in numbers), ("price", "", _add_price(1)))
        lists.append(Lists(name, columns, rows, keys))
    return lists


def _gear(random: Random, tables: dict[str, Any]) -> Lists:
    """Add a balancer shaft whose gear, of whole teeth, gives ratio and centre distance."""
    tables["balancer_shafts"] = [
        {"name": "balancer", "ratio": 2.0, "position": ["60 mm", "-90 mm"],
         "unbalances": [{"radius": "20 mm", "unbalance": "0.004 kg m", "angle": 180.0}]}
    ]  # fmt: skip
    place = ("balancer_shafts", 0)
    rows = []
    for ratio in random.permutation([-2.0, -1.0, 1.0, 2.0])[: random.integers(2, 4)]:
        rows += [(float(ratio), float(random.uniform(40.0, 120.0)), float(random.uniform(1e-3, 8e-3)))]
    columns = (
        ("ratio", "", _put(*place, "ratio")), ("position.y", "mm", _put(*place, "position", 0)),
        ("unbalance", "kg m", _put(*place, "unbalances", 0, "unbalance")),
    )  # fmt: skip
    return Lists("gear", columns, tuple(rows), {"sets": {
        "ratio": "balancer_shafts.balancer.ratio", "position.y": "balancer_shafts.balancer.position.1",
        "unbalance": "balancer_shafts.balancer.unbalances.1.unbalance",
    }})  # fmt: skip


def random_scene(seed: int) -> Scene:
    """Return a random problem with one to three lists of two to six rows."""
    random = np.random.default_rng(seed)
    tables = _engine(random)
    kind, count = seed % 4, int(random.integers(1, 4))
    _points(random, tables)
    if kind == 0:
        tables["mounts"] = {
            "positions": [["300 mm", "250 mm", "0 mm"], ["300 mm", "-250 mm", "0 mm"], ["-600 mm", "0 mm", "0 mm"]]
        }
        gears = [_gear(random, tables)] if random.random() < 0.4 else []
        lists = [*gears, *_weights(random, tables, max(count - len(gears), 1), int(random.integers(0, 2)))]
        quantity = ["rms mount force", "mean mount force", "maximum mount force", "rms shaking force"]
    elif kind == 1:
        lists = _elastic(random, tables, count)
        if random.random() < 0.3:
            _weights(random, tables, 0, 1)
        quantity = ["rms mount force", "maximum mount force", "mean mount force", "rms mount travel"]
    elif kind == 2:
        lists = _torsion(random, tables, count)
        quantity = ["rms shaft stress", "rms shaft twist", "maximum shaft torque"]
    else:
        lists = [*_elastic(random, tables, 1), *_weights(random, tables, count - 1, 1)]
        quantity = ["rms mount force", "maximum mount force", "mean mount force"]
    objective: dict[str, Any] = {"minimise": str(random.choice(quantity))}
    if random.random() < 0.6 and any(name == "price" for parts in lists for name, *_ in parts.columns):
        tables["parts_price"] = {"total": 100.0}
        if random.random() < 0.5:
            weight = float(10.0 ** random.uniform(-3.0, 0.0))
            terms = [{"quantity": objective["minimise"]}, {"quantity": "parts price", "weight": weight}]
            objective = {"terms": terms}
        else:
            prices = [[row[-1] for row in parts.rows] for parts in lists if parts.columns[-1][0] == "price"]
            counts = [len(parts.keys.get("parts", [0])) for parts in lists if parts.columns[-1][0] == "price"]
            middle = sum(count * float(np.median(p)) for count, p in zip(counts, prices, strict=True))
            tables.setdefault("constraints", []).append({"limit": "parts price", "max": middle})
    return Scene({**tables, "objective": objective}, tuple(lists))
