"""Shares of motions in modes over boxes of stiffness: what they are not over, and what they lack (E39, E64).

A mode v of a box in the modes u of its middle, with the change E of the stiffness in these:

    (l - s_j - E_jj) v_j = sum of E_jk v_k over the others

l the square of its frequency, which more stiffness only raises. So parts |v_j| are bounded, and by these any share,
the product of two linear functions of v.
"""

from __future__ import annotations

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


def most_shares(model: BoxModel, asked: Measure, lower: Array, upper: Array) -> Array:
    """What the shares of motions in a mode of their own are not over in boxes, shape (motions, boxes) (E7, E64)."""
    modes, parts = _modes(model, lower, upper)
    found = []
    for motion in motion_indices(asked):
        along, momentum = model.root[:, motion] @ modes, np.linalg.inv(model.root)[motion] @ modes
        found.append((_most_along(along, parts) * _most_along(momentum, parts)).max(axis=1))
    return np.array(found)


def shortfall(model: BoxModel, asked: Measure, lower: Array, upper: Array) -> Array:
    """Least over boxes of the sum of what motions lack, shape (boxes,) (E47, E64)."""
    return np.asarray(np.maximum(asked.wanted - most_shares(model, asked, lower, upper), 0.0).sum(axis=0))


def _modes(model: BoxModel, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Modes of the middles, shape (boxes, 6, 6), columns; and of every mode what parts |v_j| it has at most there."""
    squares, modes = np.linalg.eigh(model.stiffness(0.5 * (lower + upper)))
    slopes = np.einsum("bji,njk,bkl->bnil", modes, model.stiffness_slopes, modes, optimize=True)
    slopes = slopes * (0.5 * (upper - lower))[:, :, None, None]
    rounding = ROUNDING * np.abs(squares[:, -1:])
    change = np.abs(slopes).sum(axis=1) + rounding[:, :, None]
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
    return np.asarray(modes), parts


def _most_along(along: Array, parts: Array) -> Array:
    """What |vector' v| is not over, of the parts of the vector in the modes of the middle, shape (boxes, modes)."""
    sizes = np.abs(along)[:, None]
    near = parts > NEAR
    together = np.sqrt(np.sum(np.where(near, sizes, 0.0) ** 2, axis=2))
    together += np.sum(np.where(near, 0.0, sizes * parts), axis=2)
    return np.asarray(np.minimum(together, np.sum(sizes * parts, axis=2)))
