"""Lower bounds of transmissibility over boxes: ratio of forces to those on rigid mounts (E40)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.machine import OperatingPoint
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.numerics.spectrum import orders_equal
from laufruhe.problem import channels
from laufruhe.problem.measure import Measure
from laufruhe.prove.mounts.box_norms import LinearBound, root_under
from laufruhe.prove.mounts.box_response import LoadedOrders
from laufruhe.prove.mounts.box_series import LinearResponse

HALVINGS = 45
RATIOS = frozenset({channels.TRANSMISSIBILITY})
"""Channels of transmissibility."""


def is_ratio(measure: Measure) -> bool:
    """Return True if a measure is a transmissibility."""
    return measure.channel in RATIOS


def groups_of(measure: Measure, points: Sequence[OperatingPoint], lines: LoadedOrders) -> list[Mask]:
    """Return masks of the lines of each ratio: one per operating point and named order, or all orders above zero."""
    groups = []
    for p in (p for p in np.unique(lines.points) if measure.includes_point(points[p])):
        moving = (lines.points == p) & (lines.orders > 0.0)
        orders: Sequence[float | None] = (None,) if measure.orders is None else measure.orders
        groups += [moving if order is None else moving & orders_equal(lines.orders, order) for order in orders]
    return [group for group in groups if group.any()]


def ratio_under(elastic: LinearResponse, rigid: LinearResponse, groups: Sequence[Mask]) -> tuple[Array, Array]:
    """Return lower bounds of the largest ratio, shape (boxes,), and branching scores, shape (boxes, n).

    Parameters
    ----------
    elastic, rigid
        Mount forces by order on elastic mounts, and on rigid mounts under the same loads.
    groups
        Orders of each ratio, from `groups_of`.
    """
    best, scores = np.zeros(len(elastic.value)), np.zeros(elastic.scores[:, 0].shape)
    for group in groups:
        weights = group.astype(float)
        top, bottom = root_under(elastic, weights), root_under(rigid, weights)
        square = np.einsum("k,bk->b", weights, np.linalg.norm(rigid.slopes, axis=-1).sum(axis=-1) ** 2)
        is_bounded = np.all(np.isfinite(rigid.remainder[:, group]), axis=1) & (bottom.value > 0.0)
        curvature = square / (2.0 * np.where(is_bounded, bottom.value, 1.0))
        minimum = _least_ratio(top, replace(bottom, remainder=bottom.remainder + curvature))
        best = np.maximum(best, np.where(is_bounded, minimum, 0.0))
        scores = np.maximum(scores, (top.scores + minimum[:, None] * bottom.scores) / bottom.value[:, None])
    return best, scores


def _least_ratio(top: LinearBound, bottom: LinearBound) -> Array:
    # largest t with top - t bottom >= 0 all over the box (E40)
    low = np.zeros(len(top.value))
    high = top.value / np.where(bottom.value > 0.0, bottom.value, 1.0)
    for _ in range(HALVINGS):
        t = 0.5 * (low + high)
        left = top.value - top.remainder - t * (bottom.value + bottom.remainder)
        holds = left - np.abs(top.slopes - t[:, None] * bottom.slopes).sum(axis=1) >= 0.0
        low, high = np.where(holds, t, low), np.where(holds, high, t)
    return low
