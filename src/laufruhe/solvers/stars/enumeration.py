"""Find the best crank stars, or the best firing orders, by enumeration (S4, V9)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.load_models.amplitudes import AmplitudeObjective
from laufruhe.load_models.pair_tables import PairObjective
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over, limit_time
from laufruhe.numerics.progress import report_progress
from laufruhe.physics.crank_stars import Stars, StarSpace

SLACK = 1e-9
"""Relative difference of objectives that counts as none."""
MAX_SLOTS = 13
"""Largest number of cylinders whose firing orders are enumerated; their number grows as the factorial."""


@dataclass(frozen=True, eq=False)
class StarSearchResult:
    """Best crank stars in ascending order of the objective.

    Attributes
    ----------
    stars, values
        Steps of the stars, shape (n, throws), and objectives [SI], shape (n,).
    lower_bound
        Lower bound of the objective over all stars [SI].
    complete
        True if the search ended with a proof that these stars are the best.
    nodes
        Number of partial and complete stars that the search evaluated.
    """

    stars: Stars
    values: Array
    lower_bound: float
    complete: bool
    nodes: int


class BestStars:
    """Best `count` crank stars so far, best first: steps, shape (n, throws), and objectives [SI], shape (n,)."""

    def __init__(self, count: int, throws: int) -> None:
        self.count, self.throws = count, throws
        self.stars, self.values = np.zeros((0, throws), dtype=np.uint8), np.zeros(0)

    @property
    def cut(self) -> float:
        """Objective that a new crank star must be below [SI]; infinite while fewer than `count` stars are known."""
        return float(self.values[-1]) if len(self.values) >= self.count else float("inf")

    def offer(self, stars: Stars, values: Array) -> None:
        """Keep those of n crank stars that are among the best so far, without duplicates; `values` are objectives.

        Stars with an infinite objective are left out.
        """
        is_feasible = np.isfinite(values)
        stars, values = stars[is_feasible], values[is_feasible]
        if not len(values) or float(values.min()) > self.cut * (1.0 + SLACK):
            return
        best = np.argsort(values, kind="stable")[: 4 * self.count]
        all_stars = np.concatenate([self.stars, stars[best]])
        all_values = np.concatenate([self.values, values[best]])
        _, first = np.unique(all_stars, axis=0, return_index=True)
        # objectives equal within rounding sort by their star, so that runs are repeatable
        scale = float(np.abs(all_values).max()) or 1.0
        keys = (*(all_stars[first, k] for k in range(self.throws - 1, -1, -1)), np.round(all_values[first] / scale, 11))
        selected = first[np.lexsort(keys)[: self.count]]
        self.stars, self.values = all_stars[selected], all_values[selected]


def enumerate_stars(
    space: StarSpace, objective: AmplitudeObjective | PairObjective, count: int = 1, time_limit: float = float("inf")
) -> StarSearchResult:
    """Return the best `count` crank stars of a space, by evaluating all of them in blocks.

    After `time_limit` [s] the search returns the best stars so far, without a proof.
    """
    best, nodes, complete = BestStars(count, space.throws), 0, True
    with limit_time(time_limit):
        for block in space.blocks():
            if nodes and is_time_over():
                complete = False
                break
            best.offer(block, objective.values(space, block))
            nodes += len(block)
            report_progress("crank stars", nodes, space.size, float(best.values.min(initial=np.inf)))
    minimum = float(best.values[0]) if len(best.values) else float("inf")
    bound = minimum if complete else objective.lower_bound(space)
    return StarSearchResult(best.stars, best.values, bound, complete, nodes)
