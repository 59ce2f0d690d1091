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
from scipy.optimize import linear_sum_assignment

from laufruhe.load_models.affine import FEASIBLE, AffineNorm, AffineProblem
from laufruhe.load_models.star_model import StarModel, StarProblem
from laufruhe.physics.crank_stars import Array, Stars
from laufruhe.physics.star_space import StarSpace
from laufruhe.problem.decision import Domain
from laufruhe.problem.phasing import ShaftChoice
from laufruhe.prove.certificate import Multipliers, best_bound

COARSE = 48
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
    return tuple(b for b in choice.allowed if not any(set(b) < set(other) for other in choice.allowed))


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
    floor: float = 0.0,
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
    floor
        Value beside which a gap is relative when the best is smaller [SI].
    """
    started = time.perf_counter()
    owners = owners_of(model)
    sets = allowed_sets(model.phasing.shafts, model.domains, owners)
    bounds = np.zeros((len(stars), len(sets)))
    open_ = np.ones(bounds.shape, dtype=bool)
    solved: list[Solved] = []
    infeasible, complete = 0, True
    while open_.any():
        values = distinct_values(model.space, solved)
        target = values[count - 1] if len(values) >= count else float("inf")
        row, column = divmod(int(np.argmin(np.where(open_, bounds, np.inf))), len(sets))
        if bounds[row, column] >= target - tolerance * max(target, floor):
            break
        if time.perf_counter() - started > time_limit:
            complete = False
            break
        star, built = tuple(int(p) for p in stars[row]), sets[column]
        answer = solve_design(model, star, built, owners, tolerance, floor)
        open_[row, column] = False
        if answer is None:
            infeasible += 1
            bounds[row, column] = np.inf
            continue
        found, cut = answer
        solved.append(found)
        _raise(bounds, cut, stars, sets, owners)
        bounds[row, column] = max(found.bound, bounds[row, column])
    beyond = float(np.where(open_, bounds, np.inf).min(initial=np.inf))
    solved.sort(key=lambda s: (s.value, s.star, s.built))
    least = min([beyond, *(s.bound for s in solved)])
    seconds = time.perf_counter() - started
    return CutsFound(tuple(solved), least, beyond, complete, bounds.size, infeasible, seconds)


def _raise(bounds: Array, cut: Cut, stars: Stars, sets: Sequence[tuple[int, ...]], owners: Sequence[int]) -> None:
    """What a cut proves of every star and set of shafts, in place and in blocks."""
    for start in range(0, len(stars), _CHUNK):
        part = slice(start, start + _CHUNK)
        np.maximum(bounds[part], cut.bounds(stars[part], sets, owners), out=bounds[part])


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
    floor: float = 0.0,
) -> tuple[Solved, Cut] | None:
    """The optimum of one star with one set of shafts, and what it proves of all others; None if there is none."""
    full = model.samples
    fine = model.at(full)
    whole = fine.at(star)
    kept = tuple(own < 0 or own in built for own in owners)
    if not any(kept):
        return _fixed(fine, whole, star, built)
    from laufruhe.solvers.conic import ConicProgram

    best: tuple[Solved, Multipliers] | None = None
    for samples in _grids(full):
        coarse, judged = _only(model.at(samples).at(star), kept), _only(whole, kept)
        solution = ConicProgram(coarse).solve()
        if solution.x is None:
            return None
        bound = best_bound(judged, coarse, solution.x, solution.multipliers)
        value = judged.objective(solution.x)
        met = judged.excess(solution.x) <= FEASIBLE
        found = Solved(star, built, value, bound.value, _spread(solution.x, whole, kept))
        best = (found, bound.multipliers)
        if met and value - bound.value <= 0.25 * tolerance * max(value, floor):
            break
    if best is None:
        return None
    found, multipliers = best
    return found, cut_of(fine, multipliers)


def _fixed(
    fine: StarProblem, whole: AffineProblem, star: tuple[int, ...], built: tuple[int, ...]
) -> tuple[Solved, Cut] | None:
    """A star with nothing to decide: its rows are its proof."""
    x = np.zeros(whole.size)
    if any(norm.value(x) > maximum * (1.0 + FEASIBLE) for maximum, norm in whole.limits):
        return None
    value = whole.objective(x)
    terms = tuple(n.subgradient(x) for _, n in whole.terms)
    limits = tuple(np.zeros_like(n.constant) for _, n in whole.limits)
    return Solved(star, built, value, value, x), cut_of(fine, Multipliers(terms, limits))


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


@dataclass(frozen=True, eq=False)
class Cut:
    """c + sum_k A[k, p_k] + sum over decisions of min_x (g + sum_k G[k, p_k]) . x, under every objective (S14).

    Attributes
    ----------
    constant, moves
        c and A, shape (throws, steps).
    gradient, turns
        g and G, shapes (n,) and (throws, steps, n); no G where g is the same for every star.
    domains
        Of the decisions.
    """

    constant: float
    moves: Array
    gradient: Array
    turns: Array | None
    domains: tuple[Domain, ...]

    def bounds(self, stars: Stars, sets: Sequence[tuple[int, ...]], owners: Sequence[int]) -> Array:
        """Lower bounds of stars with sets of shafts, shape (stars, sets); never under zero."""
        total = np.full(len(stars), self.constant)
        for k in range(stars.shape[1]):
            total += self.moves[k, stars[:, k]]
        least = self._least(stars)
        out = np.empty((len(stars), len(sets)))
        for column, built in enumerate(sets):
            chosen = [d for d, own in enumerate(owners) if own < 0 or own in built]
            out[:, column] = total + (least[:, chosen].sum(axis=1) if chosen else 0.0)
        return np.maximum(out, 0.0)

    def least(self, space: StarSpace) -> float:
        """A bound of every star: the best assignment of throws to steps; never under zero."""
        if self.turns is not None:
            return 0.0
        rest = sum(domain.least(self.gradient) for domain in self.domains)
        values = []
        for pattern in space.patterns:
            places = np.repeat(np.arange(space.phases), pattern)
            # the first throw stands on step 0
            places = np.delete(places, 0)
            cost = self.moves[1:][:, places]
            rows, columns = linear_sum_assignment(cost)
            values.append(self.moves[0, 0] + float(cost[rows, columns].sum()))
        return float(max(0.0, self.constant + rest + min(values)))

    def _least(self, stars: Stars) -> Array:
        """min g . x of every decision, shape (stars, decisions)."""
        if self.turns is None:
            return np.tile([domain.least(self.gradient) for domain in self.domains], (len(stars), 1))
        gradients = np.tile(self.gradient, (len(stars), 1))
        for k in range(stars.shape[1]):
            gradients += self.turns[k, stars[:, k]]
        return np.array([[domain.least(g) for domain in self.domains] for g in gradients])


def cut_of(fine: StarProblem, multipliers: Multipliers) -> Cut:
    """What dual rows prove of every star (S14)."""
    throws, steps = fine.terms[0][1].moves.shape[:2]
    size = fine.terms[0][1].slope.shape[-1]
    constant, moves = 0.0, np.zeros((throws, steps))
    gradient, turns, turning = np.zeros(size), np.zeros((throws, steps, size)), False
    parts = []
    for (weight, norm), given in zip(fine.terms, multipliers.terms, strict=True):
        parts.append((weight * norm.norm.dual_feasible(norm.grid, given), norm))
    for (maximum, norm), given in zip(fine.limits, multipliers.limits, strict=True):
        z = norm.norm.balanced(norm.grid, given)
        constant -= norm.norm.dual_norm(norm.grid, z) * maximum
        parts.append((z, norm))
    for z, norm in parts:
        constant += float(np.vdot(z, norm.constant))
        moves += np.einsum("kd,tpkd->tp", z, norm.moves)
        gradient += np.einsum("kd,kdn->n", z, norm.slope)
        if norm.turns is not None:
            turning = True
            turns += np.einsum("kd,tpkdn->tpn", z, norm.turns)
    return Cut(constant, moves, gradient, turns if turning else None, fine.domains)
