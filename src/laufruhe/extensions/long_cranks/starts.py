"""Stars with little couple that a search begins from: drawn with what cancels built in, then bettered (S47)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np

from laufruhe.extensions.long_cranks.halves import Free, Window, meeting, shares_of
from laufruhe.load_models.amplitudes import NEGLIGIBLE
from laufruhe.numerics.arrays import Array, Indices
from laufruhe.numerics.budget import in_time
from laufruhe.physics.crank_stars import Stars
from laufruhe.physics.star_space import StarSpace
from laufruhe.solvers.stars.search import SLACK

STARTS, IN_BLOCKS = 12, 1500
"""Stars of each kind that are bettered, and of those in blocks so many that the best of them are taken from."""
TOGETHER = (8, 8, 10, 10, 12, 12)
"""Throws that are arranged anew at once, of the best of them, one choice after the other."""
SEED = 1964


class CoupleObjective(Protocol):
    """What is to be least of a star, as far as couples tell stars apart."""

    def values(self, space: StarSpace, stars: Stars, most: float = math.inf) -> Array:
        """Of many stars, shape (n,); over `most` any number between it and the value."""

    def largest(self, space: StarSpace) -> float:
        """No star has more [SI of the objective]."""

    def least(self, space: StarSpace) -> float:
        """No star has less, whatever its couples [SI of the objective]."""

    def window(self, space: StarSpace, pattern: tuple[int, ...], value: float) -> Window | None:
        """Where the couple of an order lies of every star that is worth no more; None where no star is."""


LONG = 16
"""Throws from which this is worth it: of fewer all stars are looked at as soon."""


def good_starts(space: StarSpace, objective: CoupleObjective) -> Stars:
    """Stars that swapping any two throws does not improve, the best of them with many throws arranged at once."""
    rng = np.random.default_rng(SEED)
    drawn = [
        star
        for pattern in space.patterns
        for star in (*_mirrored(pattern, rng), *_in_blocks(space, pattern, objective, rng), *_shuffled(pattern, rng))
    ]
    found = np.array([_swapped(space, objective, star) for star in drawn])
    values = objective.values(space, found)
    best = found[np.argmin(values)]
    if space.throws < LONG or values.min() <= NEGLIGIBLE * objective.largest(space):
        return found
    for count in TOGETHER:
        best = _arranged(space, objective, best, sorted(map(int, 1 + rng.permutation(space.throws - 1)[:count])))
    return np.concatenate([found, best[None]])


def _swapped(space: StarSpace, objective: CoupleObjective, star: Stars) -> Stars:
    """The star that swaps of two throws lead to, the best one each time."""
    value = float(objective.values(space, star[None])[0])
    while True:
        near = swaps(star)
        values = objective.values(space, near)
        least = int(np.argmin(values))
        if values[least] >= value * (1.0 - SLACK):
            return star
        star, value = near[least], float(values[least])


def swaps(star: Stars) -> Stars:
    """Stars in which two throws, never the first, have each other's steps."""
    pairs = np.array(list(itertools.combinations(range(1, len(star)), 2)) or [(0, 0)])
    near, rows = np.repeat(star[None], len(pairs), axis=0), np.arange(len(pairs))
    near[rows, pairs[:, 0]], near[rows, pairs[:, 1]] = star[pairs[:, 1]], star[pairs[:, 0]]
    return near


def _arranged(space: StarSpace, objective: CoupleObjective, star: Stars, throws: Sequence[int]) -> Stars:
    """The best star with these throws in any order on the steps that they have, by halves that meet (S5)."""
    free, value = Free.of(star, throws), float(objective.values(space, star[None])[0])
    pattern = tuple(map(int, np.bincount(star, minlength=space.phases)))
    for share in in_time(shares_of(space, free)):
        window = objective.window(space, pattern, value * (1.0 - SLACK))
        if window is None:
            break
        for block in meeting(space, free, share, window):
            values = objective.values(space, block, value)
            least = int(np.argmin(values))
            if values[least] < value * (1.0 - SLACK):
                star, value = block[least], float(values[least])
    return star


def _shuffled(pattern: Sequence[int], rng: np.random.Generator) -> Iterator[Stars]:
    """Random stars, the first throw on step 0."""
    rest = np.repeat(np.arange(len(pattern)), [pattern[0] - 1, *pattern[1:]])
    for _ in range(STARTS):
        yield np.concatenate([[0], rng.permutation(rest)]).astype(np.uint8)


def _mirrored(pattern: Sequence[int], rng: np.random.Generator) -> Iterator[Stars]:
    """Random stars that are their own mirror image, where a pattern has any: equal places leave them no couple."""
    middle = np.flatnonzero(np.mod(pattern, 2))
    if len(middle) > 1 or pattern[0] < 2:
        return
    half = np.repeat(np.arange(len(pattern)), np.array(pattern) // 2)
    for _ in range(STARTS):
        front = np.concatenate([half[:1], rng.permutation(half[1:])])
        yield np.concatenate([front, middle, front[::-1]]).astype(np.uint8)


def _in_blocks(
    space: StarSpace, pattern: Sequence[int], objective: CoupleObjective, rng: np.random.Generator
) -> Iterator[Stars]:
    """The best of many stars whose throws stand in even groups, where each step has one throw (S47)."""
    if set(pattern) != {1} or space.phases in (1, *_primes(space.phases)):
        return
    places = np.array([_blocks(space.phases, rng) for _ in range(IN_BLOCKS)])
    steps = np.argsort(places, axis=1)
    stars = ((steps - steps[:, :1]) % space.phases).astype(np.uint8)
    best = np.argsort(objective.values(space, stars), kind="stable")[:STARTS]
    yield from stars[best]


def _blocks(phases: int, rng: np.random.Generator) -> Indices:
    """Which throw stands on each step, from 0 (S47).

    Blocks of q neighbours stand evenly; which of them is on step p depends on p modulo P / q' alone, so that only
    orders that q or q' divides have a couple, and those of q only as the star of the blocks has it.
    """
    primes = _primes(phases)
    if not primes:
        return np.zeros(1, dtype=np.intp)
    size = primes[int(rng.integers(len(primes)))]
    others = [prime for prime in primes if prime != size]
    period = phases // others[int(rng.integers(len(others)))] if others else phases
    count = period // size
    inner = rng.permuted(np.tile(np.arange(size), (count, 1)), axis=1).T.reshape(-1)
    steps = np.arange(phases)
    return np.asarray(size * _blocks(phases // size, rng)[steps % (phases // size)] + inner[steps % period])


def _primes(number: int) -> list[int]:
    return [k for k in range(2, number + 1) if number % k == 0 and all(k % low for low in range(2, k))]
