"""Worst errors of a design, and an upper bound over all errors (R4 to R7).

The objective is convex in the errors, so its maximum lies at an end of each interval and on the circle of each disc.
Branch and bound finds it: an interval is fixed at either end, a circle is divided into arcs, and the remaining errors
are bounded from above. All bounds come from rows of the exact model.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import BoundError
from laufruhe.load_models.affine import AffineNorm
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms.norm import lengths
from laufruhe.numerics.witness import is_over, report
from laufruhe.prove.branch_and_bound import BoundedParts, BranchAndBound, FathomedPart, OpenNode
from laufruhe.prove.witness import THIN, Witness

Terms: TypeAlias = Sequence[tuple[float, AffineNorm]]
"""Weights, and norms as functions of the errors."""

# relative rise that counts as rounding, and most nodes of branch and bound
ROUNDING = 1e-12
MAX_NODES = 5000
STARTS, CLIMBS = 12, 30
"""Random starts of the local search, and most steps of each."""
MAX_ENDS = 12
"""Most intervals with all ends enumerated in one node."""
MAJORANTS, BALL_STEPS = 6, 6
"""Most new majorants, and fixed-point steps for the points of balls, in one node."""
MAX_KNOWN, MIN_FALL = 12, 0.05
"""Most majorants of earlier nodes that a node uses, and share of the excess by which a new one must lower the bound."""


@dataclass(frozen=True, eq=False)
class WorstCase:
    """Worst errors found, with an upper bound over all errors.

    Attributes
    ----------
    errors
        Shape (columns,).
    value
        Weighted sum of the norms at these errors.
    bound
        Upper bound over all errors, without tolerance.
    nodes
        Count of nodes.
    """

    errors: Array
    value: float
    bound: float
    nodes: int


def value_at(terms: Terms, errors: Array) -> float:
    """Return the weighted sum of the norms at errors of shape (columns,)."""
    return sum(weight * norm.value(errors) for weight, norm in terms)


def worst_case(terms: Terms, columns: Sequence[slice], tolerance: float, maximum: int = MAX_NODES) -> WorstCase:
    """Return the largest objective over all manufacturing errors z: norms N of rows V0 + E z, weighted and added.

    Each error lies in an interval or a disc.

    Parameters
    ----------
    terms
        Weights and norms, with rows affine in z.
    columns
        Slice of each error: one column for an interval from -1 to 1, two for the unit disc.
    tolerance
        Relative gap at which the search ends.
    maximum
        Most nodes.
    """
    count = columns[-1].stop if columns else 0
    starts = np.random.default_rng(0).uniform(-1.0, 1.0, (STARTS + 1, count))
    starts[0] = 0.0
    for disc in columns:
        # scale points of the square into the disc
        starts[:, disc] /= np.maximum(np.hypot.reduce(starts[:, disc], axis=1), 1.0)[:, None]
    best = max((_climb(terms, columns, start) for start in starts), key=lambda point: point[0])
    if not count:
        return WorstCase(np.zeros(0), best[0], best[0], 0)
    search = _ErrorSearch(terms, tolerance, best)
    blocks = [ErrorBlock(error_columns, np.eye(error_columns.stop - error_columns.start)) for error_columns in columns]
    root = bound_node(terms, np.zeros(count), blocks, best[0], search.known)
    search.improve(_climb(terms, columns, root.errors))
    bound = search.divide((-root.bound, _Node(np.zeros(count), blocks, root.split)), maximum)
    value, errors = search.best
    if is_over(bound, -value):
        report(BoundError("upper bound of the worst case over manufacturing errors", -bound, value))
    return WorstCase(errors, value, -bound, search.node_count)


def check_worst(terms: Terms, columns: Sequence[slice], worst: WorstCase) -> None:
    """Report an error if the bound of a thin node around the worst errors is below their objective."""
    sides = [ErrorBlock(part, THIN * np.eye(part.stop - part.start)) for part in columns]
    thin = bound_node(terms, (1.0 - THIN) * worst.errors, sides, -math.inf, KnownBounds(terms))
    # the sum is maximised, and a witness bounds a minimum
    Witness(worst.errors, -worst.value).check_near(
        "upper bound of the worst case over manufacturing errors", -thin.bound
    )


@dataclass(frozen=True, eq=False)
class _Node:
    """Node of the search: centre, free blocks, and index of the block to divide next."""

    centre: Array
    blocks: list[ErrorBlock]
    split: int


class _ErrorSearch(BranchAndBound[_Node]):
    """Branch and bound over errors, which minimises the negative sum of norms."""

    what, reports_bounds = "boxes of errors", False

    def __init__(self, terms: Terms, tolerance: float, best: tuple[float, Array]) -> None:
        self._terms, self._tolerance, self.best = terms, tolerance, best
        self.known = KnownBounds(terms)

    def improve(self, point: tuple[float, Array]) -> None:
        """Store a value and its errors if they are worse than the worst so far."""
        self.best = max(self.best, point, key=lambda pair: pair[0])

    def is_fathomed(self, node: OpenNode[_Node]) -> bool:
        """Return True if no errors of a node are worse by the tolerance."""
        return -node.bound <= self.best[0] * (1.0 + self._tolerance)

    def branch(self, nodes: Sequence[OpenNode[_Node]]) -> BoundedParts[_Node]:
        """Yield the parts of a node with their bounds: an error at either end of its interval, or on arcs."""
        ((negative_bound, _, parent),) = nodes
        other_blocks = [block for k, block in enumerate(parent.blocks) if k != parent.split]
        for centre, free in parent.blocks[parent.split].parts(parent.centre):
            blocks = other_blocks if free is None else [*other_blocks, free]
            child = bound_node(self._terms, centre, blocks, self.best[0] * (1.0 + self._tolerance), self.known)
            self.improve((value_at(self._terms, child.errors), child.errors))
            # the bound of the parent also holds for the child
            bound = min(child.bound, -negative_bound)
            yield (-bound, _Node(centre, blocks, child.split)) if blocks else FathomedPart(-bound)


def _climb(terms: Terms, columns: Sequence[slice], errors: Array) -> tuple[float, Array]:
    """Return a local maximum of the objective and its errors: steps go to the extreme errors along the slope."""
    value = value_at(terms, errors)
    for _ in range(CLIMBS):
        slope = np.zeros(len(errors))
        for weight, norm in terms:
            slope += weight * np.einsum("kd,kdn->n", norm.subgradient(errors), norm.slope)
        next_errors = np.zeros(len(errors))
        for error_columns in columns:
            size = float(np.hypot.reduce(slope[error_columns]))
            next_errors[error_columns] = (
                slope[error_columns] / size if size > 0.0 else np.eye(error_columns.stop - error_columns.start)[0]
            )
        next_value = value_at(terms, next_errors)
        if next_value <= value * (1.0 + ROUNDING):
            return max((value, errors), (next_value, next_errors), key=lambda point: point[0])
        value, errors = next_value, next_errors
    return value, errors


@dataclass(frozen=True, eq=False)
class ErrorBlock:
    """Error that is free in a node, by local numbers: each from -1 to 1, or together in the unit disc.

    Attributes
    ----------
    columns
        Slice in the vector of errors.
    spans
        Change of the errors per local number, shape (width, width).
    arc
        Middle and half angle of an arc [rad]; None for an interval or a whole disc.
    """

    columns: slice
    spans: Array
    arc: tuple[float, float] | None = None

    @property
    def is_disc(self) -> bool:
        """True if its local numbers lie in the unit disc, False for intervals."""
        return self.arc is None and len(self.spans) > 1

    @property
    def vertices(self) -> tuple[tuple[float, ...], ...]:
        """Vertices of an interval, or of a trapezoid around an arc, in local numbers (R7)."""
        if self.arc is None:
            return ((1.0,), (-1.0,))
        top = 0.5 / math.cos(0.5 * self.arc[1]) ** 2
        return ((1.0, top), (1.0, -top), (-1.0, 1.0), (-1.0, -1.0))

    def parts(self, centre: Array) -> list[tuple[Array, ErrorBlock | None]]:
        """Return smaller blocks of errors, with centres, that together contain all extreme points of this block."""
        if len(self.spans) == 1:
            ends = [centre.copy(), centre.copy()]
            for end, sign in zip(ends, (1.0, -1.0), strict=True):
                end[self.columns] += sign * self.spans[0]
            return [(end, None) for end in ends]
        if self.arc is None:
            return [self._arc(centre, 0.5 * np.pi * quarter, 0.25 * np.pi) for quarter in range(4)]
        middle, half = self.arc
        return [self._arc(centre, middle + side * 0.5 * half, 0.5 * half) for side in (-1.0, 1.0)]

    def _arc(self, centre: Array, middle: float, half: float) -> tuple[Array, ErrorBlock]:
        radial = np.array([np.cos(middle), np.sin(middle)])
        tangential = np.array([-radial[1], radial[0]])
        cosine = float(np.cos(half))
        new_centre = centre.copy()
        new_centre[self.columns] = 0.5 * (1.0 + cosine) * radial
        spans = np.stack([0.5 * (1.0 - cosine) * radial, np.sin(half) * tangential], axis=1)
        return new_centre, ErrorBlock(self.columns, spans, (middle, half))


@dataclass(frozen=True, eq=False)
class NodeBound:
    """Upper bound over a node, index of the block to divide next, and errors that are near the worst."""

    bound: float
    split: int
    errors: Array


class KnownBounds:
    """Bounds that all nodes of one search share: reaches of blocks, and majorants of the terms that have them (R6).

    A majorant c + g . z + z . H z / 2 is an upper bound at all errors z, so that a later node needs few new ones.
    """

    def __init__(self, terms: Terms) -> None:
        self._terms = terms
        self.reaches: list[dict[_Key, _Reach]] = [{} for _ in terms]
        self.has_majorant = [
            norm.norm.majorant(norm.grid, lengths(norm.constant)) is not None for _, norm in terms
        ]  # fmt: skip
        self.majorants: list[tuple[float, Array, Array]] = []
        # rows as functions of 1 and z
        self._columns = [
            np.concatenate([norm.constant[..., None], norm.slope], axis=2).reshape(norm.constant.size, -1)
            for _, norm in terms
        ]  # fmt: skip

    def touch(self, row_lengths: Sequence[Array]) -> tuple[float, Array, Array]:
        """Return the majorant that is exact at given lengths of the rows of each term, and keep it."""
        size = self._columns[0].shape[1]
        offset, form = 0.0, np.zeros((size, size))
        for (weight, norm), sizes, columns in zip(self._terms, row_lengths, self._columns, strict=True):
            majorant = norm.norm.majorant(norm.grid, sizes)
            if majorant is not None:
                factors = np.repeat(weight * majorant[0], norm.constant.shape[1])
                # a margin for rounding
                offset += weight * majorant[1] * (1.0 + ROUNDING)
                form += columns.T @ (factors[:, None] * columns)
        self.majorants.append((offset + 0.5 * float(form[0, 0]), form[0, 1:], form[1:, 1:]))
        return self.majorants[-1]


def bound_node(
    terms: Terms, centre: Array, blocks: Sequence[ErrorBlock], cutoff: float, known: KnownBounds
) -> NodeBound:
    """Return an upper bound of the objective over all errors of a node (R5, R6).

    Parameters
    ----------
    terms
        Weights and norms.
    centre
        Errors about which the blocks are free, shape (columns,).
    blocks
        Free blocks.
    cutoff
        Bound at which the node is fathomed and no better bound is needed.
    known
        Bounds of earlier nodes; those of this node are added.
    """
    if not blocks:
        return NodeBound(value_at(terms, centre), -1, centre)
    reaches = [
        [_reach(norm, block, cached) for block in blocks]
        for (_, norm), cached in zip(terms, known.reaches, strict=True)
    ]  # fmt: skip
    sizes = np.array([[weight * r.size for r in of_term] for (weight, _), of_term in zip(terms, reaches, strict=True)])
    with_majorant = np.array(known.has_majorant)
    over = _OverBlocks(centre, blocks, sizes[with_majorant].sum(axis=0), sizes[~with_majorant].sum(axis=0))
    separate = sum(
        _separate_bound(*term, centre, blocks, of_term)
        for term, of_term, has_majorant in zip(terms, reaches, known.has_majorant, strict=True) if not has_majorant
    )  # fmt: skip
    if not with_majorant.any():
        over.lower((separate, np.zeros(len(centre)), np.zeros((len(centre), len(centre)))))
        return NodeBound(over.bound, over.split, over.errors)
    cutoff -= separate
    if not known.majorants:
        known.touch([
            np.sqrt(np.square(lengths(norm.rows(centre))) + sum(np.square(r.rows) for r in of_term))
            for (_, norm), of_term in zip(terms, reaches, strict=True)
        ])  # fmt: skip
    for majorant in reversed(known.majorants[-MAX_KNOWN:]):
        over.lower(majorant, cutoff)
    for _ in range(MAJORANTS):
        if over.bound <= cutoff:
            break
        rows = [norm.rows(over.point) for _, norm in terms]
        value = sum(
            weight * norm.norm.value(norm.grid, row)
            for (weight, norm), row, has_majorant in zip(terms, rows, known.has_majorant, strict=True) if has_majorant
        )  # fmt: skip
        # no majorant is lower than the value at a point of the node
        if over.bound <= value * (1.0 + 2.0 * ROUNDING):
            break
        before = over.bound
        over.lower(known.touch([lengths(row) for row in rows]), cutoff)
        if value > cutoff or before - over.bound < MIN_FALL * (before - cutoff):
            break
    return NodeBound(separate + over.bound, over.split, over.errors)


class _OverBlocks:
    """Upper bound over a node: the least of several majorants at each combination of vertices.

    The vertices of blocks with up to MAX_ENDS numbers are enumerated. The other blocks are bounded as balls (R6a).

    Attributes
    ----------
    split
        Index of the block to divide next. Blocks have `sizes` in terms with majorants, which are exact at enumerated
        ends of intervals, and `other_sizes` in terms without.
    """

    def __init__(self, centre: Array, blocks: Sequence[ErrorBlock], sizes: Array, other_sizes: Array) -> None:
        self._centre, self._blocks = centre, blocks
        ends = np.cumsum([0, *(len(block.spans) for block in blocks)])
        numbers_of = [list(range(a, b)) for a, b in itertools.pairwise(ends)]
        self._spans = np.zeros((len(centre), ends[-1]))
        for block, numbers in zip(blocks, numbers_of, strict=True):
            self._spans[block.columns, numbers[0] : numbers[-1] + 1] = block.spans
        enumerated: list[int] = []
        count = 0
        # majorants alone need vertices
        for k in np.argsort(-sizes, kind="stable") if sizes.any() else ():
            if not blocks[k].is_disc and count + len(numbers_of[k]) <= MAX_ENDS:
                enumerated.append(int(k))
                count += len(numbers_of[k])
        self._enumerated = [j for k in enumerated for j in numbers_of[k]]
        self._vertices = _vertices(tuple(blocks[k].vertices for k in enumerated))
        others = [k for k in range(len(blocks)) if k not in enumerated]
        self._others = [j for k in others for j in numbers_of[k]]
        # a disc is one ball; each number of an interval or an arc is a ball of its own
        self._firsts = np.array([
            self._others.index(j) for k in others for j in (numbers_of[k][:1] if blocks[k].is_disc else numbers_of[k])
        ], dtype=int)  # fmt: skip
        # the ends of an interval are errors; the outer vertices of an arc are farther out the wider the arc
        shares = [
            1.0 if k not in enumerated else 0.0 if block.arc is None else block.arc[1] for k, block in enumerate(blocks)
        ]
        weights = sizes + other_sizes if other_sizes.any() else sizes * shares
        self.split = int(np.argmax(weights if weights.any() else sizes))
        self._bounds = np.full(len(self._vertices), math.inf)
        self._points = np.zeros((len(self._vertices), len(self._others)))

    def lower(self, majorant: tuple[float, Array, Array], cutoff: float = -math.inf) -> None:
        """Lower the bounds of the vertices above the cutoff by another majorant."""
        rows = np.flatnonzero(self._bounds > cutoff)
        if not len(rows):
            return
        constant, slope, curvature = majorant
        curved, vertices = curvature @ self._centre, self._vertices[rows]
        constant += float(slope @ self._centre) + 0.5 * float(self._centre @ curved)
        slope, curvature = self._spans.T @ (slope + curved), self._spans.T @ curvature @ self._spans
        slope_changes = vertices @ curvature[self._enumerated]
        pulls = slope[self._others] + slope_changes[:, self._others]
        values = constant + vertices @ slope[self._enumerated]
        values += 0.5 * np.einsum("sn,sn->s", slope_changes[:, self._enumerated], vertices)
        balls, points = _over_balls(pulls, curvature[np.ix_(self._others, self._others)], self._firsts)
        is_lower = values + balls < self._bounds[rows]
        self._bounds[rows[is_lower]] = (values + balls)[is_lower]
        self._points[rows[is_lower]] = points[is_lower]

    @property
    def bound(self) -> float:
        """Upper bound over the node."""
        return float(self._bounds.max())

    @property
    def point(self) -> Array:
        """Errors at the vertices with the largest bound, shape (columns,)."""
        best, numbers = int(np.argmax(self._bounds)), np.zeros(self._spans.shape[1])
        numbers[self._enumerated], numbers[self._others] = self._vertices[best], self._points[best]
        return np.asarray(self._centre + self._spans @ numbers)

    @property
    def errors(self) -> Array:
        """Errors of the node near `point`, shape (columns,): each error in the plane on the circle of its disc."""
        errors = self.point
        for block in self._blocks:
            if len(block.spans) > 1:
                errors[block.columns] /= float(np.hypot(*errors[block.columns])) or 1.0
        return errors


def _separate_bound(
    weight: float, norm: AffineNorm, centre: Array, blocks: Sequence[ErrorBlock], reaches: Sequence[_Reach]
) -> float:
    """Return an upper bound of a weighted norm over a node, as if each row had its own worst errors (R5)."""
    kind, grid, rows = norm.norm, norm.grid, norm.rows(centre)
    bound = weight * (kind.value(grid, rows) + sum(reach.size for reach in reaches))
    if not kind.is_monotone_in_lengths:
        return bound
    pull_sum = np.zeros(len(rows))
    for block, reach in zip(blocks, reaches, strict=True):
        pulls = np.einsum("kd,kdn->kn", rows, reach.move)
        pull_sum += np.hypot.reduce(pulls, axis=1) if block.is_disc else np.abs(pulls).sum(axis=1)
    reach_sum, row_lengths = np.sum([reach.rows for reach in reaches], axis=0), lengths(rows)
    longest = np.sqrt(np.square(row_lengths) + 2.0 * pull_sum + np.square(reach_sum))
    longest = np.minimum(row_lengths + reach_sum, longest)
    return min(bound, weight * kind.value(grid, longest[:, None]))


def _over_balls(slopes: Array, curvature: Array, firsts: NDArray[np.int_]) -> tuple[Array, Array]:
    """Return upper bounds of a . u + u . H u / 2 over vectors u whose part in each ball has length one (R6a).

    Parameters
    ----------
    slopes
        Vectors a, shape (s, n).
    curvature
        Matrix H, shape (n, n).
    firsts
        Index of the first number of each ball.

    Returns
    -------
    Bounds, shape (s,), and the points about which they are taken, shape (s, n).
    """
    if not len(curvature):
        return np.zeros(len(slopes)), np.zeros((len(slopes), 0))
    sizes = np.diff([*firsts, len(curvature)])

    def lengths_of(vectors: Array) -> Array:
        return np.asarray(np.sqrt(np.add.reduceat(np.square(vectors), firsts, axis=1)))

    # the mean curvature of each ball is constant on its sphere
    mean_curvature = np.add.reduceat(np.diag(curvature), firsts) / sizes
    deviation = curvature - np.diag(np.repeat(mean_curvature, sizes))
    largest_eigenvalue = float(np.linalg.eigvalsh(deviation)[-1])
    points, gradient = np.zeros_like(slopes), slopes
    for _ in range(BALL_STEPS):
        size = np.repeat(lengths_of(gradient), sizes, axis=1)
        points = np.where(size > 0.0, gradient / np.where(size > 0.0, size, 1.0), 0.0)
        # without a gradient any point of the sphere will do
        points[:, firsts] += lengths_of(points) == 0.0
        gradient = slopes + points @ deviation
    ball_lengths = lengths_of(gradient - largest_eigenvalue * points) + largest_eigenvalue
    bound = (
        ball_lengths.sum(axis=1)
        - 0.5 * np.einsum("sn,sn->s", points @ deviation, points)
        + 0.5 * float(mean_curvature.sum())
    )
    return bound, points


@lru_cache(maxsize=256)
def _vertices(vertices_of: tuple[tuple[tuple[float, ...], ...], ...]) -> Array:
    # all combinations of the vertices of blocks, shape (combinations, numbers)
    combinations = [list(itertools.chain(*parts)) for parts in itertools.product(*vertices_of)]
    return np.array(combinations).reshape(len(combinations), -1)


@dataclass(frozen=True, eq=False)
class _Reach:
    """Change of rows by a block: `move`, (k, d, w), its maximum per row `rows`, (k,), and rise `size` of the norm."""

    move: Array
    rows: Array
    size: float


_Key: TypeAlias = tuple[int, tuple[float, float] | None]


def _reach(norm: AffineNorm, block: ErrorBlock, cache: dict[_Key, _Reach]) -> _Reach:
    key = block.columns.start, block.arc
    if key not in cache:
        move = norm.slope[..., block.columns] @ block.spans
        columns = [move[..., j] for j in range(move.shape[-1])]
        if block.is_disc:
            gram = np.einsum("kdi,kdj->kij", move, move)
            mean, half = 0.5 * (gram[:, 0, 0] + gram[:, 1, 1]), 0.5 * (gram[:, 0, 0] - gram[:, 1, 1])
            rows = np.sqrt(mean + np.hypot(half, gram[:, 0, 1]))
        else:
            rows = sum((lengths(column) for column in columns), np.zeros(len(move)))
        kind, grid = norm.norm, norm.grid
        rise = (
            kind.value(grid, rows[:, None])
            if kind.is_monotone_in_lengths
            else sum(kind.value(grid, c) for c in columns)
        )
        cache[key] = _Reach(move, rows, rise)
    return cache[key]
