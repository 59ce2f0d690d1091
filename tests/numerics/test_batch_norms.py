"""Norms of many designs against the norms of each, and what blocks and threads may change: nothing."""

from __future__ import annotations

import numpy as np
import pytest

from laufruhe.numerics.batch_norms import BatchNorm
from laufruhe.numerics.norms import NORMS, Grid, Norm

DESIGNS, FEATURES, ROWS = 70, 5, 40


def _batch(norm: Norm, components: int) -> tuple[BatchNorm, np.ndarray]:
    rng = np.random.default_rng(components)
    rows = rng.normal(size=(components, FEATURES, ROWS))
    return BatchNorm(norm, rows, Grid(rng.uniform(0.1, 1.0, ROWS), ROWS)), rng.normal(size=(DESIGNS, FEATURES))


@pytest.mark.parametrize("norm", NORMS.values())
@pytest.mark.parametrize("components", [1, 2, 3])
def test_norm_of_each_design(norm: Norm, components: int) -> None:
    batch, features = _batch(norm, components)
    wanted = [norm.value(batch.grid, np.einsum("cfk,f->kc", batch.rows, design)) for design in features]
    np.testing.assert_allclose(batch.values(features), wanted, rtol=1e-13)
    np.testing.assert_allclose([batch.value(design) for design in features], wanted, rtol=1e-13)


@pytest.mark.parametrize("components", [1, 2, 3])
def test_blocks_and_threads_change_no_digit_that_counts(components: int) -> None:
    batch, features = _batch(NORMS["mean"], components)
    alone = batch.values(features)
    np.testing.assert_array_equal(batch.values(features, threads=2, cache_bytes=1), batch.values(features, 1, 1))
    np.testing.assert_allclose(batch.values(features, cache_bytes=1), alone, rtol=1e-14)


@pytest.mark.parametrize("components", [2, 3])
def test_turning_every_row_changes_nothing(components: int) -> None:
    batch, features = _batch(NORMS["maximum"], components)
    turn, _ = np.linalg.qr(np.random.default_rng(9).normal(size=(components, components)))
    turned = BatchNorm(batch.norm, np.einsum("cd,dfk->cfk", turn, batch.rows), batch.grid)
    np.testing.assert_allclose(turned.values(features), batch.values(features), rtol=1e-13)
