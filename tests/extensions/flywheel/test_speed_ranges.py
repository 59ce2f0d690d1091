"""Speeds at which a flywheel keeps a degree of irregularity: against the exact degree on a grid of speeds."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from laufruhe.extensions.flywheel.torque import Swing, swing_of
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.machine import LoadTorque
from laufruhe.physics.torque import crank_torque, turning_inertia
from problem_files import PROBLEMS

SCENES: dict[str, tuple[str, dict[str, Any]]] = {
    "a compressor": ("compressor-set", {}),
    "misfire": ("tractor-three", {"misfire": [2]}),
    "branches": ("inline-five-generator", {"misfire": [1]}),
    "single cylinders": ("tractor-three", {}),
    "a single": ("tractor-single", {}),
    "no gas": ("tractor-single", {"gas": False}),
}


def swing(name: str, inertia: float | None) -> tuple[Swing, float]:
    ready, point = SCENES[name]
    tables = tables_of(PROBLEMS / f"{ready}.toml")
    tables |= {"operating_points": [{"name": "p", "speed": "1500 rpm", **point}]}
    if name == "single cylinders":
        single = {"cylinders": 2, "reciprocating_mass": "2.5 kg"}
        tables["engine"] = {**tables["engine"], "single_cylinders": [single]}
    if inertia is not None:
        tables["flywheel"] = {"inertia": f"{inertia} kg m^2"}
    problem = load_tables(tables, PROBLEMS / f"{ready}.toml")
    total = turning_inertia(problem.engine, problem.fidelity)
    assert total is not None
    return swing_of(problem.engine, problem.points[0], problem.fidelity), total


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("degree", [0.002, 0.01, 0.05, 0.3])
def test_ranges_have_the_speeds_that_keep_the_limit_and_no_others(name: str, degree: float) -> None:
    causes, inertia = swing(name, None if name == "branches" else 0.25)
    ranges = causes.speed_ranges(degree, inertia)
    speeds = np.geomspace(5.0, 5000.0, 120)
    for speed in speeds:
        keeps = replace(causes, speed=float(speed)).irregularity(inertia) <= degree
        assert keeps == any(low <= speed <= high for low, high in ranges), speed
    for end in (end for pair in ranges for end in pair if 0.0 < end < math.inf):
        assert replace(causes, speed=end).irregularity(inertia) == pytest.approx(degree, rel=1e-4)


def test_a_range_of_speeds_may_have_two_ends() -> None:
    """A load that takes the torque of the pistons at one speed leaves no irregularity there, but some elsewhere."""
    problem = load_tables(tables_of(PROBLEMS / "tractor-single.toml"), PROBLEMS / "tractor-single.toml")
    point = replace(problem.points[0], gas=None)
    angles = np.radians(np.arange(0.0, 720.0, 0.5))
    torques = crank_torque(problem.engine, point).values(angles)
    load = LoadTorque(tuple(angles.tolist()), tuple(torques.tolist()))
    causes = swing_of(replace(problem.engine, load_torque=load), point, problem.fidelity)
    degree = 0.5 * replace(causes, speed=1e5).irregularity(0.3)
    ((low, high),) = causes.speed_ranges(degree, 0.3)
    assert 0.5 * point.speed < low < point.speed < high < 2.0 * point.speed
    for end in (low, high):
        assert replace(causes, speed=end).irregularity(0.3) == pytest.approx(degree, rel=1e-4)
    assert causes.speed_ranges(3.0 * degree, 0.3)[-1][1] == math.inf
