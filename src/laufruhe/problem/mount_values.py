"""What the exact model says of mounts and modes (E11, E15)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.mount_design import (
    MountLimit,
    MountMeasure,
    MountQuantity,
    decoupling_of,
    mounting_in,
    sag_of,
    torque_roll_residual,
    total_stiffness,
)
from laufruhe.problem.problem import Problem

Array = NDArray[np.float64]


def transmitted(forces: Spectrum, firm: Spectrum, orders: Sequence[float] | None) -> float:
    """Force on elastic mounts over that on the same mounts if they gave no way (E11).

    Both are the root of the sum of squares over mounts; the largest of the orders named,
    or all orders above zero together. Zero where nothing excites.
    """
    if orders is None:
        return _ratio(forces.coefficients[1:], firm.coefficients[1:])
    return max(_ratio(forces.at(order), firm.at(order)) for order in orders)


def _ratio(forces: NDArray[np.complex128], firm: NDArray[np.complex128]) -> float:
    below = float(np.linalg.norm(firm))
    return float(np.linalg.norm(forces)) / below if below > 0.0 else 0.0


def mount_value(quantity: MountQuantity, evaluation: Evaluation) -> float:
    """A quantity of a design on elastic mounts [SI]; of natural frequencies, the lowest."""
    mounting = mounting_in(evaluation.engine)
    measure = quantity.measure
    if measure is MountMeasure.SAG:
        return sag_of(mounting)
    if measure is MountMeasure.FREQUENCIES:
        return float(mounting.modes.frequencies[0])
    if measure is MountMeasure.DECOUPLING:
        return decoupling_of(mounting.modes.energy, quantity.motion_indices)
    if measure is MountMeasure.TORQUE_ROLL:
        return torque_roll_residual(mounting, quantity.frequency)
    if measure is MountMeasure.TOTAL_STIFFNESS:
        return total_stiffness(evaluation.engine.mounts)
    return _transmissibility(quantity, evaluation)


def _transmissibility(quantity: MountQuantity, evaluation: Evaluation) -> float:
    firm = rigid_mounting(evaluation.engine.mounts)
    ratios = [
        transmitted(loads.mount_forces, firm.forces(loads.wrench), quantity.orders)
        for loads in evaluation.loads
        if (quantity.points is None or loads.point.name in quantity.points) and loads.mount_forces is not None
    ]
    return max(ratios, default=0.0)


def limit_value(limit: MountLimit, evaluation: Evaluation) -> tuple[float, float, str]:
    """Value, and the side that it is nearest to breaking, or breaks: where it lies and what it says (E15).

    Of natural frequencies these are the frequency and the edge with the least room.
    """
    value, (_, edge, side) = _worst(limit, evaluation)
    return value, edge, side


def excess(limit: MountLimit, evaluation: Evaluation) -> float:
    """Relative excess over the worst side of a limit; zero or less inside."""
    return -_worst(limit, evaluation)[1][0]


def _worst(limit: MountLimit, evaluation: Evaluation) -> tuple[float, tuple[float, float, str]]:
    if limit.quantity.measure is MountMeasure.FREQUENCIES:
        values = [float(f) for f in mounting_in(evaluation.engine).modes.frequencies]
    else:
        values = [mount_value(limit.quantity, evaluation)]
    return min(((value, _room(limit, value)) for value in values), key=lambda pair: pair[1][0])


def _room(limit: MountLimit, value: float) -> tuple[float, float, str]:
    """Relative distance inside the nearest side, negative outside; that side, and its sense."""
    sides = []
    if limit.minimum is not None:
        sides.append((value - limit.minimum, limit.minimum, "at least"))
    if limit.maximum is not None:
        sides.append((limit.maximum - value, limit.maximum, "at most"))
    if limit.outside is not None:
        low, high = limit.outside
        below, above = (low - value, low, "at most"), (value - high, high, "at least")
        sides.append(max(below, above))
    return min(((room / (abs(edge) or 1.0), edge, side) for room, edge, side in sides), default=(math.inf, 0.0, ""))


def whole_objective(problem: Problem, evaluation: Evaluation) -> float:
    """Load quantities and mount quantities of the objective together."""
    loads = sum(term.weight * evaluation.value(term.quantity) for term in problem.objective)
    return loads + sum(weight * mount_value(quantity, evaluation) for quantity, weight in problem.mount_design.terms)
