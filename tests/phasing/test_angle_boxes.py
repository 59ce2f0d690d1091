"""Boxes of an open bank or split-pin angle: their loads against the exact model, their bounds against a fine grid."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from laufruhe.files.reader import load_tables
from laufruhe.load_models.angle_waves import AngleWaves
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from problem_files import PROBLEMS, changed

TWIN = """
title = "V-twin on one pin"
[engine]
layout = "vee"
cycle = "four-stroke"
cylinders = 2
bank_angle = { between = [40, 120] }
bank_stagger = "25 mm"
throws = "open"
firing_order = [1, 2]
bore = "90 mm"
stroke = "80 mm"
rod_ratio = 0.27
reciprocating_mass = "0.5 kg"
rotating_mass = "0.4 kg"
cylinder_spacing = "100 mm"
[engine.rod]
mass = "0.5 kg"
centre_of_gravity = "45 mm"
inertia = "0.002 kg m^2"
[phasing]
intervals = { min = 225, max = 495 }
[[operating_points]]
speed = "5000 rpm"
"""
SECOND = '[[operating_points]]\nspeed = "3000 rpm"\nweight = 2\n'
TWIN += SECOND
GAS = '[gas]\nmodel = "wiebe"\nimep = "8 bar"\nstart = -10\nduration = 60\ncompression_ratio = 10\n'
MOUNTS = """[mounts]
positions = [["200 mm", "200 mm", "50 mm"], ["200 mm", "-200 mm", "50 mm"], ["-300 mm", "0 mm", "-100 mm"]]
relative_stiffness = [1, 1, 1]
"""
WEIGHTS = """[[counterweights]]
name = "web"
opposite_throw = 1
unbalance = { between = ["0 kg m", "0.1 kg m"] }
[[counterweights]]
name = "pulley"
x = "120 mm"
unbalance = { between = ["0 kg m", "0.01 kg m"] }
angle = { between = [0, 360] }
"""
SPLIT = changed(
    TWIN, "bank_angle = { between = [40, 120] }", "bank_angle = 60\nsplit_pin_angle = { between = [-30, 90] }"
)


def _read(text: str) -> Problem:
    return load_tables(tomllib.loads(text), PROBLEMS / "twin.toml")


def _objective(name: str) -> str:
    return f'[objective]\nminimise = "{name}"\n'


def _at(problem: Problem, angle: float, of_bank: bool, order: tuple[int, ...] = (1, 2)) -> Problem:
    """The problem with its open angle fixed [rad], cylinder 1 at its dead centre when phi = 0."""
    phasing = problem.phasing
    geometry = (angle, phasing.split[0] if phasing.split else 0.0) if of_bank else (phasing.bank[0], angle)
    layout = phasing.layout(*geometry)
    throw = (layout.banks[0] - layout.pin_offsets[0]) % math.tau
    return replace(phasing.realise(Candidate((throw,), order, *geometry)), phasing=None)


@pytest.mark.parametrize("gas", ["", GAS])
@pytest.mark.parametrize(("text", "of_bank"), [(TWIN, True), (SPLIT, False)])
@pytest.mark.parametrize("name", ["rms shaking force", "rms roll moment", "rms rocking couple"])
def test_waves_are_those_of_the_exact_model(text: str, of_bank: bool, gas: str, name: str) -> None:
    """At every angle, from waves that were taken at one of them."""
    problem = _read(text + gas + MOUNTS + WEIGHTS + _objective(name))
    measure, here = problem.objective[0].measure, math.radians(50.0)
    there = _at(problem, here, of_bank)
    layout = problem.phasing.layout(*((here, 0.0) if of_bank else (math.radians(60.0), here)))
    waves = AngleWaves(there, layout, (0, 1), of_bank)
    norm = waves.norm(measure, waves.samples(measure, 96))
    for degrees in (20.0, 40.0, 77.0, 90.0, 120.0):
        half = 0.5 * math.radians(degrees)
        turned = np.einsum("h,hkd->kd", np.exp(1j * waves.numbers * half), norm.waves[0]).real
        found = measure.norm.value(norm.fixed.grid, norm.fixed.constant + turned)
        wanted = evaluate(_at(problem, 2.0 * half, of_bank)).value(measure)
        assert found == pytest.approx(wanted, rel=1e-6, abs=norm.left_out)


CASES = [
    (TWIN, True, "", "rms shaking force"),
    (changed(TWIN, SECOND, ""), True, GAS, "rms roll moment"),
    (TWIN, True, "", "maximum rocking couple"),
    (SPLIT, False, "", "rms mount force"),
    (SPLIT, False, GAS, "rms roll moment"),
    # least where two peaks, or two parts of the cycle, are as large: a bend of the objective
    (TWIN, True, "", "maximum roll moment"),
    (changed(TWIN, SECOND, ""), True, "", "maximum shaking force"),
    (SPLIT, False, "", "mean rocking couple"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("text", "of_bank", "gas", "name"), CASES)
def test_no_angle_is_better_than_the_bound(text: str, of_bank: bool, gas: str, name: str) -> None:
    """Cones at fixed angles, and the bound meets the design."""
    problem = _read(text + gas + MOUNTS + WEIGHTS + _objective(name))
    result = solve(problem)
    low, high = problem.phasing.bank if of_bank else problem.phasing.split
    grid = [solve(_at(problem, angle, of_bank)).objective.value for angle in np.linspace(low, high, 13)]
    assert result.certificate.lower_bound <= min(grid) * (1.0 + 1e-9)
    assert result.objective.value <= min(grid) * (1.0 + 1e-6)
    assert str(result.certificate.kind) == "global"
    assert result.certificate.gap <= 1e-4
    # close to the design, where a bend of the objective is missed by a program of smooth functions
    at = result.phasing.ranking[0]
    best = at.bank_angle if of_bank else at.split_pin
    places = np.clip([best + step for step in (-1e-3, -1e-4, 1e-4, 1e-3)], low, high)
    near = [solve(_at(problem, angle, of_bank)).objective.value for angle in places]
    assert result.certificate.lower_bound <= min(near) * (1.0 + 1e-9)
    assert result.objective.value <= min(near) * (1.0 + 1e-4)


@pytest.mark.slow
def test_an_open_order_takes_the_better_one() -> None:
    """Firing close together and far apart are two orders of one crank: with gas they differ."""
    text = changed(TWIN, "firing_order = [1, 2]", 'firing_order = "open"')
    text = changed(text, "intervals = { min = 225, max = 495 }", "intervals = { min = 30, max = 690 }")
    problem = _read(text + GAS + MOUNTS + WEIGHTS + _objective("rms roll moment"))
    result = solve(problem)
    low, high = problem.phasing.bank
    values = [
        solve(_at(problem, angle, True, order)).objective.value
        for angle in np.linspace(low, high, 5)
        for order in ((1, 2), (2, 1))
    ]
    assert result.certificate.lower_bound <= min(values) * (1.0 + 1e-9)
    assert result.objective.value <= min(values) * (1.0 + 1e-6)


@pytest.mark.slow
def test_intervals_bound_the_bank_angle() -> None:
    """At most 420 degrees between firings leave a bank of 60 at most, and none is left by 380."""
    text = TWIN + MOUNTS + WEIGHTS + _objective("rms shaking force")
    result = solve(_read(changed(text, "min = 225, max = 495", "min = 300, max = 420")))
    assert math.degrees(result.phasing.ranking[0].bank_angle) == pytest.approx(60.0, abs=1e-4)
    assert str(result.certificate.kind) == "global"
    none = solve(_read(changed(text, "min = 225, max = 495", "min = 340, max = 380")))
    assert str(none.status) == "infeasible"


def test_what_knows_where_the_crank_stands_has_no_boxes() -> None:
    """A weight at an angle of its own is not turned with the crank: the certificate says no more than it did."""
    fixed = '[[counterweights]]\nname = "still"\nx = "50 mm"\nunbalance = "0.01 kg m"\nangle = 30\n'
    result = solve(_read(TWIN + MOUNTS + WEIGHTS + fixed + _objective("rms shaking force")))
    assert "boxes" not in result.certificate.method


def test_weights_that_know_how_far_pins_are_apart_have_no_boxes() -> None:
    """A share of what turns on offset pins is another weight at every offset: a bound from one would be false."""
    share = '[[counterweights]]\nname = "share"\nbalance_factor = 0.5\n'
    problem = _read(SPLIT + MOUNTS + share + _objective("rms shaking force"))
    near, far = (abs(_at(problem, angle, False).engine.rotors[-1].unbalance) for angle in problem.phasing.split)
    assert abs(near - far) > 1e-3
    assert "boxes" not in solve(problem).certificate.method
