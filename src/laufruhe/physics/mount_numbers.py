"""Figures of a block on its mounts (E7, E9, E11, E14, E46, E47)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from laufruhe.machine import Block, Mount
from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.modes import Modes, static_motion, torque_roll_axis, weight_wrench


def transmitted(forces: Spectrum, firm: Spectrum, orders: Sequence[float] | None) -> float:
    """Return the force on elastic mounts over that on the same mounts if rigid (E11).

    Both are the root of the sum of squares over mounts; the largest of the orders named,
    or all orders above zero together. Zero where nothing excites.
    """
    if orders is None:
        return _ratio(forces.coefficients[1:], firm.coefficients[1:])
    return max(_ratio(forces.at(order), firm.at(order)) for order in orders)


def _ratio(forces: ComplexArray, firm: ComplexArray) -> float:
    below = float(np.linalg.norm(firm))
    return float(np.linalg.norm(forces)) / below if below > 0.0 else 0.0


def sag(mounting: ElasticMounting) -> float:
    """Return the static sag of the centre of gravity under the weight [m] (E9)."""
    return float(-static_motion(mounting.modes, weight_wrench(mounting.block))[2])


def decoupling(energy: Any, motions: Sequence[int]) -> float:
    """Return the least energy share of a motion in its dominant mode (E7)."""
    return float(min(energy[motion].max() for motion in motions))


def motion_frequencies(modes: Modes, motions: Sequence[int]) -> list[float]:
    """Return the frequency of each motion's dominant mode, where its energy share is largest [Hz] (E6, E7)."""
    return [float(modes.frequencies[modes.energy[motion].argmax()]) for motion in motions]


def decoupling_shortfall(energy: Any, motions: Sequence[int], wanted: float) -> float:
    """Return the summed shortfall of energy shares in dominant modes from `wanted` (E47)."""
    return float(sum(max(wanted - energy[motion].max(), 0.0) for motion in motions))


@dataclass(frozen=True, eq=False)
class AxisResidual:
    """Distance of a rotation about the torque-roll axis from a mode, |left A right - s mass|, s bounded.

    A is the stiffness in coordinates in which the mass is one. The least s is known in closed form, so that the
    residual is the distance of an affine function of A from a line: convex in stiffness.

    Attributes
    ----------
    left, right, mass
        Shapes (6, 6), (6,) and (6,).
    minimum, maximum
        Bounds of s.
    """

    left: Array
    right: Array
    mass: Array
    minimum: float
    maximum: float

    def stiffness_part(self, matrix: Any) -> Any:
        """Return left A right, the part of the residual that depends on stiffness; also for symbols."""
        return self.left @ matrix @ self.right

    def nearest(self, stiffness_part: Array) -> float:
        """Return the s with the least residual, from the part that depends on stiffness."""
        return float(np.clip(self.mass @ stiffness_part / (self.mass @ self.mass), self.minimum, self.maximum))

    def rows(self, matrix: Array) -> Array:
        """Return left A right - s mass at the best s, shape (6,)."""
        stiffness_part = np.asarray(self.stiffness_part(matrix))
        return stiffness_part - self.nearest(stiffness_part) * self.mass

    def linear_bound(self, z: Array) -> tuple[Array, float]:
        """Return y and c of a lower bound of the residual, linear in stiffness: y . left A right - c (E19, E46).

        `z` is its slope before it is shortened to length one, and made valid for an unbounded s. c is the largest
        s y . mass within the bounds of s.
        """
        y = z / max(float(np.linalg.norm(z)), 1.0)
        along = float(y @ self.mass)
        if self.maximum == np.inf and along > 0.0:
            y = y - along / float(self.mass @ self.mass) * self.mass
            along = 0.0
        return y, along * (self.maximum if along > 0.0 else self.minimum)


Band: TypeAlias = tuple[float, float]
"""Least and largest frequency that counts [Hz]."""


def relative_residual(block: Block, band: Band) -> AxisResidual:
    """Return |A t / w^2 - t|, t the unit rotation in coordinates in which the mass is one (E14)."""
    along = _along(block)
    return AxisResidual(np.eye(6) / (2.0 * np.pi * band[0]) ** 2, along, along, 1.0, 1.0)


def raw_residual(block: Block, band: Band) -> AxisResidual:
    """Return |K q - w^2 M q|, q one radian about the torque-roll axis [N, N m per rad] (E46)."""
    root, motion = np.asarray(np.linalg.cholesky(block.mass_matrix), dtype=np.float64), _turning(block)
    low, high = ((2.0 * np.pi * frequency) ** 2 for frequency in band)
    return AxisResidual(root, root.T @ motion, block.mass_matrix @ motion, low, high)


def _turning(block: Block) -> Array:
    return np.asarray(np.concatenate([np.zeros(3), torque_roll_axis(block)]), dtype=np.float64)


def _along(block: Block) -> Array:
    direction = np.linalg.cholesky(block.mass_matrix).T @ _turning(block)
    return np.asarray(direction / np.linalg.norm(direction))


def mass_root(block: Block) -> Array:
    """Return R with R M R' = 1, shape (6, 6); its transpose maps unit-mass coordinates to motion."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(block.mass_matrix)))


def residual_of(mounting: ElasticMounting, axis: AxisResidual) -> float:
    """Return the residual of a block on its mounts."""
    root = mass_root(mounting.block)
    return float(np.linalg.norm(axis.rows(root @ mounting.stiffness @ root.T)))


def torque_roll_answer(mounting: ElasticMounting) -> float:
    """Return |K q|, the mount forces and moments per radian about the torque-roll axis (E46)."""
    return float(np.linalg.norm(mounting.stiffness @ _turning(mounting.block)))


def torque_roll_coupling(mounting: ElasticMounting) -> float:
    """Return the distance of the rotation about the torque-roll axis from a mode, 0 to 1 (E8).

    0: a torque about the crank moves the block about that axis alone, at one natural
    frequency. 1: the mounts answer with nothing but other motions.
    """
    root, along = mass_root(mounting.block), _along(mounting.block)
    stiffness_part = root @ mounting.stiffness @ root.T @ along
    size = float(np.linalg.norm(stiffness_part))
    return float(np.linalg.norm(stiffness_part - along * (along @ stiffness_part))) / size if size > 0.0 else 0.0


def torque_roll_frequency(mounting: ElasticMounting) -> float:
    """Return the frequency at which rotation about the torque-roll axis is nearest to a mode [Hz] (E46)."""
    axis = raw_residual(mounting.block, (0.0, np.inf))
    return float(np.sqrt(axis.nearest(mounting.stiffness @ _turning(mounting.block))) / (2.0 * np.pi))


def total_stiffness(mounts: Sequence[Mount]) -> float:
    """Return the sum of all stiffnesses along the mounts' own axes [N/m]."""
    return float(sum(sum(spring.stiffness) for _, spring in every_spring(mounts)))
