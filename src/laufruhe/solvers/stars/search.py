"""The best stars by looking at every one (S4)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.physics.crank_stars import Stars
from laufruhe.physics.star_space import StarSpace

SLACK = 1e-9
"""Share by which a value is no better than another."""


class StarObjective(Protocol):
    """Objective of stars, as far as even ones differ."""

    def values(self, space: StarSpace, stars: Stars) -> Array:
        """Return the values of many stars, shape (n,)."""


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
        Arrangements of halves, and whole stars, that were looked at.
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


def enumerate_stars(space: StarSpace, objective: StarObjective, count: int = 1) -> StarsFound:
    """The best stars by looking at every one, in blocks."""
    best, seen = BestStars(count, space.throws), 0
    for block in space.blocks():
        best.offer(block, objective.values(space, block))
        seen += len(block)
    least = float(best.values[0]) if len(best.values) else float("inf")
    return StarsFound(best.stars, best.values, least, True, seen)
