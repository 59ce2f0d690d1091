"""Boxes of an open bank or split-pin angle: their loads against the exact model, their bounds against a fine grid."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from laufruhe.files.reader import load_tables
from laufruhe.machine.firing import firing_turns, intervals_of
from laufruhe.machine.firing_windows import FiringWindow
from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from laufruhe.solvers.stars.star_results import StarDesign, solve_fixed
from laufruhe.solvers.throws.throw_search import ThrowSearch
from laufruhe.solvers.throws.throw_windows import design_at, firing_bounds, windows_of
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
FEW = "[fidelity]\nsamples = 360\n"
SPLIT = changed(
    TWIN, "bank_angle = { between = [40, 120] }", "bank_angle = 60\nsplit_pin_angle = { between = [-30, 90] }"
)


def _read(text: str) -> Problem:
    return load_tables(tomllib.loads(text), PROBLEMS / "twin.toml")


def _objective(name: str) -> str:
    return f'[objective]\nminimise = "{name}"\n'


def _at(problem: Problem, angle: float, of_bank: bool, order: tuple[int, ...] = (1, 2)) -> Problem:
    """Return the problem with its open angle fixed [rad], cylinder 1 at its dead centre when phi = 0."""
    phasing = problem.phasing
    geometry = (angle, phasing.split[0] if phasing.split else 0.0) if of_bank else (phasing.bank[0], angle)
    layout = phasing.layout(*geometry)
    throw = (layout.banks[0] - layout.pin_offsets[0]) % math.tau
    return replace(phasing.problem_of(Candidate((throw,), order, *geometry)), phasing=None)


VEE = changed(TWIN, "cylinders = 2", "cylinders = 4")
VEE = changed(VEE, "firing_order = [1, 2]", 'firing_order = "open"')
VEE = changed(changed(VEE, "min = 225, max = 495", 'largest_deviation = "100 deg"'), SECOND, "")
BOTH = changed(VEE, "bank_angle =", "split_pin_angle = { between = [-30, 60] }\nbank_angle =")
SIX = changed(changed(VEE, "cylinders = 4", "cylinders = 6"), "100 deg", "30 deg")
COUPLE = "rms rocking couple"
SHAFT = """[[balancer_shafts]]
name = "shaft"
ratio = -1
position = ["20 mm", "30 mm"]
[[balancer_shafts.unbalances]]
x = "40 mm"
unbalance = "0.02 kg m"
angle = 20
"""


def _drawn(rng: np.random.Generator, window: FiringWindow) -> Array | None:
    """Return the random throws and angles that keep a window."""
    low, high = window.box
    for k in rng.permutation(len(low)):
        here = np.arange(len(low)) == k
        at = rng.uniform(low[k], high[k])
        box = window.within(np.where(here, at, low), np.where(here, at, high))
        if box is None:
            return None
        low, high = box
    return np.asarray(0.5 * (low + high))


def _design(problem: Problem, window: FiringWindow, angles: Array) -> Candidate:
    return replace(design_at(problem.phasing, angles), firing_order=window.order)


@pytest.mark.parametrize(
    ("text", "gas", "name"),
    [
        *((text, "", name) for text in (TWIN, SPLIT, VEE, BOTH, SIX + SHAFT) for name in ("rms shaking force", COUPLE)),
        *((text, GAS, "rms roll moment") for text in (VEE, BOTH)),
    ],
    ids=range(12),
)
def test_waves_and_windows_are_those_of_the_exact_model(text: str, gas: str, name: str) -> None:
    """Compare loads and firing intervals of windows at random angles with the exact model."""
    problem = _read(text + gas + MOUNTS + _objective(name))
    phasing, measure, rng = problem.phasing, problem.objective[0].measure, np.random.default_rng(3)
    windows, firing = windows_of(problem, phasing), firing_bounds(phasing)
    waves = ThrowSearch(problem, phasing, windows, lambda _: None, None).roots[0][0].programs.waves
    norm, seen = waves.norm(measure, waves.samples(measure, 96)), 0
    for window in (windows[k] for k in rng.integers(len(windows), size=6)):
        angles = _drawn(rng, window)
        if angles is None:
            continue
        design, seen = _design(problem, window, angles), seen + 1
        there = replace(phasing.problem_of(design), phasing=None)
        matrix, constants = firing.rows(window)
        turns = firing_turns(phasing.layout_of(design), design.throws, design.firing_order)
        assert matrix @ angles + constants == pytest.approx(intervals_of(phasing.cycle, turns), abs=1e-9)
        rows = norm.fixed.constant.copy()
        for part, wave in zip(waves.parts, norm.waves, strict=True):
            lap = 0 if part.cylinder is None else window.laps[part.cylinder]
            own = np.array([angles[part.pin], *angles[waves.throws :]])
            turned = np.exp(1j * (waves.orders @ own - math.tau * lap * waves.orders[:, 0]))
            rows += np.einsum("h,hkd->kd", turned, wave).real
        result = norm.fixed.norm.value(norm.fixed.grid, rows)
        assert result == pytest.approx(evaluate(there).value(measure), rel=1e-6, abs=norm.left_out)
    assert seen > 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "rest"),
    [
        (VEE, WEIGHTS + _objective("rms mount force")),
        (BOTH, GAS + _objective("mean mount force")),
        (SIX + SHAFT, _objective("rms mount force")),
    ],
)
def test_no_design_in_a_box_of_throws_and_angles_goes_under_its_bound(text: str, rest: str) -> None:
    """Check boxes around random designs with unbalances at their proven optimum."""
    problem, rng, seen = _read(text + MOUNTS + rest), np.random.default_rng(4), 0
    phasing, windows = problem.phasing, windows_of(problem, problem.phasing)
    programs = ThrowSearch(problem, phasing, windows, lambda _: None, None).roots[0][0].programs
    for width in (2.0, 2.0, 2.0, 10.0, 10.0, 40.0, 40.0, 400.0):
        window = windows[rng.integers(len(windows))]
        angles = _drawn(rng, window)
        if angles is None:
            continue
        reach = math.radians(width) * rng.uniform(0.0, 1.0, (2, len(angles)))
        box = programs.box(programs.program(window), angles - reach[0], angles + reach[1], 0.0, math.inf)
        design = _design(problem, window, angles)
        value = StarDesign(design, solve_fixed(replace(phasing.problem_of(design), phasing=None))).value
        assert box is not None
        assert box.bound <= value * (1.0 + 1e-9)
        assert np.all((box.lower <= angles + 1e-9) & (angles <= box.upper + 1e-9))
        assert box.bound >= (0.9 if width < 5.0 else 0.0) * value
        seen += 1
    assert seen > 2


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
    """Compare the bound with cone programs at fixed angles, and with the design."""
    # few samples of a pressure do not give the last digits
    steps = changed(FEW, "360", "720") if gas else FEW
    problem = _read(text + gas + MOUNTS + WEIGHTS + steps + _objective(name))
    result = solve(problem)
    low, high = problem.phasing.bank if of_bank else problem.phasing.split
    grid = [solve(_at(problem, angle, of_bank)).objective.value for angle in np.linspace(low, high, 3)]
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
    problem = _read(text + GAS + MOUNTS + WEIGHTS + FEW + _objective("rms roll moment"))
    result = solve(problem)
    low, high = problem.phasing.bank
    values = [
        solve(_at(problem, angle, True, order)).objective.value
        for angle in np.linspace(low, high, 3)
        for order in ((1, 2), (2, 1))
    ]
    assert result.certificate.lower_bound <= min(values) * (1.0 + 1e-9)
    assert result.objective.value <= min(values) * (1.0 + 1e-6)


@pytest.mark.slow
def test_intervals_bound_the_bank_angle() -> None:
    """Check that firing intervals of at most 420 deg bound the bank angle by 60 deg, and that 380 deg allow none."""
    text = TWIN + MOUNTS + WEIGHTS + _objective("rms shaking force")
    result = solve(_read(changed(text, "min = 225, max = 495", "min = 300, max = 420")))
    assert math.degrees(result.phasing.ranking[0].bank_angle) == pytest.approx(60.0, abs=1e-4)
    assert str(result.certificate.kind) == "global"
    none = solve(_read(changed(text, "min = 225, max = 495", "min = 340, max = 380")))
    assert str(none.status) == "infeasible"


@pytest.mark.slow
def test_weights_at_a_fixed_angle_are_bounded() -> None:
    """A weight at an angle of its own does not turn with the crank: throws are then turned by the bank angle."""
    fixed = '[[counterweights]]\nname = "still"\nx = "50 mm"\nunbalance = "0.01 kg m"\nangle = 30\n'
    problem = _read(TWIN + MOUNTS + WEIGHTS + fixed + _objective("rms shaking force"))
    result = solve(problem)
    grid = [solve(_at(problem, angle, True)).objective.value for angle in np.linspace(*problem.phasing.bank, 7)]
    assert result.certificate.lower_bound <= min(grid) * (1.0 + 1e-9)
    assert result.certificate.gap <= 2e-4


def test_weights_that_depend_on_pin_offsets_have_no_boxes() -> None:
    """Check that shares of masses on offset pins, which change with the offset, have no box bound."""
    share = '[[counterweights]]\nname = "share"\nbalance_factor = 0.5\n'
    problem = _read(SPLIT + MOUNTS + share + _objective("rms shaking force"))
    near, far = (abs(_at(problem, angle, False).engine.rotors[-1].unbalance) for angle in problem.phasing.split)
    assert abs(near - far) > 1e-3
    assert "boxes" not in solve(problem).certificate.method
