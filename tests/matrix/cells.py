"""Problem files of every kind of decision, measure and layout; what else a file may say is drawn by seed."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from laufruhe.extensions.flywheel.channels import FlywheelChannel
from laufruhe.problem.channels import CHANNELS, Channel, Needs

Document = dict[str, Any]
Generator = np.random.Generator
LeaveOpen = Callable[[Document, Generator], None]


@dataclass(frozen=True)
class Open:
    """A number that is left open, under the name that a result gives it; `unit` as files say it."""

    name: str
    lower: float
    upper: float
    unit: str = ""

    def text(self, values: Mapping[str, float] | None) -> str:
        """Return the bounds, or the value decided [SI]; angles are degrees in files."""
        if values is None:
            return f"{{ between = [{self._number(self.lower)}, {self._number(self.upper)}] }}"
        return self._number(math.degrees(values[self.name]) if self.unit == "deg" else values[self.name])

    def _number(self, value: float) -> str:
        return f"{value:.17g}" if self.unit in ("", "deg") else f'"{value:.17g} {self.unit}"'


@dataclass(frozen=True)
class OpenThrows:
    """Throws left open, or all but the first within bounds of their own [deg]."""

    count: int
    bounds: tuple[tuple[float, float], ...] = ()

    def text(self, values: Mapping[str, float] | None) -> str:
        """Return the value of the key: open without values, else the angles of the throws [deg]."""
        if values is None and not self.bounds:
            return '"open"'
        if values is None:
            return "[0, " + ", ".join(f"{{ between = [{low:g}, {high:g}] }}" for low, high in self.bounds) + "]"
        return "[" + ", ".join(f"{math.degrees(values[f'throw {k + 1}']):.17g}" for k in range(self.count)) + "]"


def written(document: Document, values: Mapping[str, float] | None = None) -> str:
    """Return the text of a file, its open numbers open or at values."""

    def text(value: Any) -> str:
        if isinstance(value, (Open, OpenThrows)):
            return value.text(values)
        if isinstance(value, list):
            return "[" + ", ".join(text(each) for each in value) + "]"
        if isinstance(value, dict):
            return "{ " + ", ".join(f"{key} = {text(each)}" for key, each in value.items()) + " }"
        return json.dumps(value)

    tables = [(f"[{key}]", own) for key, own in document.items() if isinstance(own, dict)]
    tables += [(f"[[{key}]]", own) for key, of in document.items() if isinstance(of, list) for own in of]
    lines = [f"{key} = {text(own)}" for key, own in document.items() if not isinstance(own, (dict, list))]
    for head, table in tables:
        lines += [head, *(f"{key} = {text(own)}" for key, own in table.items())]
    return "\n".join(lines) + "\n"


# layouts: keys of [engine], throws as given where an engine has some that may be open


def _line(rng: Generator, layout: str = "inline", maximum: int = 4) -> Document:
    count = int(rng.integers(1, maximum + 1))
    return {"layout": layout, "throws": _throws(rng, count), "cylinder_spacing": "100 mm"}


def _throws(rng: Generator, count: int) -> list[float]:
    if rng.random() < 0.3:
        return [0.0, *(float(a) for a in rng.integers(1, 359, count - 1))]
    return [360.0 * k / count for k in range(count)]


def _vee(rng: Generator, **more: Any) -> Document:
    return {**_line(rng, "vee", 3), "bank_angle": float(rng.choice([60.0, 90.0, 72.0])), **more}


def _opposed(rng: Generator) -> Document:
    lead = float(rng.choice([0.0, 8.0]))
    return {**_line(rng, "opposed-piston", 2), "cycle": "two-stroke", "crank_distance": "700 mm", "crank_lead": lead}


def _boxer(rng: Generator) -> Document:
    keys = {"cylinder_spacing": "100 mm", "bank_stagger": "40 mm", "cylinders": 4}
    return {
        "layout": "boxer",
        "throws": [90, 270, 270, 90],
        "firing_order": [1, 4, 3, 2],
        "cycle": "four-stroke",
        **keys,
    }


def _parts(rng: Generator) -> Document:
    ratio = int(rng.choice([-1, 1]))
    shafts = [
        {"name": "L", "position": ["100 mm", "0 mm"]},
        {"name": "R", "position": ["-100 mm", "0 mm"], "ratio": ratio},
    ]
    cranks = [{"shaft": "L", "x": "20 mm"}, {"shaft": "R", "x": "-30 mm", "firing_angle": 360}]
    return {"layout": "parts", "cycle": "four-stroke", "shafts": shafts, "slider_cranks": cranks}


def _radial(rng: Generator) -> Document:
    return {"layout": "radial", "cylinders": int(rng.choice([3, 5])), "knuckle_radius": "42 mm"}


def _yoke(rng: Generator) -> Document:
    lever = {"mass": "0.4 kg", "centre_of_gravity": "50 mm", "inertia": "4e-4 kg m^2"}
    drive = {"drive": "swinging-yoke", "pivot_distance": "110 mm", "return_ratio": float(rng.choice([1.3, 1.9]))}
    return {**_line(rng), **drive, "lever": lever}


def _crank_rocker(rng: Generator) -> Document:
    side, reach = int(rng.choice([-1, 1])), float(rng.uniform(130, 150))
    links = {"rocker_arm": "140 mm", "rocker_end": f"{reach:.4g} mm", "rocker_angle": 180, "rocker_side": side}
    pivot = {"rocker_pivot_along": "-252 mm", "rocker_pivot_across": f"{140 * side} mm", "offset": f"{280 * side} mm"}
    weighs = {"mass": "0.9 kg", "centre_of_gravity": f"{rng.integers(-30, 60)} mm", "inertia": "3e-3 kg m^2"}
    rods = {"coupler_length": "252 mm", "piston_rod_length": "150 mm"}
    return {**_line(rng), "drive": "crank-rocker", **pivot, **links, **rods, "rocker": weighs}


def _rhombic(rng: Generator) -> Document:
    """Return both cranks of one drive."""
    shafts = [{"name": "R", "ratio": -1, "position": ["110 mm", "0 mm"]}]
    cranks = [{"x": "20 mm", "offset": "40 mm"}, {"x": "20 mm", "offset": "-40 mm", "shaft": "R", "throw": 0}]
    keys = {"drive": "rhombic", "displacer_mass": f"{rng.uniform(0.3, 1.0):.4g} kg", "fires_together": True}
    return {"layout": "parts", "cycle": "two-stroke", **keys, "shafts": shafts, "slider_cranks": cranks}


def _steam(rng: Generator) -> Document:
    return {**_line(rng), "cycle": "two-stroke", "drive": str(rng.choice(["slider-crank", "klein", "scotch-yoke"]))}


def _chambers(rng: Generator) -> Document:
    """Return chambers on both sides of a piston, and a pump on the rod of the first cylinder."""
    steam = {"admission": "9 bar", "cut_off": float(rng.uniform(0.2, 0.6)), "back_pressure": "1.2 bar"}
    steam |= {"release": 0.93, "compression": 0.15, "lead": 0.01, "clearance": 0.06}
    sides = [{"end": "head", "bore": "80 mm"}, {"end": "crank", "bore": "80 mm", "rod": "18 mm"}]
    pump = {"name": "pump", "cylinders": [1], "end": "head", "bore": "50 mm"}
    of_pump = {"pump": {"suction": "0.7 bar", "delivery": "6 bar"}}
    return {"model": "chambers", "chambers": [*({**side, "steam": steam} for side in sides), {**pump, **of_pump}]}


LAYOUTS: Mapping[str, Callable[[Generator], Document]] = {
    "inline": _line,
    "offset": lambda rng: {**_line(rng), "offset": "6 mm"},
    "scotch yoke": lambda rng: {**_line(rng), "rod_ratio": 0.0},
    "vee": _vee,
    "split vee": lambda rng: _vee(rng, split_pin_angle=30.0),
    "staggered vee": lambda rng: _vee(rng, bank_stagger="18 mm"),
    "boxer": _boxer,
    "opposed-piston": _opposed,
    "radial": _radial,
    "parts": _parts,
    "swinging yoke": _yoke,
    "crank-rocker": _crank_rocker,
    "rhombic": _rhombic,
    "steam": _steam,
    "speed range": _line,
}


# decisions


def _counterweight(**keys: Any) -> LeaveOpen:
    def leave_open(document: Document, rng: Generator) -> None:
        document.setdefault("counterweights", []).append({"name": "web", **keys})

    return leave_open


def _shaft(position: Sequence[Any] = ("80 mm", "-60 mm"), coupled: bool = False, **keys: Any) -> LeaveOpen:
    own = {key: keys.pop(key) for key in ("optional", "shaft_mass") if key in keys}

    def leave_open(document: Document, rng: Generator) -> None:
        ratio = int(rng.choice([-2, -1, 1, 2]))
        weights = [{"x": "35 mm", "radius": "40 mm", **keys}]
        if coupled:
            weights = [
                {"name": "f", **weights[0]},
                {"name": "r", "x": "-60 mm", "coupled": {"to": "s.f", "as": "opposite"}},
            ]
        shaft = {"name": "s", "ratio": ratio, "position": list(position), "unbalances": weights}
        document.setdefault("balancer_shafts", []).append({**shaft, **own})

    return leave_open


def _engine(**keys: Any) -> LeaveOpen:
    return lambda document, rng: document["engine"].update(keys)


def _throws_open(bounded: bool) -> LeaveOpen:
    def leave_open(document: Document, rng: Generator) -> None:
        engine = document["engine"]
        throws = engine.get("throws", [0.0])
        banks = 2 if engine["layout"] in ("vee", "boxer") else 1
        document["phasing"] = {"best": 3}
        if bounded and len(throws) > 1:
            document["phasing"]["intervals"] = {"largest_deviation": "180 deg"}
        else:
            engine["cylinders"] = banks * len(throws)
        bounds = tuple((angle - 12.0, angle + 12.0) for angle in throws[1:]) if bounded else ()
        engine["throws"] = OpenThrows(len(throws), bounds)
        engine.pop("firing_order", None)

    return leave_open


def _order_open(document: Document, rng: Generator) -> None:
    document["engine"]["firing_order"] = "open"
    document["phasing"] = {"intervals": {"largest_deviation": "359 deg"}}


def _angle_open(key: str, lower: float, upper: float) -> LeaveOpen:
    def leave_open(document: Document, rng: Generator) -> None:
        _throws_open(False)(document, rng)
        document["engine"][key] = Open(key.removesuffix("_angle").replace("_", " ") + " angle", lower, upper, "deg")
        document["phasing"]["intervals"] = {"largest_deviation": "20 deg"}

    return leave_open


def _mount(key: str, index: int, number: Open) -> LeaveOpen:
    def leave_open(document: Document, rng: Generator) -> None:
        place = document["mounts.places"][0]
        place[key] = [*place[key]]
        place[key][index] = number

    return leave_open


def _loss(document: Document, rng: Generator) -> None:
    document["mounts.places"][0]["loss_factor"] = Open("a.loss_factor", 0.02, 0.3)


RIM: Document = {
    "mean_diameter": "300 mm", "width": "60 mm", "height": "40 mm",
    "arms": {"count": 5, "at_rim": ["30 mm", "40 mm"], "at_hub": ["36 mm", "50 mm"], "hub_diameter": "80 mm"},
}  # fmt: skip


def _wheel(**keys: Any) -> LeaveOpen:
    def leave_open(document: Document, rng: Generator) -> None:
        document["flywheel"] = {**keys} if "inertia" in keys else {"rim": {**RIM, **keys}}

    return leave_open


SIZE = Open("s.unbalance", 0.0, 0.03, "kg m")
WEB = {"radius": "60 mm", "mass": Open("web.mass", 0.0, 1.5, "kg")}
TURN = {"angle": Open("web.angle", 0.0, 360.0, "deg")}
STIFF = Open("a.stiffness.z", 80e3, 600e3, "N/m")

DECISIONS: Mapping[str, LeaveOpen] = {
    "balance factor": _counterweight(balance_factor=Open("web.balance_factor", 0.0, 1.0)),
    "counterweight mass": _counterweight(x="30 mm", angle=200.0, **WEB),
    "counterweight mass and angle": _counterweight(opposite_throw=1, **WEB, **TURN),
    "counterweight in a sector": _counterweight(x="-20 mm", **WEB, angle=Open("web.angle", 120.0, 260.0, "deg")),
    "counterweight place": _counterweight(x=Open("web.x", -0.08, 0.09, "m"), **{**WEB, "mass": "0.7 kg"}, angle=170.0),
    "counterweight place and mass": _counterweight(x=Open("web.x", -0.08, 0.09, "m"), **WEB, angle=190.0),
    "shaft": _shaft(unbalance=SIZE, angle=180.0),
    "shaft and phase": _shaft(unbalance=SIZE, angle=Open("s.angle", 0.0, 360.0, "deg")),
    "coupled shaft": _shaft(coupled=True, unbalance=Open("s.f.unbalance", 0.0, 0.03, "kg m")),
    "at least so much": _shaft(unbalance=Open("s.unbalance", 0.004, 0.03, "kg m"), angle=20.0),
    "optional shaft": _shaft(optional=True, shaft_mass="1 kg", unbalance=SIZE),
    "shaft place x": _shaft(**{"x": Open("s.x", -0.1, 0.1, "m")}, unbalance="0.01 kg m", angle=180.0),
    "shaft place y": _shaft((Open("s.y", -0.15, 0.1, "m"), "0 mm"), unbalance="0.01 kg m", angle=180.0),
    "shaft place z and size": _shaft(("50 mm", Open("s.z", -0.2, 0.1, "m")), unbalance=SIZE, angle=180.0),
    "throws": _throws_open(False),
    "throws within bounds": _throws_open(True),
    "firing order": _order_open,
    "bank angle": _angle_open("bank_angle", 50.0, 125.0),
    "split pin angle": _angle_open("split_pin_angle", 0.0, 65.0),
    "lever weight": _engine(
        lever_weight=Open("lever weight", 0.0, 2.0, "kg"), lever_weight_radius="60 mm", drive="swinging-yoke"
    ),
    "displacer mass": _engine(displacer_mass=Open("displacer mass", 0.2, 1.4, "kg"), drive="rhombic"),
    "reciprocating mass": _engine(reciprocating_mass=Open("reciprocating mass", 0.3, 1.5, "kg")),
    "flywheel inertia": _wheel(inertia=Open("flywheel.inertia", 0.2, 3.0, "kg m^2")),
    "flywheel rim": _wheel(
        width=Open("flywheel.width", 0.03, 0.12, "m"), height=Open("flywheel.height", 0.02, 0.06, "m")
    ),
    "stiffness": _mount("stiffness", 2, STIFF),
    "loss factor": _loss,
    "damping": _mount("damping", 2, Open("a.damping.z", 10.0, 800.0, "N s/m")),
    "mount place": _mount("position", 0, Open("a.position.x", 0.15, 0.35, "m")),
    "mount inclination": _mount("turned", 0, Open("a.turned.x", 0.0, 50.0, "deg")),
}
OF_MOUNTS = ("stiffness", "loss factor", "damping", "mount place", "mount inclination")

MEASURES: Sequence[str] = [
    name for channel in CHANNELS.values() for name in
    ([f"{norm} {channel}" for norm in channel.norms] if channel.is_load else [channel.name])
]  # fmt: skip


@dataclass(frozen=True)
class Cell:
    """Combination of decision, measure and layout; its problem file follows from the combination and the seed."""

    decision: str
    measure: str
    layout: str
    seed: int = 0

    def __str__(self) -> str:
        return f"{self.decision} | {self.measure} | {self.layout} | {self.seed}"


def cells(seed: int = 0) -> list[Cell]:
    """Return all combinations."""
    return [Cell(*each, seed) for each in itertools.product(DECISIONS, MEASURES, LAYOUTS)]


def document_of(cell: Cell) -> Document:
    """Return the problem of a cell."""
    rng = np.random.default_rng([cell.seed, *map(ord, str(cell))])
    engine = {
        "cycle": str(rng.choice(["two-stroke", "four-stroke"])), "bore": "80 mm", "stroke": "84 mm", "rod_ratio": 0.27,
        "reciprocating_mass": "0.7 kg", "rotating_mass": str(rng.choice(["0 kg", "0.5 kg"])),
        "big_end": {"diameter": "48 mm", "width": "25 mm"},
    }  # fmt: skip
    document: Document = {"title": str(cell), "engine": {**engine, **LAYOUTS[cell.layout](rng)}}
    points = [{"name": "slow", "speed": f"{rng.integers(700, 1500)} rpm"}]
    if rng.random() < 0.4 and cell.decision not in OF_MOUNTS:
        points.append({"name": "fast", "speed": f"{rng.integers(2000, 4500)} rpm", "weight": 0.6})
    document["operating_points"] = points
    _add_mounts(document, cell, rng)
    if rng.random() < 0.35:
        document["gas"] = {"model": "seiliger", "peak_pressure": "60 bar", "imep": "7 bar"}
    if cell.layout == "steam":
        document["gas"] = _chambers(rng)
    if document["engine"].get("drive") in ("swinging-yoke", "scotch-yoke", "crank-rocker"):
        del document["engine"]["rod_ratio"]
    document["fidelity"] = {"samples": 120}
    document["search"] = {"starts": 2, "boxes": 100}
    if cell.decision == "optional shaft":
        document["phasing"] = {"intervals": {"largest_deviation": "350 deg"}}
    DECISIONS[cell.decision](document, rng)
    if cell.decision in OF_MOUNTS and cell.decision != "stiffness" and rng.random() < 0.3:
        DECISIONS["shaft and phase"](document, rng)
    if any(name in cell.measure for name in ("main-bearing", "friction", "hammer")):
        places = (226, 126, 26, -74, -174)
        document["main_bearings"] = [
            {"x": f"{x} mm", "diameter": "70 mm", "width": "30 mm", "friction": 0.01} for x in places
        ]
    if isinstance(_channel(cell.measure), FlywheelChannel):
        document.setdefault("flywheel", {"rim": RIM})
    document["objective"] = {"minimise": cell.measure, **_narrowed(cell.measure, document, rng)}
    if rng.random() < 0.4:
        _add_limit(document, rng)
    if cell.layout == "speed range":
        _add_range(document, rng)
    return document


def _channel(measure: str) -> Channel:
    """Return the channel of a measure's name."""
    return next(channel for channel in CHANNELS.values() if measure.endswith(channel.name))


