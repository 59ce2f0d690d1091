"""Stars are scored as the exact model scores them, and listed once each."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from laufruhe.machine import Cycle, Engine, OperatingPoint
from laufruhe.machine.layouts import build, inline
from laufruhe.physics.crank_stars import StarSpace, star_sums
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import shaking_loads
from mechanisms import mechanism_of

RADIUS, LAMBDA, MASS, SPACING, SPEED = 0.06, 0.26, 1.25, 0.125, 200.0


def score_stars(stars, phases, x, orders):
    """Return |F_h| and |C_h| of many stars."""
    sizes = np.abs(star_sums(stars, phases, x, orders))
    return sizes[..., 0], sizes[..., 1]


def places(throws):
    return inline(throws, 1.0).throw_positions


@given(st.integers(2, 9).flatmap(lambda n: st.permutations(range(n))))
def test_score_equals_the_exact_model(star):
    n = len(star)
    mechanism = mechanism_of(RADIUS, RADIUS / LAMBDA, MASS)
    parts, _ = build(Cycle.TWO_STROKE, inline(n, SPACING), mechanism, [math.tau * p / n for p in star])
    wrench = shaking_loads(Engine("star", Cycle.TWO_STROKE, parts), OperatingPoint("at", SPEED), Fidelity("two-order"))
    forces, couples = score_stars(np.array([star], dtype=np.uint8), n, places(n), (1, 2))
    unit = MASS * RADIUS * SPEED**2
    for k, (order, factor) in enumerate(((1, 1.0), (2, LAMBDA))):
        exact = wrench.at(order)
        assert factor * unit * forces[0, k] == pytest.approx(abs(exact[2]), rel=1e-12, abs=1e-12 * unit)
        assert factor * unit * SPACING * couples[0, k] == pytest.approx(abs(exact[4]), rel=1e-12, abs=1e-12 * unit)


@given(st.integers(2, 12), st.lists(st.integers(0, 11), min_size=1, max_size=12), st.integers(1, 6))
def test_sums_are_the_definition(phases, steps, order):
    star = np.array([[step % phases for step in steps]], dtype=np.uint8)
    x = np.linspace(-1.0, 2.0, len(steps))
    waves = np.exp(2j * np.pi * order * star[0] / phases)
    result = star_sums(star, phases, x, (order,))[0, 0]
    np.testing.assert_allclose(result, [waves.sum(), (x * waves).sum()], atol=1e-12)


def test_stars_that_cancel_score_zero():
    even = np.array([[0, 1, 2, 2, 1, 0]], dtype=np.uint8)
    forces, couples = score_stars(even, 3, places(6), (1, 2, 4))
    np.testing.assert_allclose(forces, 0.0, atol=1e-14)
    np.testing.assert_allclose(couples, 0.0, atol=1e-13)


@given(st.integers(3, 9).flatmap(lambda n: st.permutations(range(n))))
def test_images_are_worth_the_same(star):
    n = len(star)
    space = StarSpace(n, ((1,) * n,), (0.0,) * n, mirror=True, reflect=True)
    same = np.concatenate(space.images(np.array([star], dtype=np.uint8)))
    forces, couples = score_stars(same, n, places(n), (1, 2, 3, 4))
    np.testing.assert_allclose(forces, np.broadcast_to(forces[0], forces.shape), atol=1e-11)
    np.testing.assert_allclose(couples, np.broadcast_to(couples[0], couples.shape), atol=1e-11)
    assert len(np.unique(space.canonical(same), axis=0)) == 1


@pytest.mark.parametrize("throws", [1, 2, 3, 4, 5, 6, 7])
@pytest.mark.parametrize(("mirror", "reflect"), [(False, False), (True, False), (False, True), (True, True)])
def test_every_star_is_listed_once(throws, mirror, reflect):
    space = StarSpace(throws, ((1,) * throws,), places(throws), mirror, reflect)
    every = np.array([(0, *rest) for rest in itertools.permutations(range(1, throws))], dtype=np.uint8)
    expected = np.unique(space.canonical(every), axis=0)
    result = np.concatenate(list(space.blocks()))
    assert len(every) == space.size
    assert sorted(map(tuple, result)) == sorted(map(tuple, expected))


@pytest.mark.parametrize("pattern", [(2, 2), (2, 2, 2), (2, 0, 2, 0), (1, 2, 1)])
def test_throws_side_by_side_are_listed_once(pattern):
    phases, throws = len(pattern), sum(pattern)
    space = StarSpace(phases, (pattern,), places(throws), True, True)
    steps = [p for p, times in enumerate(pattern) for _ in range(times)]
    every = np.array(sorted({s for s in itertools.permutations(steps) if s[0] == 0}), dtype=np.uint8)
    assert len(every) == space.size
    expected = np.unique(space.canonical(every), axis=0)
    # images of a pattern with gaps may use other steps: those stay under their own pattern
    result = np.concatenate(list(space.blocks()))
    of_pattern = [tuple(s) for s in expected if tuple(np.bincount(s, minlength=phases)) == pattern]
    assert sorted(map(tuple, result)) == sorted(of_pattern)


def test_memory_does_not_grow_with_the_number_of_stars():
    largest = {}
    for throws in (8, 9, 10):
        space = StarSpace(throws, ((1,) * throws,), places(throws), True, True)
        largest[throws] = max(len(block) for block in space.blocks())
    assert largest[10] <= 1 << 14
    assert largest[9] <= 1 << 14
