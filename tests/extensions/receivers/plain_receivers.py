"""Random problems with receivers, and their responses from mount forces over the cycle, by independent formulas.

Forces of the package are sampled over the cycle, transformed, multiplied by transfer functions, and summed back.
A frame is that of `two_bodies`, and weightings follow from their formulas in f.
"""

from __future__ import annotations

import csv
import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from extensions.receivers import two_bodies
from laufruhe.extensions.receivers.machine import Frame
from laufruhe.machine import Block, Mount
from laufruhe.problem.channels import MOUNT_FORCE
from laufruhe.problem.evaluation import Evaluation, channel_samples
from laufruhe.units import parse

Table = dict[str, Any]
AXES = "xyz"
DERIVATIVES = {"m/s^2": 2, "m/s": 1}


def weight(name: str, f: np.ndarray) -> np.ndarray:
    """Return the factor of a weighting at frequencies above zero, from its formula."""
    if name == "none":
        return np.ones(f.shape)
    s = 2j * math.pi * f
    if name == "A":
        a, b, c, d = (2.0 * math.pi * x for x in (20.598997, 107.65265, 737.86223, 12194.217))
        a_kilohertz = 2.0e3j * math.pi
        factor = [x**4 / ((x + a) ** 2 * (x + b) * (x + c) * (x + d) ** 2) for x in (s, a_kilohertz)]
        return factor[0] / abs(factor[1])
    f1, f2, f3, q4 = {
        "Wk": (0.4, 100.0, 12.5, 0.63), "Wd": (0.4, 100.0, 2.0, 0.63), "Wh": (10**0.8, 10**3.1, 50.0 / math.pi, 0.64),
    }[name]  # fmt: skip
    w1, w2, w3 = (2.0 * math.pi * x for x in (f1, f2, f3))
    root = math.sqrt(2.0)
    out = s**2 / (s**2 + root * w1 * s + w1**2) * w2**2 / (s**2 + root * w2 * s + w2**2)
    out = out * (1.0 + s / w3) / (1.0 + s / (q4 * w3) + (s / w3) ** 2)
    if name == "Wk":
        w5, w6 = 2.0 * math.pi * 2.37, 2.0 * math.pi * 3.35
        out = out * (1.0 + s / (0.91 * w5) + (s / w5) ** 2) / (1.0 + s / (0.91 * w6) + (s / w6) ** 2) * (w5 / w6) ** 2
    return out


