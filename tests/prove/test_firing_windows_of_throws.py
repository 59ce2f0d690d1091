"""Distance of throws from the even steps, as far as the ends of allowed firing intervals move them (S24)."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from laufruhe.machine import Cycle
from laufruhe.machine.firing import firing_lattice
from laufruhe.problem.phasing import Intervals
from laufruhe.prove.throws.firing_windows_bound import windows
from phasing import engines


def ends_of(count: int, cycle: float, low: float, high: float) -> set[tuple[float, ...]]:
    """Return the intervals that are least or most but for one of them, and add up to a cycle, in every order."""
    found = set()
    for maximum in range(count):
        left = cycle - maximum * high - (count - 1 - maximum) * low
        if low <= left <= high:
            found |= set(itertools.permutations([high] * maximum + [left] + [low] * (count - 1 - maximum)))
    return found


@pytest.mark.parametrize(("count", "cycle"), [(4, "two-stroke"), (4, "four-stroke"), (5, "four-stroke")])
def test_windows_are_those_of_the_most_uneven_firing(tmp_path, count: int, cycle: str) -> None:
    phasing = engines.problem(tmp_path, count, cycle).phasing
    assert phasing is not None
    even, whole = phasing.even_interval, phasing.cycle.angle
    lattice = firing_lattice(phasing.cycle, count)
    for low, high in ((0.8, 1.1), (0.5, 2.0), (0.0, 1.2)):
        lower, upper = windows(phasing, Intervals(low * even, high * even))
        seen = {p: [math.inf, -math.inf] for p in range(lattice.steps)}
        for intervals in ends_of(count, whole, low * even, high * even):
            for s, fires in enumerate([0.0, *np.cumsum(intervals)[:-1]]):
                # a throw that fires later stands less far ahead of its step
                own = seen[-lattice.slots[s] % lattice.steps]
                own[:] = min(own[0], s * even - fires), max(own[1], s * even - fires)
        held = 0 if phasing.cycle is Cycle.TWO_STROKE or count % 2 else None
        for p, (minimum, maximum) in seen.items():
            expected = (0.0, 0.0) if p == held else (minimum, maximum)
            assert (lower[p], upper[p]) == pytest.approx(expected, abs=1e-12)
