"""Measures and limits of a problem file on elastic mounts for many designs at once, by independent loads and mounts.

The module reads the file and values of decisions, and shares no code with the package.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from attack import own_loads, own_runs, plain_loads
from attack.own_loads import Table, si
from attack.own_mounts import GRAVITY, Blocks, blocks
from attack.plain_scene import norm_and_channel, smallest_ball

MOTIONS = ("fore-aft", "lateral", "bounce", "roll", "pitch", "yaw")
ON_BLOCK = {"shaking force": [0, 1, 2], "rocking couple": [4, 5], "roll moment": [3]}
SIGNS = {"equal": 1.0, "opposite": -1.0, "mirrored": 1.0, "mirrored opposite": -1.0}


@dataclass(frozen=True)
class Open:
    """An open number: its name, where it stands in the file, and bounds in SI units but for angles [deg]."""

    name: str
    path: tuple[Any, ...]
    low: float
    high: float
    start: float


@dataclass(frozen=True)
class Weight:
    """Weight: its place along the crank and in the plane, its speed ratio, and the table of its unbalance."""

    name: str
    x: float
    place: complex
    ratio: float
    entry: Table
    turned: float
    role: str
    follows: tuple[str, float, bool] | None = None


def is_open(entry: Any) -> bool:
    return isinstance(entry, dict) and "between" in entry


def open_numbers_of(table: Table) -> list[Open]:
    """Open numbers of mounts, counterweights and balancer shafts."""
    rows: list[Open] = []

    def look(entry: Any, path: tuple[Any, ...], name: str) -> None:
        if is_open(entry):
            low, high = (si(v) for v in entry["between"])
            nearest = min(max(0.0, low), high)
            rows.append(Open(name, path, low, high, si(entry["start"]) if "start" in entry else nearest))
        elif isinstance(entry, dict):
            for key, part in entry.items():
                look(part, (*path, key), f"{name}.{key}")
        elif isinstance(entry, list):
            for k, part in enumerate(entry):
                look(part, (*path, k), f"{name}.{'xyz'[k]}" if k < 3 else name)

    for key in ("counterweights", "balancer_shafts"):
        for k, part in enumerate(table.get(key, [])):
            if key == "counterweights":
                look(part, (key, k), part["name"])
                continue
            for j, u in enumerate(part["unbalances"]):
                single = len(part["unbalances"]) == 1 and "name" not in u
                name = part["name"] if single else f"{part['name']}.{u.get('name', j + 1)}"
                look(u, (key, k, "unbalances", j), name)
    for k, part in enumerate(table["mounts"].get("places", [])):
        look(part, ("mounts", "places", k), part.get("name", f"mount {k + 1}"))
    for key, part in table["mounts"].items():
        if key != "places":
            look(part, ("mounts", key), f"mounts.{key}")
    return rows


class OwnModel:
    """Objective and limits of designs X (count, open numbers).

    Parameters
    ----------
    table
        Of the problem file.
    samples
        Of the cycle, for lengths.
    share
        Orders whose load is under this share of the largest are left out.
    """

    def __init__(self, table: Table, samples: int = 4096, share: float = 0.0) -> None:
        self.table, self.samples, self.share = table, samples, share
        self.open = open_numbers_of(table)
        self.turns = own_loads.turns_of(table["engine"])
        self.points: list[Table] = list(table["operating_points"])
        self.speeds = [si(p["speed"]) for p in self.points]
        self.has_links = "drive" in table["engine"]
        self.cylinders, self.pins = ([], []) if self.has_links else own_loads.cylinders_and_pins(table["engine"])

    @property
    def box(self) -> np.ndarray:
        return np.array([(o.low, o.high) for o in self.open]).reshape(-1, 2)

    @property
    def start(self) -> np.ndarray:
        return np.array([o.start for o in self.open])

    # --- loads

    @cached_property
    def weights(self) -> list[Weight]:
        rows = []
        engine = self.table["engine"]
        throws = [math.radians(float(t)) for t in engine["throws"]]
        for entry in self.table.get("counterweights", []):
            if "balance_factor" in entry:
                for k in entry.get("throws", range(1, len(throws) + 1)):
                    x, throw, turning = self.pins[k - 1]
                    rest = {
                        **entry,
                        "turning": turning,
                        "shares": si(engine["reciprocating_mass"]) * self.cylinders[0].radius,
                    }
                    rows.append(Weight(f"{entry['name']} {k}", x, 0j, 1.0, rest, throw + math.pi, "c"))
                continue
            x, turned = entry.get("x"), 0.0
            if "opposite_throw" in entry:
                x, turned, _ = self.pins[entry["opposite_throw"] - 1]
                turned += math.pi
            rows.append(Weight(entry["name"], si(x), 0j, 1.0, entry, turned, "c"))
        for shaft in self.table.get("balancer_shafts", []):
            y, z = (si(v) for v in shaft["position"])
            for j, entry in enumerate(shaft["unbalances"]):
                single = len(shaft["unbalances"]) == 1 and "name" not in entry
                name = shaft["name"] if single else f"{shaft['name']}.{entry.get('name', j + 1)}"
                how = entry.get("coupled")
                follows = (how["to"], SIGNS[how["as"]], how["as"].startswith("mirrored")) if how else None
                rows.append(
                    Weight(
                        name,
                        si(entry["x"]) if "x" in entry else 0.0,
                        complex(z, y),
                        float(shaft["ratio"]),
                        entry,
                        0.0,
                        "b",
                        follows,
                    )
                )
        return rows

    @cached_property
    def inertia(self) -> np.ndarray:
        """Return the coefficients (harmonics, 6) of pistons, rods and throws at 1 rad/s."""
        count = own_loads.HIGHEST + 1 if "gas" in self.table else 64 * self.turns + 1
        if self.has_links:
            # linkages are those of the plain model, with the half of every order but the mean
            unit = 2.0 * plain_loads.engine_spectrum(plain_loads.machine(self.table["engine"]))[:count]
            unit[0] *= 0.5
            return unit
        unit = own_loads.of_pistons(self.cylinders, self.turns, count)
        for x, throw, turning in self.pins:
            one, _ = own_loads.of_unbalance(x, 0j, 1.0, self.turns, count)
            unit += one * turning * np.exp(1j * throw)
        return unit

    def gas(self, point: Table) -> np.ndarray:
        """Return the coefficients (harmonics, 6) of the gas at an operating point."""
        out = np.zeros_like(self.inertia)
        if "gas" in self.table and point.get("gas", True) is not False:
            out[:, 3] = own_loads.of_gas(self.table["gas"], point, self.cylinders, self.table["engine"])
        return out

    @cached_property
    def _fixed(self) -> np.ndarray:
        """Return the coefficients (points, harmonics, 6) of pistons, rods, throws and gas."""
        both = zip(self.speeds, self.points, strict=True)
        return np.array([self.inertia * w**2 + self.gas(point) for w, point in both])

    @cached_property
    def of_weights(self) -> list[tuple[np.ndarray, np.ndarray]]:
        count = self._fixed.shape[1]
        return [own_loads.of_unbalance(w.x, w.place, w.ratio, self.turns, count) for w in self.weights]

    @cached_property
    def harmonics(self) -> np.ndarray:
        """Return the harmonics of the cycle that count."""
        size = np.abs(self._fixed).max(axis=(0, 2))
        if self.share > 0.0:
            # far above its modes a block answers with the inverse square of the order
            size = size / np.maximum(np.arange(len(size)) / self.turns, 1.0) ** 2
        size[[round(abs(w.ratio)) * self.turns for w in self.weights]] = np.inf
        return np.flatnonzero(size > max(self.share, 1e-16) * np.max(size[np.isfinite(size)]))

    def unbalances(self, table: Table, count: int) -> dict[str, np.ndarray]:
        """Return the unbalance of every weight, complex, shape (count,)."""
        by_name: dict[str, np.ndarray] = {}
        for w in self.weights:
            entry = _at_names(table, w, self)
            if w.follows:
                name, sign, mirrored = w.follows
                leader = by_name[name]
                by_name[w.name] = sign * (leader.conj() if mirrored else leader)
                continue
            if "balance_factor" in entry:
                size = entry["turning"] + entry["shares"] * _array(entry["balance_factor"], count)
            elif "unbalance" in entry:
                size = _array(entry["unbalance"], count)
            else:
                size = _array(entry["mass"], count) * si(entry["radius"])
            by_name[w.name] = size * np.exp(1j * (np.radians(_array(entry.get("angle", 0.0), count)) + w.turned))
        return by_name

    def wrenches(self, unbalances: dict[str, np.ndarray], count: int) -> np.ndarray:
        """Return an array (count, points, felt, 6)."""
        out = np.broadcast_to(self._fixed[:, self.harmonics], (count, len(self.points), len(self.harmonics), 6)).copy()
        w2 = np.array(self.speeds) ** 2
        for w, (upright, aside) in zip(self.weights, self.of_weights, strict=True):
            u = unbalances[w.name]
            unit = u.real[:, None, None] * upright[self.harmonics] + u.imag[:, None, None] * aside[self.harmonics]
            out += w2[:, None, None] * unit[:, None]
        return out

    # --- what is asked

    def closed(self, x: np.ndarray) -> Table:
        """Return the file with values (count, open numbers) put in."""
        table = copy.deepcopy(self.table)
        for o, values in zip(self.open, x.T, strict=True):
            holder = table
            for key in o.path[:-1]:
                holder = holder[key]
            holder[o.path[-1]] = np.ascontiguousarray(values)
        return table

    def designs(self, x: np.ndarray) -> Designs:
        return Designs(self, np.atleast_2d(np.asarray(x, float)))


def _array(numbers: Any, count: int) -> np.ndarray:
    return numbers if isinstance(numbers, np.ndarray) else np.full(count, si(numbers))


def _at_names(table: Table, w: Weight, model: OwnModel) -> Table:
    """Return the numbers of a weight with open ones put in."""
    for entry in table.get("counterweights", []):
        if entry["name"] == w.name or ("balance_factor" in entry and w.name.startswith(entry["name"] + " ")):
            return {**entry, **{k: w.entry[k] for k in ("turning", "shares") if k in w.entry}}
    for shaft in table.get("balancer_shafts", []):
        for j, entry in enumerate(shaft["unbalances"]):
            if w.name in (shaft["name"], f"{shaft['name']}.{entry.get('name', j + 1)}"):
                return dict(entry)
    raise KeyError(w.name)


class Designs:
    """Values of measures of many designs."""

    def __init__(self, model: OwnModel, x: np.ndarray) -> None:
        self.model, self.x, self.count = model, x, len(x)
        self.table = model.closed(x)
        self.unbalances = model.unbalances(self.table, self.count)
        self.wrench = model.wrenches(self.unbalances, self.count)

    @cached_property
    def blocks(self) -> Blocks:
        return blocks(self.table, self.count)

    @cached_property
    def _answers(self) -> dict[str, np.ndarray]:
        """Return the coefficients (count, points, felt, mounts, 3)."""
        orders = self.model.harmonics / self.model.turns
        both = [self.blocks.answer(orders * w, self.wrench[:, p]) for p, w in enumerate(self.model.speeds)]
        return {
            "mount force": np.stack([f for f, _ in both], axis=1),
            "mount travel": np.stack([t for _, t in both], axis=1),
        }

    def coefficients(self, term: Table, channel: str) -> np.ndarray:
        """Return an array (count, points that count, places, felt, components), and the weights of the points."""
        keep = self._points(term)
        if channel in ON_BLOCK:
            series = self.wrench[:, keep][..., ON_BLOCK[channel]][:, :, None]
        else:
            at = [k for k in self._mounts(term) if self.blocks.place[k] == k]
            series = self._answers[channel][:, keep][:, :, :, at] * np.array(
                term.get("direction_weights", [1.0] * 3), float
            )
            series = series.transpose(0, 1, 3, 2, 4)
        return series * self._orders(term)[:, None]

    def _orders(self, term: Table) -> np.ndarray:
        orders = self.model.harmonics / self.model.turns
        listed = term.get("orders")
        return (
            np.ones(len(orders))
            if listed is None
            else np.array([float(any(abs(o - t) < 1e-9 for t in listed)) for o in orders])
        )

    def _points(self, term: Table) -> list[int]:
        names = term.get("operating_points")
        return [k for k, p in enumerate(self.model.points) if names is None or p["name"] in names]

    def _mounts(self, term: Table) -> list[int]:
        names = [p.get("name", f"mount {k + 1}") for k, p in enumerate(self.table["mounts"]["places"])]
        return [names.index(n) for n in term.get("mounts", names)]

    def samples(self, c: np.ndarray) -> np.ndarray:
        """Return an array (..., samples, components) of coefficients (..., felt, components)."""
        n = self.model.samples
        full = np.zeros((*c.shape[:-2], n // 2 + 1, c.shape[-1]), complex)
        low = self.model.harmonics <= n // 2
        full[..., self.model.harmonics[low], :] = (
            c[..., low, :] * np.where(self.model.harmonics[low] == 0, 1.0, 0.5)[:, None]
        )
        return np.fft.irfft(full, n=n, axis=-2) * n

    def norm(self, norm: str, term: Table, channel: str) -> np.ndarray:
        c = self.coefficients(term, channel)
        w = np.array([float(self.model.points[k].get("weight", 1.0)) for k in self._points(term)])
        share = w / w.sum()
        if norm == "rms":
            half = np.where(self.model.harmonics == 0, 1.0, 0.5)
            return np.sqrt((np.sum(np.abs(c) ** 2, axis=-1) @ half).mean(axis=2) @ share)
        v = self.samples(c)
        if norm == "peak to peak":
            return np.array(
                [max(smallest_ball(s)[0] for p, q in zip(d, w, strict=True) if q > 0.0 for s in p) for d in v]
            )
        length = np.linalg.norm(v, axis=-1)
        if norm == "mean":
            return length.mean(axis=(2, 3)) @ share
        if norm == "worst mean":
            return length.mean(axis=(2, 3)).max(axis=1)
        if norm == "rmq":
            return ((length**4).mean(axis=(2, 3)) @ share) ** 0.25
        assert norm == "maximum"
        return self._largest(c[:, w > 0.0], length[:, w > 0.0])

    def _largest(self, c: np.ndarray, length: np.ndarray) -> np.ndarray:
        """Return the largest length, sought between the samples by Newton's method."""
        if self.model.share > 0.0:
            return length.max(axis=(1, 2, 3))
        n, h = length.shape[-1], 1j * self.model.harmonics
        at = 2.0 * np.pi * length.argmax(axis=-1) / n
        best = length.max(axis=-1)
        for _ in range(4):
            e = np.exp(h * at[..., None])[..., None] * c
            v, d, dd = e.real.sum(-2), (h[:, None] * e).real.sum(-2), (h[:, None] ** 2 * e).real.sum(-2)
            best = np.maximum(best, np.linalg.norm(v, axis=-1))
            slope, bend = np.sum(v * d, -1), np.sum(d * d + v * dd, -1)
            at = at - np.clip(np.where(bend < 0.0, slope / np.where(bend < 0.0, bend, 1.0), 0.0), -4.0 / n, 4.0 / n)
        return best.max(axis=(1, 2))

    def measure(self, term: Table) -> np.ndarray:
        """Return an array (count,) of an objective's term or a limit's quantity."""
        norm, channel = norm_and_channel(term["quantity"])
        if norm:
            return self.norm(norm, term, channel)
        if channel in own_runs.MEASURES:
            return self._runs[channel]
        if channel == "transmissibility":
            return self._transmissibility(term)
        if channel.endswith("mass"):
            return self._mass(term, channel)
        if channel in ("static travel", "static mount force"):
            return self._static(term, channel)
        b = self.blocks
        if channel in ("kinetic-energy decoupling", "decoupling shortfall"):
            shares = b.modes[1].max(axis=2)[:, [MOTIONS.index(m) for m in term.get("motions", MOTIONS)]]
            if channel == "kinetic-energy decoupling":
                return shares.min(axis=1)
            return np.maximum(float(term.get("wanted", 1.0)) - shares, 0.0).sum(axis=1)
        if channel == "motion frequencies":
            frequencies, shares = b.modes
            dominant = shares.argmax(axis=2)[:, [MOTIONS.index(m) for m in term.get("motions", MOTIONS)]]
            return np.take_along_axis(frequencies, dominant, axis=1).max(axis=1)
        if channel == "static sag":
            return b.sag
        if channel == "total stiffness":
            return b.stiff.sum(axis=(1, 2))
        if channel == "torque-roll residual":
            return b.torque_roll(si(term["frequency"]))
        assert channel == "raw torque-roll residual", channel
        edges = term.get("frequency")
        band = (
            (0.0, np.inf)
            if edges is None
            else tuple(si(v) for v in edges["between"])
            if is_open(edges)
            else (si(edges),) * 2
        )
        return b.raw_torque_roll(band)

    @cached_property
    def _runs(self) -> dict[str, np.ndarray]:
        return own_runs.run_through(self)

    def _transmissibility(self, term: Table) -> np.ndarray:
        keep = (self.model.harmonics > 0) & (self._orders(term) > 0)
        rows = []
        for p in self._points(term):
            passed = np.sum(np.abs(self._answers["mount force"][:, p, keep]) ** 2, axis=(1, 2, 3))
            rows.append(
                np.sqrt(passed / np.sum(np.abs(self.blocks.firm(self.wrench[:, p, keep])) ** 2, axis=(1, 2, 3)))
            )
        return np.max(rows, axis=0)

    def _mass(self, term: Table, channel: str) -> np.ndarray:
        role = {"counterweight mass": "c", "balancer mass": "b", "added mass": "cb"}[channel]
        total = np.zeros(self.count)
        for w in self.model.weights:
            if w.role in role and ("of" not in term or w.name in term["of"]):
                leader = w if w.follows is None else next(v for v in self.model.weights if v.name == w.follows[0])
                total += np.abs(self.unbalances[w.name]) / si(w.entry.get("radius", leader.entry.get("radius")))
        return total

    def _static(self, term: Table, channel: str) -> np.ndarray:
        rows, at = [], self._mounts(term)
        weigh = np.array(term.get("direction_weights", [1.0] * 3), float)
        for case in self.table["load_cases"]:
            if case["name"] not in term.get("load_cases", [case["name"]]):
                continue
            load = np.zeros(6)
            load[:3] += (
                GRAVITY * self.blocks.mass[0, 0] * np.array([float(v) for v in case.get("times_weight", [0.0] * 3)])
            )
            load[3] += si(case.get("torque", 0.0))
            if "force" in case:
                force = np.array([si(v) for v in case["force"]])
                at_place = np.array([si(v) for v in case["place"]]) - self.blocks.centre
                load += np.concatenate([force, np.cross(at_place, force)])
            travel, force = self.blocks.static_answer(load)
            rows.append(
                np.linalg.norm((travel if channel == "static travel" else force)[:, at] * weigh, axis=-1).max(axis=1)
            )
        return np.max(rows, axis=0)

    @cached_property
    def objective(self) -> np.ndarray:
        objective = self.table["objective"]
        terms = objective["terms"] if "terms" in objective else [{**objective, "quantity": objective["minimise"]}]
        weights = [float(t.get("weight", 1.0)) if "terms" in objective else 1.0 for t in terms]
        return sum(w * self.measure(t) for w, t in zip(weights, terms, strict=True))  # type: ignore[return-value]

    def violation(self, limit: Table) -> np.ndarray:
        """Share of itself by which a limit is broken; not over nought where it is kept."""
        rows = []
        if limit["limit"] == "natural frequencies":
            f = self.blocks.modes[0]
            high, low = f.max(axis=1), f.min(axis=1)
            if "outside" in limit:
                a, b = (si(v) for v in limit["outside"])
                rows.append(np.minimum(f - a, b - f).max(axis=1) / b)
        else:
            high = low = self.measure({**limit, "quantity": limit["limit"]})
        if "max" in limit:
            rows.append(high / si(limit["max"]) - 1.0)
        if "min" in limit:
            rows.append(1.0 - low / si(limit["min"]))
        return np.max(rows, axis=0)

    @cached_property
    def excesses(self) -> np.ndarray:
        """Return an array (count, limits)."""
        limits = self.table.get("constraints", [])
        return (
            np.stack([self.violation(limit) for limit in limits], axis=1) if limits else np.full((self.count, 1), -1.0)
        )
