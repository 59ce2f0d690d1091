"""Prices of limits and bounds on either side: least and largest multipliers that hold an optimum (P5, P19)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import Decision
from laufruhe.problem.measure import Limit, Side
from laufruhe.problem.sets import EDGE
from laufruhe.prove.certificate import Bound
from laufruhe.solvers.cones.cone_program import ConeRows, run_clarabel

ALIKE = 0.02
"""Share of the larger price up to which two sides are one."""
INDEPENDENT, BALANCED = 1e-3, 1e-2
"""Least share of its length that a slope has across all others, and what may be left of all, where prices are told."""
_SPARE = 1e-6
ACTIVE = 1e-5
"""Share of a limit, and of the scale of a decision, by which it may be missed and be active."""
MOST_VANISHING, _WAYS, MOST_CORNERS = 64, 8, 256
"""Rows that vanish of a number that is told, ways in which a segment stands for a disc, and corners of a hull."""


@dataclass(frozen=True)
class Price:
    """Price of an edge [unit of the objective per unit of the edge].

    Attributes
    ----------
    relaxed
        Fall of the objective as the edge is relaxed.
    tightened
        Rise as it is tightened; not a number where that is not known.
    """

    relaxed: float
    tightened: float

    def __post_init__(self) -> None:
        if self.tightened < self.relaxed:
            object.__setattr__(self, "tightened", self.relaxed)

    @classmethod
    def both(cls, price: float) -> Price:
        """Return the price of an edge that is worth the same on both sides."""
        return cls(price, price)

    def __add__(self, other: Price) -> Price:
        """Return the price of two edges that move together."""
        return Price(self.relaxed + other.relaxed, self.tightened + other.tightened)

    @property
    def is_one(self) -> bool:
        """Tell if both sides are alike."""
        return self.relaxed >= (1.0 - ALIKE) * self.tightened

    @property
    def other(self) -> float | None:
        """The price as it is tightened, None where that is the same."""
        return None if self.is_one or math.isnan(self.relaxed) else self.tightened

    def felt(self, minimum: float) -> Price:
        """Return it without what is no more than a rounding."""
        relaxed, tightened = (0.0 if price <= minimum else price for price in (self.relaxed, self.tightened))
        return Price(relaxed, tightened)


@dataclass(frozen=True, eq=False)
class Slopes:
    """Subgradients of a convex function at a design: a convex hull, and segments added to it (P19).

    Attributes
    ----------
    hull
        Shape (m, n): one row of a number that is smooth there.
    segments
        Shape (s, n): each may be added up to once, in both senses.
    """

    hull: Array
    segments: Array

    @classmethod
    def smooth(cls, slope: Array) -> Slopes:
        """Return the only slope of a number without a kink."""
        return cls(slope[None], np.zeros((0, len(slope))))

    def scaled(self, units: Array) -> Slopes:
        """Return them in other units of the decisions."""
        return Slopes(self.hull * units, self.segments * units)

    @property
    def corners(self) -> Array:
        """The hull, or of a large one its outermost rows in as many directions as corners are told.

        All rows of a signal of constant length are as long as the longest; a circle of 256 corners lacks 1e-4.
        """
        step = -(-len(self.hull) // MOST_CORNERS)
        if step == 1:
            return self.hull
        ways = (self.hull - self.hull.mean(axis=0))[::step]
        return np.asarray(self.hull[np.unique(np.argmax(self.hull @ ways.T, axis=0))])

    @property
    def is_smooth(self) -> bool:
        """Tell if there is one slope alone."""
        return len(self.hull) + len(self.segments) == 1


def prices_of(objective: Sequence[Slopes], limits: Sequence[Slopes], edges: Array) -> list[Price] | None:
    """Return the price of every limit, then of every edge of a set (P19).

    Parameters
    ----------
    objective
        Of every term, its weight in it.
    limits
        Of those that the design stands at.
    edges
        Outward normals of the sets' edges that it stands at, shape (edges, n).

    Returns
    -------
    None where slopes do not balance: the design is no optimum to first order, or a kink of it is not told.
    """
    count = len(limits) + len(edges)
    if not count:
        return []
    slope = np.sum([own.hull[0] for own in objective], axis=0)
    turns = [rows for own in objective for rows in (np.ptp(own.hull, axis=0), own.segments)]
    size = max(float(np.abs(rows).max(initial=0.0)) for rows in (slope, *turns))
    if not size:
        return None
    if all(own.is_smooth for own in (*objective, *limits)):
        unique = _unique(np.concatenate([*(own.hull for own in limits), edges]), slope)
        if unique is not None:
            return [Price.both(price) for price in unique]
    return _ranges(objective, limits, edges, size)


def _unique(rows: Array, slope: Array) -> list[float] | None:
    # None for dependent slopes, or slopes that do not balance
    lengths = np.linalg.norm(rows, axis=1)
    if not lengths.all():
        return None
    scaled = rows / lengths[:, None]
    if np.linalg.svd(scaled, compute_uv=False).min() < INDEPENDENT or len(rows) > rows.shape[1]:
        return None
    found = np.linalg.lstsq(scaled.T, -slope)[0]
    if np.abs(scaled.T @ found + slope).max() > BALANCED * np.abs(slope).max():
        return None
    return [float(price) for price in np.maximum(found, 0.0) / lengths]


def _ranges(objective: Sequence[Slopes], limits: Sequence[Slopes], edges: Array, size: float) -> list[Price] | None:
    """Return least and largest multiplier of each by linear programs over all that balance."""
    shares, count = [*objective, *limits, *(Slopes.smooth(edge) for edge in edges)], len(objective)
    sizes = [max(float(np.abs(rows).max(initial=0.0)) for rows in (own.hull, own.segments)) for own in shares]
    scales = [size] * count + [own or 1.0 for own in sizes[count:]]
    parts = [part / scale for own, scale in zip(shares, scales, strict=True) for part in (own.corners, own.segments)]
    columns = np.concatenate(parts)
    numbers = np.split(np.arange(len(columns)), np.cumsum([len(part) for part in parts])[:-1])
    # the last number is what is left of the balance
    each, last = np.eye(len(columns) + 1), len(columns)
    totals = np.array([each[own].sum(axis=0) for own in numbers[::2]])
    pullback = np.concatenate([columns.T, np.zeros((columns.shape[1], 1))], axis=1)
    above = [pullback - each[last], -pullback - each[last], *(-each[own] for own in numbers[::2]), -each[last:]]
    maximum = [np.zeros(sum(map(len, above)))]
    for k, own in enumerate(numbers[1::2]):
        # a segment of the objective is added once, that of a limit as often as its price
        held = totals[k] if k >= count else np.zeros(last + 1)
        above += [each[own] - held, -each[own] - held]
        maximum.append(np.full(2 * len(own), 1.0 if k < count else 0.0))
    program = _Program(np.concatenate([totals[:count], *above]), np.concatenate([np.ones(count), *maximum]), count)
    left = program.minimum(each[last])
    if not left <= BALANCED:
        return None
    program = program.under(each[last], 1.01 * left + _SPARE)
    found = []
    for total, scale in zip(totals[count:], scales[count:], strict=True):
        low, high = program.minimum(total), -program.minimum(-total)
        if math.isnan(low) or math.isnan(high):
            return None
        found.append(Price(max(low, 0.0) * size / scale, high * size / scale))
    return found


@dataclass(frozen=True, eq=False)
class _Program:
    """Linear program of numbers: the first rows are equal to the right, the others no more."""

    rows: Array
    right: Array
    equal: int

    def under(self, row: Array, maximum: float) -> _Program:
        """Return it with one more row."""
        return replace(self, rows=np.vstack([self.rows, row]), right=np.append(self.right, maximum))

    def minimum(self, cost: Array) -> float:
        """Return the least cost; less than any number where it has none, and no number where the solver stopped."""
        import clarabel

        rows = ConeRows(len(cost))
        rows.add(np.arange(len(self.right))[:, None], np.arange(len(cost)), self.rows, self.right)
        rows.cones += [clarabel.ZeroConeT(self.equal), clarabel.NonnegativeConeT(len(self.right) - self.equal)]
        answer = run_clarabel(rows, cost, {"tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10, "tol_feas": 1e-10})
        status = str(answer.status)
        if "DualInfeasible" in status:
            return -math.inf
        return float(cost @ np.asarray(answer.x)) if "Solved" in status else math.nan


def edges_at(decision: Decision, column: Array) -> dict[str, Array]:
    """Outward normals of the edges that a decision stands at, by the name of its size or angle, shape (width,)."""
    own = decision.set
    if own.width == 1:
        reach = (own.scale if decision.is_affine else own.upper - own.lower) * ACTIVE
        at = float(column[0])
        found = {decision.name: np.ones(1)} if at >= own.upper - reach else {}
        return {decision.name: -np.ones(1)} if at <= own.lower + reach else found
    size = float(np.hypot(*column))
    if size <= own.scale * ACTIVE:
        return {}
    along = column / size
    found = {decision.name: along} if size >= own.upper - own.scale * ACTIVE else {}
    turn = np.array([-along[1], along[0]])
    for edge, sign in zip(own.edges, (-1.0, 1.0), strict=False):
        if along @ edge >= 1.0 - EDGE:
            # a turn of one radian moves as far as the size
            found[angle_name(decision)] = sign * turn / size
    return found


def _at_nothing(decision: Decision, column: Array) -> list[Array]:
    # outward normals of the edges of an angle, at a size of zero, shape (2,) each
    own = decision.set
    if own.width == 1 or own.free_angle or float(np.hypot(*column)) > own.scale * ACTIVE:
        return []
    return [sign * np.array([-edge[1], edge[0]]) for edge, sign in zip(own.edges, (-1.0, 1.0), strict=False)]


def bounds_of(decision: Decision, column: Array, slope: Array) -> dict[str, Price]:
    """Return prices of the edges that a decision stands at, where this slope is left of all else."""
    edges = edges_at(decision, column).items()
    return {name: Price.both(max(-float(slope @ normal) / float(normal @ normal), 0.0)) for name, normal in edges}


def affine_prices(
    problem: AffineProblem, limits: Sequence[Limit], x: Array, bound: Bound
) -> tuple[dict[Side, Price], dict[str, Price]]:
    """Return prices of limits and of the bounds of sizes and angles, at an optimum of affine norms (P19)."""
    found = bound.multipliers
    solver = found.shadow_prices(problem)
    prices = {
        # no design is under a limit of nothing
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
    objective = [_slopes(norm, x, z, weight) for (weight, norm), z in zip(problem.terms, found.terms, strict=True)]
    held = [
        _slopes(problem.limits[k][1], x, found.limits[k] / solver[k] if solver[k] else None) for k in active
    ]  # fmt: skip
    # at nothing a size is held by the edges of its angle, which have no prices there
    apex = [
        (domain.columns, own) for domain in problem.domains for own in _at_nothing(domain.decision, x[domain.columns])
    ]
    normals = np.zeros((len(edges) + len(apex), problem.size))
    for row, (columns, normal) in zip(normals, [*edges.values(), *apex], strict=True):
        row[columns] = normal
    scaled = [None if own is None else own.scaled(problem.units) for own in (*objective, *held)]
    known = [own for own in scaled if own is not None]
    count, ranges = len(objective), None
    if len(known) == len(scaled) and not problem.groups:
        ranges = prices_of(known[:count], known[count:], normals * problem.units)
    if ranges is None:
        # what the bound itself leaves over prices the edges; how far the sides lie apart is not known
        left: dict[str, Price] = {}
        for domain in problem.domains:
            left |= bounds_of(domain.decision, x[domain.columns], bound.gradient[domain.columns])
        one_sided = {
            side: Price(price.relaxed, math.nan) for side, price in prices.items() if price.is_one and price.relaxed
        }
        return prices | one_sided, {name: Price(price.relaxed, math.nan) for name, price in left.items()}
    for k, price in zip(active, ranges, strict=False):
        if not price.is_one:
            side = limits[k], "at most"
            prices[side] = Price(price.relaxed, math.inf if problem.limits[k][0] == 0.0 else price.tightened)
    return prices, dict(zip(edges, ranges[len(active) :], strict=False))


def _slopes(norm: AffineNorm, x: Array, z: Array | None, weight: float = 1.0) -> Slopes | None:
    """Return all slopes of a norm at a design; None where they are not known, or too much of it vanishes."""
    rows = norm.rows(x)
    kinks = norm.norm.kinks(norm.grid, rows, norm.norm.subgradient(norm.grid, rows) if z is None else z)
    if kinks is None or len(kinks.vanishing) > MOST_VANISHING:
        return None
    hull = np.array([norm.pullback(own) for own in (kinks.base, *kinks.others)])
    if len(kinks.longest):
        own = rows[kinks.longest]
        hull = np.einsum("ad,adn->an", own / np.linalg.norm(own, axis=1)[:, None], norm.slope[kinks.longest])
    segments = [
        segment for k in kinks.vanishing for segment in _disc(float(norm.grid.weights[k]) * norm.slope[k])
    ]  # fmt: skip
    return Slopes(weight * hull, weight * np.array(segments).reshape(-1, len(x)))


def _disc(slope: Array) -> list[Array]:
    # segments whose sum is the image of the unit ball, shape (n,) each
    sizes, ways = np.linalg.svd(slope, full_matrices=False)[1:]
    strong = sizes > EDGE * sizes.max(initial=0.0)
    axes = sizes[strong, None] * ways[strong]
    if len(axes) != 2:
        return list(axes)
    turns = math.pi * np.arange(_WAYS) / _WAYS
    return [0.5 * math.pi / _WAYS * (math.cos(t) * axes[0] + math.sin(t) * axes[1]) for t in turns]


def angle_name(decision: Decision) -> str:
    """Name the angle of an open size."""
    return decision.name.rsplit(".", 1)[0] + ".angle"
