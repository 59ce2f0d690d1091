"""Shares of motions in modes over boxes of stiffness: what they are not over, and what they lack (E39, E64).

A mode v of a box in the modes u of its middle, with the change E of the stiffness in these:

    (l - s_j - E_jj) v_j = sum of E_jk v_k over the others

l the square of its frequency, which more stiffness only raises. So parts |v_j| are bounded, and by these what is
left of v beside u_i + sum E_ij / (s_i - s_j) u_j: a share, the product of two linear functions of v, is linear in
stiffness but for the square of the size of the box.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.problem.channels import motion_indices
from laufruhe.problem.measure import Measure
from laufruhe.prove.mounts.box_response import BoxModel

# parts of other modes from which these count together
NEAR = 0.25
# rounds in which bounds of parts bound each other
ROUNDS = 4
# share of the largest square that entries of the stiffness and squares may be off by
ROUNDING = 1e-12
_EYE = np.eye(6, dtype=bool)


@dataclass(frozen=True, eq=False)
class BoxModes:
    """Modes of the designs of boxes in those of their middles.

    Attributes
    ----------
    modes, squares
        Of the middles, shapes (boxes, 6, 6), columns, and (boxes, 6).
    slopes
        Of the stiffness in these modes over half a box, shape (boxes, open numbers, 6, 6).
    parts
        What parts |v_j| of mode i are not over, shape (boxes, i, j).
    lacks
        What |v_i| lacks to one at the most, shape (boxes, i).
    moved
        By how much the square of mode i moves at the most, shape (boxes, i).
    """

    modes: Array
    squares: Array
    slopes: Array
    parts: Array
    lacks: Array
    moved: Array

    @property
    def change(self) -> Array:
        """Largest size of E, shape (boxes, 6, 6)."""
        return np.asarray(_change(self.slopes, self.squares))

    @property
    def apart(self) -> Array:
        """s_i - s_j, infinite where it is nothing, and on the diagonal, shape (boxes, i, j)."""
        apart = self.squares[:, :, None] - self.squares[:, None, :]
        return np.where(_EYE | (apart == 0.0), np.inf, apart)

    @property
    def first(self) -> Array:
        """E_ij / (s_i - s_j) by every open number over half a box, shape (boxes, open numbers, i, j)."""
        return np.asarray(self.slopes / self.apart[:, None])

    @property
    def rests(self) -> Array:
        """What v_j of mode i differs from that at the most, shape (boxes, i, j)."""
        change = self.change
        others = np.einsum("bjk,bik->bij", change, np.where(_EYE, 0.0, self.parts))
        rest = change * self.lacks[:, :, None] + others + self.moved[:, :, None] * self.parts + _rounding(self.squares)
        alike = self.squares[:, :, None] == self.squares[:, None, :]
        return np.where(_EYE, 0.0, np.where(alike, np.inf, rest / np.abs(self.apart)))


def box_modes(model: BoxModel, lower: Array, upper: Array) -> BoxModes:
    """Modes of boxes, shapes (boxes, open numbers)."""
    squares, modes = np.linalg.eigh(model.stiffness(0.5 * (lower + upper)))
    slopes = np.einsum("bji,njk,bkl->bnil", modes, model.stiffness_slopes, modes, optimize=True)
    slopes = slopes * (0.5 * (upper - lower))[:, :, None, None]
    change, rounding = _change(slopes, squares), _rounding(squares)[:, :, 0]
    low, high = (np.linalg.eigvalsh(model.stiffness(x)) for x in (lower, upper))
    low, high = np.minimum(low, squares) - rounding, np.maximum(high, squares) + rounding
    own = np.einsum("bjj->bj", change)
    over, under = low[:, :, None] - (squares + own)[:, None, :], (squares - own)[:, None, :] - high[:, :, None]
    apart = np.maximum(np.maximum(over, under), 0.0)
    across = np.where(_EYE, 0.0, change)
    parts, most = np.ones_like(across), np.linalg.norm(across, axis=2)[:, None, :]
    for _ in range(ROUNDS):
        pulled = np.minimum(np.einsum("bjk,bik->bij", across, parts), most)
        least = np.where(apart > 0.0, pulled / np.where(apart > 0.0, apart, 1.0), 1.0)
        parts = np.where(_EYE, 1.0, np.minimum(parts, least))
    others = np.sum(np.where(_EYE, 0.0, parts) ** 2, axis=2)
    lacks = 1.0 - np.sqrt(np.maximum(1.0 - others, 0.0))
    return BoxModes(modes, squares, slopes, parts, lacks, np.maximum(high - squares, squares - low))


def _change(slopes: Array, squares: Array) -> Array:
    return np.asarray(np.abs(slopes).sum(axis=1) + _rounding(squares))


def _rounding(squares: Array) -> Array:
    """Shape (boxes, 1, 1)."""
    return np.asarray(ROUNDING * np.abs(squares[:, -1, None, None]))


def most_shares(model: BoxModel, asked: Measure, lower: Array, upper: Array) -> Array:
    """What the shares of motions in a mode of their own are not over in boxes, shape (motions, boxes) (E7, E39)."""
    at = box_modes(model, lower, upper)
    return np.array([_shares(model, at, motion).most.max(axis=1) for motion in motion_indices(asked)])


def shortfall(model: BoxModel, asked: Measure, lower: Array, upper: Array) -> Array:
    """Least over boxes, shape (boxes,): the sum of linear functions under what motions lack (E47, E64)."""
    at = box_modes(model, lower, upper)
    total, slopes = np.zeros(len(lower)), np.zeros_like(lower)
    alone = np.zeros(len(lower))
    for motion in motion_indices(asked):
        value, slope, most = _of_the_largest(_shares(model, at, motion))
        alone += np.maximum(asked.wanted - most, 0.0)
        # what is lacking is over nothing, and over what the linear function leaves
        lacking = asked.wanted - value
        counts = (lacking > 0.0) & (lacking + np.abs(slope).sum(axis=1) > 0.0)
        total += np.where(counts, lacking, 0.0)
        slopes += np.where(counts[:, None], slope, 0.0)
    return np.asarray(np.maximum(alone, total - np.abs(slopes).sum(axis=1)))


@dataclass(frozen=True, eq=False)
class _Shares:
    """Linear functions over the share of a motion in every mode, and what it is not over; half a box is one.

    Attributes
    ----------
    value, slopes
        Shapes (boxes, modes) and (boxes, modes, open numbers).
    most
        Shape (boxes, modes).
    """

    value: Array
    slopes: Array
    most: Array


def _shares(model: BoxModel, at: BoxModes, motion: int) -> _Shares:
    shape, momentum = model.root[:, motion], np.linalg.inv(model.root)[motion]
    a, b = shape @ at.modes, momentum @ at.modes
    near = _most_along(a, at.parts) * _most_along(b, at.parts)
    both = a[:, :, None] * b[:, None, :] + a[:, None, :] * b[:, :, None]
    slopes = np.einsum("bij,bnij->bin", np.where(_EYE, 0.0, both), at.first)
    others = np.where(_EYE, 0.0, at.parts)
    far = [np.abs(c) * at.lacks + np.einsum("bij,bj->bi", others, np.abs(c)) for c in (a, b)]
    with np.errstate(invalid="ignore"):
        rest = np.where(both == 0.0, 0.0, np.abs(both) * at.rests).sum(axis=2)
    rest = rest + np.maximum(-2.0 * a * b, 0.0) * at.lacks + far[0] * far[1]
    value = a * b + rest
    reach = np.abs(slopes).sum(axis=2)
    # where the linear function tells no more than the parts it is none
    poor = ~(value + reach < near)
    value, slopes = np.where(poor, near, value), np.where(poor[:, :, None], 0.0, slopes)
    return _Shares(value, slopes, np.minimum(near, value + np.abs(slopes).sum(axis=2)))


def _of_the_largest(shares: _Shares) -> tuple[Array, Array, Array]:
    """One linear function over the largest of the shares, and what that is not over: (boxes,), (boxes, n), (boxes,)."""
    boxes = np.arange(len(shares.value))
    best = np.argmax(shares.value, axis=1)
    value, slope = shares.value[boxes, best], shares.slopes[boxes, best]
    above = shares.value - value[:, None] + np.abs(shares.slopes - slope[:, None]).sum(axis=2)
    above[boxes, best] = 0.0
    return value + np.maximum(above, 0.0).max(axis=1), slope, shares.most.max(axis=1)


def _most_along(along: Array, parts: Array) -> Array:
    """What |vector' v| is not over, of the parts of the vector in the modes of the middle, shape (boxes, modes)."""
    sizes = np.abs(along)[:, None]
    near = parts > NEAR
    together = np.sqrt(np.sum(np.where(near, sizes, 0.0) ** 2, axis=2))
    together += np.sum(np.where(near, 0.0, sizes * parts), axis=2)
    return np.asarray(np.minimum(together, np.sum(sizes * parts, axis=2)))
