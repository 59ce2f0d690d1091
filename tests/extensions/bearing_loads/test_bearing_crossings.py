"""Bearings with further parts of an engine: bounds, compared with random designs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from lanes import first_fast
from laufruhe.errors import InputError
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from problem_files import PROBLEMS

THREE = tables_of(PROBLEMS / "tractor-three-bearings.toml")
ENGINE = {key: value for key, value in THREE["engine"].items() if key != "firing_order"}
WEBS = [
    {"name": f"web {k + 1}", "x": f"{125 - 125 * k + 30} mm", "opposite_throw": k + 1, "radius": "75 mm",
     "mass": {"between": ["0 kg", "3 kg"]}} for k in range(3)
]  # fmt: skip
ELASTIC = {
    "mounts": {"kind": "elastic", "loss_factor": 0.1, "places": [
        {"name": name, "position": [f"{x} mm", f"{y} mm", "0 mm"], "stiffness": ["200 N/mm", "200 N/mm", "400 N/mm"]}
        for name, x, y in (("front left", 250, 250), ("front right", 250, -250), ("rear", -900, 0))
    ]},
    "block": {"mass": "300 kg", "centre_of_gravity": ["-200 mm", "0 mm", "100 mm"],
              "inertia": ["20 kg m^2", "45 kg m^2", "40 kg m^2"]},
    "constraints": [{"limit": "mean mount force", "max": "900 N"}],
}  # fmt: skip
POINTS = [
    {"name": "rated", "speed": "2500 rpm"}, {"name": "idle", "speed": "900 rpm", "weight": 2.0},
    {"name": "over", "speed": "3300 rpm", "gas": False, "weight": 0.5},
]  # fmt: skip
VEE = ENGINE | {"layout": "vee", "bank_angle": 60, "throws": [0, 120, 240]}
WIEBE = {"model": "wiebe", "imep": "6 bar", "start": "-8 deg", "duration": "60 deg"}
RADIAL = {
    **{key: value for key, value in ENGINE.items() if key not in ("cylinder_spacing", "throws", "rod")},
    "layout": "radial", "cylinders": 3, "knuckle_radius": "42 mm",
}  # fmt: skip
ON_ONE_THROW = [{**web, "x": f"{x} mm", "opposite_throw": 1} for web, x in zip(WEBS, (60, 20, -60), strict=True)]
BESIDE = [{"beside_throws": "80 mm", "diameter": "70 mm", "width": "40 mm"}]
CASES: dict[str, dict[str, Any]] = {
    "uneven throws": {"engine": ENGINE | {"throws": [0, 100, 250], "firing_order": [1, 3, 2]}},
    "three points": {"operating_points": POINTS},
    "heat release": {"gas": WIEBE},
    "no gas": {"gas": None},
    "two rods on a pin": {"engine": VEE},
    "two-stroke": {"engine": ENGINE | {"cycle": "two-stroke", "firing_order": [1, 3, 2]}},
    "elastic mounts": ELASTIC,
    "as a beam": {"fidelity": {"samples": 120, "crankshaft": "beam"}},
    "radial": {"engine": RADIAL, "main_bearings": BESIDE, "counterweights": ON_ONE_THROW, "gas": None},
    "pin off its path": {"engine": ENGINE | {"offset": "6 mm", "firing_order": [1, 3, 2]}},
}


def problem_of(changes: dict[str, Any], quantity: str) -> Problem:
    whole = {key: value for key, value in THREE.items() if key != "constraints"}
    whole |= {"counterweights": WEBS, "fidelity": {"samples": 120}, "objective": {"minimise": quantity}, **changes}
    return load_tables({key: value for key, value in whole.items() if value is not None}, Path("crossed.toml"))


MEAN, MAXIMUM = "mean main-bearing force", "maximum main-bearing pressure"
PAIRS = [(name, quantity) for name in CASES for quantity in (MEAN, MAXIMUM)]


@pytest.mark.parametrize(("name", "quantity"), first_fast(PAIRS, 0, long=PAIRS[1::4] + PAIRS[2::4]))
def test_no_design_goes_under_the_bound(name: str, quantity: str) -> None:
    problem = problem_of(CASES[name], quantity)
    result = laufruhe.solve(problem)
    assert result.certificate.kind in (Proof.GLOBAL, Proof.WITHIN_GAP)
    assert result.certificate.gap < 2e-3
    assert result.objective.value < 0.9995 * result.objective.initial
    rng = np.random.default_rng(9)
    best = np.array([d.value for d in result.decisions])
    met = 0
    for k in range(12):
        # near the design that is told, and anywhere
        masses = best + rng.normal(0.0, 0.1, 3) if k % 2 else rng.uniform(0.0, 3.0, 3)
        masses = np.clip(masses, 0.0, 3.0)
        other = evaluate(problem, problem.design(masses.tolist()), 2880)
        if other.violation(problem.limits) <= 0.0:
            met += 1
            assert objective_value(problem, other) >= result.certificate.lower_bound * (1.0 - 1e-3)
    assert met > 2


def test_sizes_of_rods_on_a_master_rod_are_refused_by_name() -> None:
    tables = {**CASES["radial"], "running_gear": {"rod": {"diameter": "30 mm"}}}
    with pytest.raises(InputError, match="hinged to a master rod"):
        problem_of(tables, "maximum rod stress")


def _shaft(x: Any) -> list[dict[str, Any]]:
    return [{"name": "against", "ratio": -1, "position": ["60 mm", "-90 mm"], "unbalances": [
        {"name": "weight", "x": x, "unbalance": {"between": ["0 kg m", "0.08 kg m"]}, "angle": {"between": [0, 360]}}
    ]}]  # fmt: skip


@pytest.mark.slow
def test_places_of_balancer_shafts_beside_bearings() -> None:
    """Compare with the best of a row of shaft places, which no bearing force depends on."""
    tables = {
        "objective": {"terms": [{"quantity": "rms mount force"},
                                {"quantity": "rms main-bearing force", "weight": 0.1}]},
        "counterweights": WEBS[:2], "tolerance": 1e-3, "gas": None,
    }  # fmt: skip
    open_place = {"between": ["-200 mm", "200 mm"]}
    found = laufruhe.solve(problem_of({**tables, "balancer_shafts": _shaft(open_place)}, ""))
    assert found.certificate.kind is Proof.GLOBAL
    row = [
        laufruhe.solve(problem_of({**tables, "balancer_shafts": _shaft(f"{x} mm")}, "")) for x in range(-200, 201, 100)
    ]
    minimum = min(result.objective.value for result in row)
    assert found.objective.value <= minimum * (1.0 + 1e-3)
    assert found.certificate.lower_bound <= minimum
    assert minimum <= 1.05 * found.objective.value
    # the place of a weight on the crank changes bearing forces, along a line between two bearings (P20)
    moved = [{**WEBS[0], "x": open_place, "mass": "1 kg"}, *WEBS[1:]]
    carried = laufruhe.solve(problem_of({**tables, "counterweights": moved}, ""))
    assert carried.certificate.kind is Proof.GLOBAL
    fixed = [
        laufruhe.solve(problem_of({**tables, "counterweights": [{**moved[0], "x": f"{x} mm"}, *moved[1:]]}, ""))
        for x in (-200, -100, 0, 100, 200)
    ]
    minimum = min(one.objective.value for one in fixed)
    assert carried.certificate.lower_bound <= carried.objective.value <= minimum * (1.0 + 1e-3)
