"""What no errors of a part exceed: intervals and discs about a centre, and bounds of norms over them (R5 to R7)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.affine import AffineNorm
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms.norm import lengths

Terms: TypeAlias = Sequence[tuple[float, AffineNorm]]

ROUNDING = 1e-12
MOST_ENDS = 12
"""Intervals whose ends are tried all in one part."""
TOUCHES, TURNS = 3, 6
"""Squares that are laid over a norm, and turns of a point into its pull, in one part."""


@dataclass(frozen=True, eq=False)
class Block:
    """Error that is still free: local numbers of it, in an interval of -1 to 1 each, or in the unit disc.

    Attributes
    ----------
    columns
        In the vector of errors.
    spans
        What each local number moves there, shape (width, width).
    arc
        Middle and half angle where it is a part of a circle; None of an interval or a whole disc.
    """

    columns: slice
    spans: Array
    arc: tuple[float, float] | None = None

    @property
    def is_disc(self) -> bool:
        """Return whether its local numbers lie in the unit disc and not in intervals."""
        return self.arc is None and len(self.spans) > 1

    def parts(self, centre: Array) -> list[tuple[Array, Block | None]]:
        """Return centres and free blocks that together hold every extreme point."""
        if len(self.spans) == 1:
            return [(_moved(centre, self.columns, end * self.spans[0]), None) for end in (1.0, -1.0)]
        if self.arc is None:
            return [_arc(centre, self.columns, 0.5 * np.pi * quarter, 0.25 * np.pi) for quarter in range(4)]
        middle, half = self.arc
        return [_arc(centre, self.columns, middle + side * 0.5 * half, 0.5 * half) for side in (-1.0, 1.0)]


def _arc(centre: Array, columns: slice, middle: float, half: float) -> tuple[Array, Block]:
    """Return the rectangle about an arc of the unit circle (R7)."""
    along = np.array([np.cos(middle), np.sin(middle)])
    across = np.array([-along[1], along[0]])
    near = float(np.cos(half))
    moved = centre.copy()
    moved[columns] = 0.5 * (1.0 + near) * along
    spans = np.stack([0.5 * (1.0 - near) * along, np.sin(half) * across], axis=1)
    return moved, Block(columns, spans, (middle, half))


def _moved(centre: Array, columns: slice, by: Array) -> Array:
    moved = centre.copy()
    moved[columns] += by
    return moved


def bounded(terms: Terms, centre: Array, blocks: Sequence[Block], enough: float, known: Known) -> Part:
    """Bound a part of the errors, and say which block to divide next (R5, R6); no better than is enough."""
    parts = [_Moved.of(weight, norm, centre, blocks, own) for (weight, norm), own in zip(terms, known, strict=True)]
    sizes = np.sum([part.sizes for part in parts], axis=0)
    apart = sum(part.alone for part in parts)
    if not blocks:
        return Part(apart, -1, centre)
    if not any(part.squares(part.farthest) for part in parts):
        ends = np.ones(parts[0].moves.shape[2])
        return Part(apart, int(np.argmax(sizes)), _errors(centre, blocks, ends))
    touched = [np.sqrt(np.square(part.lengths) + np.square(part.reaches).sum(axis=0)) for part in parts]
    best, slack, farthest = math.inf, np.zeros(len(blocks)), np.zeros(0)
    for k in range(TOUCHES):
        above, at, rest = _over_squares(parts, touched, blocks)
        if above < best:
            best, slack, farthest = above, rest, at
        reached = [part.lengths_at(at) for part in parts]
        if best <= enough or best <= sum(part.value_of(own) for part, own in zip(parts, reached, strict=True)) * (
            1.0 + ROUNDING
        ):
            break
        touched = [(a * k + b) / (k + 1) for a, b in zip(touched, reached, strict=True)]
    discs = [k for k, block in enumerate(blocks) if slack[k] > 0.0]
    split = int(np.argmax(sizes))
    if discs and slack.sum() > 0.25 * (
        best - sum(part.value_of(own) for part, own in zip(parts, reached, strict=True))
    ):
        split = max(discs, key=lambda k: slack[k])
    return Part(min(apart, best), split, _errors(centre, blocks, farthest))


def _errors(centre: Array, blocks: Sequence[Block], local: Array) -> Array:
    """Return the errors of local numbers, on the circle where they are of a disc."""
    errors, at = centre.copy(), 0
    for block in blocks:
        width = len(block.spans)
        errors[block.columns] += block.spans @ local[at : at + width]
        if width > 1:
            errors[block.columns] /= float(np.hypot(*errors[block.columns])) or 1.0
        at += width
    return errors


@dataclass(frozen=True, eq=False)
class Part:
    """A bound of a part of the errors, its block to divide next, and errors that may be the worst of it."""

    bound: float
    split: int
    errors: Array


@dataclass(frozen=True, eq=False)
class _Moved:
    """Norm about a centre, and what the blocks move.

    Attributes
    ----------
    rows
        Shape (k, d).
    moves
        Of the local numbers of all blocks, shape (k, d, n).
    own
        Of every block its local numbers among these.
    lengths, reaches
        Of the rows, (k,), and the longest that each block moves them, (blocks, k).
    sizes
        The most that each block adds to the norm.
    alone
        What the norm does not exceed, each row at its own worst (R5).
    farthest
        Length of every row at its own worst.
    """

    weight: float
    norm: AffineNorm
    rows: Array
    moves: Array
    own: tuple[slice, ...]
    lengths: Array
    reaches: Array
    sizes: Array
    alone: float
    farthest: Array

    @classmethod
    def of(
        cls, weight: float, norm: AffineNorm, centre: Array, blocks: Sequence[Block], known: dict[_Key, _Reach]
    ) -> _Moved:
        """Return those of one term; the reach of blocks does not change with the centre."""
        rows, kind, grid = norm.rows(centre), norm.norm, norm.grid
        found = [_reach(norm, block, known) for block in blocks]
        ends = np.cumsum([0, *(each.move.shape[-1] for each in found)])
        own = tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(ends))
        joined = np.concatenate([np.zeros((*rows.shape, 0)), *(each.move for each in found)], axis=2)
        size = lengths(rows)
        reaches = np.array([each.rows for each in found]).reshape(len(blocks), len(rows))
        pulls = sum((rows[:, j, None] * joined[:, j] for j in range(rows.shape[1])), np.zeros((len(rows), ends[-1])))
        along = sum((np.hypot.reduce(pulls[:, s], axis=1) if b.is_disc else np.abs(pulls[:, s]).sum(axis=1)
                     for s, b in zip(own, blocks, strict=True)), np.zeros(len(rows)))  # fmt: skip
        across = reaches.sum(axis=0)
        sizes = np.array([each.size for each in found])
        farthest = np.minimum(size + across, np.sqrt(np.square(size) + 2.0 * along + np.square(across)))
        alone = kind.value(grid, rows) + float(sizes.sum())
        if kind.of_row_lengths:
            alone = min(alone, kind.value(grid, farthest[:, None]))
        return cls(weight, norm, rows, joined, own, size, reaches, weight * sizes, weight * alone, farthest)

    def squares(self, touched: Array) -> tuple[Array, float] | None:
        """Return squares over the norm that touch it where rows are this long (R6)."""
        return self.norm.norm.majorant(self.norm.grid, touched)

    def lengths_at(self, local: Array) -> Array:
        """Return lengths of the rows at some local numbers."""
        return lengths(self.rows + self.moves @ local)

    def value_of(self, size: Array) -> float:
        """Return the weighted norm of rows of these lengths; a norm that needs more counts as nothing."""
        kind = self.norm.norm
        return self.weight * kind.value(self.norm.grid, size[:, None]) if kind.of_row_lengths else 0.0


def _over_squares(
    parts: Sequence[_Moved], touched: Sequence[Array], blocks: Sequence[Block]
) -> tuple[float, Array, Array]:
    """Return the largest value of squares over the norms, where it stands, and what each block adds to it.

    Ends of intervals are tried all, so that between these the squares are exact; of what is left each block is bounded
    by itself.
    """
    own = parts[0].own
    count = parts[0].moves.shape[2]
    constant, slope, bend = 0.0, np.zeros(count), np.zeros((count, count))
    for part, lengths_ in zip(parts, touched, strict=True):
        squares = part.squares(lengths_)
        if squares is None:
            constant += part.alone
            continue
        factors, c = squares
        factors, flat = part.weight * factors, part.moves.reshape(-1, count)
        weighed = (factors[:, None, None] * part.moves).reshape(-1, count)
        constant += part.weight * c + 0.5 * float(factors @ np.square(part.lengths))
        slope += weighed.T @ part.rows.reshape(-1)
        bend += weighed.T @ flat
    ends = [k for k, block in enumerate(blocks) if not block.is_disc]
    ends.sort(key=lambda k: -float(np.abs(bend[own[k]]).sum()))
    tried: list[int] = []
    for k in ends:
        if len(tried) + own[k].stop - own[k].start <= MOST_ENDS:
            tried += range(own[k].start, own[k].stop)
    signs = _signs(len(tried))
    rest = [k for k in range(len(blocks)) if own[k].start not in tried]
    # a disc is one ball, each number of an interval or an arc one of its own
    balls = [(k, j) for k in rest for j in range(own[k].start, own[k].start + 1 if blocks[k].is_disc else own[k].stop)]
    left = [j for k in rest for j in range(own[k].start, own[k].stop)]
    firsts = np.array([left.index(j) for _, j in balls], dtype=int)
    total = signs @ slope[tried] + 0.5 * np.einsum("sn,sn->s", signs @ bend[np.ix_(tried, tried)], signs)
    added, points, slacks = _over_balls(
        slope[left] + signs @ bend[np.ix_(tried, left)], bend[np.ix_(left, left)], firsts
    )
    best = int(np.argmax(total + added))
    at, slack = np.zeros(count), np.zeros(len(blocks))
    at[tried], at[left] = signs[best], points[best]
    for (k, _), own_slack in zip(balls, slacks[best], strict=True):
        slack[k] += own_slack
    return constant + float(total[best] + added[best]), at, slack


def _over_balls(pulls: Array, bend: Array, firsts: NDArray[np.int_]) -> tuple[Array, Array, Array]:
    """Bound a . u + u . H u / 2 where every u_b has the length one (R6a).

    Parameters
    ----------
    pulls
        Of many a, shape (s, n).
    bend
        H, shape (n, n).
    firsts
        First number of every ball.

    Returns
    -------
    The bounds (s,), the points about which they are taken (s, n), and what each ball leaves open (s, balls): nothing
    where its pull is stronger than the bends across balls.
    """
    if not len(bend):
        return np.zeros(len(pulls)), np.zeros((len(pulls), 0)), np.zeros((len(pulls), 0))
    sizes = np.diff([*firsts, len(bend)])

    def lengths_of(vectors: Array) -> Array:
        return np.asarray(np.sqrt(np.add.reduceat(np.square(vectors), firsts, axis=1)))

    # what bends alike in all directions of a ball is known
    even = np.add.reduceat(np.diag(bend), firsts) / sizes
    rest = bend - np.diag(np.repeat(even, sizes))
    most = float(np.linalg.eigvalsh(rest)[-1])
    points, pulled = np.zeros_like(pulls), pulls
    for _ in range(TURNS):
        size = np.repeat(lengths_of(pulled), sizes, axis=1)
        points = np.where(size > 0.0, pulled / np.where(size > 0.0, size, 1.0), 0.0)
        # any point of the sphere will do where nothing pulls
        points[:, firsts] += lengths_of(points) == 0.0
        pulled = pulls + points @ rest
    own = lengths_of(pulled - most * points) + most
    bound = own.sum(axis=1) - 0.5 * np.einsum("sn,sn->s", points @ rest, points) + 0.5 * float(even.sum())
    return bound, points, own - np.add.reduceat(pulled * points, firsts, axis=1)


@cache
def _signs(count: int) -> Array:
    """Return all ends of so many intervals, shape (2^count, count)."""
    return np.array(list(itertools.product((1.0, -1.0), repeat=count))).reshape(2**count, count)


@dataclass(frozen=True, eq=False)
class _Reach:
    """Moves of a block, shape (k, d, w), the longest that it moves each row, and the most that a norm grows by it."""

    move: Array
    rows: Array
    size: float


_Key: TypeAlias = tuple[int, tuple[float, float] | None]
Known: TypeAlias = Sequence[dict[_Key, _Reach]]


def _reach(norm: AffineNorm, block: Block, known: dict[_Key, _Reach]) -> _Reach:
    """Return the reach of a block, found once."""
    key = block.columns.start, block.arc
    if key not in known:
        move = norm.slope[..., block.columns] @ block.spans
        if block.is_disc:
            gram = np.einsum("kdi,kdj->kij", move, move)
            mean, half = 0.5 * (gram[:, 0, 0] + gram[:, 1, 1]), 0.5 * (gram[:, 0, 0] - gram[:, 1, 1])
            rows = np.sqrt(mean + np.hypot(half, gram[:, 0, 1]))
        else:
            rows = sum((lengths(move[..., j]) for j in range(move.shape[-1])), np.zeros(len(move)))
        of_all = norm.norm.value(norm.grid, rows[:, None]) if norm.norm.of_row_lengths else sum(
            norm.norm.value(norm.grid, move[..., j]) for j in range(move.shape[-1]))  # fmt: skip
        known[key] = _Reach(move, rows, of_all)
    return known[key]
