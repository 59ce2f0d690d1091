"""Measures, objective and violations of a problem file for one design, with every number closed.

Loads of one design are a transform per operating point; a measure picks a channel and a norm of it.
"""

from __future__ import annotations

import itertools
import json
import math
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from attack import (
    plain_crankcase,
    plain_electric,
    plain_gear,
    plain_loads,
    plain_motion,
    plain_mounts,
    plain_receivers,
    plain_rotary,
)
from attack.plain_loads import SAMPLES, number

Table = dict[str, Any]
NORMS = ("mean", "maximum", "rms", "peak to peak", "worst mean", "rmq", "worst rms", "worst rmq")
"""The last two are for ranges of speed alone."""
ON_BLOCK = {"shaking force": slice(0, 3), "rocking couple": slice(4, 6), "roll moment": slice(3, 4)}


def norm_and_channel(quantity: str) -> tuple[str, str]:
    """Return the "peak to peak", "mount force" of "peak to peak mount force"; no norm where it has none."""
    for norm in NORMS if quantity not in plain_motion.QUANTITIES else ():
        if quantity.startswith(f"{norm} "):
            return norm, quantity[len(norm) + 1 :]
    return "", quantity


def circumsphere(points: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """Return smallest ball about few points: centre, radius and the weights of its points (all subsets are tried)."""
    best = (points[0], math.inf, np.eye(len(points))[0])
    for size in range(1, min(len(points), points.shape[1] + 1) + 1):
        for chosen in itertools.combinations(range(len(points)), size):
            p = points[list(chosen)]
            edges = p[1:] - p[0]
            gram = edges @ edges.T
            try:
                lam = np.linalg.solve(2.0 * gram, np.diag(gram)) if size > 1 else np.zeros(0)
            except np.linalg.LinAlgError:
                continue
            weights = np.concatenate([[1.0 - lam.sum()], lam])
            if weights.min() < -1e-9:
                continue
            centre = weights @ p
            radius = float(np.linalg.norm(points - centre, axis=1).max())
            if radius < best[1] - 1e-15:
                full = np.zeros(len(points))
                full[list(chosen)] = weights
                best = (centre, radius, full)
    return best


def smallest_ball(signal: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return diameter of the smallest ball that holds a path, the samples it rests on, and twice their pull on it."""
    scale = float(np.abs(signal).max()) or 1.0
    v = signal / scale
    if v.shape[1] == 1:
        k = np.array([int(np.argmax(v)), int(np.argmin(v))])
        return float(np.ptp(v)) * scale, k, np.array([[1.0], [-1.0]])
    support = [int(np.argmax(np.linalg.norm(v - v[0], axis=1)))]
    for _ in range(200):
        centre, radius, weights = circumsphere(v[support])
        far = np.linalg.norm(v - centre, axis=1)
        k = int(np.argmax(far))
        if far[k] <= radius * (1.0 + 1e-12) + 1e-15 or k in support:
            break
        support = [h for h, w in zip(support, weights, strict=True) if w > 0.0] + [k]
    centre, radius, weights = circumsphere(v[support])
    pull = 2.0 * weights[:, None] * (v[support] - centre) / (radius or 1.0)
    return 2.0 * float(np.linalg.norm(v - centre, axis=1).max()) * scale, np.array(support), pull


POWERS = {"mean": 1, "rms": 2, "rmq": 4}


def norm_of(norm: str, signal: np.ndarray, weights: np.ndarray) -> float:
    """Return the norm of a signal, shape (points, places, samples, d); points of weight zero do not count."""
    counted = signal[weights > 0.0]
    share = weights[weights > 0.0] / weights.sum()
    if norm in ("peak to peak", "maximum") or norm.startswith("worst"):
        return max(norm_at(norm, point) for point in counted)
    power = POWERS[norm]
    return float(share @ [norm_at(norm, point) ** power for point in counted]) ** (1.0 / power)


def norm_at(norm: str, signal: np.ndarray) -> float:
    """Return the norm at one operating point, shape (places, samples, d)."""
    if norm == "peak to peak":
        return max(smallest_ball(v)[0] for v in signal)
    length = np.linalg.norm(signal, axis=-1)
    power = POWERS.get(norm.removeprefix("worst "))
    return float(length.max()) if power is None else float((length**power).mean()) ** (1.0 / power)


@lru_cache(maxsize=64)
def machine_of(engine: str, order: tuple[int, ...] | None) -> plain_loads.Machine:
    return plain_loads.machine(json.loads(engine), list(order) if order else None)


@lru_cache(maxsize=64)
def _unit_load(engine: str, order: tuple[int, ...] | None) -> np.ndarray:
    return plain_loads.engine_spectrum(machine_of(engine, order))


@lru_cache(maxsize=64)
def _gas_load(
    engine: str, order: tuple[int, ...] | None, gas: str, unfired: tuple[tuple[int, str], ...] = ()
) -> np.ndarray:
    return plain_loads.gas_spectrum(json.loads(gas), machine_of(engine, order), dict(unfired))


def states_of(point: Table, cylinders: int) -> list[Table]:
    """Return a point, or one for each cylinder that misfires alone."""
    if point.get("misfire") != "each":
        return [point]
    weight = point.get("weight", 1.0) / cylinders
    return [
        {**point, "misfire": [k], "weight": weight, "name": f"{point['name']}, cylinder {k} misfires"}
        for k in range(1, cylinders + 1)
    ]


def unfired_of(point: Table) -> tuple[tuple[int, str], ...]:
    """Return the index of each cylinder without combustion, and what its valves do."""
    misfires = [(k - 1, "moving") for k in point.get("misfire", ())]
    return (*misfires, *((k - 1, point.get("cut_valves", "closed")) for k in point.get("cut", ())))


class Scene:
    """A design: a table without open numbers, and unbalances that were put in beside it.

    Parameters
    ----------
    table
        Of the problem file, every number closed.
    rotors
        (name, x, place in the plane, ratio, unbalance, radius, role) of every rotor.
    order
        Firing order, where the file leaves it open.
    """

    def __init__(self, table: Table, rotors: list[tuple[Any, ...]], order: tuple[int, ...] | None = None) -> None:
        self.table, self.rotors, self.order = table, rotors, order
        self.key = json.dumps(plain_gear.weighed(table), sort_keys=True)

    @cached_property
    def turns(self) -> int:
        return plain_loads.turns_of(self.table["engine"])

    @cached_property
    def points(self) -> list[Table]:
        cylinders = len(machine_of(self.key, self.order).mechanisms)
        return [state for point in self.table["operating_points"] for state in states_of(point, cylinders)]

    @cached_property
    def speeds(self) -> list[float]:
        return [number(p["speed"]) for p in self.points]

    @cached_property
    def orders(self) -> np.ndarray:
        return np.arange(SAMPLES // 2 + 1) / self.turns

    @cached_property
    def mounting(self) -> plain_mounts.Rigid | plain_mounts.Elastic:
        mounts = self.table["mounts"]
        if mounts.get("kind") == "elastic":
            return plain_mounts.elastic(mounts, self.table["block"])
        return plain_mounts.rigid(mounts)

    @cached_property
    def wrenches(self) -> list[np.ndarray]:
        """Return the coefficients (n, 6) of every operating point; gas is real and does not grow with speed."""
        unit = _unit_load(self.key, self.order).copy()
        for _, x, place, ratio, unbalance, _, role in self.rotors:
            if role == plain_electric.ROLE:
                continue
            unit += np.fft.rfft(plain_loads.rotor_load(x, place, ratio, unbalance, self.turns), axis=0) / SAMPLES
        signals = [unit * speed**2 for speed in self.speeds]
        if "electric_machines" in self.table:
            for signal, point in zip(signals, self.points, strict=True):
                _, on_block = plain_electric.on_crank_and_block(self, point)
                signal[:, 3] += np.fft.rfft(on_block) / SAMPLES
        if "gas" in self.table:
            for k, point in enumerate(self.points):
                if point.get("gas", True):
                    keys = {**self.table["gas"], **({"imep": point["imep"]} if "imep" in point else {})}
                    gas = json.dumps(keys, sort_keys=True)
                    signals[k] = signals[k] + _gas_load(self.key, self.order, gas, unfired_of(point))
        return signals

    @cached_property
    def loaded_orders(self) -> np.ndarray:
        """Return the indices of the orders that carry a load."""
        size = np.max([np.abs(w).max(axis=1) for w in self.wrenches], axis=0)
        return np.flatnonzero(size > 1e-13 * size.max())

    def coefficients(self, channel: str, orders: list[float] | None) -> list[np.ndarray]:
        """Return the per operating point (n, places, d)."""
        keep = self.loaded_orders
        if orders is not None:
            keep = np.array([k for k in keep if any(abs(self.orders[k] - o) < 1e-9 for o in orders)], dtype=int)
        signals = []
        for wrench, speed in zip(self.wrenches, self.speeds, strict=True):
            state = (self.orders[keep], wrench[keep], speed)
            if channel in ON_BLOCK:
                part = wrench[keep][:, None, ON_BLOCK[channel]]
            elif channel == "mount force":
                part = self.mounting.forces(*state)
            elif channel in plain_receivers.QUANTITIES:
                assert isinstance(self.mounting, plain_mounts.Elastic), channel
                part = plain_receivers.responses(self.table, self.mounting, channel, *state)
            else:
                assert isinstance(self.mounting, plain_mounts.Elastic), channel
                part = self.mounting.travel(*state)
            whole = np.zeros((len(self.orders), *part.shape[1:]), complex)
            whole[keep] = part
            signals.append(whole)
        return signals

    def signal(self, term: Table) -> np.ndarray:
        """Return an array (points, places, samples, d) of a load that is asked for."""
        signal = self._signal(term)
        if "over" in term:
            counted = self.weights(term) > 0.0
            signal[counted] /= np.array(term["over"])[:, None, None, None]
        return signal

    def values_at_points(self, term: Table) -> np.ndarray:
        """Return the value at every operating point that counts."""
        norm, _ = norm_and_channel(term["quantity"])
        return np.array([norm_at(norm, one) for one in self.signal(term)[self.weights(term) > 0.0]])

    def _signal(self, term: Table) -> np.ndarray:
        _, channel = norm_and_channel(term["quantity"])
        if channel in plain_crankcase.CHANNELS:
            return plain_crankcase.signal(self, machine_of(self.key, self.order), channel, term.get("orders"))
        if channel in plain_gear.SIZED:
            machine = machine_of(self.key, self.order)
            return np.stack([plain_gear.stress(self, machine, channel, k) for k in range(len(self.points))])
        if channel == "electric torque":
            names = term.get("electric_machines", [one["name"] for one in self.table["electric_machines"]])
            machines = [one for one in self.table["electric_machines"] if one["name"] in names]
            rows = [[plain_electric.torque(self, one, point) for one in machines] for point in self.points]
            return np.array(rows)[..., None]
        signals = [plain_mounts.over_cycle(c) for c in self.coefficients(channel, term.get("orders"))]
        signal = np.stack(signals).transpose(0, 2, 1, 3)
        if channel in ON_BLOCK:
            return signal * np.array(term.get("direction_weights", 1.0))
        if channel in plain_receivers.QUANTITIES:
            unit, _ = plain_receivers.QUANTITIES[channel]
            names = [one["name"] for one in self.table["receivers"] if one.get("unit", "m/s^2") == unit]
            places = [names.index(name) for name in term.get("receivers", names)]
            return signal[:, places] * np.array(term.get("direction_weights", [1.0, 1.0, 1.0]))
        names = [place.get("name", f"mount {k + 1}") for k, place in enumerate(self.table["mounts"]["places"])]
        places = [names.index(name) for name in term.get("mounts", names)]
        return signal[:, places] * np.array(term.get("direction_weights", [1.0, 1.0, 1.0]))

    def weights(self, term: Table) -> np.ndarray:
        names = term.get("operating_points")
        counted = [names is None or point["name"] in names for point in self.points]
        return np.array([point.get("weight", 1.0) * c for point, c in zip(self.points, counted, strict=True)])

    def measure(self, term: Table) -> float:
        """Return the number of an objective's term or a limit."""
        norm, channel = norm_and_channel(term["quantity"])
        if norm:
            return norm_of(norm, self.signal(term), self.weights(term))
        if channel == "running-gear mass":
            return plain_gear.mass(self.table, machine_of(self.key, self.order))
        if channel == "throw clearance":
            return plain_gear.clearance(self.table, machine_of(self.key, self.order))
        if channel.endswith("mass"):
            return self.mass(channel)
        if channel.startswith("apex"):
            at = np.array(self.speeds)[self.weights(term) > 0.0].max()
            return plain_rotary.apex(self.table["engine"], float(at), 1 + channel.endswith("acceleration"))
        if channel in plain_motion.QUANTITIES:
            return plain_motion.largest(self, machine_of(self.key, self.order), term, channel)
        if channel == "degree of irregularity":
            return plain_crankcase.irregularity(self, machine_of(self.key, self.order), self.weights(term))
        block = self.mounting
        assert isinstance(block, plain_mounts.Elastic), channel
        if channel == "transmissibility":
            return self._transmissibility(block, term)
        return {
            "static sag": lambda: block.sag,
            "total stiffness": lambda: block.total,
            "torque-roll residual": lambda: block.torque_roll(number(term["frequency"])),
        }[channel]()

    def _transmissibility(self, block: plain_mounts.Elastic, term: Table) -> float:
        ratios = []
        for wrench, speed, weight in zip(self.wrenches, self.speeds, self.weights(term), strict=True):
            keep = [k for k in self.loaded_orders if k > 0]
            if term.get("orders") is not None:
                keep = [k for k in keep if any(abs(self.orders[k] - o) < 1e-9 for o in term["orders"])]
            if weight > 0.0 and keep:
                passed = np.sum(np.abs(block.forces(self.orders[keep], wrench[keep], speed)) ** 2)
                ratios.append(math.sqrt(passed / np.sum(np.abs(block.firm(wrench[keep])) ** 2)))
        return max(ratios, default=0.0)

    def mass(self, channel: str) -> float:
        role = {"counterweight mass": "c", "balancer mass": "b", "added mass": "cb"}[channel]
        machines = machine_of(self.key, self.order).mechanisms if "c" in role else []
        levers = sum(m.lever.weight for m in machines if m.lever is not None)
        return levers + sum(abs(u) / radius for *_, u, radius, kind in self.rotors if kind in role)

    @cached_property
    def objective(self) -> float:
        return sum(term.get("weight", 1.0) * self.measure(term) for term in terms_of(self.table))

    def violation(self, limit: Table) -> float:
        """Return the relative excess over a limit; negative if it is met."""
        term = {**limit, "quantity": limit["limit"]}
        if limit["limit"] == "natural frequencies":
            block = self.mounting
            assert isinstance(block, plain_mounts.Elastic)
            f = block.frequencies
            over = f.max() / number(limit["max"]) - 1.0 if "max" in limit else -1.0
            under = 1.0 - f.min() / number(limit["min"]) if "min" in limit else -1.0
            a, b = (number(v) for v in limit.get("outside", [0.0, 0.0]))
            within = max((min(v - a, b - v) / b for v in f), default=-1.0) if b else -1.0
            return float(max(over, under, within))
        value = self.measure(term)
        over = value / number(limit["max"]) - 1.0 if "max" in limit else -1.0
        if limit["limit"] in plain_motion.QUANTITIES and "min" in limit:
            value = plain_motion.smallest(self, machine_of(self.key, self.order), term, limit["limit"])
        under = 1.0 - value / number(limit["min"]) if "min" in limit else -1.0
        return max(over, under)

    @cached_property
    def worst(self) -> float:
        """Return the largest excess over all limits."""
        return max((self.violation(limit) for limit in self.table.get("constraints", [])), default=-1.0)


def terms_of(table: Table) -> list[Table]:
    """Return the terms of the objective."""
    objective = table.get("objective", {})
    if "terms" in objective:
        return list(objective["terms"])
    return [{**objective, "quantity": objective["minimise"]}] if objective else []
