"""Even firing: which stars, which orders."""

import itertools
import math
from dataclasses import replace

import pytest

from laufruhe.machine import Cycle
from laufruhe.machine.engine import Engine
from laufruhe.machine.firing import (
    NoEvenStarError,
    even_orders,
    even_patterns,
    firing_lattice,
    firing_turns,
    intervals_of,
    lap_orders,
    longest_bank_gap,
    order_content,
    star_throws,
    successive_neighbours,
)
from laufruhe.machine.layouts import build, inline, vee
from mechanisms import mechanism_of

FOUR, TWO = Cycle.FOUR_STROKE, Cycle.TWO_STROKE
MECHANISM = mechanism_of(0.05, 0.2, 1.0)
RIGHT = math.pi / 2


@pytest.mark.parametrize(
    ("cycle", "layout", "patterns"),
    [
        (FOUR, inline(4, 1.0), {(2, 2)}),
        (FOUR, inline(5, 1.0), {(1,) * 5}),
        (FOUR, inline(6, 1.0), {(2, 2, 2)}),
        (TWO, inline(4, 1.0), {(1, 1, 1, 1)}),
        (TWO, inline(6, 1.0), {(1,) * 6}),
        (FOUR, vee(8, 1.0, RIGHT), {(1, 1, 1, 1), (2, 0, 2, 0)}),
        (FOUR, vee(6, 1.0, RIGHT, math.radians(30)), {(1, 1, 1)}),
        (FOUR, vee(12, 1.0, math.radians(60)), {(1,) * 6, (2, 0, 2, 0, 2, 0)}),
        (FOUR, vee(20, 1.0, math.radians(72)), {(1,) * 10}),
    ],
)
def test_patterns(cycle, layout, patterns):
    assert set(even_patterns(cycle, layout)) == patterns


@pytest.mark.parametrize("cylinders", range(1, 9))
@pytest.mark.parametrize("cycle", [TWO, FOUR])
def test_patterns_are_all_the_even_stars(cycle, cylinders):
    """Any assignment of firings to cylinders gives a star, and no other star is even."""
    steps = firing_lattice(cycle, cylinders).steps
    seen = set()
    for order in itertools.permutations(range(cylinders)):
        throws = [0] * cylinders
        for slot, k in enumerate(order):
            throws[k] = (-slot * cycle.turns * steps // cylinders) % steps
        if throws[0] == 0:
            seen.add(tuple(throws.count(p) for p in range(steps)))
        if cylinders > 6 and len(seen) > 1:
            break
    assert set(even_patterns(cycle, inline(cylinders, 1.0))) == seen


def test_a_vee_that_cannot_fire_evenly_says_why():
    with pytest.raises(NoEvenStarError, match=r"multiple of 120 deg, and they make 90 deg"):
        even_patterns(FOUR, vee(6, 1.0, RIGHT))
    with pytest.raises(NoEvenStarError, match="the same arrangement of cylinders"):
        even_patterns(FOUR, replace(vee(4, 1.0, 0.0), banks=(0.0, 0.0, 0.0, math.pi)))


@pytest.mark.parametrize(
    ("cycle", "layout", "star", "count", "one"),
    [
        (FOUR, inline(6, 1.0), (0, 2, 1, 1, 2, 0), 4, (1, 5, 3, 6, 2, 4)),
        (FOUR, inline(4, 1.0), (0, 1, 1, 0), 2, (1, 3, 4, 2)),
        (TWO, inline(4, 1.0), (0, 3, 1, 2), 1, (1, 2, 4, 3)),
        (FOUR, vee(8, 1.0, RIGHT), (0, 1, 3, 2), 8, None),
    ],
)
def test_orders_of_a_star(cycle, layout, star, count, one):
    orders = list(even_orders(cycle, layout, star))
    assert len(set(orders)) == len(orders) == count
    assert one is None or one in orders
    steps = firing_lattice(cycle, len(layout.positions)).steps
    for order in orders:
        throws = star_throws(layout, star, steps)
        parts, _ = build(cycle, layout, MECHANISM, throws, order)
        engine = Engine("even", cycle, parts)
        assert engine.slider_cranks[0].firing_angle == pytest.approx(0.0, abs=1e-12)
        assert engine.firing_intervals == pytest.approx([cycle.angle / len(order)] * len(order), rel=1e-12)
        turns = firing_turns(layout, throws, order)
        assert intervals_of(cycle, turns) == pytest.approx(engine.firing_intervals, rel=1e-9)
        assert order_content(cycle, turns) == pytest.approx(0.0, abs=1e-9)


def test_orders_are_all_there_are():
    layout, star = inline(6, 1.0), (0, 1, 2, 2, 1, 0)
    throws = star_throws(layout, star, 3)
    by_laps = {
        order
        for order in lap_orders(FOUR, layout, throws)
        if max(i := intervals_of(FOUR, firing_turns(layout, throws, order))) - min(i) < 1e-9
    }
    assert by_laps == set(even_orders(FOUR, layout, star))


def test_measures_of_orders():
    layout = inline(4, 1.0)
    assert successive_neighbours(layout, (1, 2, 3, 4)) == 3
    assert successive_neighbours(layout, (1, 3, 2, 4)) == 1
    cross = vee(8, 1.0, RIGHT)
    order = next(even_orders(FOUR, cross, (0, 1, 3, 2)))
    throws = star_throws(cross, (0, 1, 3, 2), 4)
    # two left-hand or right-hand cylinders follow each other somewhere in a cross-plane V8
    assert longest_bank_gap(FOUR, cross, order, firing_turns(cross, throws, order)) > math.radians(180.0)
    # two cylinders at 180 and 540 deg leave all of order 1 (S9): |1 + e^{-i pi}| = 0 there, half orders stay
    assert order_content(FOUR, (0.0, 0.5)) == pytest.approx(abs(1 + complex(0, -1)) / 2)


def test_pistons_that_rise_together_fire_a_turn_apart():
    """The two of a four-stroke parallel twin: one dead centre, one turn between the firings."""
    layout = inline(2, 0.1)
    assert intervals_of(FOUR, firing_turns(layout, (0.0, 0.0), (1, 2))) == pytest.approx([math.tau] * 2)
    parts, _ = build(FOUR, layout, MECHANISM, (0.0, 0.0), (1, 2))
    assert [part.firing_angle for part in parts] == pytest.approx([0.0, math.tau])
