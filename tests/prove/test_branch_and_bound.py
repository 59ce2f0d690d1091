"""Branch and bound on functions with a known minimum."""

from __future__ import annotations

import math

import numpy as np
import pytest

from laufruhe.numerics.budget import limit_time
from laufruhe.numerics.progress import Step, progress_listener
from laufruhe.prove.branch_and_bound import (
    INFEASIBLE_PART,
    BoundedParts,
    Box,
    BranchAndBound,
    FathomedPart,
    OpenNode,
    bisect_box,
    halves,
    widest,
)

# numbers in a row; the least between two places bounds a part from below
Part = tuple[int, int]


class Least(BranchAndBound[Part]):
    """The least of numbers: a part's bound is the least of its own, less what its width leaves open."""

    what = "parts"

    def __init__(self, numbers: np.ndarray, batch_size: int = 1) -> None:
        self.numbers, self.batch_size = numbers, batch_size
        self.looked: list[float] = []

    def bound(self, part: Part) -> tuple[float, Part]:
        first, last = part
        return float(self.numbers[first:last].min()) - 0.3 * (last - first - 1), part

    def propose(self, part: Part) -> None:
        self.value = min(self.value, float(self.numbers[part[0]]))

    def is_fathomed(self, node: OpenNode[Part]) -> bool:
        return node.bound >= self.value

    def branch(self, nodes: list[OpenNode[Part]]) -> BoundedParts[Part]:
        for bound, _, (first, last) in nodes:
            self.looked.append(bound)
            if last - first == 1:
                # a number of the same round may come before its turn
                self.value = min(self.value, bound)
                continue
            middle = (first + last) // 2
            for part in ((first, middle), (middle, last)):
                yield self.bound(part)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("batch_size", [1, 4])
def test_it_ends_at_the_least_of_all(seed: int, batch_size: int) -> None:
    numbers = np.random.default_rng(seed).normal(size=40)
    search = Least(numbers, batch_size)
    bound = search.divide(search.bound((0, 40)), 10_000)
    assert min(bound, search.value) == search.value == numbers.min()
    assert search.complete
    # one at a time the bounds that are divided never fall
    assert batch_size > 1 or search.looked == sorted(search.looked)


@pytest.mark.parametrize("maximum", [1, 2, 7, 20])
def test_remaining_nodes_bound_an_unfinished_search(maximum: int) -> None:
    numbers = np.random.default_rng(5).normal(size=64)
    search = Least(numbers)
    bound = search.divide(search.bound((0, 64)), maximum)
    assert maximum <= search.node_count <= maximum + 1
    assert not search.complete
    assert min(bound, search.value) <= numbers.min()
    assert [one.bound for one in search.next_nodes(3)] == sorted(one.bound for one in search.open_nodes)[:3]


def test_named_places_are_middles_of_the_least_boxes() -> None:
    """Check that the named places are near the minimum of a squared distance."""
    place = np.array([2.3, 7.1])

    class Distance:
        what, batch_size = "boxes", 1

        def bounds(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            nearest = np.clip(place, lower, upper)
            return 1.0 + np.square(nearest - place).sum(axis=1), np.argmax(upper - lower, axis=1)

    result = bisect_box(Distance(), np.array([1.0, 5.0]), np.array([4.0, 9.0]), 1.05, 0.0, 60)
    assert result.bound == 1.0
    assert result.places
    for middle in result.places:
        assert np.abs(middle - place).max() < 1.5


def test_no_allowed_value_leaves_no_box_and_no_time_the_whole() -> None:
    search = Least(np.arange(8.0))
    assert search.divide(INFEASIBLE_PART, 10) == math.inf
    assert search.complete
    assert search.divide(FathomedPart(3.0), 10) == 3.0
    assert search.complete
    with limit_time(0.0):
        assert search.divide((-5.0, (0, 8)), 10) == -5.0
    assert not search.complete


def test_reported_bounds_rise_below_the_best_value() -> None:
    steps: list[Step] = []
    search = Least(np.random.default_rng(1).normal(size=64))
    with progress_listener(steps.append):
        search.divide(search.bound((0, 64)), 1000)
    assert [step.bound for step in steps] == sorted(step.bound for step in steps)
    assert all(step.bound <= step.value for step in steps)


class Bowl:
    """The sum of |x - c|, bounded on a box exactly."""

    what, batch_size = "boxes", 8

    def __init__(self, centre: np.ndarray) -> None:
        self.centre = centre

    def bounds(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nearest = np.clip(self.centre, lower, upper)
        # half of it is left open, so that boxes are divided
        result = np.abs(nearest - self.centre).sum(axis=1) - 0.5 * (upper - lower).sum(axis=1)
        return result, np.argmax(upper - lower, axis=1)


def test_boxes_are_halved_until_none_is_better_by_the_room() -> None:
    centre = np.array([0.3, 0.7])
    result = bisect_box(Bowl(centre), np.zeros(2), np.ones(2), 0.0, 1e-2, 20_000)
    assert -1e-2 <= result.bound <= 0.0
    few = bisect_box(Bowl(centre), np.zeros(2), np.ones(2), 0.0, 1e-2, 20)
    assert few.bound < -1e-2
    assert len(few.places) == 3
    assert bisect_box(Bowl(centre), np.zeros(2), np.ones(2), -10.0, 1e-2, 20).places == ()


def test_halves_cover_a_box() -> None:
    box = Box(
        np.array([0.0, 1.0]), np.array([2.0, 5.0]), widest(np.array([0.0, 1.0]), np.array([2.0, 5.0]), np.ones(2))
    )
    (low, middle), (again, high) = halves(box)
    assert box.side == 1
    assert low.tolist() == [0.0, 1.0]
    assert middle.tolist() == [2.0, 3.0]
    assert again.tolist() == [0.0, 3.0]
    assert high.tolist() == [2.0, 5.0]
