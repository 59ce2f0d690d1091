"""Ranges of spring numbers by bounds of decisions, and of the stiffness matrix by limits (E31, E43, E53)."""

from __future__ import annotations

import math

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.physics.modes import weight_wrench
from laufruhe.problem import channels
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.problem import Problem

SLACK = 1e-6
"""Relative violation of a limit that counts as none."""


def number_ranges(problem: Problem, lower: Array | None = None, upper: Array | None = None) -> tuple[Array, Array]:
    """Return lower and upper bounds of all numbers of every spring, fixed ones included, shape (springs, 14) each.

    The open numbers lie between `lower` and `upper`, shape (n,), or by default between the bounds of the problem.
    """
    low = np.array(problem.mount_numbers, dtype=float)
    high = low.copy()
    decisions = problem.mount_decisions
    sides = [
        [getattr(d, side) for d in decisions] if values is None else values.tolist()
        for side, values in (("lower", lower), ("upper", upper))
    ]
    for decision, *edges in zip(decisions, *sides, strict=True):
        for drive in decision.mount_drives:
            ends = [drive.gain * (edge - decision.real_start) for edge in edges]
            low[drive.mount, drive.number] += min(ends)
            high[drive.mount, drive.number] += max(ends)
    return low, high


def limited_stiffness(problem: Problem, root: Array) -> tuple[list[Array], list[Array], list[tuple[float, float]]]:
    """Return bounds of the stiffness matrix A that hold for every design within the limits.

    The results are matrices L <= A by lowest frequency and sag (E31), matrices U >= A (E43), and bands without any
    eigenvalue of A (E53). A is in coordinates with unit mass, and `root` takes wrenches there, shape (6, 6). Bands are
    squares of angular frequencies [rad^2/s^2], less the tolerance of limits.
    """
    floors, ceilings, bands = [], [], []
    weight = weight_wrench(mounting_in(problem.engine).block)
    for limit in problem.mount_limits:
        if limit.measure.channel is channels.FREQUENCIES:
            floors += [(math.tau * limit.minimum) ** 2 * np.eye(6)] if limit.minimum > 0.0 else []
            ceilings += [(math.tau * limit.maximum) ** 2 * np.eye(6)] if limit.maximum < math.inf else []
            for low, high in [limit.outside] if limit.outside is not None else []:
                bands.append(((math.tau * low * (1.0 + SLACK)) ** 2, (math.tau * high * (1.0 - SLACK)) ** 2))
        if limit.measure.channel is channels.SAG and 0.0 < limit.maximum < math.inf:
            pull = root @ weight
            floors.append(np.outer(pull, pull) / (limit.maximum * -weight[2]))
    return floors, ceilings, bands
