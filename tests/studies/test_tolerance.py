"""Free forces from tolerances: known sums, bounds, and the study's order of size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from laufruhe import load
from laufruhe.errors import ModelError
from laufruhe.studies.tolerance import SEVERAL, Tolerances, compared, random_forces, spread, worst_force

PROBLEMS = Path(__file__).resolve().parents[2] / "problems"
KILOPOND = 9.80665


def test_one_unbalance_is_u_omega_squared() -> None:
    problem = load(PROBLEMS / "tractor-six.toml")
    tolerances = Tolerances(unbalance=1e-3, planes=1)
    assert worst_force(problem.engine, 200.0, tolerances) == pytest.approx(1e-3 * 200.0**2)
    drawn = random_forces(problem.engine, 200.0, tolerances, 2000, 1)
    # even over a disc: the mean size is two thirds of the largest
    assert drawn.mean() == pytest.approx(2.0 / 3.0 * 40.0, rel=0.03)


def test_pistons_alone_at_the_dead_centre() -> None:
    """All pistons of a four are at a dead centre together: the worst sum is 2 |s''_top| + 2 |s''_bottom|."""
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    part = problem.engine.slider_cranks[0]
    found = worst_force(problem.engine, 1.0, Tolerances(reciprocating_mass=0.01))
    top, bottom = 1.0 + part.rod_ratio, 1.0 - part.rod_ratio
    assert found == pytest.approx(0.01 * part.crank_radius * 2.0 * (top + bottom), rel=1e-6)


def test_random_engines_stay_under_the_worst() -> None:
    problem = load(PROBLEMS / "vee-six-60.toml")
    tolerances = Tolerances(0.01, 2e-4, 2, 5e-5, (20.0,))
    worst = worst_force(problem.engine, 250.0, tolerances)
    drawn = random_forces(problem.engine, 250.0, tolerances, 1000, 7)
    assert drawn.max() <= worst * (1.0 + 2e-5)
    assert np.array_equal(drawn, random_forces(problem.engine, 250.0, tolerances, 1000, 7))


def test_second_order_outweighs_the_worst_sum() -> None:
    """The paper's 1000 against 100 kp, as an order of size: its tolerances are not printed.

    Assumed: 10 g on a piston of 1.25 kg, 50 g cm on each plane, a flywheel of 30 kg centred to 0.05 mm.
    """
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    tolerances = Tolerances(0.010, 5e-4, 2, 5e-5, (30.0,))
    six = load(PROBLEMS / "tractor-six.toml")
    data = compared({"four": spread(problem, tolerances, 700), "six": spread(six, tolerances, 700)})
    four = data.sel(case="four")
    worst, nominal = float(four["worst"]) / KILOPOND, float(four["nominal"]) / KILOPOND
    assert 10.0 < worst < 100.0
    assert nominal > SEVERAL * worst
    causes = [float(four[f"worst_{cause}"]) for cause in ("reciprocating_masses", "unbalance", "alignment")]
    assert sum(causes) == pytest.approx(float(four["worst"]))
    assert min(causes) > 0.0
    assert float(four["random"].sel(share=0.95)) < 0.9 * float(four["worst"])
    assert float(four["random"].sel(share=1.0)) <= float(four["worst"])
    # the six has only what orders 6, 12, ... leave: there tolerances are all
    assert float(data["nominal"].sel(case="six")) < float(data["worst"].sel(case="six"))


def test_quantiles_are_those_of_the_draws() -> None:
    problem = load(PROBLEMS / "tractor-six.toml")
    tolerances = Tolerances(0.01, 5e-4, 2, 5e-5, (30.0,))
    found = spread(problem, tolerances, 400, seed=3)
    drawn = random_forces(problem.engine, problem.points[0].speed, tolerances, 400, 3)
    assert found.mean == pytest.approx(drawn.mean())
    assert found.random[100] == pytest.approx(np.median(drawn))
    assert found.random[-1] == drawn.max()


def test_several_operating_points_are_refused() -> None:
    problem = load(PROBLEMS / "tractor-six.toml")
    twice = replace(problem, points=problem.points * 2)
    with pytest.raises(ModelError, match="one operating point"):
        spread(twice, Tolerances())


def test_negative_tolerances_are_refused() -> None:
    with pytest.raises(ModelError, match="negative"):
        Tolerances(alignment=-1e-5)
