"""Box of all stiffness matrices in a plane (E63)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from laufruhe.extensions.mount_relaxation.parameter_maps import PlaneStiffness


def planes(generator: np.random.Generator, count: int) -> list[PlaneStiffness]:
    """Return random plane stiffnesses of every width, with angles in all quarters."""
    found = []
    for _ in range(count):
        low = 10.0 ** generator.uniform(0.0, 2.0, 2)
        high = low * 10.0 ** generator.choice([0.0, 0.05, 0.5, 1.5], 2)
        first = generator.uniform(-math.pi, math.pi)
        found.append(
            PlaneStiffness(low, high, (first, first + generator.choice([0.1, 0.8, 1.7, 3.5])), 0.5 * (low + high))
        )
    return found


@pytest.mark.parametrize("seed", range(2))
def test_a_whole_box_is_reached(seed: int) -> None:
    """Check that some stiffnesses and angles reach every end."""
    for plane in planes(np.random.default_rng(seed), 20):
        whole = plane.full_box
        ends = np.stack(np.meshgrid(*zip(plane.low, plane.high, strict=True)), axis=-1).reshape(-1, 2)
        angles = np.linspace(*plane.angles, 4001)
        c, s = np.cos(2.0 * angles), np.sin(2.0 * angles)
        p, d = (0.5 * (ends[:, :1] + sign * ends[:, 1:]) for sign in (1.0, -1.0))
        reached = [np.array([entry.min(), entry.max()]) for entry in (p + d * c, p - d * c, d * s)]
        assert whole == pytest.approx(np.array(reached), abs=1e-5 * float(plane.high.max()))
