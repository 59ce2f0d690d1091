"""Bounds of leads with unbalances that turn, compared with designs of boxes (P13)."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from laufruhe.extensions.phase_leads.bounds import minimum_on_arcs
from laufruhe.problem.decision import Decision, RotorDrive, domains_of
from laufruhe.problem.sets import Interval, Sector

DOMAINS = domains_of((
    Decision("size", "kg m", Interval(-0.3, 0.7), 0.0, (RotorDrive("web", 1.0),)),
    Decision("size and angle", "kg m", Sector(0.4), 0.0, (RotorDrive("disc", 1.0),)),
))  # fmt: skip
RATIOS = np.array([0.5, 1.5])


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("turned", [0.0, 1.0])
@pytest.mark.parametrize("size", [1.0, 0.3, 0.01])
def test_no_leads_of_a_box_are_under_its_bound(size: float, turned: float, seed: int) -> None:
    """Check shafts slower and faster than the crank, up to a sixth of their turn on either side."""
    rng, half = np.random.default_rng(seed), size * 1.1 / RATIOS
    columns = sum(domain.width for domain in DOMAINS)
    gradient, slopes, tilts = rng.normal(size=columns), rng.normal(size=2), turned * rng.normal(size=(2, 2, columns))
    bound = minimum_on_arcs(DOMAINS, RATIOS, half, gradient, slopes, tilts)
    minimum = np.inf
    for shares in itertools.product(np.linspace(-1.0, 1.0, 41), repeat=2):
        d = np.array(shares) * half
        pull = gradient + (np.cos(RATIOS * d) - 1.0) @ tilts[0] + (np.sin(RATIOS * d) / RATIOS) @ tilts[1]
        # an interval is least at an end, a disc opposite to its gradient
        own = min(-0.3 * pull[0], 0.7 * pull[0]) - 0.4 * float(np.hypot(*pull[1:]))
        minimum = min(minimum, float(d @ slopes) + own)
    assert bound <= minimum + 1e-12
    assert minimum - bound <= 3.0 * size**2


def test_leads_alone_are_least_at_a_corner() -> None:
    slopes, half = np.array([2.0, -3.0]), np.array([1.5, 0.4])
    bound = minimum_on_arcs((), RATIOS, half, np.zeros(0), slopes, np.zeros((2, 2, 0)))
    assert bound == pytest.approx(min(np.array(ends) * half @ slopes for ends in itertools.product((-1, 1), repeat=2)))


def test_long_arcs_have_no_bound() -> None:
    assert (
        minimum_on_arcs(DOMAINS, RATIOS, np.array([3.0, 0.1]), np.ones(3), np.ones(2), np.zeros((2, 2, 3))) == -np.inf
    )
