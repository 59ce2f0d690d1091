"""Halves that meet find what looking at every star finds, for every objective offered."""

import itertools
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from laufruhe.extensions.long_cranks import couple_search as star_search
from laufruhe.extensions.long_cranks.couple_objectives import StarAmplitudes
from laufruhe.extensions.long_cranks.couple_search import search_stars
from laufruhe.extensions.long_cranks.throw_halves import Free, Window, meeting, shares_of, work_of
from laufruhe.load_models.amplitudes import AmplitudeTerm
from laufruhe.machine.layouts import inline
from laufruhe.numerics.workers import SERIAL, working_on
from laufruhe.physics.crank_stars import StarSpace, outside_in, star_sums
from laufruhe.solvers.stars.enumeration import enumerate_stars

NONE = (0.0,) * 4
ORDERS = (1, 2, 3, 4)
OBJECTIVES = {
    "one order": StarAmplitudes((1,), (AmplitudeTerm(1.0, (0.0,), (1.0,)),)),
    "second order": StarAmplitudes((2,), (AmplitudeTerm(2.5, (0.0,), (1.0,)),)),
    "rms of two": StarAmplitudes((1, 2), (AmplitudeTerm(1.0, (0.0, 0.0), (1.0, 0.25)),)),
    "sum of two": StarAmplitudes(
        (1, 2), (AmplitudeTerm(1.0, (0.0, 0.0), (1.0, 0.0)), AmplitudeTerm(1.0, (0.0, 0.0), (0.0, 1.0)))
    ),
    "rms of four": StarAmplitudes(ORDERS, (AmplitudeTerm(1.0, NONE, (1.0, 0.3, 0.05, 0.02)),)),
    "mixed": StarAmplitudes(
        ORDERS,
        (AmplitudeTerm(1.0, NONE, (1.0, 0.3, 0.0, 0.0)), AmplitudeTerm(0.5, NONE, (0.0, 1.0, 0.0, 0.4))),
    ),
    "with force": StarAmplitudes(
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
    minimum = np.sqrt(couples[0] ** 2 + (0.25 * couples[1]) ** 2).min()
    assert enumerate_stars(space, objective).values[0] == pytest.approx(minimum, rel=1e-12)


@settings(max_examples=40)
@given(st.integers(3, 7), st.sampled_from(sorted(OBJECTIVES)), st.floats(0.2, 1.5), st.data())
def test_halves_meet_in_every_star_of_a_window(throws, name, share, data):
    """What a window holds is found whole, and no star that is worth as little lies outside."""
    reflect = data.draw(st.booleans())
    space = replace(whole(throws), mirror=False, reflect=reflect)
    objective = OBJECTIVES[name]
    every = np.array([(0, *rest) for rest in itertools.permutations(range(1, throws))], dtype=np.uint8)
    values = objective.values(space, every)
    cut = share * float(np.median(values)) + 1e-9
    window = objective.window(space, space.patterns[0], cut)
    free = Free.from_pattern(space.patterns[0])
    blocks = [
        space.canonical(block)
        for own in shares_of(space, free)
        for block in (meeting(space, free, own, window) if window else ())
    ]
    found = {tuple(star) for block in blocks for star in block}
    assert {tuple(star) for star in space.canonical(every[values < cut * (1.0 - 1e-9)])} <= found
    if window is not None:
        couples = star_sums(every, throws, space.places, (window.order,))[:, 0, 1]
        clear = np.abs(np.abs(couples.real) - window.high.real) > 1e-9
        clear &= np.abs(np.abs(couples.imag) - window.high.imag) > 1e-9
        inside = (np.abs(couples.real) < window.high.real) & (np.abs(couples.imag) < window.high.imag)
        assert {tuple(star) for star in space.canonical(every[inside & clear])} <= found


@pytest.mark.parametrize("throws", [5, 8, 11])
def test_some_throws_are_arranged_in_every_order(throws):
    """Of free throws all orders are met where the window is wide, and the others stay."""
    space, free = (
        replace(whole(throws), reflect=False),
        Free.from_throws(np.arange(throws, dtype=np.uint8), (1, 2, 3, 4)),
    )
    wide = Window(1, complex(-np.inf, -np.inf), complex(np.inf, np.inf))
    found = np.concatenate([block for own in shares_of(space, free) for block in meeting(space, free, own, wide)])
    assert len(np.unique(found, axis=0)) == len(found) == 24
    assert (found[:, 5:] == np.arange(5, throws)).all()


@pytest.mark.parametrize("throws", [4, 7, 9, 10])
def test_arrangements_are_counted(throws):
    for space in (whole(throws), *((in_pairs(throws),) if throws % 2 == 0 else ())):
        free = Free.from_pattern(space.patterns[0])
        ways = len(shares_of(replace(space, reflect=False), free))
        assert work_of(replace(space, reflect=False)) == free.arrangements * ways
        assert len(shares_of(space, free)) * 2 <= ways + 2 ** (throws // 2)


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
    with working_on(SERIAL):
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
    with working_on(SERIAL):
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
    forces = StarAmplitudes((1, 2), (AmplitudeTerm(1.0, (1.0, 1.0), (0.0, 0.0)),))
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


def test_a_piece_without_an_answer_leaves_the_search_open(monkeypatch):
    """What nobody looked at may hold a better star: nothing is proven but what holds of every star."""
    given, objective, space = star_search.unordered_map, OBJECTIVES["rms of four"], whole(6)

    def all_but_one(work, pieces, *more, **keys):
        yield from list(given(work, pieces, *more, **keys))[1:]

    assert search_stars(space, objective).complete
    monkeypatch.setattr(star_search, "unordered_map", all_but_one)
    found = search_stars(space, objective)
    assert not found.complete
    assert found.lower_bound == objective.lower_bound(space)
