"""Bounds of sag, natural frequencies and other mount numbers over boxes of stiffness (E39)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np

from laufruhe.numerics.arrays import Array, Mask
from laufruhe.physics.modes import weight_wrench
from laufruhe.physics.mount_numbers import total_stiffness
from laufruhe.problem import channels
from laufruhe.problem.channels import Channel
from laufruhe.problem.measure import Limit, Measure
from laufruhe.prove.mounts.box_cases import static_loads
from laufruhe.prove.mounts.box_norms import LinearBound
from laufruhe.prove.mounts.box_response import BoxModel
from laufruhe.prove.mounts.box_shares import maximum_shares, shortfall
from laufruhe.prove.mounts.ranges import SLACK


def sag(model: BoxModel, x: Array) -> Array:
    """Return the static sag of many designs [m], shape (boxes,); infinite with a free mode (E9)."""
    weight = weight_wrench(model.mounting(model.lower).block)
    matrices, pull = model.stiffness(x), model.root @ weight
    stable = np.linalg.eigvalsh(matrices)[:, 0] > 0.0
    y = np.linalg.solve(np.where(stable[:, None, None], matrices, np.eye(6)), pull)
    return np.where(stable, y @ pull / -weight[2], math.inf)


def sag_under(model: BoxModel, _: Measure, lower: Array, upper: Array) -> LinearBound:
    """Return the tangent of the convex sag at the middle, for boxes whose softest corner has no free mode (E9)."""
    weight, halves = weight_wrench(model.mounting(model.lower).block), 0.5 * (upper - lower)
    matrices, pull = model.stiffness(0.5 * (lower + upper)), model.root @ weight
    stable = np.linalg.eigvalsh(model.stiffness(lower))[:, 0] > 0.0
    y = np.linalg.solve(np.where(stable[:, None, None], matrices, np.eye(6)), pull)
    slopes = halves * np.einsum("bi,nij,bj->bn", y, model.slopes["stiffness"], y) / weight[2]
    return LinearBound(y @ pull / -weight[2], slopes, np.zeros(len(lower)), np.abs(slopes)).where(stable)


def axis_residual(model: BoxModel, measure: Measure, lower: Array, upper: Array) -> Array:
    """Bound the convex torque-roll residual by its tangent at the middle, shape (boxes,) (E19, E46)."""
    assert measure.channel.axis_residual is not None
    axis = measure.channel.axis_residual(model.mounting(model.lower).block, measure.frequency)
    bounds = np.zeros(len(lower))
    slopes = axis.left @ model.slopes["stiffness"] @ axis.right
    for k, matrix in enumerate(model.stiffness(0.5 * (lower + upper))):
        rows = axis.rows(matrix)
        y, constant = axis.under(rows / (float(np.linalg.norm(rows)) or 1.0))
        minimum = float(y @ axis.answer(matrix)) - constant - np.abs(slopes @ y) @ (0.5 * (upper[k] - lower[k]))
        bounds[k] = max(float(minimum), 0.0)
    return bounds


def stiffness_in_all(model: BoxModel, x: Array) -> Array:
    """Return the total stiffness of many designs [N/m], shape (boxes,)."""
    decisions = model.problem.mount_decisions
    gains = np.array([sum(drive.gain for drive in decision.mount_drives) for decision in decisions])
    lowest = model.problem.design([float(v) for v in model.lower], decisions)
    return np.asarray(total_stiffness(lowest.mounts) + (x - model.lower) @ gains)


def _frequencies(model: BoxModel, x: Array) -> Array:
    # [Hz], shape (boxes, 6)
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(model.stiffness(x)), 0.0)) / math.tau)


Ranges: TypeAlias = Callable[[BoxModel, Measure, Array, Array], tuple[Array | float, Array | float]]
RANGES: Mapping[Channel, Ranges] = {
    channels.SAG: lambda model, _, lower, upper: (sag(model, upper), sag(model, lower)),
    channels.TOTAL_STIFFNESS: lambda model, _, lower, upper: (
        stiffness_in_all(model, lower), stiffness_in_all(model, upper)
    ),
    channels.TORQUE_ROLL: lambda *box: (axis_residual(*box), math.inf),
    channels.RAW_TORQUE_ROLL: lambda *box: (axis_residual(*box), math.inf),
    channels.DECOUPLING: lambda *box: (-math.inf, maximum_shares(*box).min(axis=0)),
    channels.STATIC_TRAVEL: lambda *box: (static_loads(*box).minimum, math.inf),
    channels.STATIC_FORCE: lambda *box: (static_loads(*box).minimum, math.inf),
    channels.DECOUPLING_SHORTFALL: lambda *box: (shortfall(*box), math.inf),
    channels.FREQUENCIES: lambda model, _, lower, upper: (
        _frequencies(model, lower)[:, -1], _frequencies(model, upper)[:, 0]
    ),
}  # fmt: skip
"""Lower and upper bounds of mount numbers on boxes: more stiffness lowers sag and raises every frequency (E39).

If a measure has several numbers, the lower bound is that of the largest and the upper bound that of the smallest.
"""
LINEAR_BOUNDS: Mapping[Channel, Callable[[BoxModel, Measure, Array, Array], LinearBound]] = {
    channels.SAG: sag_under,
    channels.STATIC_TRAVEL: static_loads,
    channels.STATIC_FORCE: static_loads,
}
"""Linear lower bounds of mount numbers, which give limits a multiplier on a box (E38)."""
BOUNDED_LINEARLY = frozenset({channels.STATIC_TRAVEL, channels.STATIC_FORCE})
"""Channels whose range is no better than the linear bound."""


def breaks(model: BoxModel, limit: Limit, lower: Array, upper: Array) -> Mask:
    """Return True for boxes in which every design violates a limit, shape (boxes,) (E39)."""
    minimum, maximum = RANGES[limit.measure.channel](model, limit.measure, lower, upper)
    violated = np.zeros(len(lower), dtype=bool) | (minimum > limit.maximum * (1.0 + SLACK))
    violated |= maximum < limit.minimum * (1.0 - SLACK)
    if limit.outside is not None:
        a, b = limit.outside[0] * (1.0 + SLACK), limit.outside[1] * (1.0 - SLACK)
        violated |= np.any((_frequencies(model, lower) > a) & (_frequencies(model, upper) < b), axis=1)
    return np.asarray(violated)
