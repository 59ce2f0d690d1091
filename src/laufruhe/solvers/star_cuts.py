"""Exact search over stars and sets of shafts with everything else at its own optimum (S13-S15).

Whoever solves the cone program of one star gets dual rows Z. The bound that they prove
is affine in the star, so one solve bounds every star from below: least first, the next
star is solved only while its bound lies under the best value known. It ends with a
proof, because each star is solved at most once.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import FEASIBLE, AffineNorm, AffineProblem
from laufruhe.load_models.star_model import StarModel, StarProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import passed
from laufruhe.numerics.progress import tell
from laufruhe.physics.crank_stars import Stars
from laufruhe.physics.star_space import StarSpace
from laufruhe.problem.decision import Domain
from laufruhe.problem.phasing import ShaftChoice
from laufruhe.prove.certificate import Multipliers, best_bound, gap_of, room_of
from laufruhe.prove.star_cut import Cut, cut_of
from laufruhe.solvers.conclusion import KEPT
from laufruhe.solvers.conic import solve_cones

COARSE = 48
# times as many angles, where a limit is nearly at its edge
FINER = 4
_CHUNK = 1 << 17


@dataclass(frozen=True, eq=False)
class Solved:
    """One star with one set of shafts, everything else at its optimum.

    Attributes
    ----------
    star
        Steps of the throws.
    built
        Which sets of optional shafts are built.
    value, bound
        Objective of the design found, and what no design of this star goes under.
    x
        Decision vector, zero for shafts that are not built.
    """

    star: tuple[int, ...]
    built: tuple[int, ...]
    value: float
    bound: float
    x: Array


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
    seconds
        Spent.
    """

    solved: tuple[Solved, ...]
    lower_bound: float
    beyond: float
    complete: bool
    designs: int
    infeasible: int
    seconds: float


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


def owners_of(model: StarModel) -> tuple[int, ...]:
    """The set of optional shafts that every decision belongs to, -1 for none."""
    shaft_of = {rotor.name: rotor.shaft.name for rotor in model.problem.engine.rotors}
    sets = model.phasing.shafts.optional
    out = []
    for decision in model.problem.unbalances:
        shaft = shaft_of[decision.rotor_drives[0].rotor]
        out.append(next((k for k, names in enumerate(sets) if shaft in names), -1))
    return tuple(out)


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
    started = time.perf_counter()
    search = _Search(model, stars, tolerance, nothing)
    complete = True
    while (place := search.nearest(count)) is not None:
        if time.perf_counter() - started > time_limit or (passed() and search.tried):
            complete = False
            break
        tell("stars and sets of shafts", len(search.solved) + search.infeasible, search.bounds.size, *search.standing)
        search.solve(*place)
    solved = sorted(search.solved, key=lambda s: (s.value, s.star, s.built))
    _, least = search.standing
    seconds = time.perf_counter() - started
    size = search.bounds.size
    return CutsFound(tuple(solved), least, search.beyond, complete, size, search.infeasible, seconds)


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
        answer = solve_design(self._model, star, built, self._owners, self._tolerance, self._nothing)
        self._open[row, column] = False
        if answer is None:
            self.infeasible += 1
            self.bounds[row, column] = np.inf
            return
        found, cut = answer
        self.solved.append(found)
        for start in range(0, len(self._stars), _CHUNK):
            part = slice(start, start + _CHUNK)
            proven = cut.bounds(self._stars[part], self._sets, self._owners)
            np.maximum(self.bounds[part], proven, out=self.bounds[part])
        self.bounds[row, column] = max(found.bound, self.bounds[row, column])


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


