"""Rows of a star that add up to nothing, and those that are small."""

from __future__ import annotations

import numpy as np

from laufruhe.load_models.star_model import StarNorm, compress_rows
from laufruhe.numerics.norms import NORMS, Grid


def test_roundings_of_what_cancels_are_nothing_and_small_rows_stay() -> None:
    """Take 4000 rows of size 1: cancelled to 1e-15 they are zero, with 1e-12 left they are kept."""
    rows, left = 4000, np.array([1e-15, 1e-12])
    constant = np.ones((rows, 2))
    moves = np.zeros((2, 3, rows, 2))
    moves[0, 1] = -0.5
    moves[1, 2] = -0.5 + np.where(np.arange(rows)[:, None] % 2 == 0, left, -left)
    turns = moves[..., None]
    norm = StarNorm(NORMS["mean"], constant, moves, constant[..., None], turns, Grid(np.full(rows, 1.0 / rows), rows))
    result = norm.at([1, 2])
    for part in (result.constant, result.slope[..., 0]):
        assert not part[:, 0].any()
        assert np.allclose(np.abs(part[:, 1]), 1e-12, rtol=1e-3, atol=0.0)
    assert np.array_equal(norm.at([0, 0]).constant, constant)


def test_fewer_rows_have_the_length_of_all() -> None:
    """Check that compressed rows keep the length of any sum of three arrays, and that few rows stay as they are."""
    r = np.random.default_rng(3)
    parts = [r.normal(size=(40, 2)), r.normal(size=(2, 3, 40, 2))]
    result = compress_rows(parts)
    assert result is not None
    assert result[0].shape == (7, 1)
    for weights in r.normal(size=(5, 2, 3)):
        whole, few = (a + np.einsum("ij,ijkd->kd", weights, b) for a, b in (parts, result))
        assert np.isclose(np.linalg.norm(whole), np.linalg.norm(few), rtol=1e-12)
    assert compress_rows([r.normal(size=(3, 2)), r.normal(size=(5, 3, 2))]) is None
