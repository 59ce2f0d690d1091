"""Largest torque that turns a crank slowly: polytropes written out, weights, states and single cylinders."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from laufruhe.extensions.flywheel.torque import TurningTorque, turning_torque
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.physics.gravity import potential_energy
from laufruhe.problem.problem import Problem
from problem_files import PROBLEMS

AIR = 101_325.0


def problem_of(name: str, engine: dict[str, Any] | None = None, **changes: Any) -> Problem:
    tables = {**tables_of(PROBLEMS / f"{name}.toml"), **changes}
    tables["engine"] = {**tables["engine"], **(engine or {})}
    return load_tables(tables, PROBLEMS / f"{name}.toml")


def needed(problem: Problem) -> TurningTorque:
    turning = turning_torque(problem.engine, problem.points[0])
    assert turning is not None
    return turning


def by_hand(problem: Problem, ratio: float, exponent: float, idle: tuple[str, ...] = ()) -> tuple[float, float]:
    """Return the largest sum (p - p_0) dV/dphi with p V^n = constant in compression and expansion, at 0.05 degrees."""
    engine = problem.engine
    phi = np.radians(np.arange(0.0, 720.0, 0.05))
    total = np.zeros(len(phi))
    for part in engine.slider_cranks:
        if part.name in idle:
            continue
        since = np.mod(phi - part.firing_angle + 2.0 * math.pi, 4.0 * math.pi) - 2.0 * math.pi

        def volume(angle: np.ndarray, part: Any = part) -> np.ndarray:
            r, rod = part.crank_radius, part.rod_length
            drop = r + rod - (r * np.cos(angle) + np.sqrt(rod**2 - (r * np.sin(angle)) ** 2))
            return part.piston_area * (2.0 * r / (ratio - 1.0) + drop)

        pressure = AIR * (volume(np.array([math.pi])) / volume(since)) ** exponent
        rate = (volume(since + 1e-6) - volume(since - 1e-6)) / 2e-6
        total += np.where(np.abs(since) < math.pi, -(pressure - AIR) * rate, 0.0)
    if engine.gravity:
        rotors = (*engine.pins, *engine.rotors)
        ends = [potential_energy(engine.slider_cranks, rotors, phi + side) for side in (1e-5, -1e-5)]
        total += (ends[0] - ends[1]) / 2e-5
    k = int(np.argmax(total))
    return float(total[k]), math.degrees(float(phi[k]))


@pytest.mark.parametrize("gravity", [False, True])
@pytest.mark.parametrize("name", ["tractor-single", "tractor-three", "compressor-set"])
def test_a_crank_is_turned_against_compression_and_weights(name: str, gravity: bool) -> None:
    problem = problem_of(name, {"gravity": gravity})
    gas = problem.points[0].gas
    expected = by_hand(problem, gas.compression_ratio, gas.compression_exponent)
    turning = needed(problem)
    assert turning.torque == pytest.approx(expected[0], rel=2e-3)
    distance = math.remainder(math.degrees(turning.angle) - expected[1], 720.0 / len(problem.engine.slider_cranks))
    assert abs(distance) < 0.6
    assert turning.torque > 50.0


def test_states_and_single_cylinders_have_their_own_compression() -> None:
    """Check that a misfire compresses, a cut cylinder with open valves does not, at any speed."""
    fired = needed(problem_of("tractor-three", operating_points=[{"name": "p", "speed": "900 rpm"}]))
    point = {"name": "p", "speed": "2000 rpm"}
    missed = needed(problem_of("tractor-three", operating_points=[{**point, "misfire": [2]}]))
    assert missed.torque == pytest.approx(fired.torque, rel=1e-12)
    cut = problem_of("tractor-three", operating_points=[{**point, "cut": [1, 2], "cut_valves": "open"}])
    gas = problem_of("tractor-three").points[0].gas
    names = [part.name for part in cut.engine.slider_cranks]
    expected = by_hand(cut, gas.compression_ratio, gas.compression_exponent, (names[0], names[1]))
    assert needed(cut).torque == pytest.approx(expected[0], rel=2e-3)
    tables = tables_of(PROBLEMS / "tractor-three.toml")
    single = {**tables["gas"], "single_cylinders": [{"cylinders": 2, "compression_ratio": 24.0}]}
    other = needed(problem_of("tractor-three", gas=single))
    assert 1.1 * fired.torque < other.torque < 2.0 * fired.torque


def test_gas_of_unknown_compression_has_no_torque() -> None:
    for name in ("single-recorded-trace", "waterworks-steam-pump"):
        problem = problem_of(name)
        assert turning_torque(problem.engine, problem.points[0]) is None


def test_without_gas_only_weights_resist() -> None:
    points = [{"name": "p", "speed": "900 rpm", "gas": False}]
    assert needed(problem_of("tractor-single", operating_points=points)).torque == 0.0
    heavy = problem_of("tractor-single", {"gravity": True}, operating_points=points, counterweights=[])
    part = heavy.engine.slider_cranks[0]
    assert needed(heavy).torque == pytest.approx(9.80665 * part.reciprocating_mass * part.crank_radius, rel=0.05)
