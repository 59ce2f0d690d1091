"""Find the best crank stars and the best firing orders by enumeration (S4, V9)."""

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
# number of partial firing orders that are evaluated at once
_BLOCK = 1 << 17


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
        """Keep those of n crank stars that are among the best so far, without duplicates; `values` are objectives."""
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
    space: StarSpace, objective: AmplitudeObjective, count: int = 1, time_limit: float = float("inf")
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
    minimum = float(best.values[0]) if len(best.values) else float("inf")
    bound = minimum if complete else objective.lower_bound(space)
    return StarSearchResult(best.stars, best.values, bound, complete, nodes)


def enumerate_orders(
    objective: PairObjective, cylinders: int, count: int = 1, time_limit: float = float("inf")
) -> StarSearchResult:
    """Return the best `count` firing orders, with cylinder 1 in the first slot (V9).

    Partial orders grow by one throw at a time, and the squares of their loads with them, in blocks of bounded memory.

    Parameters
    ----------
    objective
        Objective as a function of squares of loads, with tables of pairs of throws.
    cylinders
        Number of cylinders, each on its own throw.
    time_limit
        Time after which the search returns the best orders so far, without a proof [s].
    """
    best, nodes, is_late = BestStars(count, cylinders), 0, False
    stars = np.zeros((1, cylinders), dtype=np.uint8)
    squares = np.array([[table.constant + table.increments(stars, stars[:, 0], 0)[0] for table in objective.tables]])
    queue: list[tuple[int, Stars, Array]] = [(1, stars, squares)]
    with limit_time(time_limit):
        while queue and not is_late:
            report_progress("partial firing orders", nodes, value=float(best.values.min(initial=np.inf)))
            depth, stars, squares = queue.pop()
            is_late = is_time_over()
            if depth == cylinders:
                values = objective.values(squares)
                allowed = np.isfinite(values)
                best.offer(stars[allowed], values[allowed])
                nodes += len(stars)
                continue
            free = np.ones(stars.shape, dtype=bool)
            for k in range(depth):
                free[np.arange(len(stars)), stars[:, k]] = False
            rows, steps = np.nonzero(free)
            for start in range(0, len(rows), _BLOCK):
                row, step = rows[start : start + _BLOCK], steps[start : start + _BLOCK].astype(np.uint8)
                extended = stars[row]
                increments = [table.increments(extended, step, depth) for table in objective.tables]
                extended[:, depth] = step
                queue.append((depth + 1, extended, squares[row] + np.stack(increments, axis=1)))
    best_squares = np.array([table.squares(best.stars[:1])[0] for table in objective.tables if len(best.values)])
    minimum = objective.lower_value(best_squares) if len(best.values) else float("inf")
    return StarSearchResult(best.stars, best.values, 0.0 if is_late else minimum, not is_late, nodes)
