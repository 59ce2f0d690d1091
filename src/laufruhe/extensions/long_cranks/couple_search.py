"""Exact search for the best stars by their couples, from stars with little couple (S5, S47).

No star is better than the best one known unless its couple of every order lies in a window. A good star makes it
narrow, and halves of the throws meet in it (`laufruhe.extensions.long_cranks.throw_halves`). Good stars are drawn with
what cancels built in, then improved.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from laufruhe.extensions.long_cranks.throw_halves import Counts, Free, Window, meeting, shares_of, work_of
from laufruhe.load_models.amplitudes import NEGLIGIBLE
from laufruhe.numerics.arrays import Array, Indices
from laufruhe.numerics.budget import is_time_over, limit_time, until_time_limit
from laufruhe.numerics.progress import report_progress
from laufruhe.numerics.workers import SERIAL, executor_for, unordered_map, worker_count
from laufruhe.physics.crank_stars import Stars, StarSpace
from laufruhe.solvers.stars.enumeration import SLACK, BestStars, StarSearchResult

WORTH_SHARING = 20_000_000
"""Arrangements of halves that take two seconds: those of fifteen throws on as many steps."""
MOST = 400_000_000
"""Arrangements of halves that are looked at: those of sixteen throws on as many steps, half a minute of one core."""
PIECES, MOST_AT_ONCE = 64, 16
STARTS, IN_BLOCKS = 12, 1500
"""Stars of each kind that are improved, and stars in blocks that the best ones are taken from."""
TOGETHER = (8, 8, 10, 10, 12, 12)
"""Throws of the best star that are arranged anew at once, one choice after the other."""
LONG = 16
"""Throws from which that is worth it: of fewer all stars are looked at as soon."""
SEED = 1964


class CoupleObjective(Protocol):
    """Objective of stars, as far as they differ in couples."""

    def values(self, space: StarSpace, stars: Stars, maximum: float = math.inf) -> Array:
        """Return values of many stars, shape (n,); over `maximum` any number between it and the value."""

    def upper_bound(self, space: StarSpace) -> float:
        """Return an upper bound of all stars [SI]."""

    def lower_bound(self, space: StarSpace) -> float:
        """Return a lower bound of all stars, whatever their couples [SI]."""

    def window(self, space: StarSpace, pattern: tuple[int, ...], value: float) -> Window | None:
        """Return the window of couples of all stars that are worth no more than a value; None where no star is."""


def search_stars(
    space: StarSpace, objective: CoupleObjective, count: int = 1, time_limit: float = float("inf"),
    known: Stars | None = None,
) -> StarSearchResult:  # fmt: skip
    """Return the best stars, proven where their halves are few enough to be listed (S5).

    Parameters
    ----------
    space
        Stars allowed.
    objective
        Objective to minimise.
    count
        Number of distinct stars.
    time_limit
        Time after which the search stops, incomplete [s].
    known
        Good stars to start from; sought when left out.
    """
    with limit_time(time_limit):
        best = best_starts(space, objective, count, known)
        search = _Search(space, objective, best)
        search.run()
    minimum = float(best.values[0]) if len(best.values) else float("inf")
    bound = objective.lower_bound(space) if search.ended else minimum
    return StarSearchResult(best.stars, best.values, bound, not search.ended, search.looked_at)


def best_starts(space: StarSpace, objective: CoupleObjective, count: int, known: Stars | None = None) -> BestStars:
    """Return the best stars to begin from, or of known ones, and of all swaps of two throws in them."""
    best = BestStars(count, space.throws)
    stars = good_starts(space, objective) if known is None or not len(known) else known
    best.offer(space.canonical(stars), objective.values(space, space.canonical(stars)))
    if count > 1:
        near = np.unique(space.canonical(np.concatenate([swaps(star) for star in best.stars])), axis=0)
        best.offer(near, objective.values(space, near))
    return best


@dataclass(frozen=True, eq=False)
class _Piece:
    """Some ways to share a pattern between front and back, and the best stars when they are looked at."""

    space: StarSpace
    objective: CoupleObjective
    pattern: tuple[int, ...]
    shares: Counts
    best: BestStars


class _Search:
    """The best stars of what was looked at so far."""

    def __init__(self, space: StarSpace, objective: CoupleObjective, best: BestStars) -> None:
        self.space, self.objective, self.best = space, objective, best
        self.zero_level = NEGLIGIBLE * objective.upper_bound(space)
        self.looked_at, self.ended = 0, False

    def run(self) -> None:
        """Search all stars in pieces and rounds: each piece knows the best of the rounds before it.

        Pieces and rounds do not depend on the workers, so the result does not either.
        """
        if self.best.cut <= self.zero_level:
            return
        work = work_of(self.space)
        self.ended = work > MOST
        if self.ended:
            return
        pieces = [
            (pattern, part)
            for pattern in self.space.patterns
            for part in np.array_split(shares_of(self.space, Free.from_pattern(pattern)), PIECES)
            if len(part)
        ]
        with ExitStack() as stack:
            many = work > WORTH_SHARING and worker_count() > 1
            executor = stack.enter_context(executor_for()) if many else SERIAL
            start, size = 0, 1
            while start < len(pieces):
                chosen = pieces[start : start + size]
                batch = [_Piece(self.space, self.objective, *piece, self.best) for piece in chosen]
                # the first pieces find values that spare the others most of their work
                start, size = start + size, min(2 * size, MOST_AT_ONCE)
                answers = sorted(unordered_map(_explored, batch, executor, patient=True), key=lambda answer: answer[0])
                for _, (best, looked_at, ended) in answers:
                    self.best.offer(best.stars, best.values)
                    self.looked_at += looked_at
                    self.ended = self.ended or ended
                self.ended = self.ended or len(answers) < len(batch)
                report_progress(
                    "arrangements of halves", self.looked_at, work, float(self.best.values.min(initial=np.inf))
                )
                if self.ended:
                    return


def _explored(piece: _Piece) -> tuple[BestStars, int, bool]:
    """The best stars of a piece, how many were looked at, and whether time was over."""
    space, objective, free, seen = piece.space, piece.objective, Free.from_pattern(piece.pattern), 0
    best = BestStars(piece.best.count, space.throws)
    best.offer(piece.best.stars, piece.best.values)
    window, cut = None, np.nan
    for share in piece.shares:
        if is_time_over():
            return best, seen, True
        if best.cut != cut:
            # stars equal to the last of the best are left out: any of them will do
            cut = best.cut
            window = objective.window(space, piece.pattern, cut * (1.0 - SLACK))
        if window is None:
            break
        seen += free.arrangements
        for block in meeting(space, free, share, window):
            stars = np.unique(space.canonical(block), axis=0)
            best.offer(stars, objective.values(space, stars, best.cut))
            seen += len(stars)
    return best, seen, False


def good_starts(space: StarSpace, objective: CoupleObjective) -> Stars:
    """Return stars that swapping any two throws does not improve, the best one with many throws arranged at once."""
    rng = np.random.default_rng(SEED)
    drawn = [
        star
        for pattern in space.patterns
        for star in (*_mirrored(pattern, rng), *_in_blocks(space, pattern, objective, rng), *_shuffled(pattern, rng))
    ]
    improved = np.array([_swapped(space, objective, star) for star in drawn])
    values = objective.values(space, improved)
    best = improved[np.argmin(values)]
    if space.throws < LONG or values.min() <= NEGLIGIBLE * objective.upper_bound(space):
        return improved
    for count in TOGETHER:
        best = _arranged(space, objective, best, sorted(map(int, 1 + rng.permutation(space.throws - 1)[:count])))
    return np.concatenate([improved, best[None]])


def _swapped(space: StarSpace, objective: CoupleObjective, star: Stars) -> Stars:
    # takes the best swap of two throws each time
    value = float(objective.values(space, star[None])[0])
    while True:
        near = swaps(star)
        values = objective.values(space, near)
        first = int(np.argmin(values))
        if values[first] >= value * (1.0 - SLACK):
            return star
        star, value = near[first], float(values[first])


def swaps(star: Stars) -> Stars:
    """Return stars in which two throws, never the first, have each other's steps, shape (n, throws)."""
    pairs = np.array(list(itertools.combinations(range(1, len(star)), 2)) or [(0, 0)])
    near, rows = np.repeat(star[None], len(pairs), axis=0), np.arange(len(pairs))
    near[rows, pairs[:, 0]], near[rows, pairs[:, 1]] = star[pairs[:, 1]], star[pairs[:, 0]]
    return near


