"""Best stars, and best firing orders, by looking at every one (S4, V9)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from laufruhe.load_models.pair_tables import PairObjective
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over, limit_time
from laufruhe.numerics.progress import report_progress
from laufruhe.physics.crank_stars import Stars, StarSpace

SLACK = 1e-9
"""Share by which a value is no better than another."""
MOST_SLOTS = 13
"""Cylinders whose firing orders, a factorial of them, are looked at one by one."""
_BLOCK = 1 << 17


class StarObjective(Protocol):
    """Objective of stars, as far as even ones differ."""

    def values(self, space: StarSpace, stars: Stars) -> Array:
        """Return the values of many stars, shape (n,)."""


@dataclass(frozen=True, eq=False)
class StarSearchResult:
    """Best stars in ascending order of the objective.

    Attributes
    ----------
    stars, values
        Shapes (n, throws) and (n,).
    lower_bound
        Bound of the objective of every star.
    complete
        Whether the search ended by itself, so that these are proven the best.
    nodes
        Arrangements of halves, and whole stars, that were looked at.
    """

    stars: Stars
    values: Array
    lower_bound: float
    complete: bool
    nodes: int


@dataclass
class BestStars:
    """Best stars so far, and the value that a new one has to beat."""

    count: int
    throws: int
    stars: Stars = field(init=False)
    values: Array = field(init=False)

    def __post_init__(self) -> None:
        self.stars, self.values = np.zeros((0, self.throws), dtype=np.uint8), np.zeros(0)

    @property
    def cut(self) -> float:
        """Value that a new star has to beat."""
        return float(self.values[-1]) if len(self.values) >= self.count else float("inf")

    def offer(self, stars: Stars, values: Array) -> None:
        """Take stars that are among the best, each once."""
        if not len(values) or float(values.min()) > self.cut * (1.0 + SLACK):
            return
        near = np.argsort(values, kind="stable")[: 4 * self.count]
        both = np.concatenate([self.stars, stars[near]])
        value = np.concatenate([self.values, values[near]])
        _, first = np.unique(both, axis=0, return_index=True)
        # values equal to a rounding are ordered by the star alone, so that runs repeat
        scale = float(np.abs(value).max()) or 1.0
        keys = (*(both[first, k] for k in range(self.throws - 1, -1, -1)), np.round(value[first] / scale, 11))
        selected = first[np.lexsort(keys)[: self.count]]
        self.stars, self.values = both[selected], value[selected]


def enumerate_stars(space: StarSpace, objective: StarObjective, count: int = 1) -> StarSearchResult:
    """Return the best `count` stars by looking at every one, in blocks."""
    best, seen = BestStars(count, space.throws), 0
    for block in space.blocks():
        best.offer(block, objective.values(space, block))
        seen += len(block)
    minimum = float(best.values[0]) if len(best.values) else float("inf")
    return StarSearchResult(best.stars, best.values, minimum, True, seen)


def enumerate_orders(
    objective: PairObjective, cylinders: int, count: int = 1, time_limit: float = float("inf")
) -> StarSearchResult:
    """Return the best `count` firing orders, the first cylinder in the first slot (V9).

    Stars grow throw by throw, and their squares with them, in blocks of bounded memory.

    Parameters
    ----------
    cylinders
        Cylinders, each on a throw of its own.
    time_limit
        Time after which it ends with the best so far, which is not complete [s].
    """
    best, seen, ended = BestStars(count, cylinders), 0, False
    stars = np.zeros((1, cylinders), dtype=np.uint8)
    squares = np.array([[table.constant + table.placed(stars, stars[:, 0], 0)[0] for table in objective.tables]])
    waiting: list[tuple[int, Stars, Array]] = [(1, stars, squares)]
    with limit_time(time_limit):
        while waiting and not ended:
            report_progress("partial firing orders", seen, value=float(best.values.min(initial=np.inf)))
            placed, stars, squares = waiting.pop()
            ended = is_time_over()
            if placed == cylinders:
                values = objective.values(squares)
                allowed = np.isfinite(values)
                best.offer(stars[allowed], values[allowed])
                seen += len(stars)
                continue
            free = np.ones(stars.shape, dtype=bool)
            for k in range(placed):
                free[np.arange(len(stars)), stars[:, k]] = False
            rows, steps = np.nonzero(free)
            for start in range(0, len(rows), _BLOCK):
                row, step = rows[start : start + _BLOCK], steps[start : start + _BLOCK].astype(np.uint8)
                grown = stars[row]
                more = [table.placed(grown, step, placed) for table in objective.tables]
                grown[:, placed] = step
                waiting.append((placed + 1, grown, squares[row] + np.stack(more, axis=1)))
    of_best = np.array([table.squares(best.stars[:1])[0] for table in objective.tables if len(best.values)])
    minimum = objective.below(of_best) if len(best.values) else float("inf")
    return StarSearchResult(best.stars, best.values, 0.0 if ended else minimum, not ended, seen)
