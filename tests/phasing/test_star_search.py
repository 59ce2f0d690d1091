"""Branch and bound finds what looking at every star finds, for every objective offered."""

import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from laufruhe.load_models.amplitudes import AmplitudeObjective, AmplitudeTerm
from laufruhe.machine.layouts import inline
from laufruhe.numerics.workers import HERE, working_on
from laufruhe.physics.star_space import Partial, StarSpace, outside_in
from laufruhe.solvers.stars import search as star_search
from laufruhe.solvers.stars.search import enumerate_stars, search_stars

NONE = (0.0,) * 4
ORDERS = (1, 2, 3, 4)
OBJECTIVES = {
    "one order": AmplitudeObjective((1,), (AmplitudeTerm(1.0, (0.0,), (1.0,)),)),
    "second order": AmplitudeObjective((2,), (AmplitudeTerm(2.5, (0.0,), (1.0,)),)),
    "rms of two": AmplitudeObjective((1, 2), (AmplitudeTerm(1.0, (0.0, 0.0), (1.0, 0.25)),)),
    "sum of two": AmplitudeObjective(
        (1, 2), (AmplitudeTerm(1.0, (0.0, 0.0), (1.0, 0.0)), AmplitudeTerm(1.0, (0.0, 0.0), (0.0, 1.0)))
    ),
    "rms of four": AmplitudeObjective(ORDERS, (AmplitudeTerm(1.0, NONE, (1.0, 0.3, 0.05, 0.02)),)),
    "mixed": AmplitudeObjective(
        ORDERS,
        (AmplitudeTerm(1.0, NONE, (1.0, 0.3, 0.0, 0.0)), AmplitudeTerm(0.5, NONE, (0.0, 1.0, 0.0, 0.4))),
    ),
    "with force": AmplitudeObjective(
        (1, 2), (AmplitudeTerm(1.0, (1.0, 1.0), (0.0, 0.0)), AmplitudeTerm(1.0, (0.0, 0.0), (1.0, 0.25)))
    ),
}


def whole(throws):
    return StarSpace(throws, ((1,) * throws,), inline(throws, 1.0).throw_positions, True, True)


