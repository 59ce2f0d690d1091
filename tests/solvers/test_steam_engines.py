"""Ready steam engines and locomotives, compared with every angle or weight one by one."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import laufruhe
from laufruhe.files.reader import load_tables
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.physics.torque import crank_torque
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.solvers import Result
from ready import solved

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def two_crank() -> Result:
    return solved("steam-two-crank")


def test_angle_between_the_cranks_is_the_best_of_all(two_crank: Result) -> None:
    """Compare with the torque of one crank twice, shifted by angles from 30 to 150 degrees."""
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
    result = solved("waterworks-steam-pump")
    assert result.certificate.kind == "global"
    assert result.final.value(result.problem.limits[0].measure) == pytest.approx(1.0 / 40.0, rel=1e-6)


def test_flywheel_of_the_scotch_yoke_pump() -> None:
    """Compare speed over a turn with the energy of flywheel, yoke and chambers in plain steps."""
    result = solved("scotch-yoke-steam-pump")
    assert result.certificate.kind == "global"
    point = result.problem.points[0]
    gas = gas_loads(result.final.engine, point.gas)
    phi = math.tau * np.arange(4096) / 4096
    torque = gas.values(phi)[:, 3] - gas.coefficients[0, 3].real
    work = np.concatenate([[0.0], np.cumsum(0.5 * (torque[1:] + torque[:-1]))]) * math.tau / 4096
    inertia = result.objective.value + 60.0 * (0.1 * np.sin(phi)) ** 2

    def speeds(start: float) -> np.ndarray:
        return np.sqrt(2.0 * (start + work) / inertia)

    start = brentq(lambda own: np.mean(point.speed / speeds(own)) - 1.0, 1.0 - work.min(), 1e6)
    assert np.ptp(speeds(start)) / point.speed == pytest.approx(1.0 / 20.0, rel=1e-4)


def test_weight_of_kleins_drive() -> None:
    """Check that no weight on a grid about the best is better."""
    result = solved("klein-steam-pump")
    assert result.certificate.kind == "global"
    point, mass, radius, rod, pin = result.problem.points[0], 70.0, 0.1, 0.3, 5.0
    alpha = math.tau * np.arange(2880) / 2880
    orders = np.fft.fftfreq(2880, 1.0 / 2880)
    place = radius * np.cos(alpha) + np.sqrt(rod**2 - (radius * np.sin(alpha)) ** 2)
    along = mass * np.fft.ifft(orders**2 * np.fft.fft(place)).real + pin * radius * np.exp(1j * alpha)
    best = min(
        float(np.abs(along - weight * np.exp(1j * alpha)).max()) * point.speed**2
        for weight in np.arange(4.0, 5.5, 0.002)
    )
    assert result.objective.value == pytest.approx(best, rel=1e-3)
    assert result.objective.value <= best * (1.0 + 1e-6)


@pytest.mark.parametrize("quantity", ["rms roll moment", "degree of irregularity"])
def test_stars_differ_by_chambers_of_some_cylinders(quantity: str) -> None:
    """Check two working cylinders of four, adjacent in the star or opposite."""
    steam = {"admission": "9 bar", "cut_off": 0.4, "back_pressure": "1.2 bar", "release": 0.93, "compression": 0.15}
    power = {"cylinders": [1, 2], "end": "head", "bore": "90 mm", "steam": {**steam, "clearance": 0.06}}

    def problem(**throws: Any) -> Problem:
        engine = {"layout": "inline", "cycle": "two-stroke", "stroke": "100 mm", "bore": "90 mm", "rod_ratio": 0.25}
        engine |= {"reciprocating_mass": "1 kg", "cylinder_spacing": "110 mm", **throws}
        tables = {"title": "Half a steam engine", "engine": engine, "operating_points": [{"speed": "600 rpm"}]}
        tables |= {"gas": {"model": "chambers", "chambers": [power]}, "flywheel": {"inertia": "20 kg m^2"}}
        return load_tables({**tables, "objective": {"minimise": quantity}}, Path("half.toml"))

    stars = [problem(throws=[0, *rest]) for rest in itertools.permutations((90, 180, 270))]
    values = [objective_value(star, evaluate(star)) for star in stars]
    assert max(values) > 1.05 * min(values)
    result = laufruhe.solve(problem(throws="open", cylinders=4))
    assert result.objective is not None
    assert result.certificate is not None
    assert result.objective.value == pytest.approx(min(values), rel=1e-9)
    assert str(result.certificate.kind) == "global"
