"""Shadow prices of limits and bounds: smallest and largest multipliers that balance an optimum (P5, P19)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import Decision
from laufruhe.problem.measure import Limit, Side
from laufruhe.problem.sets import EDGE
from laufruhe.prove.certificate import Bound
from laufruhe.solvers.cones.cone_program import ConeRows, run_clarabel

ALIKE = 0.02
"""Relative difference up to which the prices of relaxing and tightening count as equal."""
INDEPENDENT, BALANCED = 1e-3, 1e-2
"""Smallest relative singular value of independent slopes, and largest relative residual of their balance."""
_RESIDUAL_MARGIN = 1e-6
"""Residual of the balance of slopes that is allowed above the smallest one."""
ACTIVE = 1e-5
"""Relative distance to a limit, or to a bound of a decision, within which it is active."""
MAX_VANISHING, _DIRECTIONS, MAX_CORNERS = 64, 8, 256
"""Largest number of zero rows of a norm, segments that approximate a disc, and largest number of rows of a hull."""


@dataclass(frozen=True)
class Price:
    """Shadow price of a limit or bound [unit of the objective per unit of the limit].

    Attributes
    ----------
    relaxed
        Fall of the objective as the limit is relaxed.
    tightened
        Rise of the objective as the limit is tightened; NaN if unknown.
    """

    relaxed: float
    tightened: float

    def __post_init__(self) -> None:
        if self.tightened < self.relaxed:
            object.__setattr__(self, "tightened", self.relaxed)

    @classmethod
    def both(cls, price: float) -> Price:
        """Return a price that is equal for relaxing and tightening."""
        return cls(price, price)

    def __add__(self, other: Price) -> Price:
        """Return the price of two limits that move together."""
        return Price(self.relaxed + other.relaxed, self.tightened + other.tightened)

    @property
    def is_equal(self) -> bool:
        """True if both prices are equal within `ALIKE`."""
        return self.relaxed >= (1.0 - ALIKE) * self.tightened

    @property
    def other(self) -> float | None:
        """Price of tightening; None if it is equal to the price of relaxing."""
        return None if self.is_equal or math.isnan(self.relaxed) else self.tightened

    def floored(self, minimum: float) -> Price:
        """Return the price with values up to `minimum` set to zero."""
        relaxed, tightened = (0.0 if price <= minimum else price for price in (self.relaxed, self.tightened))
        return Price(relaxed, tightened)


@dataclass(frozen=True, eq=False)
class Slopes:
    """Subgradients of a convex function at a design: convex hull plus segments (P19).

    Attributes
    ----------
    hull
        Gradients that span the convex hull, shape (m, n); one row for a smooth function.
    segments
        Half-lengths of segments, shape (s, n): each enters with a factor from -1 to 1.
    """

    hull: Array
    segments: Array

    @classmethod
    def smooth(cls, slope: Array) -> Slopes:
        """Return the only subgradient of a smooth function, its gradient, shape (n,)."""
        return cls(slope[None], np.zeros((0, len(slope))))

    def scaled(self, units: Array) -> Slopes:
        """Return the slopes with decisions in other units, shape (n,)."""
        return Slopes(self.hull * units, self.segments * units)

    @property
    def corners(self) -> Array:
        """Gradients that span the hull, shape (m, n); for a large hull the extreme ones in `MAX_CORNERS` directions.

        All rows of a signal of constant length may be extreme. A circle with 256 corners has a relative error of 1e-4.
        """
        step = -(-len(self.hull) // MAX_CORNERS)
        if step == 1:
            return self.hull
        directions = (self.hull - self.hull.mean(axis=0))[::step]
        return np.asarray(self.hull[np.unique(np.argmax(self.hull @ directions.T, axis=0))])

    @property
    def is_smooth(self) -> bool:
        """True if the function has one gradient only."""
        return len(self.hull) + len(self.segments) == 1


def prices_of(objective: Sequence[Slopes], limits: Sequence[Slopes], edges: Array) -> list[Price] | None:
    """Return the shadow price of every active limit, then of every active bound, from subgradients (P19).

    The result is None if slopes do not balance: the design is not optimal to first order, or a kink is unknown.

    Parameters
    ----------
    objective
        Slopes of every term times its weight.
    limits
        Slopes of active limits.
    edges
        Outward normals of active bounds, shape (bounds, n).
    """
    count = len(limits) + len(edges)
    if not count:
        return []
    slope = np.sum([slopes.hull[0] for slopes in objective], axis=0)
    turns = [rows for slopes in objective for rows in (np.ptp(slopes.hull, axis=0), slopes.segments)]
    size = max(float(np.abs(rows).max(initial=0.0)) for rows in (slope, *turns))
    if not size:
        return None
    if all(slopes.is_smooth for slopes in (*objective, *limits)):
        unique = _unique_prices(np.concatenate([*(slopes.hull for slopes in limits), edges]), slope)
        if unique is not None:
            return [Price.both(price) for price in unique]
    return _ranges(objective, limits, edges, size)


def _unique_prices(rows: Array, slope: Array) -> list[float] | None:
    # None if slopes are dependent or do not balance
    lengths = np.linalg.norm(rows, axis=1)
    if not lengths.all():
        return None
    scaled = rows / lengths[:, None]
    if np.linalg.svd(scaled, compute_uv=False).min() < INDEPENDENT or len(rows) > rows.shape[1]:
        return None
    multipliers = np.linalg.lstsq(scaled.T, -slope)[0]
    if np.abs(scaled.T @ multipliers + slope).max() > BALANCED * np.abs(slope).max():
        return None
    return [float(price) for price in np.maximum(multipliers, 0.0) / lengths]


def _ranges(objective: Sequence[Slopes], limits: Sequence[Slopes], edges: Array, size: float) -> list[Price] | None:
    """Return the range of each shadow price: smallest and largest multiplier that balance the slopes.

    `size` is the largest slope of the objective, a unit of the balance. See `prices_of`.
    """
    shares, count = [*objective, *limits, *(Slopes.smooth(edge) for edge in edges)], len(objective)
    sizes = [max(float(np.abs(rows).max(initial=0.0)) for rows in (slopes.hull, slopes.segments)) for slopes in shares]
    scales = [size] * count + [slopes or 1.0 for slopes in sizes[count:]]
    parts = [
        part / scale for slopes, scale in zip(shares, scales, strict=True) for part in (slopes.corners, slopes.segments)
    ]
    columns = np.concatenate(parts)
    numbers = np.split(np.arange(len(columns)), np.cumsum([len(part) for part in parts])[:-1])
    # the last variable is the residual of the balance
    unit, last = np.eye(len(columns) + 1), len(columns)
    totals = np.array([unit[slopes].sum(axis=0) for slopes in numbers[::2]])
    pullback = np.concatenate([columns.T, np.zeros((columns.shape[1], 1))], axis=1)
    above = [pullback - unit[last], -pullback - unit[last], *(-unit[slopes] for slopes in numbers[::2]), -unit[last:]]
    maximum = [np.zeros(sum(map(len, above)))]
    for k, slopes in enumerate(numbers[1::2]):
        # a segment of the objective has factors up to one, a segment of a limit up to its price
        bound = totals[k] if k >= count else np.zeros(last + 1)
        above += [unit[slopes] - bound, -unit[slopes] - bound]
        maximum.append(np.full(2 * len(slopes), 1.0 if k < count else 0.0))
    matrix, right = np.concatenate([totals[:count], *above]), np.concatenate([np.ones(count), *maximum])
    residual = _minimum(unit[last], matrix, right, count)
    if not residual <= BALANCED:
        return None
    matrix, right = np.vstack([matrix, unit[last]]), np.append(right, 1.01 * residual + _RESIDUAL_MARGIN)
    prices = []
    for total, scale in zip(totals[count:], scales[count:], strict=True):
        low, high = (sign * _minimum(sign * total, matrix, right, count) for sign in (1.0, -1.0))
        if math.isnan(low) or math.isnan(high):
            return None
        prices.append(Price(max(low, 0.0) * size / scale, high * size / scale))
    return prices


def _minimum(cost: Array, matrix: Array, right: Array, equal: int) -> float:
    """Return the minimum of cost . x in a linear program; -inf if it is unbounded, NaN if the solver failed.

    The first `equal` rows of the matrix are equal to the right-hand side, the others are at most that.
    """
    import clarabel

    rows = ConeRows(len(cost))
    rows.add(np.arange(len(right))[:, None], np.arange(len(cost)), matrix, right)
    rows.cones += [clarabel.ZeroConeT(equal), clarabel.NonnegativeConeT(len(right) - equal)]
    answer = run_clarabel(rows, cost, {"tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10, "tol_feas": 1e-10})
    if "DualInfeasible" in str(answer.status):
        return -math.inf
    return float(cost @ np.asarray(answer.x)) if "Solved" in str(answer.status) else math.nan


def edges_at(decision: Decision, column: Array) -> dict[str, Array]:
    """Return outward normals of active bounds, shape (width,), by the name of the size or angle of a decision.

    The decision has the value `column` [SI], shape (width,).
    """
    bounds = decision.set
    if bounds.width == 1:
        tolerance = (bounds.scale if decision.is_affine else bounds.upper - bounds.lower) * ACTIVE
        value = float(column[0])
        normals = {decision.name: np.ones(1)} if value >= bounds.upper - tolerance else {}
        return {decision.name: -np.ones(1)} if value <= bounds.lower + tolerance else normals
    size = float(np.hypot(*column))
    if size <= bounds.scale * ACTIVE:
        return {}
    direction = column / size
    normals = {decision.name: direction} if size >= bounds.upper - bounds.scale * ACTIVE else {}
    turn = np.array([-direction[1], direction[0]])
    for edge, sign in zip(bounds.edges, (-1.0, 1.0), strict=False):
        if direction @ edge >= 1.0 - EDGE:
            # a rotation by one radian moves the vector by its size
            normals[decision.angle_name] = sign * turn / size
    return normals


def bounds_of(decision: Decision, column: Array, slope: Array) -> dict[str, Price]:
    """Return prices of active bounds of a decision at its value `column`, shape (width,).

    `slope` is the gradient of the Lagrangian without these bounds, shape (width,).
    """
    edges = edges_at(decision, column).items()
    return {name: Price.both(max(-float(slope @ normal) / float(normal @ normal), 0.0)) for name, normal in edges}


def affine_prices(
    problem: AffineProblem, limits: Sequence[Limit], x: Array, bound: Bound
) -> tuple[dict[Side, Price], dict[str, Price]]:
    """Return prices of limits, and of bounds of decisions by name, at an optimum x of affine norms (P19)."""
    multipliers = bound.multipliers
    solver = multipliers.shadow_prices(problem)
    prices = {
        # no design lies below a limit of zero
        (limit, "at most"): Price(price, math.inf if maximum == 0.0 else price)
        for limit, price, (maximum, _) in zip(limits, solver, problem.limits, strict=True)
    }  # fmt: skip
    active = [k for k, (maximum, norm) in enumerate(problem.limits) if norm.value(x) >= maximum * (1.0 - ACTIVE)]
    edges = {
        name: (domain.columns, normal)
        for domain in problem.domains
        for name, normal in edges_at(domain.decision, x[domain.columns]).items()
    }
    if not active and not edges:
        return prices, {}
    objective = [
        _slopes(norm, x, z, weight) for (weight, norm), z in zip(problem.terms, multipliers.terms, strict=True)
    ]
    limit_slopes = [
        _slopes(problem.limits[k][1], x, multipliers.limits[k] / solver[k] if solver[k] else None) for k in active
    ]  # fmt: skip
    # bounds of an angle act on a size of zero and have no price there
    apex = [
        (domain.columns, sign * np.array([-edge[1], edge[0]]))
        for domain in problem.domains
        if domain.width == 2 and float(np.hypot(*x[domain.columns])) <= domain.scale * ACTIVE
        for edge, sign in zip(domain.set.edges, (-1.0, 1.0), strict=False)
    ]
    normals = np.zeros((len(edges) + len(apex), problem.size))
    for row, (columns, normal) in zip(normals, [*edges.values(), *apex], strict=True):
        row[columns] = normal
    scaled = [None if slopes is None else slopes.scaled(problem.units) for slopes in (*objective, *limit_slopes)]
    known = [slopes for slopes in scaled if slopes is not None]
    count, ranges = len(objective), None
    if len(known) == len(scaled) and not problem.groups:
        ranges = prices_of(known[:count], known[count:], normals * problem.units)
    if ranges is None:
        # the gradient of the dual bound prices the bounds; the price of tightening is unknown
        left: dict[str, Price] = {}
        for domain in problem.domains:
            left |= bounds_of(domain.decision, x[domain.columns], bound.gradient[domain.columns])
        one_sided = {
            side: Price(price.relaxed, math.nan) for side, price in prices.items() if price.is_equal and price.relaxed
        }
        return prices | one_sided, {name: Price(price.relaxed, math.nan) for name, price in left.items()}
    for k, price in zip(active, ranges, strict=False):
        if not price.is_equal:
            side = limits[k], "at most"
            prices[side] = Price(price.relaxed, math.inf if problem.limits[k][0] == 0.0 else price.tightened)
    return prices, dict(zip(edges, ranges[len(active) :], strict=False))


def _slopes(norm: AffineNorm, x: Array, z: Array | None, weight: float = 1.0) -> Slopes | None:
    """Return all subgradients of a norm at a design x, times `weight`; None if unknown, or if too many rows are zero.

    `z` has dual rows of the norm, shape (k, d); None for those of a subgradient.
    """
    rows = norm.rows(x)
    kinks = norm.norm.subdifferential(norm.grid, rows, norm.norm.subgradient(norm.grid, rows) if z is None else z)
    if kinks is None or len(kinks.vanishing) > MAX_VANISHING:
        return None
    hull = np.array([norm.pullback(multiplier) for multiplier in (kinks.base, *kinks.others)])
    if len(kinks.longest):
        multiplier = rows[kinks.longest]
        hull = np.einsum(
            "ad,adn->an", multiplier / np.linalg.norm(multiplier, axis=1)[:, None], norm.slope[kinks.longest]
        )
    segments = [
        segment for k in kinks.vanishing for segment in _disc_segments(float(norm.grid.weights[k]) * norm.slope[k])
    ]  # fmt: skip
    return Slopes(weight * hull, weight * np.array(segments).reshape(-1, len(x)))


def _disc_segments(slope: Array) -> list[Array]:
    # segments that add up to the image of the unit ball, shape (n,) each
    sizes, directions = np.linalg.svd(slope, full_matrices=False)[1:]
    strong = sizes > EDGE * sizes.max(initial=0.0)
    axes = sizes[strong, None] * directions[strong]
    if len(axes) != 2:
        return list(axes)
    turns = math.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    return [0.5 * math.pi / _DIRECTIONS * (math.cos(t) * axes[0] + math.sin(t) * axes[1]) for t in turns]
