"""Open numbers of a problem file as a vector for a search, and the design of a result as such a vector.

A vector has one entry for every open number of engine, places and mounts, and one or two for every open
unbalance: its size where the angle is given, its two components otherwise. All entries are shares of their bounds.
"""

from __future__ import annotations

import cmath
import copy
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from attack import plain_electric
from attack.plain_loads import number
from attack.plain_scene import Scene, Table

Path = tuple[Any, ...]
OPEN_TABLES = ("engine", "counterweights", "balancer_shafts", "mounts", "running_gear", "main_bearings")
SIZED = ("running_gear", "main_bearings")
SIGNS = {"equal": 1.0, "opposite": -1.0, "mirrored": 1.0, "mirrored opposite": -1.0}


def is_open(value: Any) -> bool:
    return isinstance(value, dict) and "between" in value


def middle(value: Any) -> float:
    """Return a number, or where an open one starts."""
    if not is_open(value):
        return number(value)
    return number(value["start"]) if "start" in value else number(value["between"][0])


@dataclass(frozen=True)
class Weight:
    """An open unbalance.

    Attributes
    ----------
    minimum, maximum
        Of its size [kg m].
    sector
        Bounds of its angle [rad]; None where it is open wholly.
    follows
        Name of its leader, sign and whether it is mirrored.
    """

    name: str
    where: Path
    shaft: Path | None
    ratio: float
    radius: float
    role: str
    minimum: float
    maximum: float
    sector: tuple[float, float] | None
    follows: tuple[str, float, bool] | None = None

    @property
    def entries(self) -> int:
        """Return the number of its entries in the vector."""
        if self.follows or self.minimum == self.maximum:
            return 0
        return 1 if self.sector and self.sector[0] == self.sector[1] else 2

    def unbalance(self, entries: np.ndarray) -> complex:
        if self.entries == 2:
            return self.maximum * complex(*entries)
        size = self.minimum if self.entries == 0 else self.minimum + (self.maximum - self.minimum) * float(entries[0])
        return size * cmath.exp(1j * (self.sector or (0.0, 0.0))[0])


