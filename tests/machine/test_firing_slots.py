"""Firings that throws share out: as even as a search over all angles finds, and never more even than that."""

import itertools
import math

import numpy as np
import pytest

from laufruhe.machine.engine import Cycle
from laufruhe.machine.firing_slots import FiringSlots
from laufruhe.machine.layouts import inline, vee

GRID = 6


def slots(cycle, throws, angle, deviation, sides=(0.5, -0.5)):
    even = cycle.angle / throws / len(sides)
    bounds = (max(even - math.radians(deviation), 0.0), even + math.radians(deviation))
    return FiringSlots(cycle, throws, sides, (math.radians(angle), math.radians(angle)), *bounds)


def least_deviation(cycle, throws, angle):
    """Return the least deviation from even firing over cranks on a grid, cylinders on any turn [deg]."""
    layout = vee(2 * throws, 0.1, math.radians(angle))
    count, minimum = 2 * throws, math.inf
    for rest in itertools.product(range(0, 360, GRID), repeat=throws - 1):
        centres = [
            math.degrees(float(layout.dead_centre_turn(k)) * math.tau) - (0, *rest)[layout.pins[k]]
            for k in range(count)
        ]
        for laps in itertools.product(range(cycle.turns), repeat=count - 1):
            moments = np.sort(
                [(c + 360.0 * lap) % (360.0 * cycle.turns) for c, lap in zip(centres, (0, *laps), strict=True)]
            )
            steps = np.diff([*moments, moments[0] + 360.0 * cycle.turns])
            minimum = min(minimum, float(np.abs(steps - 360.0 * cycle.turns / count).max()))
    return minimum


@pytest.mark.parametrize("angle", [0, 20, 45, 60, 66, 90, 120, 174])
@pytest.mark.parametrize(("cycle", "throws"), [(Cycle.TWO_STROKE, 2), (Cycle.FOUR_STROKE, 2), (Cycle.TWO_STROKE, 3)])
def test_no_pattern_is_more_even(cycle, throws, angle):
    patterns, complete = slots(cycle, throws, angle, 0.0).patterns()
    result = max(abs(i - cycle.angle / throws / 2) for i in patterns[0].intervals(cycle))
    assert complete
    assert result == pytest.approx(patterns[0].broken, abs=1e-7)
    grid = least_deviation(cycle, throws, angle)
    assert math.degrees(result) - 1e-6 <= grid <= math.degrees(result) + GRID


@pytest.mark.parametrize(
    ("throws", "angle"), [*((throws, angle) for throws in (3, 4, 5) for angle in (20.0, 65.0, 90.0)), (6, 65.0)]
)
@pytest.mark.parametrize("cycle", list(Cycle))
def test_moments_keep_banks_apart_and_bounds(cycle, throws, angle):
    own = slots(cycle, throws, angle, 25.0)
    for pattern in own.patterns()[0]:
        assert sorted(slot for members in pattern.members for slot in members) == list(range(2 * throws))
        for left, right in pattern.members:
            apart = pattern.moments[right] - pattern.moments[left] + math.radians(angle)
            assert math.remainder(apart, math.tau) == pytest.approx(0.0, abs=1e-7)
        if pattern.broken <= 1e-7:
            intervals = pattern.intervals(cycle)
            assert own.minimum - 1e-7 <= min(intervals)
            assert max(intervals) <= own.maximum + 1e-7


def test_cylinders_in_line_fire_evenly():
    (pattern,), complete = slots(Cycle.FOUR_STROKE, 5, 0.0, 3.0, sides=(0.0,)).patterns()
    assert complete
    assert np.degrees(pattern.intervals(Cycle.FOUR_STROKE)) == pytest.approx([144.0] * 5)
    assert len(inline(5, 0.1).throw_positions) == len(pattern.members)


def test_no_crank_by_hand_is_less_broken():
    """Compare the best pattern with a crank by hand: six throws at 100 deg that fire 50 or 70 deg apart."""
    moments = [0.0, 50.0, 100.0, 170.0, 220.0, 290.0, 360.0, 430.0, 480.0, 550.0, 620.0, 670.0]
    pairs = [(0, 10), (1, 11), (2, 6), (3, 7), (4, 8), (5, 9)]
    assert all((moments[left] - moments[right] - 100.0) % 360.0 == 0.0 for left, right in pairs)
    by_hand = np.abs(np.diff([*moments, 720.0]) - 60.0).max()
    patterns, _ = slots(Cycle.FOUR_STROKE, 6, 100.0, 0.0).patterns()
    assert math.degrees(patterns[0].broken) <= by_hand + 1e-6
