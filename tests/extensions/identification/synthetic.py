"""Synthetic engines with known numbers, and orders measured on them with noise.

python tests/extensions/identification/synthetic.py --number 300
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass

import numpy as np

import laufruhe as lr
from laufruhe.extensions.identification.estimate import Estimate, estimate
from laufruhe.extensions.identification.measurement import Measurement
from laufruhe.problem.channels import MOUNT_FORCE, MOUNT_TRAVEL
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem

ENGINE = """
title = "synthetic"
[search]
starts = 2
[engine]
layout = "inline"
cycle = "four-stroke"
bore = "80 mm"
stroke = "{stroke} mm"
rod_ratio = 0.28
reciprocating_mass = {mass}
cylinder_spacing = "90 mm"
throws = {throws}
[[operating_points]]
name = "slow"
speed = "{slow} rpm"
[[operating_points]]
name = "fast"
speed = "{fast} rpm"
[block]
mass = "{block} kg"
centre_of_gravity = ["10 mm", "5 mm", "40 mm"]
inertia = ["2 kg m^2", "5 kg m^2", "4.5 kg m^2"]
[mounts]
kind = "elastic"
loss_factor = 0.08
[[mounts.places]]
name = "front"
position = ["300 mm", "0 mm", "-50 mm"]
stiffness = ["200 N/mm", "150 N/mm", {stiffness}]
[[mounts.places]]
name = "rear left"
position = ["-250 mm", "220 mm", "-30 mm"]
stiffness = ["180 N/mm", "220 N/mm", "260 N/mm"]
[[mounts.places]]
name = "rear right"
position = ["-250 mm", "-220 mm", "-30 mm"]
stiffness = ["180 N/mm", "220 N/mm", "260 N/mm"]
[[counterweights]]
name = "front disc"
x = "150 mm"
unbalance = {size}
angle = {angle}
[[counterweights]]
name = "rear disc"
x = "-160 mm"
unbalance = {rear}
angle = 40
"""
THROWS = ("[0]", "[0, 0]", "[0, 180]", "[0, 120, 240]", "[0, 180, 180, 0]")


@dataclass(frozen=True)
class Truth:
    """Numbers of a synthetic engine, and its problem with these numbers open."""

    problem: Problem
    values: tuple[complex | float, ...]


def engine(seed: int, *, linear: bool = False) -> Truth:
    rng = np.random.default_rng(seed)
    size, angle, rear = rng.uniform(2e-3, 8e-3), rng.uniform(0.0, 360.0), rng.uniform(2e-3, 8e-3)
    stiffness, mass = rng.uniform(150e3, 500e3), rng.uniform(0.45, 0.7)
    sizes = {
        "stroke": rng.uniform(60.0, 95.0), "throws": THROWS[seed % len(THROWS)], "slow": rng.uniform(900.0, 2000.0),
        "fast": rng.uniform(2500.0, 5500.0), "block": rng.uniform(70.0, 140.0),
    }  # fmt: skip
    numbers = {
        "size": '{ between = ["0 kg m", "0.02 kg m"] }',
        "angle": "{ between = [0, 360] }",
        "rear": '{ between = ["0 kg m", "0.02 kg m"] }',
        "mass": '"0.55 kg"' if linear else '{ between = ["0.3 kg", "1.0 kg"], start = "0.55 kg" }',
        "stiffness": '"300 N/mm"' if linear else '{ between = ["80 N/mm", "800 N/mm"], start = "300 N/mm" }',
    }
    problem = lr.load(ENGINE.format(**sizes, **numbers))
    true = {
        "front disc.unbalance": size * np.exp(1j * math.radians(angle)), "rear disc.unbalance": rear,
        "reciprocating mass": mass, "front.stiffness.z": stiffness,
    }  # fmt: skip
    values = tuple(true[d.name] if d.set.width == 2 or not d.rotor_drives else true[d.name] * d.set.directions[0]
                   for d in problem.decisions)  # fmt: skip
    return Truth(problem, values)


def measured(truth: Truth, rng: np.random.Generator, noise: float, orders: tuple[float, ...] = (1.0, 2.0)) -> list[
    Measurement
]:  # fmt: skip
    """Return measured forces and travel of the engine; `noise` is relative to the root mean square of a quantity."""
    design = evaluate(truth.problem.fixed_at(truth.values))
    rows = [(k, order) for k in range(2) for order in orders]
    measurements = []
    for channel in (MOUNT_FORCE, MOUNT_TRAVEL):
        exact = np.stack([design.signals(channel)[k].at(order) for k, order in rows])
        deviation = noise * float(np.sqrt(np.mean(np.abs(exact) ** 2)))
        parts = rng.normal(0.0, deviation, (2, *exact.shape))
        points, columns = zip(*rows, strict=True)
        measurements.append(
            Measurement(
                channel.name,
                truth.problem,
                channel,
                points,
                columns,
                exact + parts[0] + 1j * parts[1],
                None,
                tuple((f"{j} x", f"{j} y", f"{j} z") for j in range(exact.shape[1])),
            )
        )
    return measurements


def hits(truth: Truth, answer: Estimate) -> list[bool]:
    """Return for each number whether its interval holds the true value; nothing for numbers at a bound."""
    found = []
    for domain, value in zip(answer.domains, truth.values, strict=True):
        if np.any(answer.at_bounds[domain.columns]):
            continue
        true = (
            (abs(value), float(np.angle(value)))
            if domain.width == 2
            else (complex(value / domain.set.directions[0]).real,)
        )
        for k, ((number, deviation), exact) in enumerate(zip(answer.polar(domain), true, strict=True)):
            error = number - exact if k == 0 else math.remainder(number - exact, math.tau)
            found.append(abs(error) <= answer.half_width * deviation)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--number", type=int, default=300, help="of engines")
    parser.add_argument("--noise", type=float, default=0.05)
    arguments = parser.parse_args()
    found: list[bool] = []
    lost = 0
    for seed in range(arguments.number):
        truth = engine(seed)
        answer = estimate(measured(truth, np.random.default_rng(seed + 10_000), arguments.noise))
        inside = hits(truth, answer)
        found += inside
        lost += sum(d.width for d in answer.domains) - len(inside)
    share = np.mean(found)
    print(f"{arguments.number} engines: {share:.2%} of {len(found)} intervals hold the true number, {lost} at a bound")
    sys.exit(not 0.93 <= share <= 0.97)


if __name__ == "__main__":
    main()
