"""Exact search for the best stars by branch and bound over partial stars (S3-S5).

The objective is a sum of norms of the couples of several orders. Any direction v in the
dual ball bounds it from below by Re sum_h conj(v_h) C_h, which for the throws not yet
placed is sum_k x_k a_p: levers times numbers, least when the longest lever meets the
smallest number. That least value is exact for the direction, so the bound is valid, and
the best of many directions is nearly tight.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from copy import copy
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.amplitudes import NEGLIGIBLE, AmplitudeObjective, directions
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import limited, passed
from laufruhe.numerics.progress import tell
from laufruhe.numerics.roots import parted
from laufruhe.numerics.workers import HERE, count_of, each, executor_for
from laufruhe.physics.crank_stars import Stars, phase_waves
from laufruhe.physics.star_space import Partial, StarSpace

SLACK = 1e-9
WORTH_SHARING = 2_000_000_000
"""Stars of a space that takes several seconds: thirteen throws on as many steps take two."""
PIECES, MOST_AT_ONCE = 64, 16
STARTS = 12
"""Stars of each kind that a search begins from."""


@dataclass(frozen=True, eq=False)
class StarsFound:
    """The best stars, in ascending order of the objective.

    Attributes
    ----------
    stars, values
        Shapes (n, throws) and (n,).
    lower_bound
        No star has a smaller objective.
    complete
        Whether the search ended by itself, so that these are proven the best.
    nodes
        Partial and whole stars that were looked at.
    """

    stars: Stars
    values: Array
    lower_bound: float
    complete: bool
    nodes: int


@dataclass
class BestStars:
    """The best stars so far, and the value that a new one has to beat."""

    count: int
    throws: int
    stars: Stars = field(init=False)
    values: Array = field(init=False)

    def __post_init__(self) -> None:
        self.stars, self.values = np.zeros((0, self.throws), dtype=np.uint8), np.zeros(0)

    @property
    def cut(self) -> float:
        """What a new one has to beat."""
        return float(self.values[-1]) if len(self.values) >= self.count else float("inf")

    def offer(self, stars: Stars, values: Array) -> None:
        """Take those that are among the best, each star once."""
        if not len(values) or float(values.min()) > self.cut * (1.0 + SLACK):
            return
        near = np.argsort(values, kind="stable")[: 4 * self.count]
        both = np.concatenate([self.stars, stars[near]])
        value = np.concatenate([self.values, values[near]])
        _, first = np.unique(both, axis=0, return_index=True)
        # equal values to a rounding are told apart by the star alone, so that runs repeat
        scale = float(np.abs(value).max()) or 1.0
        keys = (*(both[first, k] for k in range(self.throws - 1, -1, -1)), np.round(value[first] / scale, 11))
        kept = first[np.lexsort(keys)[: self.count]]
        self.stars, self.values = both[kept], value[kept]


def enumerate_stars(space: StarSpace, objective: AmplitudeObjective, count: int = 1) -> StarsFound:
    """The best stars by looking at every one, in blocks."""
    best, seen = BestStars(count, space.throws), 0
    for block in space.blocks():
        best.offer(block, objective.values(space, block))
        seen += len(block)
    least = float(best.values[0]) if len(best.values) else float("inf")
    return StarsFound(best.stars, best.values, least, True, seen)


def search_stars(
    space: StarSpace, objective: AmplitudeObjective, count: int = 1, time_limit: float = float("inf")
) -> StarsFound:
    """The best stars, proven by branch and bound (S5).

    Parameters
    ----------
    space
        Stars allowed.
    objective
        What is to be least.
    count
        How many distinct stars are wanted.
    time_limit
        Seconds after which the search stops; what it has then is not complete.
    """
    with limited(time_limit):
        best = BestStars(count, space.throws)
        for start in _good_starts(space, objective):
            best.offer(space.canonical(start), objective.values(space, space.canonical(start)))
        search = _Search(space, objective, best)
        if space.size < WORTH_SHARING:
            for root in space.roots:
                search.explore(root)
        else:
            search.share()
    least = float(best.values[0]) if len(best.values) else float("inf")
    bound = least if not search.ended else search.root
    return StarsFound(best.stars, best.values, min(bound, least), not search.ended, search.looked_at)


class _Search:
    """The best stars of what was looked at so far."""

    def __init__(self, space: StarSpace, objective: AmplitudeObjective, best: BestStars) -> None:
        self.space, self.objective, self.best = space, objective, best
        self.bounds = _Bounds(space, objective)
        self.root = self.bounds.root()
        self.nothing = NEGLIGIBLE * objective.largest(space.places)
        self.looked_at, self.ended = 0, False

    def explore(self, partial: Partial) -> None:
        """All stars that some partial stars grow to, or as many as time allows."""
        for block in self.space.below(partial, self._prune):
            if not self.ended:
                self.best.offer(block, self.objective.values(self.space, block))
                self.looked_at += len(block)

    def share(self) -> None:
        """All stars in pieces, in rounds of so many: each piece knows the best of the rounds before it.

        Pieces and rounds are the same whoever works, so what is found is too.
        """
        pieces = self.space.parted(PIECES, self._prune)
        with ExitStack() as held:
            executor = held.enter_context(executor_for()) if count_of() > 1 else HERE
            start, size = 0, 1
            while start < len(pieces):
                asked = [(self, piece) for piece in pieces[start : start + size]]
                # the first pieces find values that spare the others most of their work
                start, size = start + size, min(2 * size, MOST_AT_ONCE)
                answers = sorted(each(_explored, asked, executor, patient=True), key=lambda answer: answer[0])
                for _, (best, looked_at, ended) in answers:
                    self.best.offer(best.stars, best.values)
                    self.looked_at += looked_at
                    self.ended = self.ended or ended
                self.ended = self.ended or len(answers) < len(asked)
                if self.ended:
                    return

    def _prune(self, partial: Partial) -> NDArray[np.bool_]:
        self.looked_at += len(partial.stars)
        tell("partial stars", self.looked_at, value=float(self.best.values.min(initial=np.inf)), bound=self.root)
        nothing_left = self.best.cut <= self.nothing
        self.ended = self.ended or (not nothing_left and passed())
        if nothing_left or self.ended:
            return np.ones(len(partial.stars), dtype=bool)
        if not np.isfinite(self.best.cut):
            return np.zeros(len(partial.stars), dtype=bool)
        # stars equal to the last one wanted are kept out: any of them will do
        return self.bounds.beyond(partial, self.best.cut * (1.0 - SLACK))


def _explored(step: tuple[_Search, Partial]) -> tuple[BestStars, int, bool]:
    """The best stars of a piece, how many were looked at, and whether time was over."""
    known, piece = step
    search = copy(known)
    search.best, search.looked_at, search.ended = copy(known.best), 0, False
    search.explore(piece)
    return search.best, search.looked_at, search.ended


class _Bounds:
    """Lower bounds of partial stars over a fixed set of directions (S4)."""

    def __init__(self, space: StarSpace, objective: AmplitudeObjective) -> None:
        self._space, self._objective = space, objective
        self._directions = directions(objective)
        waves = phase_waves(space.phases, objective.orders)
        # a_p of every direction: what one unit of lever on step p adds to the bound
        self._steps = (self._directions.conj() @ waves).real
        self._columns = np.concatenate([self._directions.real, self._directions.imag], axis=1).T

    def beyond(self, partial: Partial, limit: float) -> NDArray[np.bool_]:
        """Which partial stars cannot lead to a star under the limit."""
        out = np.zeros(len(partial.stars), dtype=bool)
        codes = _codes(partial.counts)
        kinds, which = np.unique(codes, return_inverse=True)
        table = self._open_part(partial, which, len(kinds))
        x = np.array(self._space.places)[list(partial.placed)]
        constant = self._constant(partial)
        step = max(1, (1 << 22) // len(self._directions))
        for start in range(0, len(out), step):
            part = slice(start, start + step)
            placed = partial.stars[part][:, list(partial.placed)]
            # the placed throws: levers times the numbers of their steps
            sums = _placed_sums(placed, x, self._space.phases, self._objective.orders)
            value = sums @ self._columns + table[which[part]]
            out[part] = value.max(axis=1) + constant > limit
        return out

    def root(self) -> float:
        """A bound of every star."""
        values = []
        for pattern in self._space.patterns:
            counts = np.array([pattern], dtype=np.uint8)
            counts[0, 0] -= 1
            star = np.zeros((1, self._space.throws), dtype=np.uint8)
            partial = Partial(star, counts, (0,), tuple(range(1, self._space.throws)))
            high = 1.0 + 2.0 * float(self._objective.values(self._space, star)[0])

            def is_beyond(value: float, at: Partial = partial) -> bool:
                return bool(self.beyond(at, value)[0])

            values.append(parted(is_beyond, 0.0, high, 60)[0])
        return min(values)

    def _open_part(self, partial: Partial, which: NDArray[np.intp], kinds: int) -> Array:
        """Least sum of lever times number over the open throws, shape (kinds, directions)."""
        first = np.zeros(kinds, dtype=np.intp)
        first[which[::-1]] = np.arange(len(which))[::-1]
        levers = np.sort(np.array(self._space.places)[list(partial.open)])
        out = np.empty((kinds, len(self._directions)))
        for kind, row in enumerate(first):
            steps = np.repeat(np.arange(self._space.phases), partial.counts[row])
            numbers = np.sort(self._steps[:, steps], axis=1)[:, ::-1]
            out[kind] = numbers @ levers
        return out

    def _constant(self, partial: Partial) -> float:
        """Terms of forces alone, which the pattern fixes before a throw is placed."""
        orders = self._objective.orders
        steps = np.bincount(partial.stars[0, list(partial.placed)], minlength=self._space.phases) + partial.counts[0]
        forces = np.abs(phase_waves(self._space.phases, orders) @ steps)
        forces[forces <= 1e-12 * self._space.throws] = 0.0
        pure = [term for term in self._objective.terms if not any(term.couple)]
        return sum(term.weight * float(np.linalg.norm(np.multiply(term.force, forces))) for term in pure)


def _codes(counts: NDArray[np.uint8]) -> NDArray[np.int64]:
    base = int(counts.max(initial=1)) + 1
    return np.asarray(counts.astype(np.int64) @ (base ** np.arange(counts.shape[1], dtype=np.int64)))


def _placed_sums(placed: Stars, x: Array, phases: int, orders: Sequence[int]) -> Array:
    """Couples of the placed throws, real parts before imaginary ones, shape (n, 2 orders)."""
    waves = phase_waves(phases, orders).T
    total = np.zeros((len(placed), len(orders)), dtype=complex)
    for column, lever in enumerate(x):
        total += lever * waves[placed[:, column]]
    return np.concatenate([total.real, total.imag], axis=1)


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


def _good_starts(space: StarSpace, objective: AmplitudeObjective) -> Iterator[Stars]:
    """Stars that swapping any two throws does not improve, from a few that are drawn."""
    rng = np.random.default_rng(1964)
    pairs = np.array(list(itertools.combinations(range(1, space.throws), 2)) or [(0, 0)])
    for pattern in space.patterns:
        for star in (*_mirrored(pattern, rng), *_shuffled(pattern, rng)):
            value = float(objective.values(space, star[None])[0])
            while True:
                near = np.repeat(star[None], len(pairs), axis=0)
                rows = np.arange(len(pairs))
                near[rows, pairs[:, 0]], near[rows, pairs[:, 1]] = star[pairs[:, 1]], star[pairs[:, 0]]
                values = objective.values(space, near)
                least = int(np.argmin(values))
                if values[least] >= value * (1.0 - SLACK):
                    break
                star, value = near[least], float(values[least])
            yield star[None]
