"""Least of affine functions of masses and unbalances on a box of sizes, compared with its corners."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

from laufruhe.extensions.sizes.boxes import SizeBoxes
from laufruhe.extensions.sizes.bundles import GroupedRows, SizeReach
from laufruhe.extensions.sizes.model import MASSES, Piece, plain
from laufruhe.extensions.sizes.rod_series import RodSeries, _lengths
from laufruhe.load_models.affine import AffineNorm
from laufruhe.numerics.norms import NORMS
from laufruhe.problem.decision import Decision, Domain
from laufruhe.problem.sets import Interval, Sector


def test_the_least_is_that_of_a_corner() -> None:
    random = np.random.default_rng(2)
    sets = [Interval(0.2, 0.5), Sector(0.3, (0.0, math.tau))]
    domains = (Domain(Decision("a", "kg m", sets[0], 0j, ()), 0), Domain(Decision("b", "kg m", sets[1], 0j, ()), 1))
    low = random.uniform(-1.0, 1.0, MASSES)
    high = low + random.uniform(0.0, 1.0, MASSES)
    reach = SizeReach(low, high, (0.1, 0.2), domains)
    turns = np.linspace(0.0, math.tau, 721)
    disc = 0.3 * np.array([np.cos(turns), np.sin(turns)])
    for function in random.normal(size=(20, 1 + MASSES + 3)):
        masses = min(function[1 : 1 + MASSES] @ corner for corner in itertools.product(*zip(low, high, strict=True)))
        weights = min(function[1 + MASSES] * x for x in (0.2, 0.5)) + float((function[-2:] @ disc).min())
        brute = function[0] + masses + weights
        assert brute - 1e-4 <= float(reach.minimum(function[None])[0]) <= brute + 1e-12
    assert reach.maximum.tolist() == [1.0, *np.maximum(np.abs(low), np.abs(high)), 0.5, 0.3, 0.3]


def test_each_size_takes_numbers_one_way_or_is_refused() -> None:
    names = [SimpleNamespace(name=name) for name in ("bore", "stroke")]
    model = SimpleNamespace(lower=np.zeros(2), upper=np.ones(2), problem=SimpleNamespace(decisions=names))
    boxes = SimpleNamespace(model=model)
    assert SizeBoxes._monotonicity(boxes, lambda x: np.array([x[0] + x[1], x[1]])).tolist() == [1.0, 1.0]
    assert SizeBoxes._monotonicity(boxes, lambda x: np.array([-2.0 * x[1], 3.0])).tolist() == [0.0, -1.0]
    with pytest.raises(ValueError, match="not monotonic in bore"):
        SizeBoxes._monotonicity(boxes, lambda x: np.array([x[0], -x[0]]))
    # it rises where the other is least, and falls where that is most
    with pytest.raises(ValueError, match="not monotonic in bore"):
        SizeBoxes._monotonicity(boxes, lambda x: np.array([x[0] * (0.5 - x[1])]))


def piece_of(random: np.random.Generator, rows: int, columns: int, norm: str) -> Piece:
    constant, slope = random.normal(size=(rows, 3)), random.normal(size=(rows, 3, columns))
    return Piece(AffineNorm(NORMS[norm], constant, slope, plain(rows)), ((0, None, rows),), ())


def test_a_series_between_two_lengths_is_that_of_its_nodes() -> None:
    """Check that rows polynomial in the reciprocal length are exact at every length."""
    random, (low, high), terms = np.random.default_rng(3), (0.15, 0.35), 5
    piece, powers = piece_of(random, 4, 2, "mean"), random.normal(size=(terms, 4, 3))

    def rows(length: float) -> np.ndarray:
        return np.tensordot(length ** -np.arange(terms), powers, axes=1)

    nodes = np.array([rows(length) for length in _lengths(low, high, terms)])
    series = RodSeries(piece, low, high, nodes, np.stack([nodes, 2.0 * nodes], axis=-1), np.zeros(3))
    for length in (low, 0.2, 0.31, high):
        rows_at = series.at_length(length)
        assert rows_at.constant == pytest.approx(rows(length), rel=1e-9)
        assert rows_at.slope[..., 1] == pytest.approx(2.0 * rows(length), rel=1e-9)


def test_rows_without_factors_are_summed_as_they_are() -> None:
    random = np.random.default_rng(4)
    series = RodSeries.fixed(piece_of(random, 4, 2, "mean"), 0.2)
    z = random.normal(size=(4, 3))
    total, largest = GroupedRows.from_rows(series, z).with_factors(())
    assert total[0] == pytest.approx([np.sum(z * series.constant[0]), *np.einsum("kd,kdn->n", z, series.slope[0])])
    assert largest == 1.0
