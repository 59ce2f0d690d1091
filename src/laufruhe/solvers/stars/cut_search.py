"""Exact search over stars and sets of shafts with everything else at its own optimum (S13-S15).

The cone program of one star gives dual rows Z. The bound that they prove is affine in the star, so one solve bounds
every star from below, or shows that others keep the limits as little. The next star is that of the least bound, as
long as this lies under the best value known. The search ends with a proof, because each star is solved at most once.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.star_model import StarModel
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over
from laufruhe.numerics.progress import report_progress
from laufruhe.physics.crank_stars import Stars, StarSpace
from laufruhe.prove.certificate import gap_tolerance_of
from laufruhe.prove.throws.star_cuts import Cut
from laufruhe.solvers.stars.star_program import Solved, shaft_owners, solve_design

_CHUNK = 1 << 17


@dataclass(frozen=True, eq=False)
class CutSearchResult:
    """Designs that were solved, and what was proven of all.

    Attributes
    ----------
    solved
        Every design that was solved, best first.
    lower_bound
        Bound over all stars and sets of shafts.
    beyond
        Bound over what was not solved.
    complete
        Whether the search ended by itself.
    designs
        Number of stars times sets of shafts.
    infeasible
        Number of solved designs that cannot keep the limits.
    """

    solved: tuple[Solved, ...]
    lower_bound: float
    beyond: float
    complete: bool
    designs: int
    infeasible: int


def search_designs(
    model: StarModel,
    stars: Stars,
    count: int,
    tolerance: float,
    time_limit: float = float("inf"),
    zero_level: float = 0.0,
) -> CutSearchResult:
    """Return the best designs of stars and shafts, proven (S15).

    Parameters
    ----------
    model
        Rows of every star.
    stars
        Every star allowed, shape (n, throws).
    count
        How many designs are to be proven best.
    tolerance
        Relative gap at which a bound meets a value.
    time_limit
        [s].
    zero_level
        Value that counts as zero [SI].
    """
    started = time.perf_counter()
    owners, shafts = shaft_owners(model), model.phasing.shafts
    # only the largest sets of shafts where every unbalance may be zero
    has_least = any(owner >= 0 and d.set.lower > 0.0 for d, owner in zip(model.domains, owners, strict=True))
    sets = shafts.allowed if has_least else shafts.largest
    bounds = np.zeros((len(stars), len(sets)))
    is_open = np.ones(bounds.shape, dtype=bool)
    solved: list[Solved] = []
    infeasible, complete = 0, False
    while True:
        left = np.where(is_open, bounds, np.inf)
        beyond = float(left.min(initial=np.inf))
        lower_bound = min([beyond, *(one.bound for one in solved)])
        values = distinct_values(model.space, solved)
        target = values[count - 1] if len(values) >= count else float("inf")
        if not is_open.any() or beyond >= target - gap_tolerance_of(target, tolerance, zero_level):
            complete = True
            break
        has_tried = bool(solved or infeasible)
        if time.perf_counter() - started > time_limit or (is_time_over() and has_tried):
            break
        best = min((one.value for one in solved), default=float("inf"))
        report_progress("stars and sets of shafts", len(solved) + infeasible, bounds.size, best, lower_bound)
        row, column = divmod(int(np.argmin(left)), len(sets))
        star = tuple(int(p) for p in stars[row])
        design, cut = solve_design(model, star, sets[column], owners, tolerance, zero_level)
        is_open[row, column] = False
        if cut is not None:
            _raise_bounds(bounds, cut, design is None, stars, sets, owners)
            is_open &= np.isfinite(bounds)
        if design is None:
            infeasible += 1
        else:
            solved.append(design)
    solved.sort(key=lambda s: (s.value, s.star, s.built))
    return CutSearchResult(tuple(solved), lower_bound, beyond, complete, bounds.size, infeasible)


def _raise_bounds(
    bounds: Array, cut: Cut, excludes: bool, stars: Stars, sets: Sequence[tuple[int, ...]], owners: Sequence[int]
) -> None:
    for start in range(0, len(stars), _CHUNK):
        part = slice(start, start + _CHUNK)
        designs = stars[part], sets, owners
        proven = np.where(cut.excludes(*designs), np.inf, 0.0) if excludes else cut.bounds(*designs)
        np.maximum(bounds[part], proven, out=bounds[part])


def distinct_values(space: StarSpace, solved: Sequence[Solved]) -> list[float]:
    """Return objectives in ascending order, images of one star that are worth the same counted once (S2)."""
    if not solved:
        return []
    images = replace(space, mirror=True, reflect=True)
    stars = images.canonical(np.array([s.star for s in solved], dtype=np.uint8))
    seen: list[tuple[bytes, tuple[int, ...], float]] = []
    for star, s in sorted(zip(stars, solved, strict=True), key=lambda pair: pair[1].value):
        key = star.tobytes(), s.built
        if not any(key == (a, b) and abs(v - s.value) <= 1e-6 * max(v, s.value) for a, b, v in seen):
            seen.append((*key, s.value))
    return [value for _, _, value in seen]
