"""Boxes of throws, mounts and unbalances: no design is under the bound of its box, and small boxes come near (E72)."""

from __future__ import annotations

import copy
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from attack.own_problem import OwnModel
from laufruhe.extensions.joint_mounts.load_boxes import LoadBoxes
from laufruhe.extensions.joint_mounts.mounted_loads import OpenThrows, along_arcs, throws_at
from laufruhe.problem.phasing import Candidate

INPUT = Path(__file__).parents[2] / "claims" / "inputs" / "uneven-throws-beside-a-stiffness.toml"
THREE = [[20, 20], [80, 150], [200, 260]]
RIDING = [{"name": "c", "balance_factor": 0.4}, {"name": "e", "opposite_throw": 2, "radius": "60 mm", "mass": "2 kg"}]


def problem_of(objective: str, throws: list[list[float]], **more: Any) -> dict[str, Any]:
    """Return the table of a problem with throws between bounds [deg]."""
    table = tomllib.loads(INPUT.read_text(encoding="utf-8"))
    table["engine"] |= {"cylinders": len(throws), "throws": [{"between": pair} for pair in throws]}
    table["engine"] |= more.pop("engine", {})
    return {**table, **more, "objective": {"minimise": objective}}


CASES = (
    problem_of("rms mount force", [[0, 0], [150, 200]]),
    problem_of("mean mount force", THREE, counterweights=RIDING),
    problem_of("maximum mount travel", THREE, counterweights=RIDING),
    problem_of("peak to peak mount force", [[0, 0], [150, 200]]),
    problem_of("rms mount force", [[-40, 10], [150, 200]], engine={"layout": "vee", "bank_angle": 70, "cylinders": 4}),
)


def throws_of(table: dict[str, Any]) -> OpenThrows:
    problem = laufruhe.load(table)
    phasing = problem.phasing
    assert phasing is not None
    assert phasing.throw_bounds is not None
    middle = tuple(0.5 * (low + high) for low, high in phasing.throw_bounds)
    bank, split = phasing.minimum_geometry
    result = throws_at(problem, phasing, Candidate(middle, None, bank, split))
    assert result is not None
    return result


def own_at(table: dict[str, Any], throws: np.ndarray) -> OwnModel:
    closed = copy.deepcopy(table)
    closed["engine"]["throws"] = [float(angle) for angle in np.degrees(throws)]
    return OwnModel(closed, 1440)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(CASES)))
def test_no_design_of_a_box_is_under_its_bound_and_small_boxes_come_near(number: int) -> None:
    table, generator = CASES[number], np.random.default_rng(number)
    throws = throws_of(table)
    boxes = LoadBoxes(throws.waves.problem, 1e-9, throws)
    low, high, near = boxes.lower, boxes.upper, []
    for widest in (1.0, 0.3, 0.1, 0.02, 0.02, 1e-4, 1e-4):
        middle, half = generator.uniform(low, high), 0.5 * (high - low) * widest * generator.random(len(low))
        lower, upper = np.maximum(middle - half, low), np.minimum(middle + half, high)
        bound = float(boxes.bounds(lower[None], upper[None])[0][0])
        for share in generator.random((6, len(low))):
            stiffness, real, imaginary, *angles = lower + share * (upper - lower)
            if np.hypot(real, imaginary) > 0.05:
                continue
            at = throws.angles.copy()
            at[throws.open] = angles
            own = own_at(table, at)
            x = [np.hypot(real, imaginary), np.degrees(np.arctan2(imaginary, real)) % 360.0, stiffness]
            value = float(own.designs(np.array([x])).objective[0])
            assert bound <= value * (1.0 + 1e-6)
            if widest == 1e-4 and bound < np.inf:
                near.append(bound / value)
    assert max(near) > 0.99


def test_an_arc_is_its_middle_its_slope_and_no_more_than_its_rest() -> None:
    halves, t = np.linspace(0.0, 4.0, 161), np.linspace(-1.0, 1.0, 401)
    middle, slope, rest = along_arcs(halves)
    off = np.abs(np.exp(1j * np.outer(halves, t)) - middle[:, None] - 1j * np.outer(slope, t)).max(axis=1)
    assert np.all(off <= rest + 1e-12)
    assert np.all(rest <= 1.5 * off + 1e-12)
    assert rest[1] <= 0.26 * halves[1] ** 2


def test_throws_that_gas_or_an_open_pin_goes_with_are_left_out() -> None:
    problem = laufruhe.load(CASES[0])
    phasing = problem.phasing
    assert phasing is not None
    middle = Candidate((0.0, 3.0), None, None, None)
    assert throws_at(problem, phasing, middle) is not None
    uneven = replace(problem, fidelity=replace(problem.fidelity, crank_inertia=True))
    assert throws_at(uneven, phasing, middle) is None
    assert throws_at(problem, replace(phasing, throw_bounds=None), middle) is None
