"""Boxes of a stiffness matrix in a plane: what is possible stays in what is kept of them (E63)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from laufruhe.extensions.mount_relaxation.parameter_maps import PlaneStiffness


def matrices(plane: PlaneStiffness, generator: np.random.Generator, count: int) -> np.ndarray:
    """K11, K22 and K12 of random stiffnesses and angles, by turning a matrix."""
    k = plane.low + generator.random((count, 2)) * (plane.high - plane.low)
    angles = generator.uniform(*plane.angles, count)
    cosine, sine = np.cos(angles), np.sin(angles)
    turn = np.stack([np.stack([cosine, sine], axis=1), np.stack([-sine, cosine], axis=1)], axis=1)
    found = np.einsum("nai,na,naj->nij", turn, k, turn)
    return np.stack([found[:, 0, 0], found[:, 1, 1], found[:, 0, 1]], axis=1)


def planes(generator: np.random.Generator, count: int) -> list[PlaneStiffness]:
    """Of every width, with angles in all quarters."""
    found = []
    for _ in range(count):
        low = 10.0 ** generator.uniform(0.0, 2.0, 2)
        high = low * 10.0 ** generator.choice([0.0, 0.05, 0.5, 1.5], 2)
        first = generator.uniform(-math.pi, math.pi)
        found.append(
            PlaneStiffness(low, high, (first, first + generator.choice([0.1, 0.8, 1.7, 3.5])), 0.5 * (low + high))
        )
    return found


@pytest.mark.parametrize("seed", range(3))
def test_what_is_possible_stays_in_the_box(seed: int) -> None:
    generator, narrower = np.random.default_rng(seed), 0
    for plane in planes(generator, 60):
        given = matrices(plane, generator, 300)
        whole = plane.full_box
        room = 1e-9 * float(plane.high.max())
        assert np.all(given >= whole[:, 0] - room)
        assert np.all(given <= whole[:, 1] + room)
        for share in (1.0, 0.5, 0.1):
            middle, half = given[0], 0.5 * share * (whole[:, 1] - whole[:, 0])
            box = np.stack([np.maximum(whole[:, 0], middle - half), np.minimum(whole[:, 1], middle + half)], axis=1)
            inside = given[np.all((given >= box[:, 0]) & (given <= box[:, 1]), axis=1)]
            low, high = plane.stiffness_range(box)
            narrower += (low, high) != (float(plane.low.min()), float(plane.high.max()))
            for k11, k22, k12 in inside:
                values = np.linalg.eigvalsh([[k11, k12], [k12, k22]])
                assert low - room <= values[0]
                assert values[1] <= high + room
    assert narrower > 2


@pytest.mark.parametrize("seed", range(2))
def test_a_whole_box_is_reached(seed: int) -> None:
    """Some stiffnesses and angles reach every end."""
    for plane in planes(np.random.default_rng(seed), 20):
        whole = plane.full_box
        ends = np.stack(np.meshgrid(*zip(plane.low, plane.high, strict=True)), axis=-1).reshape(-1, 2)
        angles = np.linspace(*plane.angles, 4001)
        c, s = np.cos(2.0 * angles), np.sin(2.0 * angles)
        p, d = (0.5 * (ends[:, :1] + sign * ends[:, 1:]) for sign in (1.0, -1.0))
        reached = [np.array([entry.min(), entry.max()]) for entry in (p + d * c, p - d * c, d * s)]
        assert whole == pytest.approx(np.array(reached), abs=1e-5 * float(plane.high.max()))