class PlainReceivers:
    """Responses of the receivers of a file in one of its designs."""

    def __init__(self, path: Path) -> None:
        self.folder, self.table = path.parent, tomllib.loads(path.read_text(encoding="utf-8"))
        mounts = self.table["mounts"]
        self.mounts = mounts["names"] if "names" in mounts else [place["name"] for place in mounts["places"]]
        self.frame = None if "frame" not in self.table else self.frame_of(self.table["frame"])

    @staticmethod
    def frame_of(table: Table) -> Frame:
        numbers = [parse(text, "kg m^2") for text in table["inertia"]]
        centre = tuple(parse(text, "m") for text in table["centre_of_gravity"])
        springs = []
        for k, one in enumerate(table.get("springs", [])):
            place, stiff, viscous = (
                tuple(parse(text, unit) for text in one.get(key, [f"0 {unit}"] * 3))
                for key, unit in (("position", "m"), ("stiffness", "N/m"), ("damping", "N s/m"))
            )
            springs.append(Mount(f"s{k}", place, stiff, loss_factor=one.get("loss_factor", 0.0), damping=viscous))
        return Frame(
            Block(parse(table["mass"], "kg"), tuple(map(tuple, np.diag(numbers).tolist())), centre), tuple(springs)
        )

    def value(self, design: Evaluation, measure: Table, norm: str, unit: str) -> float:
        """Return rms, mean or maximum of the length of the response over the cycle and the receivers that count."""
        values, weights = [], []
        for k, loads in enumerate(design.loads):
            for receiver in self.table["receivers"]:
                is_counted = receiver["name"] in measure.get("receivers", [receiver["name"]])
                if receiver.get("unit", "m/s^2") == unit and is_counted:
                    signal = self._signal(design, k, receiver, measure.get("orders"))
                    axes = np.array(measure.get("direction_weights", [1, 1, 1])[: signal.shape[1]])
                    values.append(np.linalg.norm(signal * axes, axis=1))
                    weights.append(loads.point.weight)
        lengths, shares = np.array(values), np.array(weights) / sum(weights)
        if norm == "maximum":
            return float(lengths.max())
        mean = (lengths**2 if norm == "rms" else lengths).mean(axis=1) @ shares
        return float(math.sqrt(mean) if norm == "rms" else mean)

    def _signal(self, design: Evaluation, k: int, receiver: Table, orders: list[float] | None) -> np.ndarray:
        """Return the response over the cycle, shape (steps, components)."""
        engine, loads = design.engine, design.loads[k]
        turns, steps = engine.cycle.turns, design.samples
        f = np.arange(steps // 2 + 1) / turns * loads.point.speed / (2.0 * math.pi)
        low, high = (parse(text, "Hz") for text in receiver.get("band", ["0 Hz", "1e9 Hz"]))
        counts = (f > 0.0) & (f >= low) & (f <= high)
        if orders is not None:
            counts &= np.isin(np.round(1000.0 * np.arange(len(f)) / turns), np.round(1000.0 * np.array(orders)))
        names = receiver.get("weighting", "none")
        names = names if isinstance(names, list) else [names] * 3
        on_ground = np.fft.rfft(channel_samples(design, k, MOUNT_FORCE), axis=0)
        wrench = np.fft.rfft(loads.wrench.with_finer_base(engine.cycle.base_order).series.sample(steps), axis=0)
        out = None
        for j in np.flatnonzero(counts):
            w = 2.0 * math.pi * f[j]
            responses = self._responses(design, receiver, w, on_ground[j], wrench[j])
            out = np.zeros((len(f), len(responses)), dtype=complex) if out is None else out
            out[j] = [x * weight(name, f[j : j + 1])[0] for x, name in zip(responses, names, strict=False)]
        return np.fft.irfft(out if out is not None else np.zeros((len(f), 1)), steps, axis=0)

    def _responses(
        self, design: Evaluation, receiver: Table, w: float, on_ground: np.ndarray, wrench: np.ndarray
    ) -> np.ndarray:
        engine = design.engine
        if "transfer_functions" not in receiver or receiver["force"] == "frame":
            assert engine.block is not None
            centre = engine.block.centre_of_gravity
            frame = self.frame or Frame(Block(1e30, tuple(map(tuple, (1e30 * np.eye(3)).tolist()))))
            moved = two_bodies.answer(
                engine, frame, two_bodies.at_centre(wrench, centre), np.zeros((len(engine.mounts), 3)), w
            )
            if "transfer_functions" in receiver:
                return self._transferred(receiver, w, moved.forces)
            on_frame = receiver.get("on") == "frame"
            motion, centre = (moved.frame, frame.body.centre_of_gravity) if on_frame else (moved.engine, centre)
            at = two_bodies.arm(np.array([parse(t, "m") for t in receiver["point"]]), np.array(centre))
            return (1j * w) ** DERIVATIVES[receiver.get("unit", "m/s^2")] * at @ motion
        return self._transferred(receiver, w, on_ground)

    def _transferred(self, receiver: Table, w: float, forces: np.ndarray) -> np.ndarray:
        files, f = receiver["transfer_functions"], w / (2.0 * math.pi)
        parts = []
        for component in ["sound"] if receiver.get("unit") == "Pa" else AXES:
            total = 0.0j
            if component in files:
                with (self.folder / files[component]).open(encoding="utf-8") as stream:
                    head, *rows = list(csv.reader(stream))
                numbers = np.array(rows, dtype=float)
                for column in range(1, len(head), 2):
                    words = head[column].split()
                    pair = numbers[:, column] + 1j * numbers[:, column + 1]
                    if words[-1] == "magnitude":
                        pair = numbers[:, column] * np.exp(1j * np.radians(numbers[:, column + 1]))
                    place = self.mounts.index(" ".join(words[:-2]))
                    h = np.interp(f, numbers[:, 0], pair.real) + 1j * np.interp(f, numbers[:, 0], pair.imag)
                    total += h * forces[place, AXES.index(words[-2])]
            parts.append(total)
        return np.array(parts)


def q(value: float, unit: str) -> str:
    return f"{float(f'{value:.6g}')!r} {unit}"


def functions(rng: np.random.Generator, mounts: int, path: Path) -> None:
    """Write random transfer functions from 2 Hz to 500 Hz, of both forms."""
    frequencies = np.concatenate([[2.0], np.sort(rng.uniform(2.0, 500.0, 40)), [500.0]])
    form = ("real", "imaginary") if rng.random() < 0.5 else ("magnitude", "phase [deg]")
    head, columns = ["frequency [Hz]"], [frequencies]
    for k in range(mounts):
        for axis in AXES:
            head += [f"m{k} {axis} {part}" for part in form]
            first = rng.normal(size=len(frequencies)) if form[0] == "real" else rng.random(len(frequencies))
            second = rng.normal(size=len(frequencies)) * (1.0 if form[0] == "real" else 180.0)
            columns += [first, second]
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(head)
        writer.writerows(np.column_stack(columns).tolist())


def draw(seed: int, folder: Path, kind: str) -> Table:
    """Return a random problem, and write its transfer functions.

    `kind` says what is open: weights, stars, pistons, places, leads or mounts.
    """
    rng = np.random.default_rng([seed, *map(ord, kind)])
    elastic = bool(rng.random() < 0.7) or kind == "mounts"
    with_frame = elastic and bool(rng.random() < 0.6)
    cylinders = {"stars": int(rng.integers(3, 5)), "leads": 1}.get(kind, int(rng.integers(1, 4)))
    engine: Table = {
        "layout": "inline", "cycle": "four-stroke", "bore": "90 mm", "stroke": "80 mm",
        "rod_ratio": float(f"{rng.uniform(0.22, 0.32):.3g}"), "reciprocating_mass": q(rng.uniform(0.4, 1.0), "kg"),
        "rotating_mass": q(rng.uniform(0.1, 0.6), "kg"),
    }  # fmt: skip
    engine |= {} if cylinders == 1 else {"cylinder_spacing": "100 mm"}
    engine["throws"] = (
        "open" if kind == "stars" else [float(x) for x in (720.0 / cylinders * np.arange(cylinders)) % 360.0]
    )
    engine |= {"cylinders": cylinders} if kind == "stars" else {}
    if cylinders > 1 and kind != "stars":
        engine["firing_order"] = list(range(1, cylinders + 1))
    if kind == "pistons":
        engine["reciprocating_mass"] = {"between": ["0.3 kg", "0.9 kg"]}
    mounts = int(rng.integers(3, 5))
    places = [[q(x, "mm") for x in rng.uniform((-300, -250, -80), (300, 250, 20))] for _ in range(mounts)]
    table: Table = {
        "title": "drawn", "engine": engine,
        "operating_points": [
            {"name": f"p{k}", "speed": q(s, "rpm"), "weight": q(rng.uniform(0.5, 2.0), "").strip()}
            for k, s in enumerate(rng.uniform(1500, 6000, int(rng.integers(1, 3))))
        ],
    }  # fmt: skip
    for point in table["operating_points"]:
        point["weight"] = float(point["weight"])
    if rng.random() < 0.6:
        table["gas"] = {"model": "wiebe", "imep": "6 bar", "start": -15, "duration": 50, "compression_ratio": 10}
    names = [f"m{k}" for k in range(mounts)]
    if elastic:
        table["block"] = {
            "mass": q(rng.uniform(60, 150), "kg"), "inertia": [q(x, "kg m^2") for x in rng.uniform(2.0, 3.5, 3)],
            "centre_of_gravity": [q(x, "mm") for x in rng.uniform(-60, 60, 3)],
        }  # fmt: skip
        stiff = [[q(x, "N/mm") for x in rng.uniform(80, 400, 3)] for _ in range(mounts)]
        table["mounts"] = {
            "kind": "elastic", "loss_factor": 0.1,
            "places": [
                {"name": name, "position": place, "stiffness": list(values)}
                for name, place, values in zip(names, places, stiff, strict=True)
            ],
        }  # fmt: skip
        if kind == "mounts":
            table["mounts"]["places"][0]["stiffness"][2] = {"between": ["50 N/mm", "600 N/mm"]}
    else:
        table["mounts"] = {
            "names": names, "positions": places, "relative_stiffness": [1.0, 1.0, 1.0],
        }  # fmt: skip
    if with_frame:
        table["frame"] = {
            "mass": q(rng.uniform(80, 300), "kg"), "inertia": [q(x, "kg m^2") for x in rng.uniform(12, 20, 3)],
            "centre_of_gravity": [q(x, "mm") for x in rng.uniform(-100, 100, 3)],
            "springs": [
                {"position": [q(x, "mm") for x in rng.uniform(-700, 700, 3)], "loss_factor": 0.05,
                 "stiffness": [q(x, "N/mm") for x in rng.uniform(10, 60, 3)], "damping": ["300 N s/m"] * 3}
                for _ in range(int(rng.integers(0, 4)))
            ],
        }  # fmt: skip
    functions(rng, mounts, folder / "f.csv")
    functions(rng, mounts, folder / "g.csv")
    forms: list[Table] = [
        {"transfer_functions": {"z": "f.csv", "x": "g.csv"}, "force": "rigid ground", "band": ["3 Hz", "300 Hz"]}
    ]
    point = {"point": [q(x, "mm") for x in rng.uniform(-500, 500, 3)]}
    forms += [point] if elastic else []
    if with_frame:
        forms += [
            {**point, "on": "frame"},
            {"transfer_functions": {"y": "f.csv"}, "force": "frame", "band": ["2 Hz", "500 Hz"]},
        ]
    weightings = ["none", "Wk", "Wh", ["Wd", "Wd", "Wk"]]
    table["receivers"] = [
        {"name": f"r{k}", "unit": "m/s^2", **forms[int(rng.integers(len(forms)))],
         "weighting": weightings[int(rng.integers(len(weightings)))]}
        for k in range(int(rng.integers(1, 3)))
    ]  # fmt: skip
    if rng.random() < 0.2:
        sound = {"transfer_functions": {"sound": "f.csv"}, "force": "rigid ground", "band": ["2 Hz", "500 Hz"]}
        table["receivers"] = [{"name": "ear", "unit": "Pa", **sound, "weighting": "A"}]
    table["counterweights"] = [
        {"name": "front", "x": "60 mm", "radius": "40 mm", "unbalance": {"between": ["0 kg m", "0.03 kg m"]},
         "angle": {"between": [0, 360]}},
    ]  # fmt: skip
    table["balancer_shafts"] = [
        {"name": "b", "ratio": -1 if rng.random() < 0.5 else 2, "position": ["100 mm", "-100 mm"], "unbalances": [
            {"radius": "20 mm", "unbalance": {"between": ["0 kg m", "0.02 kg m"]}, "angle": {"between": [0, 360]}},
        ]},
    ]  # fmt: skip
    if kind == "places":
        table["balancer_shafts"][0]["position"] = [{"between": ["-150 mm", "150 mm"]}, "-100 mm"]
        table["balancer_shafts"][0]["unbalances"] = [{"radius": "20 mm", "unbalance": "0.01 kg m", "angle": 30}]
    name = {"Pa": "pressure"}.get(table["receivers"][0]["unit"], "acceleration")
    norm = str(rng.choice(["rms", "mean", "maximum"]))
    table["objective"] = {"minimise": f"{norm} receiver {name}"}
    if rng.random() < 0.3:
        table["objective"]["orders"] = [1, 2]
    return table
