"""Search exactly over crank stars and sets of shafts, with unbalances at their optimum (S13-S15).

The cone program of one star gives dual rows Z. The bound from these rows is affine in the star, so one solve bounds
every star from below, or proves that other stars violate the limits too. The next star is the one with the lowest
bound. The search ends with a proof when this bound reaches the best objective. Each star is solved at most once.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.star_model import StarModel
from laufruhe.numerics.budget import is_time_over
from laufruhe.numerics.progress import report_progress
from laufruhe.physics.crank_stars import Stars, StarSpace
from laufruhe.prove.certificate import gap_tolerance_of
from laufruhe.solvers.stars.star_program import SolvedStar, shaft_owners, solve_design

# number of crank stars whose bounds are computed at once
_CHUNK = 1 << 17


@dataclass(frozen=True, eq=False)
class CutSearchResult:
    """Designs that a search solved, and lower bounds of all designs.

    Attributes
    ----------
    solved
        Every solved design, best first.
    lower_bound, open_bound
        Lower bounds of the objective over all designs, and over those not solved (infinite if there are none) [SI].
    complete
        True if the search ended with a proof, False if its time ended.
    designs, infeasible
        Number of crank stars times number of sets of shafts, and number of those solved without a feasible design.
    """

    solved: tuple[SolvedStar, ...]
    lower_bound: float
    open_bound: float
    complete: bool
    designs: int
    infeasible: int


def search_designs(
    model: StarModel, stars: Stars, count: int, tolerance: float, time_limit: float = math.inf, zero_level: float = 0.0
) -> CutSearchResult:
    """Return the best designs over crank stars and sets of optional shafts, with a proof (S15).

    Parameters
    ----------
    stars
        Steps of the throws of every crank star allowed, shape (n, throws).
    count
        Number of best designs to prove.
    time_limit
        Largest time of the search [s].
    """
    started = time.perf_counter()
    owners, shafts = shaft_owners(model), model.phasing.shafts
    # if every unbalance may be zero, the largest sets of shafts include all others
    needs_weight = any(owner >= 0 and d.set.lower > 0.0 for d, owner in zip(model.domains, owners, strict=True))
    sets = shafts.allowed if needs_weight else shafts.largest
    bounds = np.zeros((len(stars), len(sets)))
    is_open = np.ones(bounds.shape, dtype=bool)
    solved: list[SolvedStar] = []
    infeasible, complete = 0, False
    while True:
        open_bounds = np.where(is_open, bounds, np.inf)
        open_bound = float(open_bounds.min(initial=np.inf))
        lower_bound = min([open_bound, *(design.bound for design in solved)])
        values = _distinct_values(model.space, solved)
        target = values[count - 1] if len(values) >= count else math.inf
        if not is_open.any() or open_bound >= target - gap_tolerance_of(target, tolerance, zero_level):
            complete = True
            break
        has_result = bool(solved or infeasible)
        if time.perf_counter() - started > time_limit or (is_time_over() and has_result):
            break
        best = min((design.value for design in solved), default=math.inf)
        report_progress("stars and sets of shafts", len(solved) + infeasible, bounds.size, best, lower_bound)
        row, column = divmod(int(np.argmin(open_bounds)), len(sets))
        star = tuple(int(p) for p in stars[row])
        design, cut = solve_design(model, star, sets[column], tolerance, zero_level)
        is_open[row, column] = False
        if cut is not None:
            for start in range(0, len(stars), _CHUNK):
                part, designs = slice(start, start + _CHUNK), (stars[start : start + _CHUNK], sets, owners)
                proven = np.where(cut.excludes(*designs), np.inf, 0.0) if design is None else cut.bounds(*designs)
                np.maximum(bounds[part], proven, out=bounds[part])
            is_open &= np.isfinite(bounds)
        if design is None:
            infeasible += 1
        else:
            solved.append(design)
    solved.sort(key=lambda s: (s.value, s.star, s.built))
    return CutSearchResult(tuple(solved), lower_bound, open_bound, complete, bounds.size, infeasible)


def _distinct_values(space: StarSpace, solved: Sequence[SolvedStar]) -> list[float]:
    """Return the objectives of distinct designs, ascending [SI]; equally good mirror images count once (S2)."""
    if not solved:
        return []
    images = replace(space, mirror=True, reflect=True)
    stars = images.canonical(np.array([design.star for design in solved], dtype=np.uint8))
    distinct: list[tuple[bytes, tuple[int, ...], float]] = []
    for star, design in sorted(zip(stars, solved, strict=True), key=lambda pair: pair[1].value):
        key = star.tobytes(), design.built
        if not any(key == (a, b) and abs(v - design.value) <= 1e-6 * max(v, design.value) for a, b, v in distinct):
            distinct.append((*key, design.value))
    return [value for _, _, value in distinct]