def _arranged(space: StarSpace, objective: CoupleObjective, star: Stars, throws: Sequence[int]) -> Stars:
    """Return the best star with these throws in any order on their steps, by halves that meet (S5)."""
    free, value = Free.from_throws(star, throws), float(objective.values(space, star[None])[0])
    pattern = tuple(map(int, np.bincount(star, minlength=space.phases)))
    for share in until_time_limit(shares_of(space, free)):
        window = objective.window(space, pattern, value * (1.0 - SLACK))
        if window is None:
            break
        for block in meeting(space, free, share, window):
            values = objective.values(space, block, value)
            first = int(np.argmin(values))
            if values[first] < value * (1.0 - SLACK):
                star, value = block[first], float(values[first])
    return star


def _shuffled(pattern: Sequence[int], rng: np.random.Generator) -> Iterator[Stars]:
    rest = np.repeat(np.arange(len(pattern)), [pattern[0] - 1, *pattern[1:]])
    for _ in range(STARTS):
        yield np.concatenate([[0], rng.permutation(rest)]).astype(np.uint8)


def _mirrored(pattern: Sequence[int], rng: np.random.Generator) -> Iterator[Stars]:
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
    # S47: best of many stars whose throws stand in even groups, where each step has one throw
    if set(pattern) != {1} or space.phases in (1, *_primes(space.phases)):
        return
    places = np.array([_blocks(space.phases, rng) for _ in range(IN_BLOCKS)])
    steps = np.argsort(places, axis=1)
    stars = ((steps - steps[:, :1]) % space.phases).astype(np.uint8)
    best = np.argsort(objective.values(space, stars), kind="stable")[:STARTS]
    yield from stars[best]


def _blocks(phases: int, rng: np.random.Generator) -> Indices:
    """Return the throw that stands on each step, from 0 (S47).

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
