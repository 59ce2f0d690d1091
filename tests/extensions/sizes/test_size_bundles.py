"""The least of affine functions of masses and unbalances on a box of sizes, against its corners."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

from laufruhe.extensions.sizes.boxes import SizeBoxes
from laufruhe.extensions.sizes.bundles import SizeReach
from laufruhe.extensions.sizes.model import MASSES
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
