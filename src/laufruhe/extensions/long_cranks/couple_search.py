"""Exact search for the best crank stars by their couples, from stars with little couple (S5, S47).

No star is better than the best one known unless its couple of every order lies in a window. A good star makes it
narrow, and halves of the throws meet in it (`laufruhe.extensions.long_cranks.throw_halves`). Good starts are drawn from
stars in which groups of throws cancel each other, then improved.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from typing import TypeAlias

import numpy as np

from laufruhe.extensions.long_cranks.couple_objectives import CoupleNorms, StarAmplitudes
from laufruhe.extensions.long_cranks.throw_halves import Counts, Free, meeting, shares_of
from laufruhe.load_models.amplitudes import NEGLIGIBLE
from laufruhe.numerics.arrays import Indices
from laufruhe.numerics.budget import is_time_over, limit_time, timed_rounds, until_time_limit
from laufruhe.numerics.progress import report_progress
from laufruhe.numerics.workers import SERIAL, executor_for, unordered_map, worker_count
from laufruhe.physics.crank_stars import Stars, StarSpace
from laufruhe.solvers.stars.even_search import SLACK, BestStars, StarSearchResult

WORTH_SHARING = 20_000_000
"""Number of arrangements of halves from which workers share the search (fifteen throws, two seconds)."""
LONGEST_HALF = 11
"""Most throws of a half whose arrangements fit into memory (21 throws)."""
# pieces of the divisions of a pattern, and most pieces in a round
PIECES, MAX_AT_ONCE = 64, 16
STARTS, BLOCK_STARS = 12, 1500
"""Number of starting stars of each kind, and of stars in groups from which the best are selected."""
REARRANGED = (8, 8, 10, 10, 12, 12)
"""Numbers of throws in successive rearrangements of the best star."""
MAX_REARRANGED = 100_000
"""Most rearrangements of a crank whose halves are too long to list."""
LONG = 16
"""Number of throws from which rearrangement pays; shorter cranks are enumerated as fast."""
SEED = 1964


CoupleObjective: TypeAlias = StarAmplitudes | CoupleNorms
"""Objective of stars that differ in their couples."""


def search_stars(
    space: StarSpace, objective: CoupleObjective, count: int = 1, time_limit: float = math.inf,
    known: Stars | None = None,
) -> StarSearchResult:  # fmt: skip
    """Return the best crank stars of a long crank, proven if the arrangements of its halves can be enumerated (S5).

    Parameters
    ----------
    count
        Number of distinct stars to return.
    time_limit
        Time after which the search stops, incomplete [s].
    known
        Good stars to start from; by default they are generated.
    """
    with limit_time(time_limit):
        best = best_starts(space, objective, count, known)
        looked_at, complete = _search_pieces(space, objective, best)
    minimum = float(best.values[0]) if len(best.values) else math.inf
    bound = minimum if complete else objective.lower_bound(space)
    return StarSearchResult(best.stars, best.values, bound, complete, looked_at)


def best_starts(space: StarSpace, objective: CoupleObjective, count: int, known: Stars | None = None) -> BestStars:
    """Return the best `count` starting stars, given or generated, and their neighbours by swaps of two throws."""
    best = BestStars(count, space.throws)
    stars = good_starts(space, objective) if known is None or not len(known) else known
    best.offer(space.canonical(stars), objective.values(space, space.canonical(stars)))
    if count > 1:
        neighbours = np.unique(space.canonical(np.concatenate([swaps(star) for star in best.stars])), axis=0)
        best.offer(neighbours, objective.values(space, neighbours))
    return best


def _search_pieces(space: StarSpace, objective: CoupleObjective, best: BestStars) -> tuple[int, bool]:
    """Search all crank stars in rounds, and store the best; return the number of arrangements, and True if complete.

    Each piece of the search, some divisions of a pattern, starts from the best stars of earlier rounds.
    Pieces and rounds do not depend on the workers, so the result does not either.
    """
    if best.cut <= NEGLIGIBLE * objective.upper_bound(space):
        return 0, True
    frees = [Free.from_pattern(pattern) for pattern in space.patterns]
    if len(frees[0].back) > LONGEST_HALF:
        return _rearrange_in_time(space, objective, best), False
    pieces, work, rng = [], 0, np.random.default_rng(SEED)
    for pattern, free in zip(space.patterns, frees, strict=True):
        shares = rng.permutation(shares_of(space, free))
        work += len(shares) * free.arrangements
        pieces += [(pattern, part) for part in np.array_split(shares, PIECES) if len(part)]
    looked_at, start, size = 0, 0, 1
    with ExitStack() as stack:
        is_parallel = work > WORTH_SHARING and worker_count() > 1
        executor = stack.enter_context(executor_for()) if is_parallel else SERIAL
        while start < len(pieces):
            batch = pieces[start : start + size]
            # the first pieces find values that spare the others most of their work
            start, size = start + size, min(2 * size, MAX_AT_ONCE)
            search = partial(_search_piece, space=space, objective=objective, known=best)
            answers = sorted(unordered_map(search, batch, executor, patient=True), key=lambda answer: answer[0])
            for _, (found_stars, number, _) in answers:
                best.offer(found_stars.stars, found_stars.values)
                looked_at += number
            report_progress("arrangements of halves", looked_at, work, float(best.values.min(initial=np.inf)))
            if len(answers) < len(batch) or not all(complete for _, (_, _, complete) in answers):
                return looked_at, False
    return looked_at, True


def _search_piece(
    piece: tuple[tuple[int, ...], Counts], space: StarSpace, objective: CoupleObjective, known: BestStars
) -> tuple[BestStars, int, bool]:
    """Return the best crank stars of one part of the search, the number of arrangements, and True if complete."""
    (pattern, shares), looked_at = piece, 0
    free, best = Free.from_pattern(pattern), BestStars(known.count, space.throws)
    best.offer(known.stars, known.values)
    window, cut = None, np.nan
    for share in shares:
        if is_time_over():
            return best, looked_at, False
        if best.cut != cut:
            # stars equal to the last of the best are left out: any of them will do
            cut = best.cut
            window = objective.window(space, pattern, cut * (1.0 - SLACK))
        if window is None:
            break
        looked_at += free.arrangements
        for block in meeting(space, free, share, window):
            stars = np.unique(space.canonical(block), axis=0)
            best.offer(stars, objective.values(space, stars, best.cut))
            looked_at += len(stars)
    return best, looked_at, True


def _rearrange_in_time(space: StarSpace, objective: CoupleObjective, best: BestStars) -> int:
    # rearranges random throws of the best star until the time is over; returns the number of arrangements
    rng, star, looked_at = np.random.default_rng(SEED), best.stars[0], 0
    for _ in timed_rounds(MAX_REARRANGED):
        throws = sorted(map(int, 1 + rng.permutation(space.throws - 1)[: REARRANGED[-1]]))
        star = _rearrange(space, objective, star, throws)
        best.offer(space.canonical(star[None]), objective.values(space, star[None]))
        looked_at += math.factorial(len(throws))
        report_progress("rearranged stars", looked_at, value=float(best.values.min()))
    return looked_at


def good_starts(space: StarSpace, objective: CoupleObjective) -> Stars:
    """Return crank stars that no swap of two throws improves; rearrangement improves the best star further."""
    rng, candidates = np.random.default_rng(SEED), list[Stars]()
    for pattern in space.patterns:
        candidates += [*_mirror_stars(pattern, rng), *_block_stars(space, pattern, objective, rng)]
        steps = np.repeat(np.arange(len(pattern)), [pattern[0] - 1, *pattern[1:]])
        candidates += [np.concatenate([[0], rng.permutation(steps)]).astype(np.uint8) for _ in range(STARTS)]
    improved = np.array([_improve_by_swaps(space, objective, star) for star in candidates])
    values = objective.values(space, improved)
    best = improved[np.argmin(values)]
    if space.throws < LONG or values.min() <= NEGLIGIBLE * objective.upper_bound(space):
        return improved
    for count in REARRANGED:
        best = _rearrange(space, objective, best, sorted(map(int, 1 + rng.permutation(space.throws - 1)[:count])))
    return np.concatenate([improved, best[None]])


def _improve_by_swaps(space: StarSpace, objective: CoupleObjective, star: Stars) -> Stars:
    # takes the best swap of two throws each time
    value = float(objective.values(space, star[None])[0])
    while True:
        neighbours = swaps(star)
        values = objective.values(space, neighbours)
        first = int(np.argmin(values))
        if values[first] >= value * (1.0 - SLACK):
            return star
        star, value = neighbours[first], float(values[first])


def swaps(star: Stars) -> Stars:
    """Return all crank stars that differ from one by a swap of two throws' steps, (n, throws); throw 1 stays."""
    pairs = np.array(list(itertools.combinations(range(1, len(star)), 2)) or [(0, 0)])
    neighbours, rows = np.repeat(star[None], len(pairs), axis=0), np.arange(len(pairs))
    neighbours[rows, pairs[:, 0]], neighbours[rows, pairs[:, 1]] = star[pairs[:, 1]], star[pairs[:, 0]]
    return neighbours


