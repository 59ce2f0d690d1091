"""Mount forces, compared with closed forms in plain NumPy at the same crank angles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import laufruhe
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.physics.shaking_loads import shaking_loads
from problem_files import PROBLEMS
from validation.plain_forces import plain_engine

SAMPLES = 1440


@pytest.mark.parametrize("with_gas", [True, False])
@pytest.mark.parametrize("rod_ratio", [0.26, 0.31])
@pytest.mark.parametrize("speed", [150.0, 261.8])
def test_mount_forces_of_a_four_cylinder(with_gas: bool, rod_ratio: float, speed: float) -> None:
    problem = laufruhe.load(PROBLEMS / "tractor-four-lanchester.toml")
    engine = problem.design([0.05 + 0.02j, 0.03j, 0.01, 0.01j])
    parts = tuple(replace(part, rod_length=part.crank_radius / rod_ratio) for part in engine.slider_cranks)
    engine = replace(engine, slider_cranks=parts)
    point = replace(problem.points[0], speed=speed, gas=problem.points[0].gas if with_gas else None)
    forces = rigid_mounting(engine.mounts).forces(shaking_loads(engine, point)).sample(SAMPLES)
    plain = plain_engine(engine, point, SAMPLES)
    largest = np.abs(forces).max()
    assert np.abs(forces - plain.forces(rod_ratio, speed)).max() < 1e-9 * largest
    assert np.abs(forces - plain.truncated(rod_ratio)(speed)).max() < 1e-9 * largest
