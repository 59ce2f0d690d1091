"""Search of stars by halves, compared with a list of all stars, for every objective."""

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
from laufruhe.extensions.long_cranks.throw_halves import Free, Window, meeting, shares_of
from laufruhe.load_models.amplitudes import AmplitudeTerm
from laufruhe.machine.layouts import inline
from laufruhe.numerics.workers import SERIAL, working_on
from laufruhe.physics.crank_stars import StarSpace, star_sums
from laufruhe.solvers.stars.even_search import enumerate_stars

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
    """Check that the stars of a window are all those in its range, and that no better star is outside."""
    mirror, reflect = data.draw(st.booleans()), data.draw(st.booleans())
    space = replace(whole(throws), mirror=mirror, reflect=reflect)
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
        couples = np.abs(star_sums(every, throws, space.places, window.orders)[:, :, 1])
        inside = (couples < np.array(window.reaches) - 1e-9).all(axis=1)
        assert {tuple(star) for star in space.canonical(every[inside])} <= found


@pytest.mark.parametrize("name", OBJECTIVES)
def test_no_star_below_a_value_is_left_out(name):
    """Check that the window of the median holds the better half of all 720 stars."""
    space, objective = replace(whole(7), mirror=False, reflect=False), OBJECTIVES[name]
    every = np.array([(0, *rest) for rest in itertools.permutations(range(1, 7))], dtype=np.uint8)
    values = objective.values(space, every)
    median, free = float(np.median(values)), Free.from_pattern(space.patterns[0])
    window = objective.window(space, space.patterns[0], median)
    blocks = [block for share in shares_of(space, free) for block in meeting(space, free, share, window)]
    found = {tuple(star) for block in blocks for star in space.canonical(block)}
    assert {tuple(star) for star in every[values < median * (1.0 - 1e-9)]} <= found


@settings(max_examples=12)
@given(st.integers(0, 10**6), st.sampled_from([(1,), (2,), (1, 2), (2, 3)]), st.floats(-4.0, 1.0))
def test_rearranged_throws_meet_in_every_star_of_a_window_and_no_other(seed, orders, width):
    """Compare seven of nine throws at any distances with all 5040 arrangements."""
    r = np.random.default_rng(seed)
    steps = np.concatenate([[0], r.permutation(np.repeat(np.arange(5), [1, 2, 2, 2, 1]))]).astype(np.uint8)
    space = StarSpace(5, ((2, 2, 2, 2, 1),), tuple(r.normal(size=9)))
    throws = sorted(map(int, 1 + r.permutation(8)[:7]))
    every = np.repeat(steps[None], 5040, axis=0)
    every[:, throws] = np.array(list(itertools.permutations(steps[throws])))
    couples = np.abs(star_sums(every, 5, space.places, orders)[:, :, 1])
    # the window ends between two stars
    reaches = tuple(np.abs(couples[int(r.integers(5040))]) * (1.0 + 1e-6) + 10.0**width)
    free = Free.from_throws(steps, throws)
    blocks = [
        block for share in shares_of(space, free) for block in meeting(space, free, share, Window(orders, reaches))
    ]
    found = {tuple(star) for block in blocks for star in block}
    assert {tuple(star) for star in every[(couples <= np.array(reaches)).all(axis=1)]} <= found
    parts = np.concatenate([star_sums(block, 5, space.places, orders)[:, :, 1] for block in blocks])
    assert np.all(np.maximum(np.abs(parts.real), np.abs(parts.imag)) <= np.array(reaches) + 1e-9)


@pytest.mark.parametrize("throws", [5, 8, 11])
def test_some_throws_are_arranged_in_every_order(throws):
    """Check that a wide window gives all 24 orders of four free throws and leaves the others in place."""
    space, free = (
        replace(whole(throws), reflect=False),
        Free.from_throws(np.arange(throws, dtype=np.uint8), (1, 2, 3, 4)),
    )
    wide = Window((1, 2), (np.inf, np.inf))
    result = np.concatenate([block for share in shares_of(space, free) for block in meeting(space, free, share, wide)])
    assert len(np.unique(result, axis=0)) == len(result) == 24
    assert (result[:, 5:] == np.arange(5, throws)).all()


@pytest.mark.parametrize("throws", [4, 7, 8, 9, 10])
@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("reflect", [False, True])
def test_one_division_of_each_set_of_images_is_left(throws, mirror, reflect):
    """Compare the divisions, up to steps and images of their stars, with plain sets."""
    for whole_space in (whole(throws), *((in_pairs(throws),) if throws % 2 == 0 else ())):
        space = replace(whole_space, mirror=mirror, reflect=reflect)
        count, front = space.patterns[0][0], throws // 2
        orbits = set()
        for own in itertools.product(range(count + 1), repeat=space.phases):
            if sum(own) == front:
                images = [own, *([own[::-1]] if reflect else [])]
                images += [tuple(count - k for k in image) for image in images if mirror and 2 * front == throws]
                orbits.add(min(image[k:] + image[:k] for image in images for k in range(space.phases)))
        divisions = shares_of(space, Free.from_pattern(space.patterns[0]))
        assert len(divisions) == len(np.unique(divisions, axis=0)) == len(orbits)


class Clock:
    """Clock that advances with each reading."""

    def __init__(self) -> None:
        self.now = 0.0

    def monotonic(self) -> float:
        self.now += 1.0
        return self.now


