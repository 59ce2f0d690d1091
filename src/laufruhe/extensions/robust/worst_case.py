"""The worst errors of a design, and a bound that no errors exceed (R4 to R7).

The objective is convex in the errors, so its largest value stands at a corner of every interval and on the circle of
every disc. Branch and bound finds which one: an interval is fixed at either end, a circle is parted into arcs, and the
free rest is bounded from above. Every bound comes from rows of the exact model.
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
from laufruhe.prove.witness import THIN, Witness, check_near_witness

Terms: TypeAlias = Sequence[tuple[float, AffineNorm]]
"""Weights and norms, whose decision vector is that of the errors."""

ROUNDING = 1e-12
MOST_NODES = 5000
STARTS, CLIMBS = 12, 30
"""Random errors that a climb starts from, and its steps."""
MOST_ENDS = 12
"""Intervals whose ends are all tried in one part."""
TOUCHES, TURNS = 3, 6
"""Majorants that are tried, and fixed-point steps for the points of balls, in one part."""


@dataclass(frozen=True, eq=False)
class WorstCase:
    """The worst errors found, the value there, and a bound over all errors.

    Attributes
    ----------
    errors
        Shape (columns,).
    value
        Weighted sum of the norms at these errors.
    bound
        Upper bound over all errors allowed, raw.
    nodes
        Parts that the errors were divided into.
    """

    errors: Array
    value: float
    bound: float
    nodes: int


def value_at(terms: Terms, errors: Array) -> float:
    """Return the weighted sum of the norms at these errors."""
    return sum(weight * norm.value(errors) for weight, norm in terms)


def worst_case(terms: Terms, columns: Sequence[slice], tolerance: float, maximum: int = MOST_NODES) -> WorstCase:
    """Return the largest weighted sum of norms N(V0 + E z) over intervals and discs.

    Parameters
    ----------
    terms
        Weights and norms, affine in the errors.
    columns
        Columns of every error: one for an interval of -1 to 1, two for the unit disc.
    tolerance
        Relative distance of bound and value at which the search ends.
    maximum
        Largest number of parts that the errors are divided into.
    """
    count = columns[-1].stop if columns else 0
    starts = np.random.default_rng(0).uniform(-1.0, 1.0, (STARTS + 1, count))
    starts[0] = 0.0
    for disc in columns:
        # a point of the square may lie outside the disc in it
        starts[:, disc] /= np.maximum(np.hypot.reduce(starts[:, disc], axis=1), 1.0)[:, None]
    best = max((_climb(terms, columns, z) for z in starts), key=lambda point: point[0])
    if not count:
        return WorstCase(np.zeros(0), best[0], best[0], 0)
    search = _ErrorSearch(terms, tolerance, best)
    blocks = [ErrorBlock(own, np.eye(own.stop - own.start)) for own in columns]
    root = bound_part(terms, np.zeros(count), blocks, best[0], search.reaches)
    search.improve(_climb(terms, columns, root.errors))
    bound = search.divide((-root.bound, _Part(np.zeros(count), blocks, root.split)), maximum)
    value, errors = search.best
    if is_over(bound, -value):
        report(BoundError("errors that no engine exceeds", -bound, value))
    return WorstCase(errors, value, -bound, search.node_count)


def check_worst(terms: Terms, columns: Sequence[slice], worst: WorstCase) -> None:
    """Report a bound of a thin part around the worst errors that is under their value."""
    check_near_witness(_Around(terms, columns), worst.errors, Witness(worst.errors, -worst.value))


@dataclass(frozen=True, eq=False)
class _Around:
    """Bounder of thin parts of the errors; it minimises the negative of the sum."""

    terms: Terms
    columns: Sequence[slice]
    what: str = "errors that no engine exceeds"

    def around(self, errors: Array) -> tuple[Array, list[ErrorBlock]]:
        """Return a centre and thin blocks about it that reach some errors."""
        return (1.0 - THIN) * errors, [ErrorBlock(own, THIN * np.eye(own.stop - own.start)) for own in self.columns]

    def bound(self, part: tuple[Array, list[ErrorBlock]]) -> float:
        """Return the lower bound of the negative sum over a part."""
        return -bound_part(self.terms, *part, -math.inf, [{} for _ in self.terms]).bound


@dataclass(frozen=True, eq=False)
class _Part:
    """Node of the search: a centre, free blocks, and the number of the block to divide next."""

    centre: Array
    blocks: list[ErrorBlock]
    split: int


class _ErrorSearch(BranchAndBound[_Part]):
    """Branch and bound over errors; it minimises the negative of the sum."""

    what, reports_bounds = "boxes of errors", False

    def __init__(self, terms: Terms, tolerance: float, best: tuple[float, Array]) -> None:
        self._terms, self._tolerance, self.best = terms, tolerance, best
        self.reaches: Reaches = [{} for _ in terms]

    def improve(self, point: tuple[float, Array]) -> None:
        """Keep a value and its errors if they are worse than the worst so far."""
        self.best = max(self.best, point, key=lambda each: each[0])

    def is_fathomed(self, node: OpenNode[_Part]) -> bool:
        """Return whether no errors of a part are worse by the tolerance."""
        return -node.bound <= self.best[0] * (1.0 + self._tolerance)

    def branch(self, nodes: Sequence[OpenNode[_Part]]) -> BoundedParts[_Part]:
        """Yield parts with one interval fixed at either end, or one circle parted."""
        ((above, _, own),) = nodes
        rest = [block for k, block in enumerate(own.blocks) if k != own.split]
        for centre, free in own.blocks[own.split].parts(own.centre):
            blocks = rest if free is None else [*rest, free]
            part = bound_part(self._terms, centre, blocks, self.best[0] * (1.0 + self._tolerance), self.reaches)
            self.improve((value_at(self._terms, part.errors), part.errors))
            # a part is never worse than the whole
            bound = min(part.bound, -above)
            yield (-bound, _Part(centre, blocks, part.split)) if blocks else FathomedPart(-bound)


def _climb(terms: Terms, columns: Sequence[slice], errors: Array) -> tuple[float, Array]:
    """Step to the farthest point along the slope until the value stops rising; return value and errors."""
    value = value_at(terms, errors)
    for _ in range(CLIMBS):
        slope = np.zeros(len(errors))
        for weight, norm in terms:
            slope += weight * np.einsum("kd,kdn->n", norm.subgradient(errors), norm.slope)
        following = np.zeros(len(errors))
        for own in columns:
            size = float(np.hypot.reduce(slope[own]))
            following[own] = slope[own] / size if size > 0.0 else np.eye(own.stop - own.start)[0]
        reached = value_at(terms, following)
        if reached <= value * (1.0 + ROUNDING):
            return max((value, errors), (reached, following), key=lambda each: each[0])
        value, errors = reached, following
    return value, errors


@dataclass(frozen=True, eq=False)
class ErrorBlock:
    """A free error: local numbers in an interval of -1 to 1 each, or in the unit disc.

    Attributes
    ----------
    columns
        In the vector of errors.
    spans
        Change of the errors per local number, shape (width, width).
    arc
        Middle and half angle of a part of a circle; None of an interval or a whole disc.
    """

    columns: slice
    spans: Array
    arc: tuple[float, float] | None = None

    @property
    def is_disc(self) -> bool:
        """Return whether its local numbers lie in the unit disc and not in intervals."""
        return self.arc is None and len(self.spans) > 1

    def parts(self, centre: Array) -> list[tuple[Array, ErrorBlock | None]]:
        """Return centres and free blocks that together hold every extreme point."""
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
        along = np.array([np.cos(middle), np.sin(middle)])
        across = np.array([-along[1], along[0]])
        near = float(np.cos(half))
        moved = centre.copy()
        moved[self.columns] = 0.5 * (1.0 + near) * along
        spans = np.stack([0.5 * (1.0 - near) * along, np.sin(half) * across], axis=1)
        return moved, ErrorBlock(self.columns, spans, (middle, half))


@dataclass(frozen=True, eq=False)
class PartBound:
    """Upper bound over a part of the errors, its block to divide next, and errors that may be its worst."""

    bound: float
    split: int
    errors: Array


def bound_part(terms: Terms, centre: Array, blocks: Sequence[ErrorBlock], cutoff: float, reaches: Reaches) -> PartBound:
    """Bound the sum of norms over a part of the errors from above (R5, R6).

    Parameters
    ----------
    terms
        Weights and norms.
    centre
        Errors about which the blocks are free, shape (columns,).
    cutoff
        Bound at which no better one is sought.
    reaches
        What blocks move, one cache per term; filled here.
    """
    parts = [_TermAbout(*term, centre, blocks, cached) for term, cached in zip(terms, reaches, strict=True)]
    if not blocks:
        return PartBound(sum(part.separate_bound() for part in parts), -1, centre)
    local = np.ones(parts[0].moves.shape[2])
    touched = [np.sqrt(np.square(part.lengths) + np.square(part.reaches).sum(axis=0)) for part in parts]
    best = math.inf
    for k in range(TOUCHES):
        majorants = [part.norm.norm.majorant(part.norm.grid, sizes) for part, sizes in zip(parts, touched, strict=True)]
        if not any(majorants):
            best = sum(part.separate_bound() for part in parts)
            break
        above, at = _over_majorants(parts, majorants, blocks)
        if above < best:
            best, local = above, at
        reached = [lengths(part.rows + part.moves @ at) for part in parts]
        value = sum(part.value(sizes) for part, sizes in zip(parts, reached, strict=True))
        if best <= cutoff or best <= value * (1.0 + ROUNDING):
            break
        touched = [(a * k + b) / (k + 1) for a, b in zip(touched, reached, strict=True)]
    errors, at_block = centre.copy(), 0
    for block in blocks:
        width = len(block.spans)
        errors[block.columns] += block.spans @ local[at_block : at_block + width]
        if width > 1:
            # on the circle of its disc
            errors[block.columns] /= float(np.hypot(*errors[block.columns])) or 1.0
        at_block += width
    return PartBound(best, int(np.argmax(np.sum([part.sizes for part in parts], axis=0))), errors)


class _TermAbout:
    """A weighted norm about a centre, and its changes by the local numbers of all blocks.

    Attributes
    ----------
    rows
        At the centre, shape (k, d), and their lengths, shape (k,).
    moves
        Change of the rows per local number, shape (k, d, n).
    own
        Local numbers of every block among these n.
    reaches
        Largest change of every row by every block, shape (blocks, k).
    sizes
        Largest rise of the weighted norm by every block, shape (blocks,).
    """

    def __init__(
        self, weight: float, norm: AffineNorm, centre: Array, blocks: Sequence[ErrorBlock], cached: dict[_Key, _Reach]
    ) -> None:
        self.weight, self.norm, self.blocks = weight, norm, blocks
        self.rows = norm.rows(centre)
        self.lengths = lengths(self.rows)
        found = [_reach(norm, block, cached) for block in blocks]
        ends = np.cumsum([0, *(each.move.shape[-1] for each in found)])
        self.own = [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]
        self.moves = np.concatenate([np.zeros((*self.rows.shape, 0)), *(each.move for each in found)], axis=2)
        self.reaches = np.array([each.rows for each in found]).reshape(len(blocks), len(self.rows))
        self.sizes = weight * np.array([each.size for each in found])

    def separate_bound(self) -> float:
        """Return the bound of the weighted norm with every row at its own worst (R5)."""
        kind, grid, rows = self.norm.norm, self.norm.grid, self.rows
        bound = self.weight * kind.value(grid, rows) + float(self.sizes.sum())
        if not kind.of_row_lengths:
            return bound
        pulls = np.einsum("kd,kdn->kn", rows, self.moves)
        along = np.zeros(len(rows))
        for block, own in zip(self.blocks, self.own, strict=True):
            along += np.hypot.reduce(pulls[:, own], axis=1) if block.is_disc else np.abs(pulls[:, own]).sum(axis=1)
        across = self.reaches.sum(axis=0)
        longest = np.sqrt(np.square(self.lengths) + 2.0 * along + np.square(across))
        longest = np.minimum(self.lengths + across, longest)
        return min(bound, self.weight * kind.value(grid, longest[:, None]))

    def value(self, sizes: Array) -> float:
        """Return the weighted norm of rows of these lengths; zero for a norm that needs more than lengths."""
        kind = self.norm.norm
        return self.weight * kind.value(self.norm.grid, sizes[:, None]) if kind.of_row_lengths else 0.0


def _over_majorants(
    parts: Sequence[_TermAbout], majorants: Sequence[tuple[Array, float] | None], blocks: Sequence[ErrorBlock]
) -> tuple[float, Array]:
    """Return a bound of the quadratic majorants over all local numbers, and where it stands, shape (n,).

    Ends of up to MOST_ENDS intervals are all tried, so that the majorants are exact between them; of the rest each
    block is bounded by itself.
    """
    own = parts[0].own
    count = parts[0].moves.shape[2]
    constant, slope, bend = 0.0, np.zeros(count), np.zeros((count, count))
    for part, majorant in zip(parts, majorants, strict=True):
        if majorant is None:
            constant += part.separate_bound()
            continue
        factors, offset = part.weight * majorant[0], part.weight * majorant[1]
        weighed = (factors[:, None, None] * part.moves).reshape(-1, count)
        constant += offset + 0.5 * float(factors @ np.square(part.lengths))
        slope += weighed.T @ part.rows.reshape(-1)
        bend += weighed.T @ part.moves.reshape(-1, count)
    ends = [k for k, block in enumerate(blocks) if not block.is_disc]
    ends.sort(key=lambda k: -float(np.abs(bend[own[k]]).sum()))
    tried: list[int] = []
    for k in ends:
        if len(tried) + own[k].stop - own[k].start <= MOST_ENDS:
            tried += range(own[k].start, own[k].stop)
    signs = _signs(len(tried))
    rest = [k for k in range(len(blocks)) if own[k].start not in tried]
    left = [j for k in rest for j in range(own[k].start, own[k].stop)]
    # a disc is one ball, each number of an interval or an arc one of its own
    firsts = [
        left.index(j) for k in rest for j in range(own[k].start, own[k].start + 1 if blocks[k].is_disc else own[k].stop)
    ]
    total = signs @ slope[tried] + 0.5 * np.einsum("sn,sn->s", signs @ bend[np.ix_(tried, tried)], signs)
    pulls = slope[left] + signs @ bend[np.ix_(tried, left)]
    added, points = _over_balls(pulls, bend[np.ix_(left, left)], np.array(firsts, dtype=int))
    best = int(np.argmax(total + added))
    at = np.zeros(count)
    at[tried], at[left] = signs[best], points[best]
    return constant + float(total[best] + added[best]), at


def _over_balls(pulls: Array, bend: Array, firsts: NDArray[np.int_]) -> tuple[Array, Array]:
    """Bound a . u + u . H u / 2 where every u_b has the length one (R6a).

    Parameters
    ----------
    pulls
        Many a, shape (s, n).
    bend
        H, shape (n, n).
    firsts
        First number of every ball.

    Returns
    -------
    The bounds (s,), and the points about which they are taken (s, n).
    """
    if not len(bend):
        return np.zeros(len(pulls)), np.zeros((len(pulls), 0))
    sizes = np.diff([*firsts, len(bend)])

    def lengths_of(vectors: Array) -> Array:
        return np.asarray(np.sqrt(np.add.reduceat(np.square(vectors), firsts, axis=1)))

    # what bends alike in all directions of a ball is known
    even = np.add.reduceat(np.diag(bend), firsts) / sizes
    rest = bend - np.diag(np.repeat(even, sizes))
    maximum = float(np.linalg.eigvalsh(rest)[-1])
    points, pulled = np.zeros_like(pulls), pulls
    for _ in range(TURNS):
        size = np.repeat(lengths_of(pulled), sizes, axis=1)
        points = np.where(size > 0.0, pulled / np.where(size > 0.0, size, 1.0), 0.0)
        # any point of the sphere will do where nothing pulls
        points[:, firsts] += lengths_of(points) == 0.0
        pulled = pulls + points @ rest
    reached = lengths_of(pulled - maximum * points) + maximum
    bound = reached.sum(axis=1) - 0.5 * np.einsum("sn,sn->s", points @ rest, points) + 0.5 * float(even.sum())
    return bound, points


@cache
def _signs(count: int) -> Array:
    return np.array(list(itertools.product((1.0, -1.0), repeat=count))).reshape(2**count, count)


@dataclass(frozen=True, eq=False)
class _Reach:
    """Change of the rows by a block, shape (k, d, w), its largest of each row, shape (k,), and rise of the norm."""

    move: Array
    rows: Array
    size: float


_Key: TypeAlias = tuple[int, tuple[float, float] | None]
Reaches: TypeAlias = Sequence[dict[_Key, _Reach]]
"""Reach of blocks of each term, which does not change with the centre."""


def _reach(norm: AffineNorm, block: ErrorBlock, cached: dict[_Key, _Reach]) -> _Reach:
    key = block.columns.start, block.arc
    if key not in cached:
        move = norm.slope[..., block.columns] @ block.spans
        columns = [move[..., j] for j in range(move.shape[-1])]
        if block.is_disc:
            gram = np.einsum("kdi,kdj->kij", move, move)
            mean, half = 0.5 * (gram[:, 0, 0] + gram[:, 1, 1]), 0.5 * (gram[:, 0, 0] - gram[:, 1, 1])
            rows = np.sqrt(mean + np.hypot(half, gram[:, 0, 1]))
        else:
            rows = sum((lengths(column) for column in columns), np.zeros(len(move)))
        kind, grid = norm.norm, norm.grid
        apart = kind.value(grid, rows[:, None]) if kind.of_row_lengths else sum(kind.value(grid, c) for c in columns)
        cached[key] = _Reach(move, rows, apart)
    return cached[key]
