"""Smallest balls of many sets at once: each holds all of its points, and none that is smaller could."""

from __future__ import annotations

import numpy as np
import pytest

from laufruhe.numerics.norms.peak_to_peak import enclosing_balls


def sets_of(kind: str, d: int) -> np.ndarray:
    """Return sets of shape (40, 30, d)."""
    rng = np.random.default_rng(d)
    points = rng.normal(size=(40, 30, d))
    if kind == "in a line":
        points = points[..., :1] * rng.normal(size=d)
    elif kind == "on a grid":
        points = np.round(2.0 * points)
    elif kind == "on a sphere":
        points /= np.linalg.norm(points, axis=-1, keepdims=True)
    elif kind == "in one place":
        points = 1.0 + 1e-13 * points
    return points * 10.0 ** rng.uniform(-9.0, 9.0, (40, 1, 1)) + (kind == "far away") * 1e6


@pytest.mark.parametrize("kind", ["anywhere", "in a line", "on a grid", "on a sphere", "in one place", "far away"])
@pytest.mark.parametrize("d", [1, 2, 3, 6])
def test_a_ball_holds_all_and_has_its_centre_between_points_on_it(kind: str, d: int) -> None:
    """Check both conditions, which prove that no ball is smaller."""
    points = sets_of(kind, d)
    balls, size = enclosing_balls(points), np.abs(points).max(axis=(1, 2))
    rows = np.arange(len(points))[:, None]
    held = points[rows, balls.support]
    apart = np.linalg.norm(points - balls.centres[:, None], axis=2).max(axis=1)
    assert np.all(apart <= balls.radii + 1e-12 * size)
    assert np.all(balls.shares >= 0.0)
    np.testing.assert_allclose(balls.shares.sum(axis=1), 1.0, rtol=1e-12)
    between = np.einsum("sk,skd->sd", balls.shares, held)
    assert np.all(np.linalg.norm(between - balls.centres, axis=1) <= 1e-12 * size)
    on = np.linalg.norm(held - balls.centres[:, None], axis=2)
    # the square of a radius is the mean of those of its points, by their shares
    assert np.all(np.abs(np.sqrt(np.einsum("sk,sk->s", balls.shares, on**2)) - balls.radii) <= 1e-7 * size)


def test_many_together_are_as_one_by_one() -> None:
    points = sets_of("anywhere", 3)
    alone = [enclosing_balls(each[None]).radii[0] for each in points]
    np.testing.assert_allclose(enclosing_balls(points).radii, alone, rtol=1e-14)


def test_an_empty_set_has_no_ball() -> None:
    assert enclosing_balls(np.zeros((0, 5, 3))).radii.shape == (0,)
    np.testing.assert_array_equal(enclosing_balls(np.zeros((2, 5, 3))).radii, 0.0)
