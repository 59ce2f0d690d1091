"""Bounds of twist over boxes of discs, shafts and absorbers, compared with designs within."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lanes import first_fast
from laufruhe.extensions.torsion.boxes import TwistBoxes
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from problem_files import PROBLEMS

INERTIA = {"between": ["0.002 kg m^2", "0.008 kg m^2"], "start": "0.004 kg m^2"}
RUBBER = {"name": "r", "on": "throw 1", "inertia": INERTIA, "loss_factor": 0.15,
          "stiffness": {"between": ["5e3 N m/rad", "5e4 N m/rad"], "start": "2e4 N m/rad"}}  # fmt: skip
VISCOUS = {"name": "v", "on": "pulley", "inertia": INERTIA,
           "damping": {"between": ["0.5 N m s/rad", "30 N m s/rad"], "start": "5 N m s/rad"}}  # fmt: skip
PENDULUM = {"name": "p", "on": "throw 1", "inertia": INERTIA, "order": 5.0, "damping_ratio": 0.02}
WHEEL = {"name": "flywheel", "end": "rear", "shaft": {"stiffness": "6e5 N m/rad", "diameter": "58 mm"},
         "inertia": {"between": ["0.1 kg m^2", "0.2 kg m^2"], "start": "0.14 kg m^2"}}  # fmt: skip
ROUND = {"pieces": [{"length": "70 mm", "bore": "12 mm",
                     "diameter": {"between": ["40 mm", "60 mm"], "start": "48 mm"}}]}  # fmt: skip
SOFT = {"stiffness": {"between": ["2e5 N m/rad", "6e5 N m/rad"], "start": "4e5 N m/rad"}, "diameter": "48 mm"}
BRANCH = {
    "on": "pulley",
    "ratio": -2.5,
    "gear_inertia": "0.001 kg m^2",
    "discs": [
        {
            "name": "generator",
            "inertia": INERTIA,
            "damping": "0.02 N m s/rad",
            "shaft": {
                "stiffness": {"between": ["2e3 N m/rad", "2e4 N m/rad"], "start": "1e4 N m/rad"},
                "loss_factor": 0.1,
            },
        }
    ],
}

CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "viscous": ({"absorbers": [VISCOUS]}, {"minimise": "rms shaft stress"}),
    "rubber": ({"absorbers": [RUBBER]}, {"minimise": "rms shaft twist", "orders": [4.5, 5]}),
    "pendulum": ({"absorbers": [PENDULUM]}, {"minimise": "rms shaft torque"}),
    "crank stiffness": ({"crank": SOFT}, {"minimise": "rms shaft torque", "sections": ["throw 2 - throw 3"]}),
    "round shafts": ({"crank": ROUND}, {"minimise": "rms shaft stress"}),
    "round shafts, twist": (
        {"crank": ROUND, "absorbers": [VISCOUS]},
        {"minimise": "rms shaft twist", "orders": [0, 5]},
    ),
    "flywheel": ({"discs": [WHEEL], "crank": SOFT}, {"minimise": "rms shaft stress"}),
    "branch": ({"branches": [BRANCH], "absorbers": [RUBBER | {"on": "generator"}]}, {"minimise": "rms shaft torque"}),
}


def problem_of(name: str, **more: Any) -> Problem:
    torsion, objective = CASES[name]
    tables = tables_of(PROBLEMS / "inline-five-damper.toml")
    tables["torsion"] = {**tables["torsion"], "absorbers": [], **torsion}
    return load_tables({**tables, "objective": objective, "fidelity": {"samples": 180}, **more}, Path("five.toml"))


@pytest.mark.parametrize("name", first_fast(CASES, 1))
def test_no_design_in_a_box_is_under_its_bound(name: str) -> None:
    """Check random boxes of all sizes against random designs by the exact model."""
    problem = problem_of(name)
    boxes, rng = TwistBoxes(problem, evaluate(problem)), np.random.default_rng(11)
    own, tight = boxes.coordinates, []
    for size in (1.0, 0.3, 0.1, 0.03, 0.01, 0.001):
        for _ in range(4):
            low = own.lower + rng.random(len(own.lower)) * (1.0 - size) * (own.upper - own.lower)
            high = low + size * (own.upper - own.lower)
            (bound,), _ = boxes.bounds(low[None], high[None])
            values = []
            for share in (*rng.random((4, len(low))), np.zeros(len(low)), np.ones(len(low))):
                design = problem.design(own.decisions(low + share * (high - low)).tolist())
                values.append(objective_value(problem, evaluate(problem, design)))
            assert bound <= min(values) * (1.0 + 1e-9)
            tight.append((size, bound / min(values)))
    # it closes as boxes shrink
    assert min(ratio for size, ratio in tight if size == 0.001) > 0.95


@pytest.mark.parametrize("name", CASES)
def test_one_design_is_bounded_by_its_value(name: str) -> None:
    """Check that the bound of a box of no width is at most 5e-7 below the value."""
    problem = problem_of(name)
    boxes = TwistBoxes(problem, evaluate(problem))
    own = boxes.coordinates
    for share in (0.2, 0.5, 0.8):
        x = own.lower + share * (own.upper - own.lower)
        (bound,), _ = boxes.bounds(x[None], x[None])
        value = objective_value(problem, evaluate(problem, problem.design(own.decisions(x).tolist())))
        assert -1e-12 <= 1.0 - bound / value <= 5e-7


def test_boxes_of_a_limit_that_no_design_keeps() -> None:
    """Check that a frequency limit that both ends of a box break excludes the box."""
    problem = problem_of("flywheel", constraints=[{"limit": "torsional frequencies", "outside": ["290 Hz", "400 Hz"]}])
    boxes = TwistBoxes(problem, evaluate(problem))
    own, rng = boxes.coordinates, np.random.default_rng(5)
    excluded = 0
    for _ in range(60):
        low = own.lower + rng.random(2) * 0.9 * (own.upper - own.lower)
        high = low + 0.1 * (own.upper - own.lower)
        (bound,), _ = boxes.bounds(low[None], high[None])
        if bound < np.inf:
            continue
        excluded += 1
        for share in rng.random((3, 2)):
            design = problem.design(own.decisions(low + share * (high - low)).tolist())
            assert evaluate(problem, design).violation(problem.limits) > 0.0
    assert 0 < excluded < 60


def test_coordinates_are_turned_back() -> None:
    problem = problem_of("round shafts, twist")
    own = TwistBoxes(problem, evaluate(problem)).coordinates
    for share in (0.0, 0.4, 1.0):
        values = [d.lower + share * (d.upper - d.lower) for d in problem.decisions]
        assert own.decisions(own.from_decisions(np.array(values))) == pytest.approx(values, rel=1e-12)
