"""Random studies of firing patterns, against every word of firings one by one: pulses of torque added over time."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from attack import plain_crankcase, plain_mounts
from attack.families import Generator, block, elastic_mounts, gas_engine, moving_mass, points, q, rigid_mounts, toml
from attack.plain_loads import (
    ATMOSPHERE,
    FINE,
    SAMPLES,
    Mechanism,
    energy_of,
    engine_spectrum,
    machine,
    number,
    seiliger,
    slope,
    top_and_bottom,
    travel,
    unfired,
)
from attack.plain_loads import angles as angles_of
from attack.plain_scene import Table, norm_and_channel, norm_at

READ, STEPS = 2e-4, 16384
"""Accuracy of values where gas bends between steps, and steps of a cycle."""
VALVES = {"closed valves": "closed", "open valves": "open", "misfire": "moving"}
LONGEST = 6


def drawn(rng: Generator) -> tuple[Table, Table]:
    """Return a problem of an engine with gas, and a part of a study of its patterns."""
    engine = {key: value for key, value in gas_engine(rng).items() if key != "offset" or rng.random() < 0.5}
    table: Table = {"title": "one", "engine": engine, "operating_points": points(rng, 1, 60.0, 250.0)}
    table["gas"] = {
        "model": "seiliger", "peak_pressure": q(rng.uniform(55, 85), "bar"), "imep": q(rng.uniform(6.5, 10), "bar"),
    }  # fmt: skip
    if rng.random() < 0.5:
        table |= {"block": block(rng), "mounts": elastic_mounts(rng)}
    else:
        table["mounts"] = rigid_mounts(rng)
    table["flywheel"] = {"inertia": q(rng.uniform(10.0, 40.0) * moving_mass(engine), "kg m^2")}
    table["objective"] = {"minimise": "rms roll moment"}
    channels = ["roll moment", "roll moment", "mount force", "stored work"]
    measures: list[Table] = []
    for channel in rng.choice(channels, int(rng.integers(1, 3))).tolist():
        entry: Table = {"quantity": f"{rng.choice(['mean', 'rms', 'maximum'])} {channel}"}
        if channel != "stored work" and rng.random() < 0.6:
            entry["alternating"] = True
        if entry not in measures and entry["quantity"] not in [m["quantity"] for m in measures]:
            measures.append(entry)
    lengths = sorted({int(v) for v in rng.integers(2, LONGEST + 1, 2)})
    demand = "1/2" if all(v % 2 == 0 for v in lengths) else str(rng.choice(["0", "1"])) if rng.random() < 0.1 else ""
    part: Table = {
        "name": "patterns", "title": "patterns", "kind": "skip fire", "opportunities": lengths, "measures": measures,
        "skipped": str(rng.choice(list(VALVES))), "cases": [{"name": "one", "problem": "engine.toml"}],
        "demands": [demand or f"{rng.uniform(0.15, 0.85):.3f} of full"],
    }  # fmt: skip
    return table, part


class Patterns:
    """Torque of an engine over several cycles."""

    def __init__(self, table: Table, skipped: str) -> None:
        self.table, self.machine = table, machine(table["engine"])
        self.speed, self.turns = number(table["operating_points"][0]["speed"]), self.machine.turns
        self.fired = [self._torque(m, "") for m in self.machine.mechanisms]
        self.idle = [self._torque(m, VALVES[skipped]) for m in self.machine.mechanisms]
        # rounding puts no firing just below the end of the cycle
        at = [((m.fires or 0.0) + 1e-9) % (2.0 * math.pi * self.turns) for m in self.machine.mechanisms]
        self.order = sorted(range(len(at)), key=at.__getitem__)

    def _torque(self, m: Mechanism, valves: str) -> np.ndarray:
        """Return the torque of the gas over one cycle on a fine grid, from own crank angle 0."""
        gas = self.table["gas"]
        pressure = unfired(gas, valves, m, self.turns) if valves else seiliger(gas, m, self.turns)
        rise = slope(travel(m, angles_of(self.turns, FINE)).astype(complex), self.turns).real
        return -0.25 * math.pi * m.bore**2 * (pressure - ATMOSPHERE) * rise

    def torque(self, word: str, cycles: int) -> np.ndarray:
        """Return the torque of the gas over all cycles, (cycles x STEPS,)."""
        whole = 2.0 * math.pi * self.turns
        phi = whole * np.arange(cycles * STEPS) / STEPS
        total, fine = np.zeros(len(phi)), angles_of(self.turns, FINE)
        for place, k in enumerate(self.order):
            m = self.machine.mechanisms[k]
            top, bottom = top_and_bottom(m)
            # a cycle begins at the dead centre before intake, or before compression with two strokes
            begin = top - 2.0 * math.pi if self.turns == 2 else bottom - 2.0 * math.pi
            since = np.mod(phi - (m.fires or 0.0) - begin, cycles * whole)
            cycle = np.minimum((since // whole).astype(int), cycles - 1)
            fires = np.array([word[(j * len(self.order) + place) % len(word)] == "1" for j in range(cycles)])[cycle]
            local = np.mod(since + begin, whole)
            fired, idle = (np.interp(local, fine, row, period=whole) for row in (self.fired[k], self.idle[k]))
            total += np.where(fires, fired, idle)
        return total

    def value(self, measure: Table, word: str, cycles: int) -> float:
        norm, channel = norm_and_channel(measure["quantity"])
        gas = self.torque(word, cycles)
        inertia = np.fft.irfft(engine_spectrum(self.machine) * STEPS, STEPS, axis=0) * self.speed**2
        wrench = np.tile(inertia, (cycles, 1))
        wrench[:, 3] += gas
        if channel == "roll moment":
            signal = wrench[None, :, 3:4]
        elif channel == "stored work":
            energy = sum(energy_of(m, self.turns) for m in self.machine.mechanisms)
            lost = np.fft.rfft(-(self.speed**2) * slope(energy + 0j, self.turns).real)
            torque = np.tile(np.fft.irfft(lost * STEPS / SAMPLES, STEPS), cycles) + gas
            signal = plain_crankcase._integral(torque - torque.mean(), self.turns * cycles)[None, :, None]
        else:
            spectrum = np.fft.rfft(wrench, axis=0) / len(wrench)
            orders = np.arange(len(spectrum)) / (self.turns * cycles)
            # gas bends: with 90 orders a largest force is 6e-4 too large
            keep = orders <= 400.0
            elastic = self.table["mounts"].get("kind") == "elastic"
            mounting: Any = (
                plain_mounts.elastic(self.table["mounts"], self.table["block"]) if elastic
                else plain_mounts.rigid(self.table["mounts"])
            )  # fmt: skip
            part = mounting.forces(orders[keep], spectrum[keep], self.speed)
            every = np.zeros((len(spectrum), *part.shape[1:]), complex)
            every[keep] = part
            signal = np.fft.irfft(every * len(wrench), len(wrench), axis=0).transpose(1, 0, 2)
        if measure.get("alternating"):
            signal = signal - signal.mean(axis=1, keepdims=True)
        return norm_at(norm, signal)


def judge(table: Table, part: Table, folder: Path) -> list[str]:
    """Return complaints about a study of firing patterns."""
    import laufruhe

    patterns = Patterns(table, part["skipped"])
    if part["demands"][0].endswith("of full"):
        # a torque: as many firings as give it at least
        share = float(part["demands"][0].split()[0])
        ends = [patterns.torque(word, 1).mean() for word in "01"]
        part["demands"] = [f"{ends[0] + share * (ends[1] - ends[0]):.6f} N m"]
        fires = {length: math.ceil(length * share - 1e-6) for length in part["opportunities"]}
    else:
        fires = {length: round(length * Fraction(part["demands"][0])) for length in part["opportunities"]}
    (folder / "engine.toml").write_text(toml(table), encoding="utf-8")
    path = folder / "study.toml"
    path.write_text(toml({"title": "patterns", "study": {"parts": [part]}}), encoding="utf-8")
    data = laufruhe.study(path)["patterns"]
    wrong: list[str] = []
    for length, count in fires.items():
        rows = data.isel(point=[k for k, v in enumerate(data["opportunities"].values) if v == length])
        if rows["firings"].values.tolist() != [count] * len(rows["firings"]):
            wrong.append(f"{length}: {rows['firings'].values.tolist()} firings, wanted {count}")
            continue
        cycles = math.lcm(length, len(patterns.order)) // len(patterns.order)
        words = ["".join("01"[k in at] for k in range(length)) for at in itertools.combinations(range(length), count)]
        if int(rows["compared"][0]) != len(words):
            wrong.append(f"{length}: {int(rows['compared'][0])} patterns compared, there are {len(words)}")
        first = part["measures"][0]
        values = {word: patterns.value(first, word, cycles) for word in words}
        listed = rows["value"].values[:, 0].tolist()
        floor = READ * max(values.values()) + 1e-9
        for value, expected, what in (
            (listed[0], min(values.values()), "smoothest"),
            (listed[-1], max(values.values()), "worst"),
        ):
            if abs(value - expected) > floor:
                wrong.append(f"{length}: {what} {value:.9g} is {expected:.9g}")
        all_fire = patterns.value(first, "1", 1)
        if abs(float(rows["all_fire"][0]) - all_fire) > READ * all_fire + 1e-9:
            wrong.append(f"{length}: all fire {float(rows['all_fire'][0]):.9g} is {all_fire:.9g}")
        for word, value, torque in zip(
            rows["pattern"].values.tolist(), listed, rows["mean_torque"].values, strict=True
        ):
            if abs(values[word] - value) > floor:
                wrong.append(f"{word}: {first['quantity']} {value:.9g} is {values[word]:.9g}")
            expected = patterns.torque(word, cycles).mean()
            if abs(torque - expected) > READ * abs(patterns.torque("1", 1)).max():
                wrong.append(f"{word}: mean torque {float(torque):.9g} is {expected:.9g}")
        for k, measure in enumerate(part["measures"][1:], 1):
            for word, value in zip(rows["pattern"].values.tolist(), rows["value"].values[:, k].tolist(), strict=True):
                expected = patterns.value(measure, word, cycles)
                if abs(expected - value) > READ * expected + 1e-9:
                    wrong.append(f"{word}: {measure['quantity']} {value:.9g} is {expected:.9g}")
    return wrong


def skip_fire(rng: Generator, folder: Path) -> list[str]:
    table, part = drawn(rng)
    return judge(table, part, folder)


STUDIES = {"skip fire": skip_fire}