def solve_design(
    model: StarModel,
    star: tuple[int, ...],
    built: tuple[int, ...],
    owners: Sequence[int],
    tolerance: float,
    nothing: float = 0.0,
) -> tuple[Solved, Cut] | None:
    """The optimum of one star with one set of shafts, and what it proves of all others; None if there is none."""
    full = model.samples
    # what bounds means that are averaged bounds the whole cycle (P7)
    fine, sound = model.at(full), model.at(full, averaged=True)
    kept = tuple(own < 0 or own in built for own in owners)
    whole, averaged = _only(fine.at(star), kept), _only(sound.at(star), kept)
    idle = [not norm.slope.any() for _, norm in whole.limits]
    if _broken(model, star, whole, idle):
        return None
    if not any(kept):
        return _fixed(sound, whole, star, built)
    best: tuple[Solved, Multipliers] | None = None
    for samples in _grids(full):
        solution = solve_cones(_acting(_only(model.at(samples).at(star), kept), idle))
        if solution.x is None:
            # a mean at a few angles may be more than over the cycle, averages never are (P7)
            rough = _acting(_only(model.at(samples, averaged=True).at(star), kept), idle)
            solution = solve_cones(replace(rough, limits=tuple((m * (1.0 + KEPT), n) for m, n in rough.limits)))
            if solution.x is None:
                return None
            if samples < full:
                continue
        judged = _acting(whole, idle)
        bound = best_bound(_acting(averaged, idle), solution.x, solution.multipliers)
        value, excess = judged.objective(solution.x), judged.excess(solution.x)
        # where the angles forbid what averages allow, what is proven at the angles is too much
        least = bound.value if excess <= FEASIBLE else min(bound.value, value)
        found = Solved(star, built, value, least, _spread(solution.x, fine.at(star), kept))
        best = (found, _with_idle(bound.multipliers, whole, idle))
        # what averages fall short by, no grid of this fidelity gains
        if excess <= FEASIBLE and gap_of(averaged.objective(solution.x), least, nothing) <= 0.25 * tolerance:
            break
    if best is None:
        return None
    found, multipliers = best
    return found, cut_of(sound, multipliers)


def _broken(model: StarModel, star: Sequence[int], whole: AffineProblem, idle: Sequence[bool]) -> bool:
    """Whether a limit that nothing open acts on is broken, its mean averaged about many angles where that matters."""
    x, over = np.zeros(whole.size), []
    for k, (maximum, norm) in enumerate(whole.limits):
        if idle[k] and norm.value(x) > maximum * (1.0 + FEASIBLE):
            over.append(k)
    if not over:
        return False
    finer = model.at(FINER * model.samples, averaged=True).at(star).limits
    return any(norm.value(np.zeros(norm.slope.shape[-1])) > maximum * (1.0 + KEPT) for maximum, norm in
               (finer[k] for k in over))  # fmt: skip


def _acting(affine: AffineProblem, idle: Sequence[bool]) -> AffineProblem:
    """The problem under those limits alone that something open acts on."""
    if not any(idle):
        return affine
    return replace(affine, limits=tuple(limit for limit, out in zip(affine.limits, idle, strict=True) if not out))


def _with_idle(multipliers: Multipliers, whole: AffineProblem, idle: Sequence[bool]) -> Multipliers:
    """No price on the limits that were left out."""
    rows = iter(multipliers.limits)
    limits = tuple(
        np.zeros_like(norm.constant) if out else next(rows) for (_, norm), out in zip(whole.limits, idle, strict=True)
    )
    return replace(multipliers, limits=limits)


def _fixed(
    sound: StarProblem, whole: AffineProblem, star: tuple[int, ...], built: tuple[int, ...]
) -> tuple[Solved, Cut]:
    """A star with nothing to decide: its rows are its proof."""
    averaged = sound.at(star)
    x = np.zeros(averaged.size)
    value = whole.objective(np.zeros(whole.size))
    terms = tuple(n.subgradient(x) for _, n in averaged.terms)
    limits = tuple(np.zeros_like(n.constant) for _, n in averaged.limits)
    return Solved(star, built, value, min(averaged.objective(x), value), x), cut_of(sound, Multipliers(terms, limits))


def _grids(full: int) -> list[int]:
    """Numbers of samples from coarse to full, each a divisor of the full number."""
    divisors = [n for n in range(1, full + 1) if full % n == 0 and n >= min(COARSE, full)]
    chosen = [divisors[0]]
    for n in divisors:
        if n >= 3 * chosen[-1] and n % chosen[-1] == 0:
            chosen.append(n)
    return chosen


def _only(affine: AffineProblem, kept: Sequence[bool]) -> AffineProblem:
    """The problem without the decisions of shafts that are not built."""
    if all(kept):
        return affine
    columns = np.concatenate([np.full(d.width, keep) for d, keep in zip(affine.domains, kept, strict=True)])

    def cut(norm: AffineNorm) -> AffineNorm:
        return replace(norm, slope=norm.slope[..., columns])

    domains, start = [], 0
    for domain, keep in zip(affine.domains, kept, strict=True):
        if keep:
            domains.append(replace(domain, start=start))
            start += domain.width
    return AffineProblem(
        tuple((w, cut(n)) for w, n in affine.terms),
        tuple((m, cut(n)) for m, n in affine.limits),
        tuple(domains),
        affine.samples,
    )


def _spread(x: Array, affine: AffineProblem, kept: Sequence[bool]) -> Array:
    out = np.zeros(affine.size)
    columns = np.concatenate([np.full(d.width, keep) for d, keep in zip(affine.domains, kept, strict=True)])
    out[columns] = x
    return out
