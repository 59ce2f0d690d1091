"""Exact search for the best stars: a good one tells how little couple better ones have, and halves meet in these (S5).

No star is better than the best one known unless its couple of every order lies in a window; all that lie in that of
one order are found without a look at the others (`laufruhe.extensions.long_cranks.halves`).
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.long_cranks.halves import Counts, Free, meeting, shares_of, work_of
from laufruhe.extensions.long_cranks.starts import CoupleObjective, good_starts, swaps
from laufruhe.load_models.amplitudes import NEGLIGIBLE
from laufruhe.numerics.budget import limited, passed
from laufruhe.numerics.progress import report_progress
from laufruhe.numerics.workers import SERIAL, executor_for, unordered_map, worker_count
from laufruhe.physics.crank_stars import Stars
from laufruhe.physics.star_space import StarSpace
from laufruhe.solvers.stars.search import SLACK, BestStars, StarsFound

WORTH_SHARING = 20_000_000
"""Arrangements of halves that take two seconds: those of fifteen throws on as many steps."""
MOST = 400_000_000
"""Arrangements of halves that are looked at: those of sixteen throws on as many steps, half a minute of one core."""
PIECES, MOST_AT_ONCE = 64, 16


def search_stars(
    space: StarSpace, objective: CoupleObjective, count: int = 1, time_limit: float = float("inf"),
    known: Stars | None = None,
) -> StarsFound:  # fmt: skip
    """The best stars, proven where their halves are few enough to be listed (S5).

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
    known
        Stars that are good; looked for when left out.
    """
    with limited(time_limit):
        best = best_starts(space, objective, count, known)
        search = _Search(space, objective, best)
        search.run()
    least = float(best.values[0]) if len(best.values) else float("inf")
    bound = objective.least(space) if search.ended else least
    return StarsFound(best.stars, best.values, bound, not search.ended, search.looked_at)


def best_starts(space: StarSpace, objective: CoupleObjective, count: int, known: Stars | None = None) -> BestStars:
    """The best of the stars that a search begins from, those of swaps among them, or of known ones and their swaps."""
    best = BestStars(count, space.throws)
    stars = good_starts(space, objective) if known is None or not len(known) else known
    best.offer(space.canonical(stars), objective.values(space, space.canonical(stars)))
    if count > 1:
        near = np.unique(space.canonical(np.concatenate([swaps(star) for star in best.stars])), axis=0)
        best.offer(near, objective.values(space, near))
    return best


@dataclass(frozen=True, eq=False)
class _Piece:
    """Some ways to share a pattern between front and back, and what is known when they are looked at."""

    space: StarSpace
    objective: CoupleObjective
    pattern: tuple[int, ...]
    shares: Counts
    best: BestStars


class _Search:
    """The best stars of what was looked at so far."""

    def __init__(self, space: StarSpace, objective: CoupleObjective, best: BestStars) -> None:
        self.space, self.objective, self.best = space, objective, best
        self.nothing = NEGLIGIBLE * objective.largest(space)
        self.looked_at, self.ended = 0, False

    def run(self) -> None:
        """Search all stars in pieces and rounds: each piece knows the best of the rounds before it.

        Pieces and rounds are the same whoever works, so what is found is too.
        """
        if self.best.cut <= self.nothing:
            return
        work = work_of(self.space)
        self.ended = work > MOST
        if self.ended:
            return
        pieces = [(pattern, part) for pattern in self.space.patterns for part in _parts(self.space, pattern)]
        with ExitStack() as held:
            many = work > WORTH_SHARING and worker_count() > 1
            executor = held.enter_context(executor_for()) if many else SERIAL
            start, size = 0, 1
            while start < len(pieces):
                chosen = pieces[start : start + size]
                asked = [_Piece(self.space, self.objective, *piece, self.best) for piece in chosen]
                # the first pieces find values that spare the others most of their work
                start, size = start + size, min(2 * size, MOST_AT_ONCE)
                answers = sorted(unordered_map(_explored, asked, executor, patient=True), key=lambda answer: answer[0])
                for _, (best, looked_at, ended) in answers:
                    self.best.offer(best.stars, best.values)
                    self.looked_at += looked_at
                    self.ended = self.ended or ended
                self.ended = self.ended or len(answers) < len(asked)
                report_progress(
                    "arrangements of halves", self.looked_at, work, float(self.best.values.min(initial=np.inf))
                )
                if self.ended:
                    return


def _parts(space: StarSpace, pattern: tuple[int, ...]) -> list[Counts]:
    return [part for part in np.array_split(shares_of(space, Free.whole(pattern)), PIECES) if len(part)]


def _explored(piece: _Piece) -> tuple[BestStars, int, bool]:
    """The best stars of a piece, how many were looked at, and whether time was over."""
    space, objective, free, seen = piece.space, piece.objective, Free.whole(piece.pattern), 0
    best = BestStars(piece.best.count, space.throws)
    best.offer(piece.best.stars, piece.best.values)
    window, cut = None, np.nan
    for share in piece.shares:
        if passed():
            return best, seen, True
        if best.cut != cut:
            # stars equal to the last one wanted are kept out: any of them will do
            cut = best.cut
            window = objective.window(space, piece.pattern, cut * (1.0 - SLACK))
        if window is None:
            break
        seen += free.each
        for block in meeting(space, free, share, window):
            stars = np.unique(space.canonical(block), axis=0)
            best.offer(stars, objective.values(space, stars, best.cut))
            seen += len(stars)
    return best, seen, False
