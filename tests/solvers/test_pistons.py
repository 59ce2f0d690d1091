"""Reciprocating mass as a decision: loads are affine in it, so it is proven like an unbalance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import laufruhe
from laufruhe.errors import InputError
from laufruhe.extensions.flywheel.torque import torque_facts
from laufruhe.load_models.affine import AffineModel
from laufruhe.machine import Engine
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import Status
from problem_files import PROBLEMS, changed, loaded
from searched import searched

VEE = """
title = "Vee of four"
[engine]
layout = "vee"
cycle = "four-stroke"
bore = "90 mm"
stroke = "84 mm"
rod_ratio = 0.28
reciprocating_mass = { between = ["0.2 kg", "2 kg"] }
rotating_mass = "0.4 kg"
cylinder_spacing = "105 mm"
bank_angle = 70
throws = [35, 215]
[engine.rod]
mass = "0.7 kg"
centre_of_gravity = "50 mm"
inertia = "40 kg cm^2"
[[operating_points]]
name = "fired"
speed = "3000 rpm"
[[operating_points]]
name = "coasting"
speed = "4200 rpm"
gas = false
[gas]
model = "seiliger"
peak_pressure = "70 bar"
imep = "8 bar"
[mounts]
positions = [["200 mm", "180 mm", "-50 mm"], ["200 mm", "-180 mm", "-50 mm"], ["-260 mm", "0 mm", "-40 mm"]]
[[main_bearings]]
x = "110 mm"
[[main_bearings]]
x = "0 mm"
[[main_bearings]]
x = "-110 mm"
[fidelity]
samples = 360
"""
WEB = """
[[counterweights]]
name = "web"
opposite_throw = 1
radius = "60 mm"
mass = { between = ["0 kg", "2 kg"] }
"""
RADIAL = """
title = "Radial"
[engine]
layout = "radial"
cycle = "four-stroke"
cylinders = 5
stroke = "100 mm"
rod_ratio = 0.27
reciprocating_mass = { between = ["0.2 kg", "2 kg"] }
knuckle_radius = "45 mm"
[engine.rod]
mass = "1.1 kg"
centre_of_gravity = "55 mm"
inertia = "70 kg cm^2"
[engine.articulated_rod]
mass = "0.6 kg"
centre_of_gravity = "50 mm"
inertia = "20 kg cm^2"
[[operating_points]]
speed = "2200 rpm"
"""


def objective(name: str) -> str:
    return f'[objective]\nminimise = "{name}"\n'


@pytest.mark.parametrize(
    ("text", "measures"),
    [
        (VEE + WEB, ("mean mount force", "maximum main-bearing force", "peak to peak stored work", "rms rod force")),
        (RADIAL, ("rms shaking force", "peak to peak crank torque")),
    ],
)  # fmt: skip
def test_rows_are_those_of_the_engine_with_the_mass(text: str, measures: tuple[str, ...], tmp_path: Path) -> None:
    """Affine rows at a mass are the exact loads of that engine, rods, gas and bearings included."""
    rng = np.random.default_rng(3)
    for name in measures:
        problem = loaded(tmp_path, text + objective(name))
        affine = AffineModel(problem, whole_cycle=True).at(problem.fidelity.samples)
        for _ in range(2):
            values = [float(rng.uniform(d.lower, d.upper)) for d in problem.decisions]
            x = np.array(values)
            rows = evaluate(problem, problem.design(values)).rows(problem.objective[0].measure, affine.samples)
            assert affine.objective(x) == pytest.approx(rows.value, rel=1e-10)


def masses(problem: Problem, mass: float) -> Engine:
    return problem.design([mass])


@pytest.mark.slow
def test_the_studys_seven_metres_a_second() -> None:
    """There the torque of the masses works against that of the gas: least work is stored with some 2.25 kg, not 1.25.

    The optimum is the least of the excursions themselves, evaluated one by one.
    """
    problem = laufruhe.load(PROBLEMS / "tractor-four-seven-metres.toml")
    result = laufruhe.solve(problem)
    assert result.certificate.kind is Proof.GLOBAL
    (mass,) = result.decisions
    assert (mass.name, mass.unit) == ("reciprocating mass", "kg")
    assert mass.value == pytest.approx(2.25, rel=0.02)

    def stored(m: float) -> float:
        return torque_facts(masses(problem, m), problem.points[0]).excursion

    best = minimize_scalar(stored, bounds=(0.5, 4.0), method="bounded", options={"xatol": 1e-5})
    assert result.objective.value == pytest.approx(best.fun, rel=1e-4)
    assert mass.value == pytest.approx(best.x, rel=1e-3)
    # convex: no mass on a chord lies over it
    few = [stored(m) for m in np.linspace(0.5, 4.0, 9)]
    assert np.all(np.diff(few, 2) >= -1e-9 * few[0])


@pytest.mark.slow
def test_with_a_counterweight_more_freedom_is_never_worse(tmp_path: Path) -> None:
    both = laufruhe.solve(loaded(tmp_path, VEE + WEB + objective("mean mount force")))
    assert both.status is Status.OPTIMAL
    alone = laufruhe.solve(loaded(tmp_path, VEE + objective("mean mount force")))
    fixed = changed(VEE, '{ between = ["0.2 kg", "2 kg"] }', f'"{alone.decisions[0].value:.15g} kg"')
    other = laufruhe.solve(loaded(tmp_path, fixed + WEB + objective("mean mount force")))
    assert both.objective.value <= min(alone.objective.value, other.objective.value) * (1.0 + 1e-4)
    assert {d.name for d in both.decisions} == {"reciprocating mass", "web.mass"}


@pytest.mark.slow
def test_masses_at_an_uneven_speed_are_decided_locally(tmp_path: Path) -> None:
    """Check that no mass of a grid is better."""
    text = VEE + 'crank_inertia = "1 kg m^2"\n[search]\nstarts = 1\n' + objective("mean mount force")
    problem = loaded(tmp_path, text)
    result = laufruhe.solve(problem)
    assert result.certificate.kind is Proof.LOCAL
    assert result.certificate.lower_bound == 0.0
    (decision,) = problem.decisions
    for mass in np.linspace(decision.lower, decision.upper, 7):
        other = evaluate(problem, problem.design([float(mass)]))
        assert result.objective.value <= objective_value(problem, other) * (1.0 + 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        VEE + '[[counterweights]]\nname = "b"\nbalance_factor = 0.5\n' + objective("rms shaking force"),
        VEE + '[flywheel]\ninertia = "1 kg m^2"\n' + objective("degree of irregularity"),
        VEE + '[flywheel]\ninertia = { between = ["0.1 kg m^2", "1 kg m^2"] }\n' + objective("degree of irregularity"),
    ],
)
def test_problems_without_a_special_method_are_searched(text: str, tmp_path: Path) -> None:
    """A light piston turns most evenly; of weights that follow its mass the force is least at the lightest too."""
    result = searched(loaded(tmp_path, text))
    assert {d.name.split(".")[-1]: d.value for d in result.decisions}.popitem() is not None
    mass = next(d for d in result.decisions if "reciprocating" in d.name)
    assert mass.value == pytest.approx(0.2, abs=1e-3) or result.objective.value < result.objective.initial


def test_an_open_crank_beside_its_pistons_is_decided_star_by_star(tmp_path: Path) -> None:
    """Compare an open crank with open piston masses with each even crank given."""
    text = """