def _rearrange(space: StarSpace, objective: CoupleObjective, star: Stars, throws: Sequence[int]) -> Stars:
    """Return the best crank star over all arrangements of the steps of some throws (S5).

    Arrangements of the front and rear half are combined if their couples together are small.
    """
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


def _mirror_stars(pattern: Sequence[int], rng: np.random.Generator) -> Iterator[Stars]:
    middle = np.flatnonzero(np.mod(pattern, 2))
    if len(middle) > 1 or pattern[0] < 2:
        return
    half = np.repeat(np.arange(len(pattern)), np.array(pattern) // 2)
    for _ in range(STARTS):
        front = np.concatenate([half[:1], rng.permutation(half[1:])])
        yield np.concatenate([front, middle, front[::-1]]).astype(np.uint8)


def _block_stars(
    space: StarSpace, pattern: Sequence[int], objective: CoupleObjective, rng: np.random.Generator
) -> Iterator[Stars]:
    # S47: best of many stars whose throws stand in even groups, where each step has one throw
    if set(pattern) != {1} or space.phases in (1, *_primes(space.phases)):
        return
    places = np.array([_blocks(space.phases, rng) for _ in range(BLOCK_STARS)])
    steps = np.argsort(places, axis=1)
    stars = ((steps - steps[:, :1]) % space.phases).astype(np.uint8)
    best = np.argsort(objective.values(space, stars), kind="stable")[:STARTS]
    yield from stars[best]


def _blocks(phases: int, rng: np.random.Generator) -> Indices:
    """Return a start star for a search: the throw on each step, if throws stand in evenly spaced groups (S47).

    Blocks of q neighbours stand evenly. The throw of a block on step p of P depends on p modulo P / q' alone. So only
    orders that q or q' divides have a couple. Orders that q divides have it only if the star of the blocks has it.
    """
    primes = _primes(phases)
    if not primes:
        return np.zeros(1, dtype=np.intp)
    size = primes[int(rng.integers(len(primes)))]
    other_primes = [prime for prime in primes if prime != size]
    period = phases // other_primes[int(rng.integers(len(other_primes)))] if other_primes else phases
    count = period // size
    inner = rng.permuted(np.tile(np.arange(size), (count, 1)), axis=1).T.reshape(-1)
    steps = np.arange(phases)
    return np.asarray(size * _blocks(phases // size, rng)[steps % (phases // size)] + inner[steps % period])


def _primes(number: int) -> list[int]:
    return [k for k in range(2, number + 1) if number % k == 0 and all(k % low for low in range(2, k))]
