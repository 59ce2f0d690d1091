"""The diameter of the smallest ball that holds a signal, against brute force and as an objective with proof."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.optimize import minimize

from laufruhe.files.reader import load
from laufruhe.numerics.norms import NORMS, Grid
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.solvers import solve

NORM = NORMS["peak to peak"]

SINGLE = """
title = "Single"
[engine]
layout = "inline"
cycle = "four-stroke"
stroke = "90 mm"
rod_ratio = 0.28
reciprocating_mass = "0.6 kg"
throws = [0]
[[operating_points]]
speed = "3000 rpm"
[[counterweights]]
name = "web"
balance_factor = { between = [0, 1] }
[objective]
minimise = "peak to peak shaking force"
"""


def grid(count: int, groups: int = 1) -> Grid:
    return Grid(np.full(groups * count, 1.0 / (groups * count)), count)


def smallest_ball(points):
    """Return the smallest ball over all balls of two, three and four points that holds all points."""
    best = np.inf
    for size in range(2, points.shape[1] + 2):
        for subset in itertools.combinations(range(len(points)), size):
            chosen = points[list(subset)]
            apart = chosen[1:] - chosen[0]
            along = np.linalg.lstsq(2.0 * apart, (apart**2).sum(axis=1), rcond=None)[0]
            centre = chosen[0] + along
            radius = np.linalg.norm(chosen[0] - centre)
            if np.linalg.norm(points - centre, axis=1).max() <= radius * (1.0 + 1e-9):
                best = min(best, radius)
    return 2.0 * best


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("components", [2, 3])
def test_the_diameter_is_that_of_brute_force(components, seed):
    points = np.random.default_rng(seed).normal(size=(11, components))
    assert NORM.value(grid(11), points) == pytest.approx(smallest_ball(points), rel=1e-9)


def test_one_component_is_the_largest_less_the_smallest():
    values = np.random.default_rng(0).normal(size=(50, 1)) + 30.0
    assert NORM.value(grid(50), values) == pytest.approx(np.ptp(values), rel=1e-12)


def test_a_shift_and_a_turn_change_nothing_and_the_largest_signal_counts():
    rng = np.random.default_rng(1)
    signal = rng.normal(size=(40, 3))
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    value = NORM.value(grid(40), signal)
    assert NORM.value(grid(40), signal @ turn + 5.0) == pytest.approx(value, rel=1e-11)
    assert NORM.value(grid(40, 2), np.concatenate([0.5 * signal, signal + 9.0])) == pytest.approx(value, rel=1e-11)


def test_points_in_one_place_have_no_diameter():
    assert NORM.value(grid(9), np.full((9, 3), 2.5)) == pytest.approx(0.0, abs=1e-12)
    assert NORM.value(grid(9), np.zeros((9, 2))) == 0.0


def test_a_single_is_balanced_to_a_proven_optimum(tmp_path):
    path = tmp_path / "single.toml"
    path.write_text(SINGLE, encoding="utf-8")
    problem = load(path)
    result = solve(problem)
    assert result.certificate.kind == "global"

    def value(share):
        return objective_value(problem, evaluate(problem, problem.design([complex(float(share[0]))])))

    actual = minimize(value, [0.4], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-9})
    assert result.objective.value == pytest.approx(actual.fun, rel=1e-6)
    assert result.certificate.lower_bound <= actual.fun * (1.0 + 1e-9)
