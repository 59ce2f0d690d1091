"""Rotating mass of a throw, which loads the bearings and no crank pin, in every layout."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.extensions.bearing_loads.machine import bearings_of
from laufruhe.extensions.bearing_loads.physics import main_bearing_forces, pin_forces

MASS, PIN, RADIUS, ROD, STEPS = 0.6, 0.5, 0.045, 0.16, 720
SHARED: dict[str, Any] = {
    "cycle": "two-stroke", "stroke": "90 mm", "rod_length": "160 mm", "reciprocating_mass": "0.6 kg",
    "rotating_mass": "0.5 kg",
}  # fmt: skip
ENGINES: dict[str, tuple[dict[str, Any], str]] = {
    "parts": ({"layout": "parts", "slider_cranks": [{"x": "0 mm", "throw": 30.0}]}, "crankshaft"),
    "own mass": (
        {
            "layout": "parts", "rotating_mass": "0.1 kg",
            "slider_cranks": [{"x": "0 mm", "throw": 30.0, "rotating_mass": "0.5 kg"}],
        },
        "crankshaft",
    ),
    "geared": (
        {
            "layout": "parts", "shafts": [{"name": "fast", "ratio": -1, "position": ["200 mm", "0 mm"], "lead": 20.0}],
            "slider_cranks": [{"x": "0 mm", "throw": 50.0, "shaft": "fast"}],
        },
        "fast",
    ),
    "opposed pistons": (
        {"layout": "opposed-piston", "cylinders": 1, "throws": [30.0], "crank_distance": "600 mm"}, "second crankshaft",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ENGINES)
def test_pins_carry_the_rod_and_bearings_the_throw_as_well(name: str) -> None:
    """A massless rod pushes along itself: accelerations by differences, with the turning mass at the bearings alone."""
    engine, shaft = ENGINES[name]
    bearings = [{"x": x, "shaft": shaft} for x in ("-60 mm", "60 mm")]
    if shaft == "second crankshaft":
        bearings += [{"x": x, "name": f"lower {x}"} for x in ("-60 mm", "60 mm")]
    problem = laufruhe.load(
        {"title": name, "operating_points": [{"speed": "3000 rpm"}], "engine": SHARED | engine,
         "main_bearings": bearings}
    )  # fmt: skip
    part, point = problem.engine.slider_cranks[-1], problem.points[0]
    assert part.shaft.name == shaft
    phi = math.tau * np.arange(STEPS) / STEPS

    def rod(angle: np.ndarray) -> np.ndarray:
        across = RADIUS * np.sin(part.shaft.ratio * angle + part.throw - part.bank)
        return np.sqrt(ROD**2 - across**2) - 1j * across

    def piston(angle: np.ndarray) -> np.ndarray:
        return RADIUS * np.cos(part.shaft.ratio * angle + part.throw - part.bank) + rod(angle).real

    step = 1e-3
    acceleration = point.speed**2 * (piston(phi + step) - 2.0 * piston(phi) + piston(phi - step)) / step**2
    pushed = -MASS * acceleration / rod(phi).real * rod(phi) * np.exp(1j * part.bank)
    turning = PIN * RADIUS * point.speed**2 * np.exp(1j * (part.shaft.ratio * phi + part.throw))
    pin = pin_forces(problem.engine, point).sample(STEPS)[:, -1]
    on_shaft = [k for k, bearing in enumerate(bearings_of(problem.engine)) if bearing.shaft.name == shaft]
    carried = main_bearing_forces(problem.engine, point).sample(STEPS)[:, on_shaft].sum(axis=1)
    size = np.abs(pushed).max()
    assert np.abs(pin[:, 2] + 1j * pin[:, 1] - pushed).max() < 1e-5 * size
    assert np.abs(carried[:, 2] + 1j * carried[:, 1] - pushed - turning).max() < 1e-5 * size