title = "Four in line"
[engine]
layout = "inline"
cycle = "four-stroke"
stroke = "80 mm"
rod_ratio = 0.28
reciprocating_mass = { between = ["0.2 kg", "0.6 kg"] }
cylinder_spacing = "100 mm"
cylinders = 4
throws = "open"
[[operating_points]]
speed = "3000 rpm"
[[counterweights]]
name = "web"
opposite_throw = 1
mass = { between = ["0 kg", "1 kg"] }
radius = "60 mm"
[objective]
terms = [{ quantity = "mean shaking force" }, { quantity = "mean rocking couple" }]
"""
    result = laufruhe.solve(loaded(tmp_path, text))
    assert next(d.value for d in result.decisions if d.name == "reciprocating mass") == pytest.approx(0.2, abs=1e-6)
    each = (
        laufruhe.solve(loaded(tmp_path, changed(text, '"open"', throws))).objective.value
        for throws in ("[0, 180, 180, 0]", "[0, 180, 0, 180]", "[0, 0, 180, 180]")
    )
    assert result.objective.value == pytest.approx(min(each), rel=1e-4)


def test_cylinders_with_a_mass_of_their_own_do_not_follow(tmp_path: Path) -> None:
    text = """
title = "Engine and pump"
[engine]
layout = "parts"
cycle = "two-stroke"
stroke = "80 mm"
rod_ratio = 0.28
reciprocating_mass = { between = ["0.2 kg", "2 kg"] }
slider_cranks = [{ x = "50 mm" }, { x = "-50 mm", throw = 180, reciprocating_mass = "0.7 kg" }]
[[operating_points]]
speed = "3000 rpm"
[objective]
minimise = "rms shaking force"
orders = [1]
"""
    result = laufruhe.solve(loaded(tmp_path, text))
    assert [part.reciprocating_mass for part in result.final.engine.slider_cranks] == pytest.approx(
        [0.7, 0.7], rel=1e-4
    )
    with pytest.raises(InputError, match="has no effect in this engine"):
        loaded(tmp_path, changed(text, '{ x = "50 mm" }', '{ x = "50 mm", reciprocating_mass = "1 kg" }'))


def test_a_given_value_changes_no_other_number(tmp_path: Path) -> None:
    fixed = changed(VEE, '{ between = ["0.2 kg", "2 kg"] }', '"0.9 kg"')
    problem = loaded(tmp_path, fixed + objective("mean mount force"))
    opened = loaded(tmp_path, VEE + objective("mean mount force"))
    value = evaluate(problem).value(problem.objective[0].measure)
    assert evaluate(opened, masses(opened, 0.9)).value(opened.objective[0].measure) == pytest.approx(value, rel=1e-12)
    assert replace(masses(opened, 0.9), name="") == replace(problem.engine, name="")