def _add_mounts(document: Document, cell: Cell, rng: Generator) -> None:
    needs = _channel(cell.measure).needs
    minimum = 1 if needs is Needs.MOUNTS else 0
    if needs is Needs.ELASTIC or cell.decision in OF_MOUNTS:
        minimum = 2
    kind = ("none", "rigid", "elastic")[int(rng.integers(minimum, 3))]
    if kind == "none":
        return
    places: list[Document] = [
        {"name": "a", "position": ["230 mm", "180 mm", "-40 mm"]},
        {"name": "b", "position": ["230 mm", "-180 mm", "-40 mm"]},
        {"name": "c", "position": ["-260 mm", "20 mm", "-30 mm"]},
    ]
    document["mounts"] = {"kind": kind}
    if kind == "elastic":
        document["mounts"]["loss_factor"] = 0.1
        document["block"] = {
            "mass": "140 kg", "centre_of_gravity": ["0 mm", "5 mm", "80 mm"],
            "inertia": ["5 kg m^2", "10 kg m^2", "9 kg m^2"],
        }  # fmt: skip
        for place in places:
            place["stiffness"] = ["150 N/mm", "150 N/mm", "250 N/mm"]
        places[0] |= {"damping": ["0 N s/m", "0 N s/m", "0 N s/m"], "turned": [0.0, 0.0, 0.0]}
        if rng.random() < 0.5:
            places[1] = {"name": "b", "mirror_of": "a"}
    else:
        for place in places:
            place["relative_stiffness"] = [1.0, 1.0, 1.0]
    document["mounts.places"] = places


