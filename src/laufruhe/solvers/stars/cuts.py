"""Exact search over stars and sets of shafts with everything else at its own optimum (S13-S15).

Whoever solves the cone program of one star gets dual rows Z. The bound that they prove
is affine in the star, so one solve bounds every star from below, or shows that others keep the limits as
little: least first, the next star is solved only while its bound lies under the best value known. It ends with a
proof, because each star is solved at most once.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.star_model import StarModel
from laufruhe.numerics.budget import passed
from laufruhe.numerics.progress import report_progress
from laufruhe.physics.crank_stars import Stars
from laufruhe.physics.star_space import StarSpace
from laufruhe.problem.decision import Domain
from laufruhe.problem.phasing import ShaftChoice
from laufruhe.prove.certificate import room_of
from laufruhe.prove.throws.star_cut import Cut
from laufruhe.solvers.stars.program import Solved, owners_of, solve_design

_CHUNK = 1 << 17


@dataclass(frozen=True, eq=False)
class CutsFound:
    """What the search proved.

    Attributes
    ----------
    solved
        Every design that was solved, best first.
    lower_bound
        No star and no set of shafts has a smaller objective.
    beyond
        Nothing that was not solved has a smaller objective than this.
    complete
        Whether the search ended by itself.
    designs
        Stars times sets of shafts.
    infeasible
        How many of those solved cannot keep the limits.
    """

    solved: tuple[Solved, ...]
    lower_bound: float
    beyond: float
    complete: bool
    designs: int
    infeasible: int


def allowed_sets(choice: ShaftChoice, domains: Sequence[Domain], owners: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """Sets of optional shafts that may be built; only the largest where an unbalance may be zero.

    Parameters
    ----------
    choice
        Limits on number and mass.
    domains, owners
        Decisions, and the set that each belongs to (-1 for none).
    """
    if any(own >= 0 and d.set.lower > 0.0 for d, own in zip(domains, owners, strict=True)):
        return choice.allowed
    return choice.largest


def search_designs(
    model: StarModel,
    stars: Stars,
    count: int,
    tolerance: float,
    time_limit: float = float("inf"),
    nothing: float = 0.0,
) -> CutsFound:
    """The best `count` designs of stars and shafts, proven (S15).

    Parameters
    ----------
    model
        Rows of every star.
    stars
        Shape (n, throws), every star allowed.
    count
        How many designs are to be proven best.
    tolerance
        Relative gap at which a value counts as met by a bound.
    time_limit
        [s].
    nothing
        Value that counts as zero [SI].
    """
    started, search = time.perf_counter(), _Search(model, stars, tolerance, nothing)
    complete = True
    while (place := search.nearest(count)) is not None:
        if time.perf_counter() - started > time_limit or (passed() and search.tried):
            complete = False
            break
        report_progress(
            "stars and sets of shafts", len(search.solved) + search.infeasible, search.bounds.size, *search.standing
        )
        search.solve(*place)
    solved = sorted(search.solved, key=lambda s: (s.value, s.star, s.built))
    _, least = search.standing
    return CutsFound(tuple(solved), least, search.beyond, complete, search.bounds.size, search.infeasible)


class _Search:
    """Bounds of every star and set of shafts, and what has been solved of them."""

    def __init__(self, model: StarModel, stars: Stars, tolerance: float, nothing: float) -> None:
        self._model, self._stars, self._tolerance, self._nothing = model, stars, tolerance, nothing
        self._owners = owners_of(model)
        self._sets = allowed_sets(model.phasing.shafts, model.domains, self._owners)
        self.bounds = np.zeros((len(stars), len(self._sets)))
        self._open = np.ones(self.bounds.shape, dtype=bool)
        self.solved: list[Solved] = []
        self.infeasible = 0

    @property
    def tried(self) -> bool:
        """Whether any design was."""
        return bool(self.solved or self.infeasible)

    @property
    def beyond(self) -> float:
        """Least bound of what was not solved."""
        return float(np.where(self._open, self.bounds, np.inf).min(initial=np.inf))

    @property
    def standing(self) -> tuple[float, float]:
        """Objective of the best design so far, and what none goes under."""
        best = min((one.value for one in self.solved), default=float("inf"))
        return best, min([self.beyond, *(one.bound for one in self.solved)])

    def nearest(self, count: int) -> tuple[int, int] | None:
        """The star and set of the least bound; None where it cannot be among the best `count`."""
        if not self._open.any():
            return None
        values = distinct_values(self._model.space, self.solved)
        target = values[count - 1] if len(values) >= count else float("inf")
        row, column = divmod(int(np.argmin(np.where(self._open, self.bounds, np.inf))), len(self._sets))
        met = self.bounds[row, column] >= target - room_of(target, self._tolerance, self._nothing)
        return None if met else (row, column)

    def solve(self, row: int, column: int) -> None:
        """One design, and what it proves of all others."""
        star, built = tuple(int(p) for p in self._stars[row]), self._sets[column]
        found, cut = solve_design(self._model, star, built, self._owners, self._tolerance, self._nothing)
        self._open[row, column] = False
        if cut is not None:
            self._prove(cut, found is None)
        self._open &= np.isfinite(self.bounds)
        if found is None:
            self.infeasible += 1
        else:
            self.solved.append(found)

    def _prove(self, cut: Cut, excludes: bool) -> None:
        """Bounds of all designs by a cut; without end where it shows that none keeps the limits (S45)."""
        for start in range(0, len(self._stars), _CHUNK):
            part = slice(start, start + _CHUNK)
            told = self._stars[part], self._sets, self._owners
            proven = np.where(cut.excludes(*told), np.inf, 0.0) if excludes else cut.bounds(*told)
            np.maximum(self.bounds[part], proven, out=self.bounds[part])


def distinct_values(space: StarSpace, solved: Sequence[Solved]) -> list[float]:
    """Objectives in ascending order, images of one star that are worth the same counted once (S2)."""
    if not solved:
        return []
    whole = replace(space, mirror=True, reflect=True)
    stars = whole.canonical(np.array([s.star for s in solved], dtype=np.uint8))
    seen: list[tuple[bytes, tuple[int, ...], float]] = []
    for star, s in sorted(zip(stars, solved, strict=True), key=lambda pair: pair[1].value):
        key = star.tobytes(), s.built
        if not any(key == (a, b) and abs(v - s.value) <= 1e-6 * max(v, s.value) for a, b, v in seen):
            seen.append((*key, s.value))
    return [value for _, _, value in seen]