@settings(max_examples=8)
@given(st.integers(1, 60), st.sampled_from(sorted(OBJECTIVES)))
def test_looking_at_every_star_ends_with_the_time(seconds, name):
    """Check that a search out of time keeps the best star, and the bound holds for all."""
    space, objective = whole(9), OBJECTIVES[name]
    every = enumerate_stars(space, objective, 3)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("laufruhe.numerics.budget.time", Clock())
        patched.setattr("laufruhe.physics.crank_stars.BLOCK", 64)
        result = enumerate_stars(space, objective, 3, time_limit=float(seconds))
    assert len(result.values)
    assert result.complete == (result.nodes == every.nodes)
    assert result.lower_bound <= every.values[0] * (1.0 + 1e-12) <= result.values[0] * (1.0 + 1e-9)
    np.testing.assert_allclose(objective.values(space, result.stars), result.values, rtol=1e-12, atol=1e-12)


def test_enumeration_looks_at_more_stars_in_more_time(monkeypatch):
    monkeypatch.setattr("laufruhe.physics.crank_stars.BLOCK", 64)
    nodes = []
    for seconds in (2.0, 8.0, 32.0, 1e6):
        monkeypatch.setattr("laufruhe.numerics.budget.time", Clock())
        nodes.append(enumerate_stars(whole(9), OBJECTIVES["mixed"], 1, seconds))
    assert [found.complete for found in nodes] == [False, False, False, True]
    assert nodes[0].nodes < nodes[1].nodes < nodes[2].nodes < nodes[3].nodes


def test_long_cranks_are_rearranged_while_time_is_left(monkeypatch):
    """Check that more time gives no worse star, with the bound of all stars."""
    monkeypatch.setattr(star_search, "LONGEST_HALF", 5)
    monkeypatch.setattr(star_search, "REARRANGED", (4, 6))
    space, objective, found = whole(13), OBJECTIVES["rms of four"], []
    for seconds in (20.0, 200.0, 2000.0):
        clock = Clock()
        monkeypatch.setattr("laufruhe.numerics.budget.time", clock)
        found.append(search_stars(space, objective, 2, seconds))
        assert clock.now >= seconds
    assert not any(result.complete for result in found)
    assert found[0].nodes < found[1].nodes < found[2].nodes
    assert found[2].values[0] <= found[1].values[0] <= found[0].values[0]
    assert found[2].values[0] < found[0].values[0]
    assert all(result.lower_bound == objective.lower_bound(space) for result in found)


def test_a_search_out_of_time_claims_no_proof():
    objective = OBJECTIVES["rms of two"]
    result = search_stars(whole(11), objective, 1, time_limit=0.0)
    proven = search_stars(whole(11), objective)
    assert not result.complete
    assert result.lower_bound <= proven.values[0] <= result.values[0]


@pytest.mark.parametrize("name", OBJECTIVES)
def test_pieces_give_the_same_result_on_any_workers(name, monkeypatch):
    """Check equal bits on one worker and on three, and the proven best star."""
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
        result = search_stars(space, objective, 1, time_limit=0.0)
    assert not result.complete
    assert result.lower_bound <= enumerate_stars(space, objective).values[0] * (1.0 + 1e-12)


@pytest.mark.parametrize("throws", [16, 40])
@pytest.mark.parametrize("name", ["rms of four", "with force"])
def test_long_cranks_without_couples_need_no_search(throws, name):
    """Check that throws in pairs, alike at front and back, leave no load in any number."""
    space = in_pairs(throws)
    result = search_stars(space, OBJECTIVES[name], 8, time_limit=10.0)
    assert result.complete
    assert len(np.unique(result.stars, axis=0)) == 8
    assert result.values == pytest.approx(0.0, abs=1e-9 * throws**2)
    assert result.nodes < 100


@pytest.mark.parametrize("throws", [6, 14, 48])
def test_a_search_ends_when_all_stars_are_equal(throws):
    """Check forces alone, which even pairs cancel, so that all stars are equal."""
    forces = StarAmplitudes((1, 2), (AmplitudeTerm(1.0, (1.0, 1.0), (0.0, 0.0)),))
    result = search_stars(in_pairs(throws), forces, 1, time_limit=10.0)
    assert result.complete
    assert result.values == pytest.approx([0.0], abs=1e-12 * throws)


def test_a_piece_may_be_left_without_stars(monkeypatch):
    """Check the best star if the stars of a piece are all excluded before the search shares its work."""
    monkeypatch.setattr(star_search, "WORTH_SHARING", 0)
    monkeypatch.setattr(star_search, "STARTS", 40)
    space, objective = whole(7), OBJECTIVES["one order"]
    result = search_stars(space, objective, 1)
    assert result.complete
    assert result.values == pytest.approx(enumerate_stars(space, objective, 1).values, abs=1e-12)


def test_a_piece_without_an_answer_leaves_the_search_open(monkeypatch):
    """Check that a search with a lost piece proves only the bound of all stars."""
    given, objective, space = star_search.unordered_map, OBJECTIVES["rms of four"], whole(6)

    def all_but_one(work, pieces, *more, **keys):
        yield from list(given(work, pieces, *more, **keys))[1:]

    assert search_stars(space, objective).complete
    monkeypatch.setattr(star_search, "unordered_map", all_but_one)
    result = search_stars(space, objective)
    assert not result.complete
    assert result.lower_bound == objective.lower_bound(space)
