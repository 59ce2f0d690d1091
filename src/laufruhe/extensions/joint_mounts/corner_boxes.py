"""Lower bounds over boxes of mounts with any unbalances, by multipliers at the vertices of boxes (E69).

Multipliers Z_k at the mounts of vertex k bound the objective for all unbalances, and on other mounts this bound is
affine in the unbalances too (P4). Multilinear weights b_k(s) >= 0 with sum one mix the multipliers of all vertices. For
a norm N of the rows V at numbers s of the mounts and unbalances u:

    N(V(s, u)) >= sum_k b_k(s) <Z_k, V(s, u)> = a(s) + g(s) . u

The bound is tight at the vertices. V is a quadratic in s and a remainder (E68), so a and g are cubic in each s, and
their values lie between their Bernstein coefficients. The least a_v + min_u g_v . u over coefficients v, with u in the
sets of unbalances, bounds all designs of the box.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.joint_mounts.mount_loops import Loop, is_looped, mount_loop
from laufruhe.extensions.joint_mounts.mounted_loads import MountedLoads, Pairing, coarser
from laufruhe.extensions.joint_mounts.rest_limits import RestLimits, corners_of, mixed
from laufruhe.load_models.affine import FEASIBLE, MAX_NUMBERS, AffineProblem
from laufruhe.numerics.arrays import Array, ComplexArray, Mask
from laufruhe.problem.decision import real_bounds
from laufruhe.problem.evaluation import with_default_sampling
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Multipliers, best_bound, interpolate_duals, lower_bound
from laufruhe.prove.mounts.box_series import balanced, rest_of
from laufruhe.prove.mounts.named import named_part
from laufruhe.prove.mounts.subdivision import EVEN, is_stiffness_problem
from laufruhe.solvers.cones.conic import refine_multipliers, solve_cones

COARSE_ROWS, MIN_SAMPLES = (1000, 3000), 24
"""Most rows of coarse programs in the order of trials, and fewest samples."""
GAP = 1e-5
"""Relative gap at which multipliers are accepted."""


def best_at(problem: AffineProblem) -> tuple[Array, Multipliers]:
    """Return optimal unbalances, shape (columns,), and multipliers; if limits contradict, those that prove it (P6)."""
    zero = (tuple(np.zeros_like(norm.constant) for _, norm in parts) for parts in (problem.terms, problem.limits))
    x, best = problem.start, lower_bound(problem, Multipliers(*zero))
    rows = sum(len(norm.grid.weights) for _, norm in (*problem.terms, *problem.limits))
    divisors = [k for k in range(1, problem.samples // MIN_SAMPLES + 1) if problem.samples % k == 0] or [1]
    factors = {min((k for k in divisors if rows <= maximum * k), default=divisors[-1]) for maximum in COARSE_ROWS}
    for factor in sorted(factors, reverse=True):
        coarse = coarser(problem, factor)
        solution = solve_cones(coarse)
        if solution.x is None:
            proof = refine_multipliers(coarse, problem, replace(solution.multipliers, terms=()))
            return x, replace(best.multipliers, limits=interpolate_duals(problem, proof).limits)
        x, best = solution.x, best_bound(problem, solution.x, refine_multipliers(coarse, problem, solution.multipliers))
        if problem.objective(x) - best.value <= GAP * best.value:
            break
    return x, best.multipliers


MAX_OPEN = 5
"""Largest number n of open numbers of mounts: a box has 2^n vertices and 4^n coefficients."""
MAX_CORNERS, ROWS = 1200, 7e6
"""Largest number of vertices with multipliers, and of rows of all of them."""
BOXES = 4
"""Boxes for each vertex, with up to three numbers."""
WORTH = 0.7
"""Gain below which the series of an order converges fast enough for useful bounds."""
MIN_CORNER_SHARE = 2
"""Smallest budget of vertices, as a multiple of those of a box."""
NO_PRICE = 1e-8
"""Price of a limit, in objectives, that counts as zero."""
ROUNDS = 2
"""Passes over the limits to find their prices."""

ExactObjective: TypeAlias = Callable[[Array, Array], float]
"""Exact objective [SI] of mounts and columns of unbalances; infinite if a limit is violated."""


@dataclass(frozen=True, eq=False)
class Corner:
    """Optimal unbalances for the mounts at a vertex, shape (columns,), and their lower bound for any mounts.

    The bound `pairing` is None on an undamped resonance.
    """

    columns: Array
    pairing: Pairing | None


def mixes_corners(problem: Problem) -> bool:
    """Return True if bounds from the vertices of boxes of mounts apply to a problem.

    They need several decisions, few open numbers of mounts, and loads alone in the objective. One open number, or
    stiffness alone, needs no vertices.
    """
    if len(problem.decisions) < 2 or len(problem.mount_decisions) > MAX_OPEN or is_stiffness_problem(problem):
        return False
    terms = problem.load_terms
    if named_part(problem) is not problem or problem.mount_terms or len(terms) != len(problem.objective):
        return False
    summed = any(measure.load.sums_places for measure in problem.measures if measure.is_load and measure.on_mounts)
    on_mounts = any(term.measure.on_mounts for term in terms)
    return on_mounts and not summed and not problem.known_rows and is_looped(problem)


class DesignBoxes:
    """Lower bounds of boxes of mounts by multipliers at vertices.

    Attributes
    ----------
    value
        Objective of the incumbent [SI].
    best
        Mounts and columns of the incumbent if a vertex improved it.
    lower, upper
        Bounds of the open numbers of the mounts, shape (n,).
    """

    what, batch_size = "boxes of mounts, with unbalances", 2

    def __init__(self, problem: Problem, value: float, exact_objective: ExactObjective) -> None:
        problem = with_default_sampling(problem)
        self.loads, self.value, self._exact_objective = MountedLoads(problem), value, exact_objective
        self.lower, self.upper = real_bounds(problem.mount_decisions)
        self._rest = RestLimits(problem)
        self._corners: dict[tuple[float, ...], Corner] = {}
        orders = self.loads.orders
        self._counted = np.zeros(len(orders.orders), dtype=bool)
        for measure in (term.measure for term in problem.load_terms if term.measure.on_mounts):
            shares = measure.shares(problem.points)
            self._counted |= (shares[orders.points] > 0.0) & measure.counted(orders.orders)
        self.best: tuple[Array, Array] | None = None

    @property
    def max_boxes(self) -> int:
        """Largest number of boxes: as the file requests, or enough for some tens of seconds."""
        count = len(self.lower)
        # fixed loads and unbalances, in three directions
        columns = 3 * (1 + sum(domain.width for domain in self.loads.domains))
        if self.max_corners < MIN_CORNER_SHARE * 2**count or self.loads.rows * columns > MAX_NUMBERS:
            return 0
        return self.loads.problem.search.boxes_or(BOXES * self.max_corners // max(4 ** (count - 3), 1))

    @property
    def max_corners(self) -> int:
        """Largest number of vertices with multipliers."""
        return int(min(MAX_CORNERS, ROWS / max(self.loads.rows, 1)))

    @np.errstate(invalid="ignore", over="ignore", divide="ignore")
    def bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        """Return lower bounds of boxes of mounts, shape (boxes, n), and the index of the side of each to halve."""
        pairs = [self._bound(*box) for box in zip(lower, upper, strict=True)]
        return np.array([bound for bound, _ in pairs]), np.array([side for _, side in pairs], dtype=np.intp)

    def corner(self, mounts: Array) -> Corner:
        """Return optimal unbalances and multipliers for the mounts at a vertex, shape (n,).

        Each vertex is computed once.
        """
        key = tuple(mounts.tolist())
        if key not in self._corners:
            self._corners[key] = self._new_corner(mounts)
        return self._corners[key]

    def _new_corner(self, mounts: Array) -> Corner:
        problem = self.loads.at(mounts)
        if not all(np.isfinite(norm.constant).all() for _, norm in (*problem.terms, *problem.limits)):
            return Corner(problem.start, None)
        columns, multipliers = best_at(problem)
        value = problem.objective(columns)
        # a price that is only rounding would add the remainder of its limit
        limits = tuple(
            z if norm.dual_norm(z) * maximum > NO_PRICE * value else np.zeros_like(z)
            for (maximum, norm), z in zip(problem.limits, multipliers.limits, strict=True)
        )
        pairing = self.loads.pairing(problem, Multipliers(multipliers.terms, limits))
        if value < self.value and problem.violation(columns) <= FEASIBLE:
            exact_value = self._exact_objective(mounts, columns)
            if exact_value < self.value:
                self.value, self.best = exact_value, (mounts, columns)
        return Corner(columns, pairing)

    def _bound(self, lower: Array, upper: Array) -> tuple[float, int]:
        violations = self._rest.over(lower, upper)
        if any(corner.min() > 0.0 for corner in violations):
            return math.inf, 0
        balanced_loop = self.balanced_loop(lower, upper)
        widths = (upper - lower) / (self.upper - self.lower)
        if not (balanced_loop.maximum[self._counted] < WORTH).all():
            # halve until the series of all orders converge
            return 0.0, int(np.argmax(balanced_loop.scores(self._counted) + EVEN * widths))
        places = [np.where(vertex < 0.0, lower, upper) for vertex in corners_of(len(lower))]
        known_corners = [self._corners.get(tuple(place.tolist())) for place in places]
        rough_result, is_budget_spent = None, len(self._corners) >= self.max_corners
        if is_budget_spent and not any(known_corners):
            return 0.0, int(np.argmax(widths))
        if any(known_corners) and not all(known_corners):
            # multipliers of adjacent vertices suffice if all designs of the box are worse by far
            near_corners = [corner or _adjacent(places, known_corners, k) for k, corner in enumerate(known_corners)]
            rough_result = self._mixed(balanced_loop, violations, near_corners)
            if rough_result[0] >= self.value or is_budget_spent:
                return rough_result
        bound, side = self._mixed(balanced_loop, violations, [self.corner(place) for place in places])
        return (bound, side) if rough_result is None or bound >= rough_result[0] else (rough_result[0], side)

    def _mixed(self, loop: _BalancedLoop, violations: list[Array], corners: Sequence[Corner]) -> tuple[float, int]:
        """Return the lower bound of a box by multipliers of all its vertices, and the index of the side to halve."""
        centre = np.mean([corner.columns for corner in corners], axis=0)
        loaded_loop = self.loaded(loop, centre)
        ends = np.array([domain.ends for domain in self.loads.domains for _ in range(domain.width)]).reshape(-1, 2)
        reach = np.append(1.0, np.abs(ends - centre[:, None]).max(axis=1))
        expansions = (self.expanded(corner.pairing, loaded_loop, centre) for corner in corners)
        quadratics, rests = zip(*expansions, strict=True)
        remainder = np.array(rests) @ reach
        if not (np.isfinite(remainder).all() and np.isfinite(quadratics).all()):
            return 0.0, int(np.argmax(loop.scores(np.ones_like(self._counted))))
        mixes = np.einsum("vkp,kcp->vc", mixed(loop.count), np.array(quadratics), optimize=True)
        minimum = np.array([line[0] + self.minimum(line[1:], centre) for line in mixes])
        # weights of vertices add up to one, so the remainder is at most that of the worst vertex
        minimum = priced(minimum, violations) - remainder.sum(axis=1).max()
        worst = remainder[remainder.sum(axis=1).argmax()]
        scores = _concavity(minimum.reshape((4,) * loop.count)) + loop.shares.T @ worst
        return max(float(minimum.min()), 0.0), int(np.argmax(scores))

    def balanced_loop(self, lower: Array, upper: Array) -> _BalancedLoop:
        """Return the feedback loop of a box, with balanced channels."""
        loop = mount_loop(self.loads.problem, self.loads.orders.omegas, lower, upper)
        return _BalancedLoop(loop, len(lower), *balanced(loop.gain))

    def loaded(self, loop: _BalancedLoop, centre: Array) -> _LoadedLoop:
        """Return the loop under the loads at unbalances `centre`, and under the unit load of each column."""
        loads = self.loads.orders.loads
        fixed = loads[:, :1] + np.einsum("q,wqi->wi", centre, loads[:, 1:])[:, None]
        return _LoadedLoop(loop, np.concatenate([fixed, loads[:, 1:]], axis=1))

    def expanded(self, pairing: Pairing | None, loaded_loop: _LoadedLoop, centre: Array) -> tuple[Array, Array]:
        """Return a lower bound as a quadratic in the open numbers, by the multipliers of a vertex, and its remainder.

        It is expanded about unbalances `centre`. The bound has coefficients of (1, s, s s') for 1 and each column of
        unbalances, shape (1 + columns, p).

        The remainder has the shape (w, 1 + columns).
        """
        powers = np.zeros((1 + len(centre), 1 + loaded_loop.count + loaded_loop.count**2))
        remainder = np.zeros(loaded_loop.loads.shape[:2])
        if pairing is None:
            return powers, remainder
        powers[0, 0], powers[1:, 0] = pairing.constant + pairing.slopes @ centre, pairing.slopes
        for duals, maps in ((pairing.forces, loaded_loop.loop.forces), (pairing.travels, loaded_loop.loop.travels)):
            if duals.any():
                added_powers, added_rest = loaded_loop.paired(duals.conj(), maps)
                powers, remainder = powers + added_powers, remainder + added_rest
        return powers, remainder

    def minimum(self, slopes: Array, centre: Array) -> float:
        """Return the minimum of slopes . (u - centre) over the sets of unbalances u."""
        return float(sum(domain.minimum(slopes) for domain in self.loads.domains) - slopes @ centre)


@dataclass(frozen=True, eq=False)
class _BalancedLoop:
    """Feedback loop with scaled channels (E37).

    Attributes
    ----------
    count
        Number n of open numbers.
    balance
        Diagonal of the scaling T, shape (w, m).
    gain
        T G T^-1, shape (w, m, m).
    maximum
        Upper bound of its norm, shape (w,).
    """

    loop: Loop
    count: int
    balance: Array
    gain: ComplexArray
    maximum: Array

    @property
    def incidence(self) -> Array:
        """Incidence of channels on numbers, 1 or 0, shape (m, n)."""
        return np.asarray((self.loop.numbers[:, None] == np.arange(self.count)).astype(float))

    @property
    def sizes(self) -> Array:
        """Gain of each number, shape (w, n)."""
        squares = np.nan_to_num(np.square(np.abs(self.gain)), nan=1.0, posinf=1.0)
        return np.asarray(np.sqrt((squares.sum(axis=1) + squares.sum(axis=2)) @ self.incidence))

    @property
    def shares(self) -> Array:
        """Share of each number in the gain, shape (w, n)."""
        sizes = self.sizes
        return np.asarray(sizes / np.maximum(sizes.sum(axis=1, keepdims=True), 1e-300))

    def scores(self, orders: Mask) -> Array:
        """Return branching scores of numbers for orders whose series converges slowly, shape (n,)."""
        return np.asarray(self.sizes[orders & ~(self.maximum < WORTH)].max(axis=0, initial=0.0))


class _LoadedLoop:
    """Feedback loop under loads: channel inputs z0 of each load, and the remainder of its series (E68)."""

    def __init__(self, balanced_loop: _BalancedLoop, loads: ComplexArray) -> None:
        self.loop, self.loads, self.count = balanced_loop.loop, loads, balanced_loop.count
        self._incidence, self._balance = balanced_loop.incidence, balanced_loop.balance
        self._inputs = np.einsum("wmi,wci->wcm", self.loop.inputs, loads, optimize=True)
        size = np.abs(self._inputs) * self._balance[:, None]
        # a column without loads has no motion
        remainder = rest_of(balanced_loop.gain[:, None], balanced_loop.maximum[:, None], size)
        self._rest = np.where(size.any(axis=-1), remainder, 0.0)

    def paired(self, duals: ComplexArray, maps: tuple[ComplexArray, ComplexArray]) -> tuple[Array, Array]:
        """Return sums over orders of Z* f by columns and (1, s, s s'), and remainders, shape (w, 1 + columns)."""
        rigid = np.einsum("wr,wri->wi", duals, maps[0], optimize=True)
        weights = np.einsum("wr,wrm->wm", duals, maps[1], optimize=True)
        constant = np.einsum("wi,wci->c", rigid, self.loads, optimize=True).real
        first = np.einsum("wm,wcm->cm", weights, self._inputs, optimize=True).real @ self._incidence
        pairs = -np.einsum("wm,wmk,wck->cmk", weights, self.loop.gain, self._inputs, optimize=True).real
        second = np.einsum("cmk,mi,kj->cij", pairs, self._incidence, self._incidence, optimize=True)
        size = np.linalg.norm(weights / self._balance, axis=-1)[:, None]
        remainder = np.where(size > 0.0, size * self._rest, 0.0)
        return np.column_stack([constant, first, second.reshape(len(constant), -1)]), np.asarray(remainder)


def _adjacent(places: Sequence[Array], corners: Sequence[Corner | None], k: int) -> Corner:
    # known vertex with the most coordinates of vertex k
    pairs = [(corner, place) for corner, place in zip(corners, places, strict=True) if corner is not None]
    return max(pairs, key=lambda pair: int(np.sum(pair[1] == places[k])))[0]


def _concavity(values: Array) -> Array:
    # largest distance of coefficients below the chord along every side, shape (n,)
    shares, distances = np.arange(4) / 3.0, []
    for side in range(values.ndim):
        values_of_side = np.moveaxis(values, side, -1)
        chord = values_of_side[..., :1] * (1.0 - shares) + values_of_side[..., -1:] * shares
        distances.append(float((chord - values_of_side).max()))
    return np.array(distances)


def priced(values: Array, violations: list[Array]) -> Array:
    """Return a lower bound with limits at the best prices, as Bernstein coefficients over a box, shape (v,).

    `values` and each violation are Bernstein coefficients over a box. The result is infinite if a limit is violated.
    """
    if any(float(violation.min()) > 0.0 for violation in violations):
        return np.full_like(values, math.inf)
    for _ in range(ROUNDS if len(violations) > 1 else 1):
        for violation in violations:
            values = values + _price(values, violation) * violation
    return values


def _price(values: Array, violation: Array) -> float:
    """Return the price with the largest minimum of values + price * violation (P4)."""
    from scipy.optimize import minimize_scalar

    def minimum(price: float) -> float:
        return float((values + price * violation).min())

    worst = int(np.argmin(values))
    if violation[worst] <= 0.0:
        return 0.0
    high = float(values.max() - values[worst]) / float(violation[worst])
    optimum = minimize_scalar(lambda price: -minimum(price), bounds=(0.0, high), method="bounded")
    return max(0.0, float(optimum.x), key=minimum)
