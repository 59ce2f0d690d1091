"""Norms of many designs against the norms of each, and what blocks and threads may change: nothing."""

from __future__ import annotations

import numpy as np
import pytest

from laufruhe.load_models import batch
from laufruhe.load_models.batch import BatchNorm
from laufruhe.numerics.norms import NORMS, Grid, Norm

DESIGNS, FEATURES, ROWS = 70, 5, 40


def _batch(norm: Norm, components: int) -> tuple[BatchNorm, np.ndarray]:
    rng = np.random.default_rng(components)
    rows = rng.normal(size=(components, FEATURES, ROWS))
    return BatchNorm(norm, rows, Grid(rng.uniform(0.1, 1.0, ROWS), ROWS)), rng.normal(size=(DESIGNS, FEATURES))


@pytest.mark.parametrize("norm", NORMS.values())
@pytest.mark.parametrize("components", [1, 2, 3])
def test_norm_of_each_design(norm: Norm, components: int) -> None:
    norms, features = _batch(norm, components)
    expected = [norm.value(norms.grid, np.einsum("cfk,f->kc", norms.rows, design)) for design in features]
    np.testing.assert_allclose(norms.values(features), expected, rtol=1e-13)


@pytest.mark.parametrize("components", [1, 2, 3])
def test_blocks_and_threads_change_no_digit_that_counts(components: int, monkeypatch: pytest.MonkeyPatch) -> None:
    norms, features = _batch(NORMS["mean"], components)
    alone = norms.values(features)
    monkeypatch.setattr(batch, "CACHE_BYTES", 1)
    np.testing.assert_array_equal(norms.values(features, threads=2), norms.values(features))
    np.testing.assert_allclose(norms.values(features), alone, rtol=1e-14)


@pytest.mark.parametrize("components", [2, 3])
def test_turning_every_row_changes_nothing(components: int) -> None:
    norms, features = _batch(NORMS["maximum"], components)
    turn, _ = np.linalg.qr(np.random.default_rng(9).normal(size=(components, components)))
    turned = BatchNorm(norms.norm, np.einsum("cd,dfk->cfk", turn, norms.rows), norms.grid)
    np.testing.assert_allclose(turned.values(features), norms.values(features), rtol=1e-13)
