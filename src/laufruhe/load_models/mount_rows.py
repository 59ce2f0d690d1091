"""Forces and travel of mounts at angles of the cycle, as expressions of what is open (E4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.load_models.lines import waves
from laufruhe.load_models.mount_symbols import SymbolicResponse
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid
from laufruhe.problem import channels
from laufruhe.problem.measure import Measure

LEAST_SAMPLES = 32
SAMPLES_PER_ORDER = 4


@dataclass(frozen=True, eq=False)
class PointResponse:
    """Symbolic response at one operating point, and where its orders stand."""

    name: str
    weight: float
    base: float
    orders: Array
    response: SymbolicResponse


def sampled_rows(points: Sequence[PointResponse], names: Sequence[str], quantity: Measure) -> tuple[Any, Grid]:
    """Vectors at samples and their weights, as `load_rows` has them (P1).

    Of a norm that knows nothing but squares these are the orders' own (Parseval).

    Parameters
    ----------
    names
        Of the mounts, in the order of the response.
    quantity
        Of the forces or of the travel of the mounts.

    Returns
    -------
    Expression of shape (k, 3), and where its rows stand.
    """
    chosen = [p for p in points if quantity.points is None or p.name in quantity.points]
    mounts = quantity.places(names)
    whole = sum(point.weight for point in chosen)
    blocks: list[Any] = []
    weights: list[float] = []
    exact = quantity.norm.is_euclidean
    # points keep orders of their own: every signal has as many steps as the finest needs
    finest = max(float(point.orders.max(initial=0.0)) / point.base for point in chosen)
    samples = max(LEAST_SAMPLES, int(SAMPLES_PER_ORDER * finest))
    for point in chosen:
        signal = point.response.force if quantity.channel is channels.MOUNT_FORCE else point.response.travel
        counted = np.flatnonzero(quantity.counted(point.orders)).tolist()
        orders, (real, imaginary) = point.orders[counted], (part[:, counted] for part in signal)
        if exact:
            still = orders == 0.0
            values, steps = ca.horzcat(real, imaginary), np.append(0.5 + 0.5 * still, 0.5 - 0.5 * still)
        else:
            cosine, sine = waves(orders.tolist(), point.base, samples)
            values, steps = real @ cosine - imaginary @ sine, np.full(samples, 1.0 / samples)
        for k in mounts:
            rows = values[3 * k : 3 * k + 3, :].T
            if quantity.direction_weights is not None:
                rows = rows @ ca.diag(ca.DM(list(quantity.direction_weights)))
            blocks.append(rows)
            weights += [*(point.weight / whole / len(mounts) * steps)]
    return ca.vertcat(*blocks), Grid(np.array(weights), samples, points=len(chosen))


def transmitted(points: Sequence[PointResponse], quantity: Measure) -> list[tuple[Any, Any]]:
    """Squares of forces on elastic and on firm mounts, per point and order (E11)."""
    pairs = []
    counted = [quantity.orders] if quantity.orders is None else [(order,) for order in quantity.orders]
    for point in points:
        if quantity.points is not None and point.name not in quantity.points:
            continue
        for one in counted:
            group = np.flatnonzero((point.orders > 0.0) & replace(quantity, orders=one).counted(point.orders)).tolist()
            if group:
                parts = point.response.force, point.response.firm
                over, under = (sum(ca.sumsqr(part[:, group]) for part in halves) for halves in parts)
                pairs.append((over, under))
    return pairs
