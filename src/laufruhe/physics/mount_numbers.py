"""Numbers of a block on its mounts that designers ask for (E7, E9, E11, E14)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Mount
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.modes import static_motion, torque_roll_axis, weight_wrench

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


def sag(mounting: ElasticMounting) -> float:
    """How far the centre of gravity sinks under its own weight [m] (E9)."""
    return float(-static_motion(mounting.modes, weight_wrench(mounting.block))[2])


def decoupling(energy: Any, motions: Sequence[int]) -> float:
    """Least share of a motion in the mode that is most its own (E7)."""
    return float(min(energy[motion].max() for motion in motions))


def torque_roll_rows(mounting: ElasticMounting) -> tuple[Array, Array]:
    """What turning about the torque-roll axis would need to be a mode (E14).

    Returns
    -------
    Motion t about the axis in coordinates where the mass is one, shape (6,), and the
    inverse root of the mass, shape (6, 6): the residual is |R K R' t / w^2 - t|.
    """
    motion = np.concatenate([np.zeros(3), torque_roll_axis(mounting.block)])
    root = np.linalg.inv(np.linalg.cholesky(mounting.block.mass_matrix))
    along = np.linalg.solve(root.T, motion)
    return along / np.linalg.norm(along), root


def torque_roll_residual(mounting: ElasticMounting, frequency: float) -> float:
    """|R K R' t / w^2 - t|: zero where turning about the torque-roll axis is a mode at `frequency` [Hz] (E14)."""
    along, root = torque_roll_rows(mounting)
    square = (2.0 * np.pi * frequency) ** 2
    return float(np.linalg.norm(root @ mounting.stiffness @ root.T @ along / square - along))


def total_stiffness(mounts: Sequence[Mount]) -> float:
    """Sum of all stiffnesses along the mounts' own axes [N/m]."""
    return float(sum(sum(mount.stiffness) for mount in mounts))
