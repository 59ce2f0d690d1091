"""The best firing orders against the twist of the crankshaft, by looking at every one (V9)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.pair_tables import PairObjective
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import limited, passed
from laufruhe.numerics.progress import report_progress
from laufruhe.physics.crank_stars import Stars
from laufruhe.solvers.stars.search import BestStars, StarsFound

MOST_SLOTS = 13
"""Cylinders whose firing orders, a factorial of them, are looked at one by one."""
_BLOCK = 1 << 17


def enumerate_orders(
    objective: PairObjective, count: int, best: int = 1, time_limit: float = float("inf")
) -> StarsFound:
    """The best firing orders of `count` cylinders, the first one in the first slot.

    Stars grow throw by throw, and their squares with them, in blocks of bounded memory.

    Parameters
    ----------
    objective
        What is to be least.
    count
        Cylinders, each on a throw of its own.
    best
        How many are wanted.
    time_limit
        Seconds after which it ends with the best so far; what it has then is not complete.
    """
    found, seen, ended = BestStars(best, count), 0, False
    stars = np.zeros((1, count), dtype=np.uint8)
    squares = np.array([[table.constant + table.placed(stars, stars[:, 0], 0)[0] for table in objective.tables]])
    waiting: list[tuple[int, Stars, Array]] = [(1, stars, squares)]
    with limited(time_limit):
        while waiting and not ended:
            report_progress("partial firing orders", seen, value=float(found.values.min(initial=np.inf)))
            placed, stars, squares = waiting.pop()
            ended = passed()
            if placed == count:
                values = objective.values(squares)
                met = np.isfinite(values)
                found.offer(stars[met], values[met])
                seen += len(stars)
                continue
            rows, steps = np.nonzero(_free(stars, placed))
            for start in range(0, len(rows), _BLOCK):
                row, step = rows[start : start + _BLOCK], steps[start : start + _BLOCK].astype(np.uint8)
                grown = stars[row]
                more = [table.placed(grown, step, placed) for table in objective.tables]
                grown[:, placed] = step
                waiting.append((placed + 1, grown, squares[row] + np.stack(more, axis=1)))
    of_best = np.array([table.squares(found.stars[:1])[0] for table in objective.tables if len(found.values)])
    least = objective.below(of_best) if len(found.values) else float("inf")
    return StarsFound(found.stars, found.values, 0.0 if ended else least, not ended, seen)


def _free(stars: Stars, placed: int) -> NDArray[np.bool_]:
    """Slots that no throw of a star has taken, shape (n, slots)."""
    free = np.ones((len(stars), stars.shape[1]), dtype=bool)
    for k in range(placed):
        free[np.arange(len(stars)), stars[:, k]] = False
    return free
