"""Torque of a firing pattern by plain sums over time, without orders: each cylinder and cycle by its own pressure."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from laufruhe import load
from laufruhe.extensions.skip_fire.torque import FiringModel
from laufruhe.files.cylinder_states import CylinderState
from laufruhe.machine.gas.seiliger import seiliger_cut_off

NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)
STATES = ("closed valves", "open valves", "misfire")


@dataclass(frozen=True)
class Drawn:
    """A random engine of equal cylinders with a pattern of its firings."""

    tables: Mapping[str, Any]
    pattern: str
    state: str
    model: FiringModel


def drawn(seed: int) -> Drawn:
    """Return a random engine with a random pattern and a random state of its skipped cylinders."""
    rng = np.random.default_rng(seed)
    cylinders, is_two_stroke = int(rng.integers(1, 7)), bool(rng.random() < 0.3)
    # throws of even firing, in the order of the cylinders
    step = (360.0 if is_two_stroke else 720.0) / cylinders
    order = [1, *(2 + rng.permutation(cylinders - 1)).tolist()]
    throws = [-step * order.index(k + 1) % 360.0 for k in range(cylinders)]
    bore, ratio, exponent = rng.uniform(0.06, 0.15), rng.uniform(8.0, 17.0), rng.uniform(1.25, 1.4)
    intake = rng.uniform(0.4e5, 1.5e5)
    end = intake * ratio**exponent
    gas = {
        "model": "seiliger", "peak_pressure": f"{end * rng.uniform(1.2, 2.0)!r} Pa", "compression_ratio": ratio,
        "intake_pressure": f"{intake!r} Pa", "exhaust_pressure": f"{rng.uniform(0.9e5, 1.3e5)!r} Pa",
        "compression_exponent": exponent, "expansion_exponent": rng.uniform(1.2, 1.4), "imep": "0 bar",
    }  # fmt: skip
    tables = {
        "title": "drawn",
        "engine": {
            "layout": "inline", "cycle": "two-stroke" if is_two_stroke else "four-stroke", "bore": f"{bore!r} m",
            "stroke": f"{bore * rng.uniform(0.8, 1.3)!r} m", "rod_ratio": rng.uniform(0.2, 0.35), "throws": throws,
            "reciprocating_mass": f"{rng.uniform(0.3, 3.0)!r} kg", "cylinder_spacing": f"{1.2 * bore!r} m",
            "firing_order": order,
        },
        "operating_points": [{"speed": f"{rng.uniform(80.0, 400.0)!r} rad/s"}],
        "gas": gas,
        "objective": {"minimise": "rms roll moment"},
    }  # fmt: skip
    low = _imep(gas, ratio, intake, is_two_stroke, 1.0)
    gas["imep"] = f"{low + rng.uniform(0.1, 0.5) * (_imep(gas, ratio, intake, is_two_stroke, 3.0) - low)!r} Pa"
    problem, state = load(tables), STATES[int(rng.integers(3))]
    names = tuple(part.name for part in problem.engine.slider_cranks)
    misfire, cut = (names, ()) if state == "misfire" else ((), names)
    point, cycle = problem.points[0], problem.engine.cycle
    skipped = CylinderState(misfire, cut, state == "open valves", "").gas(point.gas, cycle, "skipped")
    length = int(rng.integers(1, 9))
    pattern = "".join(map(str, rng.integers(0, 2, length)))
    cycles = math.lcm(length, cylinders) // cylinders
    return Drawn(tables, pattern, state, FiringModel(problem, point.gas, skipped, cycles))


def _imep(gas: Mapping[str, Any], ratio: float, intake: float, is_two_stroke: bool, cut_off: float) -> float:
    # indicated mean pressure of the mixed cycle, work by elementary integrals
    n, m, peak = gas["compression_exponent"], gas["expansion_exponent"], float(gas["peak_pressure"].split()[0])
    small = 1.0 / (ratio - 1.0)
    hot, large = cut_off * small, ratio * small
    work = peak * (hot - small) + peak * hot / (m - 1.0) * (1.0 - (hot / large) ** (m - 1.0))
    work -= intake * large / (n - 1.0) * (ratio ** (n - 1.0) - 1.0)
    return work + (0.0 if is_two_stroke else intake - float(gas["exhaust_pressure"].split()[0]))


@dataclass(frozen=True)
class PlainTorque:
    """Gas torque over the crank angle, from the numbers of the engine alone."""

    case: Drawn

    def angles(self) -> tuple[np.ndarray, np.ndarray]:
        """Return nodes and weights of Gauss's rule over all cycles, between the dead centres and the ends of heat."""
        fires, period, ends = self._firings(), self._period(), [0.0, self._period()]
        for angle, _ in fires:
            ends += [(angle + k * math.pi) % period for k in range(round(period / math.pi))]
            ends.append((angle + self._heat_end()) % period)
        edges = np.unique(np.round(ends, 12))
        edges = np.unique(np.concatenate([np.linspace(a, b, 9) for a, b in itertools.pairwise(edges)]))
        half, middle = 0.5 * np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
        return (middle[:, None] + half[:, None] * NODES).ravel(), (half[:, None] * WEIGHTS).ravel()

    def _period(self) -> float:
        return self.case.model.cycles * self.case.model.problem.engine.cycle.angle

    def _firings(self) -> list[tuple[float, bool]]:
        # firing angle of every opportunity of all cycles, and whether it fires
        engine, pattern = self.case.model.problem.engine, self.case.pattern
        angles = sorted(part.firing_angle % engine.cycle.angle for part in engine.slider_cranks)
        every = [angle + k * engine.cycle.angle for k in range(self.case.model.cycles) for angle in angles]
        return [(angle, pattern[k % len(pattern)] == "1") for k, angle in enumerate(every)]

    def _volume(self, local: np.ndarray) -> np.ndarray:
        # volume over displacement
        part, ratio = self.case.model.problem.engine.slider_cranks[0], self.case.tables["gas"]["compression_ratio"]
        r, rod = part.crank_radius, part.rod_length
        travel = r * (1.0 - np.cos(local)) + rod - np.sqrt(rod**2 - (r * np.sin(local)) ** 2)
        return 1.0 / (ratio - 1.0) + travel / (2.0 * r)

    def _heat_end(self) -> float:
        gas, cycle = self.case.model.fired, self.case.model.problem.engine.cycle
        volume = seiliger_cut_off(gas, cycle) / (self.case.tables["gas"]["compression_ratio"] - 1.0)
        low, high = 0.0, math.pi
        for _ in range(80):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._volume(np.array(middle)) < volume else (low, middle)
        return low

    def _pressure(self, local: np.ndarray, fires: bool) -> np.ndarray:
        # over the cycle about a firing, local from the dead centre before intake or compression on
        gas, volume = self.case.model.fired, self._volume(local)
        largest = gas.compression_ratio / (gas.compression_ratio - 1.0)
        spring = gas.intake_pressure * (largest / volume) ** gas.compression_exponent
        if not fires and self.case.state != "misfire":
            return spring if self.case.state == "closed valves" else np.full(len(local), gas.intake_pressure)
        hot = seiliger_cut_off(gas, self.case.model.problem.engine.cycle) / (gas.compression_ratio - 1.0)
        burning = gas.peak_pressure * np.minimum(1.0, hot / volume) ** gas.expansion_exponent
        closed = np.where((local > 0.0) & fires, burning, spring)
        exhaust = np.where(local > 0.0, gas.exhaust_pressure, gas.intake_pressure)
        return np.where(np.abs(local) < math.pi, closed, exhaust)

    def at(self, angles: np.ndarray) -> np.ndarray:
        """Return the torque of the gas of all cylinders at crank angles [N m]."""
        part, cycle = self.case.model.problem.engine.slider_cranks[0], self.case.model.problem.engine.cycle.angle
        r, rod, total = part.crank_radius, part.rod_length, np.zeros(len(angles))
        for firing, fires in self._firings():
            local = (angles - firing + 0.5 * cycle) % self._period() - 0.5 * cycle
            within = local < 0.5 * cycle
            local = local[within]
            slope = r * np.sin(local) * (1.0 + r * np.cos(local) / np.sqrt(rod**2 - (r * np.sin(local)) ** 2))
            force = self._pressure(local, fires) - self.case.model.fired.crankcase_pressure
            total[within] += part.piston_area * force * slope
        return total

    def means(self) -> dict[str, Any]:
        """Return mean, rms of the alternating roll moment with inertia, and coefficients by order, by Gauss's rule."""
        nodes, weights = self.angles()
        model, share = self.case.model, weights / self._period()
        idle = replace(model.problem, points=(replace(model.point, gas=None),))
        from laufruhe.problem.evaluation import evaluate

        inertia = evaluate(idle).loads[0].wrench.values(nodes)[:, 3]
        gas = self.at(nodes)
        moment = gas + inertia
        orders = np.arange(60 * model.cycles) * float(model.problem.engine.cycle.base_order / model.cycles)
        waves = np.exp(-1j * np.outer(orders, nodes)) @ (2.0 * share * gas)
        mean = share @ gas
        return {
            "mean": mean, "rms": math.sqrt(share @ (moment - share @ moment) ** 2), "orders": orders, "waves": waves,
        }  # fmt: skip