def in_pairs(throws):
    return StarSpace(throws // 2, ((2,) * (throws // 2),), inline(throws, 1.0).throw_positions, True, True)


@pytest.mark.parametrize("name", OBJECTIVES)
@pytest.mark.parametrize("throws", [2, 3, 4, 5, 6, 7, 8, 9])
def test_search_equals_enumeration(throws, name):
    objective = OBJECTIVES[name]
    for space in (whole(throws), *((in_pairs(throws),) if throws % 2 == 0 else ())):
        all_of, found = (how(space, objective, 5) for how in (enumerate_stars, search_stars))
        assert found.complete
        scale = float(all_of.values.max()) or 1.0
        np.testing.assert_allclose(found.values, all_of.values, rtol=1e-9, atol=1e-9 * scale)
        np.testing.assert_allclose(objective.values(space, found.stars), found.values, rtol=1e-12, atol=1e-12 * scale)
        assert found.lower_bound <= found.values[0] * (1.0 + 1e-12)


@pytest.mark.parametrize("throws", [4, 5, 6, 7])
def test_enumeration_equals_plain_permutations(throws):
    objective = OBJECTIVES["rms of two"]
    every = np.array([(0, *rest) for rest in itertools.permutations(range(1, throws))], dtype=np.uint8)
    space = whole(throws)
    x, steps = np.array(space.places), 2.0 * np.pi * every / throws
    couples = np.stack([np.abs((x * np.exp(1j * h * steps)).sum(axis=1)) for h in (1, 2)])
    least = np.sqrt(couples[0] ** 2 + (0.25 * couples[1]) ** 2).min()
    assert enumerate_stars(space, objective).values[0] == pytest.approx(least, rel=1e-12)


@settings(max_examples=40)
@given(st.permutations(range(6)), st.integers(1, 5), st.sampled_from(sorted(OBJECTIVES)))
def test_no_completion_lies_under_the_bound(star, placed, name):
    space, objective = whole(6), OBJECTIVES[name]
    order = outside_in(6)
    fixed = order[:placed]
    every = np.array(list(itertools.permutations(range(6))), dtype=np.uint8)
    match = np.all(every[:, fixed] == np.array(star, dtype=np.uint8)[list(fixed)], axis=1)
    least = float(objective.values(space, every[match]).min())
    counts = np.ones((1, 6), dtype=np.uint8)
    for k in fixed:
        counts[0, star[k]] -= 1
    partial = Partial(np.array([star], dtype=np.uint8), counts, fixed, order[placed:])
    bounds = star_search._Bounds(space, objective)
    assert not bounds.beyond(partial, least * (1.0 + 1e-9) + 1e-12)[0]


def test_a_search_out_of_time_claims_no_proof():
    objective = OBJECTIVES["rms of two"]
    found = search_stars(whole(11), objective, 1, time_limit=0.0)
    proven = search_stars(whole(11), objective)
    assert not found.complete
    assert found.lower_bound <= proven.values[0] <= found.values[0]


@pytest.mark.parametrize("throws", [7, 9, 11])
def test_longest_levers_first(throws):
    x = np.abs(np.array(inline(throws, 1.0).throw_positions))[list(outside_in(throws))]
    assert np.all(np.diff(x) <= 0.0)


@pytest.mark.parametrize("name", OBJECTIVES)
def test_in_pieces_it_finds_the_same_whoever_works(name, monkeypatch):
    """Rounds of pieces end at the same bits on one worker and on three, and at the proven best."""
    monkeypatch.setattr(star_search, "WORTH_SHARING", 0)
    monkeypatch.setattr(star_search, "PIECES", 5)
    space, objective = whole(8), OBJECTIVES[name]
    with working_on(HERE):
        one = search_stars(space, objective, 5)
    with ThreadPoolExecutor(3) as pool, working_on(pool):
        three = search_stars(space, objective, 5)
    assert one.complete
    assert three.complete
    assert (one.stars.tobytes(), one.values.tobytes()) == (three.stars.tobytes(), three.values.tobytes())
    assert (one.nodes, one.lower_bound) == (three.nodes, three.lower_bound)
    every = enumerate_stars(space, objective, 5)
    np.testing.assert_allclose(one.values, every.values, rtol=1e-9, atol=1e-9 * float(every.values.max() or 1.0))


def test_in_pieces_it_stops_in_time(monkeypatch):
    monkeypatch.setattr(star_search, "WORTH_SHARING", 0)
    space, objective = whole(9), OBJECTIVES["rms of two"]
    with working_on(HERE):
        found = search_stars(space, objective, 1, time_limit=0.0)
    assert not found.complete
    assert found.lower_bound <= enumerate_stars(space, objective).values[0] * (1.0 + 1e-12)


@pytest.mark.parametrize("throws", [16, 40])
@pytest.mark.parametrize("name", ["rms of four", "with force"])
def test_long_cranks_without_couples_need_no_search(throws, name):
    """Throws in pairs, front and back alike, leave nothing: no star can have less, however many there are."""
    space = in_pairs(throws)
    found = search_stars(space, OBJECTIVES[name], 8, time_limit=10.0)
    assert found.complete
    assert len(np.unique(found.stars, axis=0)) == 8
    assert found.values == pytest.approx(0.0, abs=1e-9 * throws**2)
    assert found.nodes < 100


@pytest.mark.parametrize("throws", [6, 14, 48])
def test_a_search_that_nothing_is_left_of_ends(throws):
    """Forces alone, which even pairs cancel: every star is as good as the next, in pieces or not."""
    forces = AmplitudeObjective((1, 2), (AmplitudeTerm(1.0, (1.0, 1.0), (0.0, 0.0)),))
    found = search_stars(in_pairs(throws), forces, 1, time_limit=10.0)
    assert found.complete
    assert found.values == pytest.approx([0.0], abs=1e-12 * throws)


def test_a_piece_may_be_left_without_stars(monkeypatch):
    """All that stand in pieces may be excluded before the pieces are many."""
    monkeypatch.setattr(star_search, "WORTH_SHARING", 0)
    monkeypatch.setattr(star_search, "STARTS", 40)
    space, objective = whole(7), OBJECTIVES["one order"]
    found = search_stars(space, objective, 1)
    assert found.complete
    assert found.values == pytest.approx(enumerate_stars(space, objective, 1).values, abs=1e-12)