class Openings:
    """A problem's table with its open numbers as a vector."""

    def __init__(self, table: Table) -> None:
        limits = [*table.get("constraints", []), *plain_electric.limits(table)]
        self.table = {**table, "constraints": limits} if "electric_machines" in table else table

    @cached_property
    def weights(self) -> tuple[Weight, ...]:
        rows = []
        for k, entry in self._listed("counterweights"):
            shafts = [s["name"] for s in self.table["engine"].get("shafts", [])]
            at = shafts.index(entry["shaft"]) if "shaft" in entry else None
            shaft_path: Path | None = None if at is None else ("engine", "shafts", at)
            ratio = 1.0 if shaft_path is None else float(_at(self.table, shaft_path).get("ratio", 1))
            rows.append(self._weight(entry, ("counterweights", k), shaft_path, ratio, "c"))
        for k, shaft in self._listed("balancer_shafts"):
            where: Path = ("balancer_shafts", k)
            for j, u in enumerate(shaft["unbalances"]):
                single = len(shaft["unbalances"]) == 1 and "name" not in u
                name = shaft["name"] if single else f"{shaft['name']}.{u.get('name', j + 1)}"
                entry = {**u, "name": name}
                rows.append(
                    self._weight(entry, (*where, "unbalances", j), where, float(shaft["ratio"]), "b", tuple(rows))
                )
        for name, order, largest in plain_electric.open_torques(self.table):
            rows.append(Weight(name, (), None, order, 1.0, plain_electric.ROLE, 0.0, largest, None))
        return tuple(rows)

    def _listed(self, key: str) -> list[tuple[int, Table]]:
        return list(enumerate(self.table.get(key, [])))

    def _weight(
        self, entry: Table, where: Path, shaft: Path | None, ratio: float, role: str, before: tuple[Weight, ...] = ()
    ) -> Weight:
        if "coupled" in entry:
            leader = next(w for w in before if w.name == entry["coupled"]["to"])
            how = entry["coupled"]["as"]
            follows = (leader.name, SIGNS[how], how.startswith("mirrored"))
            radius = number(entry.get("radius", leader.radius))
            return Weight(entry["name"], where, shaft, ratio, radius, role, 0.0, leader.maximum, None, follows)
        radius = number(entry.get("radius", 1.0))
        size = entry["mass"] if "mass" in entry else entry["unbalance"]
        gain = radius if "mass" in entry else 1.0
        minimum, maximum = (number(v) * gain for v in (size["between"] if is_open(size) else (size, size)))
        angle = entry.get("angle", 0.0)
        low, high = (math.radians(v) for v in (angle["between"] if is_open(angle) else (angle, angle)))
        sector = None if high - low > 6.28 else (low, high)
        return Weight(entry["name"], where, shaft, ratio, radius, role, minimum, maximum, sector)

    @cached_property
    def numbers(self) -> tuple[tuple[Path, float, float], ...]:
        """Return paths and bounds of open numbers, but sizes and angles of unbalances and the angles of even stars."""
        steps = self.table["engine"].get("throws") == "open" and "intervals" not in self.table.get("phasing", {})
        rows: list[tuple[Path, float, float]] = []

        def look(value: Any, path: Path) -> None:
            if is_open(value):
                if path[0] in ("engine", "mounts", *SIZED) or path[-1] not in ("mass", "unbalance", "angle"):
                    rows.append((path, *(number(v) for v in value["between"])))
            elif isinstance(value, dict | list):
                for key, part in value.items() if isinstance(value, dict) else enumerate(value):
                    look(part, (*path, key))

        for key in OPEN_TABLES:
            if key == "engine" and steps:
                # angles of stars are chosen and not moved
                for name in ("reciprocating_mass", "rod_length", "displacer_mass"):
                    look(self.table["engine"].get(name), (key, name))
            else:
                look(self.table.get(key), (key,))
        return tuple(rows)

    @property
    def size(self) -> int:
        """Return the number of entries of the vector."""
        return len(self.numbers) + sum(w.entries for w in self.weights)

    @property
    def convex(self) -> bool:
        """Return whether unbalances alone are open."""
        return not self.numbers and self.table["engine"].get("throws") != "open"

    @property
    def box(self) -> np.ndarray:
        """Return the bounds of the entries, (size, 2); discs and sectors are `allowed` beside."""
        rows = [(0.0, 1.0)] * len(self.numbers)
        for w in self.weights:
            rows += [(0.0, 1.0)] if w.entries == 1 else [(-1.0, 1.0)] * w.entries
        return np.array(rows).reshape(-1, 2)

    def parts(self, vector: np.ndarray) -> list[tuple[Weight, np.ndarray]]:
        """Return all weights, each with its entries of the vector."""
        slices, at = [], len(self.numbers)
        for w in self.weights:
            slices.append((w, vector[at : at + w.entries]))
            at += w.entries
        return slices

    def nearest(self, vector: np.ndarray) -> np.ndarray:
        """Return the vector brought into its bounds, discs and sectors."""
        out = np.clip(vector, *self.box.T) if self.size else vector
        for w, part in self.parts(out):
            if w.entries != 2:
                continue
            if w.sector:
                part[:] = _into_sector(part, *w.sector)
            size = math.hypot(*part)
            if size > 1.0:
                part /= size
        return out

    def random(self, rng: np.random.Generator) -> np.ndarray:
        vector = rng.uniform(*self.box.T) if self.size else np.zeros(0)
        return self.nearest(vector)

    def scene(self, vector: np.ndarray, star: Table | None = None, order: tuple[int, ...] | None = None) -> Scene:
        """Return the design of a vector; `star` replaces keys of [engine] (a star, a bank)."""
        table = {**self.table, **{key: copy.deepcopy(self.table[key]) for key in OPEN_TABLES if key in self.table}}
        table["engine"].update(star or {})
        for (path, low, high), share in zip(self.numbers, vector, strict=False):
            holder = table
            for key in path[:-1]:
                holder = holder[key]
            holder[path[-1]] = low + (high - low) * float(share)
        return Scene(table, self._rotors(table, vector), order)

    def _rotors(self, table: Table, vector: np.ndarray) -> list[tuple[Any, ...]]:
        rotors: dict[str, tuple[Any, ...]] = {}
        for w, part in self.parts(vector):
            if w.role == plain_electric.ROLE:
                rotors[w.name] = (w.name, 0.0, 0j, w.ratio, w.unbalance(part), w.radius, w.role)
                continue
            entry = _at(table, w.where)
            y, z = (number(v) for v in _at(table, w.shaft)["position"]) if w.shaft else (0.0, 0.0)
            if w.follows:
                name, sign, mirrored = w.follows
                leader = rotors[name][4]
                u = sign * (leader.conjugate() if mirrored else leader)
            else:
                u = w.unbalance(part)
            rotors[w.name] = (w.name, number(entry["x"]), complex(z, y), w.ratio, u, w.radius, w.role)
        return list(rotors.values())

    def read(self, engine: Any, decisions: dict[str, float]) -> tuple[np.ndarray, Table]:
        """Return vector of an engine that was decided, and its throws and angles where these are open as a whole.

        Numbers of mounts are taken from what is told of decisions, by their names.

        An unbalance that is missing belongs to a shaft that is not built.
        """
        rotors = {r.name: r for r in engine.rotors}
        values = [
            (self._number(path, engine, rotors, decisions) - low) / (high - low) for path, low, high in self.numbers
        ]
        for w in self.weights:
            u = rotors[w.name].unbalance if w.name in rotors else 0j
            if w.role == plain_electric.ROLE:
                u = decisions[f"{w.name}.torque"] * cmath.exp(1j * decisions[f"{w.name}.angle"])
            if w.entries == 2:
                values += [u.real / w.maximum, u.imag / w.maximum]
            elif w.entries == 1:
                assert w.sector is not None
                values.append(((u * cmath.exp(-1j * w.sector[0])).real - w.minimum) / (w.maximum - w.minimum))
        return np.array(values), self._star(engine)

    def _star(self, engine: Any) -> Table:
        e = self.table["engine"]
        if e.get("throws") != "open" or e["layout"] not in ("inline", "vee", "rotary"):
            return {}
        throws, bank, split = self._angles(engine)
        star: Table = {"throws": [math.degrees(t) for t in throws]}
        if "single_cylinders" in e or "row_angle" in e:
            fires = [p.firing_angle for p in engine.slider_cranks]
            star["firing_order"] = sorted(range(1, len(fires) + 1), key=lambda n: fires[n - 1])
        if e["layout"] == "vee":
            star |= {"bank_angle": math.degrees(bank), "split_pin_angle": math.degrees(split)}
        return star

    def _angles(self, engine: Any) -> tuple[list[float], float, float]:
        """Return the throws, bank and split pin [rad]."""
        parts = engine.slider_cranks
        if self.table["engine"]["layout"] != "vee":
            return [p.throw for p in parts], 0.0, 0.0
        half = len(parts) // 2
        split = math.remainder(parts[half].throw - parts[0].throw, math.tau)
        stated = self.table["engine"].get("split_pin_angle", 0.0)
        if not is_open(stated):
            split = math.radians(stated)
        elif split < math.radians(stated["between"][0]) - 1e-9:
            split += math.tau
        return [p.throw + 0.5 * split for p in parts[:half]], parts[0].bank - parts[half].bank, split

    def _number(self, path: Path, engine: Any, rotors: dict[str, Any], decided: dict[str, float]) -> float:
        if path[-1] == "lead":
            return math.degrees(decided[f"{_at(self.table, path[:-1])['name']}.lead"])
        if (
            path[0] == "running_gear"
            or path[:2] == ("engine", "big_end")
            or path in (("engine", "rod_length"), ("engine", "stroke"), ("engine", "offset"))
        ):
            return decided[".".join(path)]
        if path in (("engine", "reciprocating_mass"), ("engine", "displacer_mass")):
            return decided[path[1].replace("_", " ")]
        if path[0] == "main_bearings":
            return decided[f"{_at(self.table, path[:-1])['name']}.{path[-1]}"]
        if path[-1] == "crank_lead":
            return math.degrees(decided["crank lead"])
        if path[0] == "engine":
            throws, bank, split = self._angles(engine)
            if path[1] == "throws":
                low, high = (float(v) for v in _at(self.table, path)["between"])
                angle = math.degrees(throws[path[2]])
                turns = round((0.5 * (low + high) - angle) / 360.0)
                return angle + 360.0 * turns
            return math.degrees({"bank_angle": bank, "split_pin_angle": split}[path[1]])
        if path[0] == "mounts":
            label = ".".join([self.table["mounts"]["places"][path[2]]["name"], path[3], *("xyz"[k] for k in path[4:])])
            return math.degrees(decided[label]) if path[3] == "turned" else decided[label]
        if path[-1] == "x":
            return float(rotors[next(w.name for w in self.weights if path[:-1] == w.where)].x)
        shaft = rotors[next(w.name for w in self.weights if path[:2] == w.shaft)].shaft
        return float((shaft.y, shaft.z)[path[3]])


def _at(table: Any, path: Path) -> Any:
    for key in path:
        table = table[key]
    return table


def _into_sector(point: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return the nearest point of a sector of at most half a turn."""
    z, middle_angle, half = complex(*point), 0.5 * (low + high), 0.5 * (high - low)
    turned = z * cmath.exp(-1j * middle_angle)
    if abs(cmath.phase(turned)) <= half or turned == 0:
        return point
    edge = cmath.exp(1j * math.copysign(half, turned.imag))
    along = max((turned * edge.conjugate()).real, 0.0)
    moved = along * edge * cmath.exp(1j * middle_angle)
    return np.array([moved.real, moved.imag])
