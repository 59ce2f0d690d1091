"""Prices on both sides of a limit against linear programs whose limits move (P5, P19)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import linprog

from laufruhe.solvers.prices import Price, Slopes, prices_of

Array = np.ndarray


def moved(slope: Array, rows: list[Array], k: int, by: float) -> float:
    """Return the least slope . x where no row of limit k is over `by`, and none of others over zero."""
    above = np.concatenate([np.full(len(own), by if k == j else 0.0) for j, own in enumerate(rows)])
    result = linprog(slope, A_ub=np.concatenate(rows), b_ub=above, bounds=[(None, None)] * len(slope))
    return {2: math.inf, 3: -math.inf}.get(result.status, result.fun)


@pytest.mark.parametrize("seed", range(12))
def test_prices_are_what_the_optimum_moves_by(seed: int) -> None:
    """Check smooth limits, limits with a kink and edges, some of them inactive."""
    random = np.random.default_rng(seed)
    kinds = [(1, 1, 1), (2, 1, 1), (1, 2, 1), (2, 2, 1)][seed % 4]
    rows = [random.normal(size=(count, 3)) for count in kinds]
    if seed >= 8:
        # one more limit that says the same as another
        rows.append(rows[0].copy())
    slope = -sum(random.uniform(0.5, 1.0, len(own)) @ own for own in rows)
    limits, edges = rows[:2] + rows[3:], rows[2]
    prices = prices_of([Slopes.smooth(slope)], [Slopes(own, np.zeros((0, 3))) for own in limits], edges)
    assert prices is not None
    ordered = [*limits, edges]
    for k, price in enumerate(prices):
        assert price.relaxed == pytest.approx(-moved(slope, ordered, k, 1.0), rel=1e-4, abs=1e-4)
        assert price.tightened == pytest.approx(moved(slope, ordered, k, -1.0), rel=1e-4, abs=1e-4)


def test_sides_are_one_where_they_differ_by_less_than_counts() -> None:
    assert Price.both(3.0).is_equal
    assert Price.both(3.0).other is None
    assert Price(0.99, 1.0).other is None
    assert Price(0.9, 1.0).other == 1.0
    assert Price(0.0, 1.0).other == 1.0
    assert Price(0.0, 0.0).is_equal