def _add_range(document: Document, rng: Generator) -> None:
    """Add a range, minimised or under a limit that is a curve."""
    low = float(rng.uniform(700, 1500))
    span = {"name": "range", "speeds": [f"{low:.5g} rpm", f"{low * rng.uniform(1.5, 4.0):.5g} rpm"]}
    span["operating_point"] = document["operating_points"][0]["name"]
    if rng.random() < 0.5:
        document["objective"].pop("operating_points", None)
        document["speed_ranges"] = [{**span, "minimise": True}]
        return
    most = [[f"{low:.5g} rpm", f"{rng.uniform(100, 3000):.5g} N"], ["4000 rpm", f"{rng.uniform(2000, 9000):.5g} N"]]
    document["speed_ranges"] = [{**span, "quantity": "rms shaking force", "max": most}]


def _narrowed(measure: str, document: Document, rng: Generator) -> Document:
    channel = _channel(measure)
    keys: Document = {}
    if channel.name == "torque-roll residual":
        return {"frequency": "18 Hz"}
    if "orders" in channel.keys and rng.random() < 0.4:
        keys["orders"] = [[1], [2], [1, 2]][int(rng.integers(3))]
    if "operating_points" in channel.keys and len(document["operating_points"]) > 1 and rng.random() < 0.4:
        keys["operating_points"] = ["fast"]
    if "mounts" in channel.keys and rng.random() < 0.3:
        keys["mounts"] = ["a", "c"]
    if "direction_weights" in channel.keys and rng.random() < 0.3:
        keys["direction_weights"] = [1.0, 1.0, 0.5]
    return keys


