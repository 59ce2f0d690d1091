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
from functools import cache
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
MAJORANTS, BALL_STEPS = 3, 6
"""Most majorants, and fixed-point steps for the points of balls, in one node."""


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
    root = bound_node(terms, np.zeros(count), blocks, best[0], search.reaches)
    search.improve(_climb(terms, columns, root.errors))
    bound = search.divide((-root.bound, _Node(np.zeros(count), blocks, root.split)), maximum)
    value, errors = search.best
    if is_over(bound, -value):
        report(BoundError("upper bound of the worst case over manufacturing errors", -bound, value))
    return WorstCase(errors, value, -bound, search.node_count)


def check_worst(terms: Terms, columns: Sequence[slice], worst: WorstCase) -> None:
    """Report an error if the bound of a thin node around the worst errors is below their objective."""
    sides = [ErrorBlock(part, THIN * np.eye(part.stop - part.start)) for part in columns]
    thin = bound_node(terms, (1.0 - THIN) * worst.errors, sides, -math.inf, [{} for _ in terms])
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
        self.reaches: Reaches = [{} for _ in terms]

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
            child = bound_node(self._terms, centre, blocks, self.best[0] * (1.0 + self._tolerance), self.reaches)
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


def bound_node(terms: Terms, centre: Array, blocks: Sequence[ErrorBlock], cutoff: float, reaches: Reaches) -> NodeBound:
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
    reaches
        Cache of the changes by blocks, one for each term; filled here.
    """
    parts = [_TermAbout(*term, centre, blocks, cached) for term, cached in zip(terms, reaches, strict=True)]
    if not blocks:
        return NodeBound(sum(part.separate_bound() for part in parts), -1, centre)
    best_point = np.ones(parts[0].moves.shape[2])
    touching_lengths = [np.sqrt(np.square(part.lengths) + np.square(part.reaches).sum(axis=0)) for part in parts]
    best = math.inf
    for k in range(MAJORANTS):
        majorants = [
            part.norm.norm.majorant(part.norm.grid, sizes) for part, sizes in zip(parts, touching_lengths, strict=True)
        ]
        if not any(majorants):
            best = sum(part.separate_bound() for part in parts)
            break
        bound, point = _over_majorants(parts, majorants, blocks)
        if bound < best:
            best, best_point = bound, point
        row_lengths = [lengths(part.rows + part.moves @ point) for part in parts]
        value = sum(part.value(sizes) for part, sizes in zip(parts, row_lengths, strict=True))
        if best <= cutoff or best <= value * (1.0 + ROUNDING):
            break
        touching_lengths = [(a * k + b) / (k + 1) for a, b in zip(touching_lengths, row_lengths, strict=True)]
    errors, first = centre.copy(), 0
    for block in blocks:
        width = len(block.spans)
        errors[block.columns] += block.spans @ best_point[first : first + width]
        if width > 1:
            # move the error to the circle of its disc
            errors[block.columns] /= float(np.hypot(*errors[block.columns])) or 1.0
        first += width
    return NodeBound(best, int(np.argmax(np.sum([part.sizes for part in parts], axis=0))), errors)


class _TermAbout:
    """Weighted norm about a centre, and its changes by the local numbers of all blocks.

    Attributes
    ----------
    rows, lengths
        Rows at the centre, shape (k, d), and their lengths, shape (k,).
    moves
        Change of the rows per local number, shape (k, d, n).
    slices
        Slice of each block among the n local numbers.
    reaches
        Largest change of each row by each block, shape (blocks, k).
    sizes
        Largest rise of the weighted norm by each block, shape (blocks,).
    """

    def __init__(
        self, weight: float, norm: AffineNorm, centre: Array, blocks: Sequence[ErrorBlock], cached: dict[_Key, _Reach]
    ) -> None:
        self.weight, self.norm, self.blocks = weight, norm, blocks
        self.rows = norm.rows(centre)
        self.lengths = lengths(self.rows)
        block_reaches = [_reach(norm, block, cached) for block in blocks]
        ends = np.cumsum([0, *(reach.move.shape[-1] for reach in block_reaches)])
        self.slices = [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]
        self.moves = np.concatenate([np.zeros((*self.rows.shape, 0)), *(reach.move for reach in block_reaches)], axis=2)
        self.reaches = np.array([reach.rows for reach in block_reaches]).reshape(len(blocks), len(self.rows))
        self.sizes = weight * np.array([reach.size for reach in block_reaches])

    def separate_bound(self) -> float:
        """Return an upper bound of the weighted norm, as if each row had its own worst errors (R5)."""
        kind, grid, rows = self.norm.norm, self.norm.grid, self.rows
        bound = self.weight * kind.value(grid, rows) + float(self.sizes.sum())
        if not kind.is_monotone_in_lengths:
            return bound
        pulls = np.einsum("kd,kdn->kn", rows, self.moves)
        pull_sum = np.zeros(len(rows))
        for block, numbers in zip(self.blocks, self.slices, strict=True):
            pull_sum += (
                np.hypot.reduce(pulls[:, numbers], axis=1) if block.is_disc else np.abs(pulls[:, numbers]).sum(axis=1)
            )
        reach_sum = self.reaches.sum(axis=0)
        longest = np.sqrt(np.square(self.lengths) + 2.0 * pull_sum + np.square(reach_sum))
        longest = np.minimum(self.lengths + reach_sum, longest)
        return min(bound, self.weight * kind.value(grid, longest[:, None]))

    def value(self, sizes: Array) -> float:
        """Return the weighted norm of rows of lengths `sizes`, shape (k,); 0 if the norm needs more than lengths."""
        kind = self.norm.norm
        return self.weight * kind.value(self.norm.grid, sizes[:, None]) if kind.is_monotone_in_lengths else 0.0


def _over_majorants(
    parts: Sequence[_TermAbout], majorants: Sequence[tuple[Array, float] | None], blocks: Sequence[ErrorBlock]
) -> tuple[float, Array]:
    """Return an upper bound of quadratic functions above the norms, over all errors of a node, and its point, (n,).

    The ends of up to MAX_ENDS intervals are enumerated, so that the majorants are exact there. The other blocks are
    bounded one by one.
    """
    numbers_of = parts[0].slices
    count = parts[0].moves.shape[2]
    constant, slope, curvature = 0.0, np.zeros(count), np.zeros((count, count))
    for part, majorant in zip(parts, majorants, strict=True):
        if majorant is None:
            constant += part.separate_bound()
            continue
        factors, offset = part.weight * majorant[0], part.weight * majorant[1]
        weighted = (factors[:, None, None] * part.moves).reshape(-1, count)
        constant += offset + 0.5 * float(factors @ np.square(part.lengths))
        slope += weighted.T @ part.rows.reshape(-1)
        curvature += weighted.T @ part.moves.reshape(-1, count)
    ends = [k for k, block in enumerate(blocks) if not block.is_disc]
    ends.sort(key=lambda k: -float(np.abs(curvature[numbers_of[k]]).sum()))
    enumerated: list[int] = []
    for k in ends:
        if len(enumerated) + numbers_of[k].stop - numbers_of[k].start <= MAX_ENDS:
            enumerated += range(numbers_of[k].start, numbers_of[k].stop)
    signs = _signs(len(enumerated))
    other_blocks = [k for k in range(len(blocks)) if numbers_of[k].start not in enumerated]
    other_numbers = [j for k in other_blocks for j in range(numbers_of[k].start, numbers_of[k].stop)]
    # a disc is one ball; each number of an interval or an arc is a ball of its own
    firsts = [
        other_numbers.index(j)
        for k in other_blocks
        for j in range(numbers_of[k].start, numbers_of[k].start + 1 if blocks[k].is_disc else numbers_of[k].stop)
    ]
    enumerated_values = signs @ slope[enumerated] + 0.5 * np.einsum(
        "sn,sn->s", signs @ curvature[np.ix_(enumerated, enumerated)], signs
    )
    pulls = slope[other_numbers] + signs @ curvature[np.ix_(enumerated, other_numbers)]
    ball_bounds, points = _over_balls(
        pulls, curvature[np.ix_(other_numbers, other_numbers)], np.array(firsts, dtype=int)
    )
    best = int(np.argmax(enumerated_values + ball_bounds))
    point = np.zeros(count)
    point[enumerated], point[other_numbers] = signs[best], points[best]
    return constant + float(enumerated_values[best] + ball_bounds[best]), point


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


@cache
def _signs(count: int) -> Array:
    return np.array(list(itertools.product((1.0, -1.0), repeat=count))).reshape(2**count, count)


@dataclass(frozen=True, eq=False)
class _Reach:
    """Change of rows by a block: `move`, (k, d, w), its maximum per row `rows`, (k,), and rise `size` of the norm."""

    move: Array
    rows: Array
    size: float


_Key: TypeAlias = tuple[int, tuple[float, float] | None]
Reaches: TypeAlias = Sequence[dict[_Key, _Reach]]
"""Cache of the reach of blocks for each term; it is independent of the centre."""


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
