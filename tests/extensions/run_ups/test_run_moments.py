"""Moments of long steps of a run (E65), compared with integrals by quadrature."""

from __future__ import annotations

import math

import numpy as np
import pytest

from laufruhe.extensions.run_ups.linear_run import NODES, Sweep
from laufruhe.extensions.run_ups.moments import MOMENTS, RunMoments
from laufruhe.numerics.arrays import Array


@pytest.mark.parametrize("place", [0, 1, 3])
def test_moments_are_integrals_of_the_polynomials_and_sizes_are_over_them(place: int) -> None:
    """Check loads with every second step a hundred times larger, and none before the run."""
    rng = np.random.default_rng(9)
    times, sweep = 4, Sweep(0.0, 0.0, 0.3, 14)
    wrenches = rng.normal(size=(NODES, 6, sweep.count)) * np.where(np.arange(sweep.count) % 2, 100.0, 1.0)
    load = rng.normal(size=(5, 6))
    own = RunMoments(sweep, wrenches.reshape(6 * NODES, -1), load, times)
    result, whole = own.ending_at(place), own.step
    nodes = 0.5 * (np.polynomial.legendre.leggauss(NODES)[0] + 1.0)
    points, shares = np.polynomial.legendre.leggauss(12)
    points, shares = 0.5 * (points + 1.0), 0.5 * shares

    def polynomial(step: int, at: Array) -> Array:
        bases = [np.prod([(at - o) / (n - o) for o in nodes if o != n], axis=0) for n in nodes]
        return np.einsum("as,ai->is", bases, wrenches[:, :, step])

    ahead = -place % times
    assert len(result.impulses) == (ahead + sweep.count) // times
    for long in range(len(result.impulses)):
        moments, push, maximum = np.zeros((MOMENTS, 6)), 0.0, 0.0
        for k in range(times):
            step = long * times - ahead + k
            if step < 0:
                continue
            at, values = (k + points) * sweep.step, polynomial(step, points)
            for order in range(MOMENTS):
                moments[order] += sweep.step * values @ (shares * (whole - at) ** order) / math.factorial(order)
            sizes = np.linalg.norm(load @ polynomial(step, np.linspace(0.0, 1.0, 101)), axis=0)
            maximum, push = max(maximum, float(sizes.max())), push + sweep.step * float(sizes.mean())
        assert result.moments[:, :, long] == pytest.approx(moments, rel=1e-9, abs=1e-12 * np.abs(moments).max())
        assert maximum <= result.peak_loads[long] < 10.0 * maximum
        assert push <= result.impulses[long] < 20.0 * push
    short = own.short(np.array([-1, 2, sweep.count]))
    assert not short[[0, 2]].any()
    values = polynomial(2, points)
    for order in range(4):
        expected = sweep.step * values @ (shares * (sweep.step * (1.0 - points)) ** order) / math.factorial(order)
        assert short[1, order] == pytest.approx(expected, rel=1e-9)
