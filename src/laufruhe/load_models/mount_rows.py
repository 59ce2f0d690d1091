"""Mount forces and mount deflections at samples of the cycle as CasADi expressions (E4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.load_models.mount_symbols import PointResponse
from laufruhe.load_models.symbolic_spectrum import cosines_and_sines
from laufruhe.numerics.norms import Grid
from laufruhe.problem import channels
from laufruhe.problem.measure import Measure

MIN_SAMPLES = 32
SAMPLES_PER_ORDER = 4
"""Number of samples per period of the highest order."""


def sampled_rows(points: Sequence[PointResponse], names: Sequence[str], measure: Measure) -> tuple[Any, Grid]:
    """Return the vectors (rows) whose norm is a measure of mount forces or deflections, as CasADi expressions (P1).

    Rows are values at samples, or coefficients of orders for a root mean square (Parseval); their expression has the
    shape (k, 3). `points` are the responses at the operating points, and `names` the names of the mounts in them.
    """
    chosen = [response for response in points if measure.includes_point(response.point)]
    signals = [one.force if measure.channel is channels.MOUNT_FORCE else one.travel for one in chosen]
    mounts = measure.places(names)
    total_weight = sum(response.point.weight for response in chosen)
    blocks: list[Any] = []
    weights: list[float] = []
    # orders differ between points: all have the samples that the highest order needs
    highest = max(float(signal.orders.max(initial=0.0)) / signal.base for signal in signals)
    samples = max(MIN_SAMPLES, int(SAMPLES_PER_ORDER * highest))
    for response, signal in zip(chosen, signals, strict=True):
        part = signal.select(np.flatnonzero(measure.counted(signal.orders)))
        if measure.norm.is_euclidean:
            is_mean = part.orders == 0.0
            values, steps = ca.horzcat(part.real, part.imaginary), np.append(0.5 + 0.5 * is_mean, 0.5 - 0.5 * is_mean)
        else:
            cosine, sine = cosines_and_sines(part.orders.tolist(), signal.base, samples)
            values, steps = part.real @ cosine - part.imaginary @ sine, np.full(samples, 1.0 / samples)
        for k in mounts:
            rows = values[3 * k : 3 * k + 3, :].T
            if measure.direction_weights is not None:
                rows = rows @ ca.diag(ca.DM(list(measure.direction_weights)))
            blocks.append(rows)
            weights += [*(response.point.weight / total_weight / len(mounts) * steps)]
    return ca.vertcat(*blocks), Grid(np.array(weights), samples, points=len(chosen))


def transmitted_squares(points: Sequence[PointResponse], measure: Measure) -> list[tuple[Any, Any]]:
    """Return sums of squared mount forces on elastic and on rigid mounts, whose ratio is a transmissibility (E11).

    The list has a pair for each operating point and order.

    If the measure names no orders, all orders above zero count together.
    """
    pairs = []
    counted = [measure.orders] if measure.orders is None else [(order,) for order in measure.orders]
    for response in points:
        for orders in counted if measure.includes_point(response.point) else ():
            all_orders = response.force.orders
            group = np.flatnonzero((all_orders > 0.0) & replace(measure, orders=orders).counted(all_orders))
            if len(group):
                forces = (response.force.select(group), response.rigid_force.select(group))
                elastic, rigid = (ca.sumsqr(force.real) + ca.sumsqr(force.imaginary) for force in forces)
                pairs.append((elastic, rigid))
    return pairs
