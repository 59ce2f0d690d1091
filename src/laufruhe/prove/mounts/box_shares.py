"""Upper bounds of energy shares of motions in modes over boxes of stiffness (E39, E64).

With E the change of the stiffness in the modes u of the middle of a box, a mode v of a design in the box satisfies

    (l - s_j - E_jj) v_j = sum of E_jk v_k over the others

with l the square of its frequency, which is monotone in stiffness. This bounds the parts |v_j|, and these bound the
difference of v and u_i + sum E_ij / (s_i - s_j) u_j. A share is the product of two linear functions of v, so linear in
stiffness up to the square of the size of the box.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.problem.channels import motion_indices
from laufruhe.problem.measure import Measure
from laufruhe.prove.mounts.box_response import BoxModel

# parts of other modes that count by their joint length
NEAR = 0.25
# iterations of the bounds of parts
ROUNDS = 4
# rounding of stiffness and squares, relative to the largest square
ROUNDING = 1e-12
_EYE = np.eye(6, dtype=bool)


@dataclass(frozen=True, eq=False)
class BoxModes:
    """Modes of designs in boxes, in coordinates of the modes of the middles.

    Attributes
    ----------
    modes
        Modes of the middles as columns, shape (boxes, 6, 6).
    parts
        Upper bounds of parts |v_j| of mode i, shape (boxes, i, j).
    deficits
        Upper bounds of 1 - |v_i|, shape (boxes, i).
    first
        Slopes of E_ij / (s_i - s_j) over half a box, shape (boxes, n, i, j).
    rests
        Upper bounds of the difference of v_j and its first order, shape (boxes, i, j).
    """

    modes: Array
    parts: Array
    deficits: Array
    first: Array
    rests: Array


def box_modes(model: BoxModel, lower: Array, upper: Array) -> BoxModes:
    """Return the modes of boxes of stiffness [N/m], shape (boxes, n)."""
    squares, modes = np.linalg.eigh(model.stiffness(0.5 * (lower + upper)))
    slopes = np.einsum("bji,njk,bkl->bnil", modes, model.slopes["stiffness"], modes, optimize=True)
    slopes = slopes * (0.5 * (upper - lower))[:, :, None, None]
    rounding = ROUNDING * np.abs(squares[:, -1, None, None])
    # upper bound of |E|
    change = np.abs(slopes).sum(axis=1) + rounding
    low, high = (np.linalg.eigvalsh(model.stiffness(x)) for x in (lower, upper))
    low, high = np.minimum(low, squares) - rounding[:, :, 0], np.maximum(high, squares) + rounding[:, :, 0]
    diagonal = np.einsum("bjj->bj", change)
    over = low[:, :, None] - (squares + diagonal)[:, None, :]
    under = (squares - diagonal)[:, None, :] - high[:, :, None]
    gaps = np.maximum(np.maximum(over, under), 0.0)
    across = np.where(_EYE, 0.0, change)
    parts, maximum = np.ones_like(across), np.linalg.norm(across, axis=2)[:, None, :]
    for _ in range(ROUNDS):
        coupling = np.minimum(np.einsum("bjk,bik->bij", across, parts), maximum)
        bound = np.where(gaps > 0.0, coupling / np.where(gaps > 0.0, gaps, 1.0), 1.0)
        parts = np.where(_EYE, 1.0, np.minimum(parts, bound))
    others = np.where(_EYE, 0.0, parts)
    deficits = 1.0 - np.sqrt(np.maximum(1.0 - np.sum(others**2, axis=2), 0.0))
    square_changes = np.maximum(high - squares, squares - low)
    coupling = np.einsum("bjk,bik->bij", change, others)
    rest = change * deficits[:, :, None] + coupling + square_changes[:, :, None] * parts + rounding
    differences = squares[:, :, None] - squares[:, None, :]
    is_equal = differences == 0.0
    differences = np.where(_EYE | is_equal, np.inf, differences)
    rests = np.where(_EYE, 0.0, np.where(is_equal, np.inf, rest / np.abs(differences)))
    return BoxModes(modes, parts, deficits, slopes / differences[:, None], rests)


def maximum_shares(model: BoxModel, measure: Measure, lower: Array, upper: Array) -> Array:
    """Return upper bounds of the largest share of each motion in a mode, shape (motions, boxes) (E7, E39)."""
    box = box_modes(model, lower, upper)
    return np.array([_shares(model, box, motion)[2].max(axis=1) for motion in motion_indices(measure)])


def shortfall(model: BoxModel, measure: Measure, lower: Array, upper: Array) -> Array:
    """Return lower bounds of the decoupling shortfall, shape (boxes,) (E47, E64)."""
    box = box_modes(model, lower, upper)
    total, slopes, boxes = np.zeros(len(lower)), np.zeros_like(lower), np.arange(len(lower))
    alone = np.zeros(len(lower))
    for motion in motion_indices(measure):
        values, share_slopes, maximum = _shares(model, box, motion)
        alone += np.maximum(measure.wanted - maximum.max(axis=1), 0.0)
        # the largest share is at most that of one mode, and the most by which another mode exceeds it
        best = np.argmax(values, axis=1)
        value, slope = values[boxes, best], share_slopes[boxes, best]
        above = values - value[:, None] + np.abs(share_slopes - slope[:, None]).sum(axis=2)
        above[boxes, best] = 0.0
        # a shortfall is at least zero, and at least its linear bound
        linear = measure.wanted - (value + np.maximum(above, 0.0).max(axis=1))
        counts = (linear > 0.0) & (linear + np.abs(slope).sum(axis=1) > 0.0)
        total += np.where(counts, linear, 0.0)
        slopes += np.where(counts[:, None], slope, 0.0)
    return np.asarray(np.maximum(alone, total - np.abs(slopes).sum(axis=1)))


def _shares(model: BoxModel, box: BoxModes, motion: int) -> tuple[Array, Array, Array]:
    """Return upper bounds of the share of a motion in every mode: value + slopes . s, and constants.

    Their shapes are (boxes, modes), (boxes, modes, n) and (boxes, modes).
    """
    shape, momentum = model.root[:, motion], np.linalg.inv(model.root)[motion]
    a, b = shape @ box.modes, momentum @ box.modes
    near = _projection_bounds(a, box.parts) * _projection_bounds(b, box.parts)
    both = a[:, :, None] * b[:, None, :] + a[:, None, :] * b[:, :, None]
    slopes = np.einsum("bij,bnij->bin", np.where(_EYE, 0.0, both), box.first)
    other_parts = np.where(_EYE, 0.0, box.parts)
    far = [np.abs(c) * box.deficits + np.einsum("bij,bj->bi", other_parts, np.abs(c)) for c in (a, b)]
    with np.errstate(invalid="ignore"):
        rest = np.where(both == 0.0, 0.0, np.abs(both) * box.rests).sum(axis=2)
    rest = rest + np.maximum(-2.0 * a * b, 0.0) * box.deficits + far[0] * far[1]
    value = a * b + rest
    reach = np.abs(slopes).sum(axis=2)
    # use constants where the linear function is no better
    poor = ~(value + reach < near)
    value, slopes = np.where(poor, near, value), np.where(poor[:, :, None], 0.0, slopes)
    return value, slopes, np.minimum(near, value + np.abs(slopes).sum(axis=2))


def _projection_bounds(components: Array, parts: Array) -> Array:
    # upper bounds of |vector' v| by the parts of the vector in middle modes, shape (boxes, modes)
    sizes = np.abs(components)[:, None]
    near = parts > NEAR
    total = np.sqrt(np.sum(np.where(near, sizes, 0.0) ** 2, axis=2))
    total += np.sum(np.where(near, 0.0, sizes * parts), axis=2)
    return np.asarray(np.minimum(total, np.sum(sizes * parts, axis=2)))
