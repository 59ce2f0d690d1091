"""Electric torque and unbalances of random engines: designs of SLSQP against the bound, and limits at 7200 angles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

import laufruhe
from extensions.electric_torque.test_electric_torque import SHAFT, decided, is_proven, machine, problem_of
from lanes import first_fast
from laufruhe.extensions.electric_torque.machine import ELECTRIC_TORQUE
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem

STARS = [
    ([0, 180, 180, 0], [1, 3, 4, 2]), ([0, 240, 120], [1, 2, 3]), ([0, 0], [1, 2]), ([0], [1]),
    ([0, 120, 240, 240, 120, 0], [1, 4, 2, 6, 3, 5]),
]  # fmt: skip
RESISTANCE, CONSTANT, UNBALANCE = 0.05, 0.5, 0.02
STEPS, EVERY, ANGLES = 5760, 16, 7200


class Rivals:
    """Loads of any design, affine in its numbers, and the share of its limits that it uses."""

    def __init__(self, problem: Problem, largest: float, loss: float) -> None:
        self.problem, self.largest, self.loss = problem, largest, loss
        self.measure = problem.objective[0].measure
        self.open = problem.decisions
        self.units = [1.0 if d.kind is ELECTRIC_TORQUE else UNBALANCE for d in self.open]
        self.orders = [float(d.name.split("order ")[1].split(".torque")[0].split(" at ")[0]) if u == 1.0 else 0.0
                       for d, u in zip(self.open, self.units, strict=True)]  # fmt: skip
        signals = evaluate(problem).signals(self.measure.load)
        self.kinks = np.unique(np.concatenate([signal.kink_angles for signal in signals]))
        count = len(self.open)
        self.bare = self._rows(np.zeros(count))
        units = [self._rows(unit * way) - self.bare for unit in np.eye(count) for way in (1.0, 1j)]
        self.columns = np.stack(units, axis=-1)
        self.few = np.r_[0:STEPS:EVERY, STEPS : self.bare.shape[1]]

    def _rows(self, numbers: np.ndarray) -> np.ndarray:
        values = [complex(number * unit) for number, unit in zip(numbers, self.units, strict=True)]
        signals = evaluate(self.problem, self.problem.design(values)).signals(self.measure.load)
        if self.measure.alternating:
            signals = [signal.without_mean for signal in signals]
        if self.measure.norm.name != "maximum":
            return np.stack([signal.series.sample(STEPS) for signal in signals])
        return np.stack([np.concatenate([signal.sample(STEPS), signal.values(self.kinks)]) for signal in signals])

    def value(self, x: np.ndarray, rows: Any = slice(None)) -> float:
        """Return the objective at real and imaginary parts in turns."""
        lengths = np.linalg.norm(self.bare[:, rows] + self.columns[:, rows] @ x, axis=-1)
        weights = np.array(self.measure.shares(self.problem.points))
        if self.measure.norm.name == "rms":
            return math.sqrt(float(weights @ (lengths**2).mean(axis=(1, 2))))
        return float(weights @ lengths.mean(axis=(1, 2)) if self.measure.norm.name == "mean" else lengths.max())

    def torques(self, x: np.ndarray, count: int) -> np.ndarray:
        """Return the torque at each operating point over the cycle, shape (points, count)."""
        angles = self.problem.engine.cycle.angle * np.arange(count) / count
        rows = []
        for point in self.problem.points:
            acts = [f" at {point.name}." in d.name or (" at " not in d.name and o > 0.0)
                    for d, o in zip(self.open, self.orders, strict=True)]  # fmt: skip
            waves = np.exp(1j * np.outer(self.orders, angles))
            rows.append((((x[::2] + 1j * x[1::2]) * acts) @ waves).real)
        return np.array(rows)

    def spare(self, x: np.ndarray, count: int) -> np.ndarray:
        """Return what is left of every limit, as a share of it."""
        torque = self.torques(x, count)
        losses = RESISTANCE * (torque**2).mean(axis=1) / CONSTANT**2
        sizes = [abs(complex(*x[2 * k : 2 * k + 2])) for k, order in enumerate(self.orders) if not order]
        return np.concatenate([
            (1.0 - torque / self.largest).ravel(), (1.0 + torque / self.largest).ravel(), 1.0 - losses / self.loss,
            1.0 - np.square(sizes),
        ])  # fmt: skip

    def allowed(self, x: np.ndarray) -> np.ndarray:
        """Return the design with its numbers scaled down until all limits hold."""
        sizes = np.abs(x[::2] + 1j * x[1::2])
        torque = self.torques(x, ANGLES)
        losses = RESISTANCE * (torque**2).mean(axis=1).max() / CONSTANT**2
        excess = max(float(np.abs(torque).max()) / self.largest, math.sqrt(losses / self.loss), 1.0)
        return x / np.repeat([excess if o else max(s, 1.0) for s, o in zip(sizes, self.orders, strict=True)], 2)


@pytest.mark.parametrize("seed", first_fast(list(range(60)), 0, 0))
def test_no_design_of_slsqp_lies_under_the_bound(seed: int) -> None:
    """Search from six starts, four of them at random."""
    rng = np.random.default_rng(seed)
    throws, order = STARS[rng.integers(len(STARS))]
    orders = sorted(rng.choice([0.5, 1, 1.5, 2, 2.5, 3, 4, 6], int(rng.integers(1, 4)), replace=False).tolist())
    largest = float(10.0 ** rng.uniform(1.0, 2.7))
    loss = RESISTANCE * (largest * rng.uniform(0.3, 1.2) / CONSTANT) ** 2
    machine_table = machine(
        orders=orders, max_torque=f"{largest!r} N m", torque_constant=f"{CONSTANT} N m/A",
        resistance=f"{RESISTANCE} ohm", max_loss=f"{loss!r} W",
    )  # fmt: skip
    norm, channel = rng.choice(["rms", "mean", "maximum"]), rng.choice(["roll moment", "mount force"])
    points = [{"name": f"p{k}", "speed": f"{rng.uniform(700, 4000)} rpm", "weight": float(rng.uniform(0.3, 2.0))}
              for k in range(int(rng.integers(1, 3)))]  # fmt: skip
    engine = {"throws": throws, "firing_order": order, "reciprocating_mass": f"{rng.uniform(0.3, 1.5)} kg"}
    shafts = [{**SHAFT, "ratio": float(rng.choice([-2, -1, 1, 2]))}] if rng.random() < 0.6 else None
    problem = problem_of(
        [machine_table], f"{norm} {channel}", engine=engine, operating_points=points, balancer_shafts=shafts
    )  # fmt: skip
    result = laufruhe.solve(problem)
    rivals = Rivals(problem, largest, loss)
    assert is_proven(result)
    assert result.certificate is not None
    assert result.objective is not None
    value, bound = result.objective.value, result.certificate.lower_bound
    assert bound <= value * (1.0 + 1e-12)
    unbalances = {rotor.name: rotor.unbalance / UNBALANCE for rotor in result.final.engine.rotors}
    torques = iter(decided(result))
    numbers = [next(torques) if order else unbalances[decision.rotor_drives[0].rotor]
               for decision, order in zip(problem.decisions, rivals.orders, strict=True)]  # fmt: skip
    own = np.array([part for number in numbers for part in (number.real, number.imag)])
    sampling = 2.0 * result.error_estimate
    assert rivals.value(own) == pytest.approx(value, rel=1e-9 + sampling)
    assert rivals.spare(own, ANGLES).min() > -1e-4
    scales = np.repeat([largest if order else 1.0 for order in rivals.orders], 2)
    unit = rivals.value(np.zeros(len(own))) or 1.0
    for start in (own, 0.9 * own, *(rivals.allowed(scales * rng.normal(size=len(own))) for _ in range(4))):
        actual = minimize(
            lambda x: rivals.value(x * scales, rivals.few) / unit, start / scales, method="SLSQP",
            constraints={"type": "ineq", "fun": lambda x: rivals.spare(x * scales, 360)},
            options={"maxiter": 60, "ftol": 1e-12},
        )  # fmt: skip
        for rival in (start, actual.x * scales):
            assert rivals.value(rivals.allowed(rival)) >= bound * (1.0 - 1e-9 - sampling)
