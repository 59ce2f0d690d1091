"""Ready steam engines and locomotives: proven, and against every angle or weight tried one by one."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from laufruhe.physics.crank_torque import crank_torque
from laufruhe.solvers import Result

PROBLEMS = Path(__file__).parents[2] / "problems"
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def two_crank() -> Result:
    return laufruhe.solve(PROBLEMS / "steam-two-crank.toml")


def test_angle_between_the_cranks_is_the_best_of_all(two_crank: Result) -> None:
    """The torque of one crank twice, shifted through a turn: no angle between 30 and 150 degrees is better."""
    problem = two_crank.problem
    assert two_crank.certificate.kind == "global"
    engine = two_crank.final.engine
    one = crank_torque(replace(engine, slider_cranks=engine.slider_cranks[:1], rotors=()), problem.points[0])
    orders, waves = one.orders[1:13], one.coefficients[1:13]
    angles = np.radians(np.arange(30.0, 150.01, 0.05))
    shifted = waves[:, None] * (1.0 + np.exp(1j * np.outer(orders, angles)))
    values = np.sqrt(0.5 * np.square(np.abs(shifted)).sum(axis=0))
    best = float(values.min())
    assert two_crank.objective.value == pytest.approx(best, rel=1e-5)
    lower = two_crank.certificate.lower_bound
    assert lower is not None
    assert lower <= best * (1.0 + 1e-9)
    throws = [part.throw for part in engine.slider_cranks]
    assert math.degrees(throws[1] - throws[0]) == pytest.approx(math.degrees(angles[values.argmin()]), abs=0.1)


def test_flywheel_of_the_waterworks_engine() -> None:
    result = laufruhe.solve(PROBLEMS / "waterworks-steam-pump.toml")
    assert result.certificate.kind == "global"
    assert result.final.value(result.problem.limits[0].measure) == pytest.approx(1.0 / 40.0, rel=1e-6)
