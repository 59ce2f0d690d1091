"""Curves, prices, pictures and open weights of the ready rotary engines."""

from __future__ import annotations

import math

import numpy as np
import pytest

from laufruhe import load, solve
from laufruhe.extensions.flywheel.torque import torque_parts
from laufruhe.extensions.twins import picture as twins
from laufruhe.report.tables import number_tables
from laufruhe.solvers import evaluate_only
from laufruhe.solvers.prices import Price
from problem_files import PROBLEMS


@pytest.mark.slow
def test_chambers_of_rotors_make_the_torque_of_the_gas() -> None:
    result = evaluate_only(load(PROBLEMS / "rotary-two.toml"))
    sheet, point = number_tables(result)["chambers"], result.problem.points[0]
    rows = np.array([row[2:] for row in sheet.rows if row[0] == point.name], dtype=float)
    steps = len(np.unique(rows[:, 1]))
    mean = rows[:, 4].reshape(-1, steps)[:, :-1].mean(axis=1).sum()
    torque = torque_parts(result.final.engine, point, result.problem.fidelity)["gas"]
    assert mean == pytest.approx(float(torque.at(0).real), rel=1e-3)
    volumes = rows[:, 2].reshape(-1, steps)
    assert volumes.min(axis=1) == pytest.approx(0.0, abs=1e-12)
    assert np.ptp(volumes.max(axis=1)) < 1e-12


@pytest.mark.slow
def test_limits_of_zero() -> None:
    """Check prices of limits of zero: 1 N m of couple saves weight, and no price exists for a tighter limit."""
    result = solve(PROBLEMS / "rotary-four-open.toml")
    prices = {limit.name: limit.price for limit in result.limits}
    speed = 8000.0 * math.tau / 60.0
    price = prices["maximum rocking couple"]
    assert price.relaxed == pytest.approx(2.0 / (0.56 * 0.05 * speed**2), rel=1e-3)
    assert price.tightened == math.inf
    assert prices["maximum shaking force"] == Price(0.0, math.inf)


def test_weights_of_open_size_and_angle_are_found_by_their_names() -> None:
    problem = load(PROBLEMS / "rotary-two.toml")
    for decision in problem.decisions:
        fixed = problem.fix(decision.name, f"{0.5 * (decision.lower + decision.upper)!r} {decision.unit}")
        assert decision.name not in {other.name for other in fixed.decisions}


def test_two_balanced_rotors_have_no_picture_of_a_twin() -> None:
    assert not twins.applies(solve(load(PROBLEMS / "rotary-two.toml")))