def _add_limit(document: Document, rng: Generator) -> None:
    """Add a limit on another measure, near its usual value."""
    has_mounts, elastic = "mounts" in document, "block" in document
    usual: list[tuple[str, tuple[float, float], str, str]] = [
        ("rms shaking force", (200, 6000), "N", "max"), ("maximum rocking couple", (10, 600), "N m", "max"),
        ("peak to peak roll moment", (50, 600), "N m", "max"), ("added mass", (0.1, 1.5), "kg", "max"),
    ]  # fmt: skip
    if has_mounts:
        usual += [("mean mount force", (100, 3000), "N", "max"), ("maximum mount force", (200, 8000), "N", "max")]
    if elastic:
        usual += [("static sag", (1e-3, 4e-3), "m", "max"), ("natural frequencies", (3, 9), "Hz", "min")]
    if "flywheel" in document:
        usual += [("degree of irregularity", (5e-3, 0.2), "", "max"), ("flywheel inertia", (0.3, 2), "kg m^2", "max")]
    if "balancer_shafts" in document:
        usual.append(("shaft distance", (0.03, 0.2), "m", "min"))
    name, (low, high), unit, side = usual[int(rng.integers(len(usual)))]
    value = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    document["constraints"] = [{"limit": name, side: f"{value:.6g} {unit}"}]
