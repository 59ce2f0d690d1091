"""Natural modes of a block on its mounts, and static motion (E6-E10)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.errors import UncarriedLoadError
from laufruhe.machine.block import Block
from laufruhe.numerics.arrays import Array, Mask

GRAVITY = 9.80665
MOTIONS = ("fore-aft", "lateral", "bounce", "roll", "pitch", "yaw")
FREE_STIFFNESS = 1e-12
PURE = 0.5


@dataclass(frozen=True, eq=False)
class Modes:
    """Undamped natural modes in ascending order (E6).

    Attributes
    ----------
    squares
        Squares of the natural angular frequencies [1/s2], shape (6,); zero where free.
    shapes
        Columns (u, theta) of the centre of gravity, shape (6, 6), with shape' M shape = 1.
    energy
        Share of each motion in the kinetic energy of each mode, shape (motions, modes);
        columns add up to one, and an entry may leave 0 to 1 where inertia couples (E7).
    loss
        Loss factor of each mode by the hysteretic mounts, shape (6,).
    """

    squares: Array
    shapes: Array
    energy: Array
    loss: Array

    @property
    def frequencies(self) -> Array:
        """Natural frequencies [Hz], shape (6,)."""
        return np.asarray(np.sqrt(self.squares) / math.tau)

    @property
    def free(self) -> Mask:
        """Mask of modes that no mount resists, shape (6,)."""
        return np.asarray(self.squares == 0.0)

    @property
    def names(self) -> tuple[str, ...]:
        """Main motion of each mode: bounce, or bounce-pitch if none has half of the energy."""
        names = []
        for shares in self.energy.T:
            first, second = np.argsort(-shares)[:2]
            names.append(MOTIONS[first] if shares[first] >= PURE else f"{MOTIONS[first]}-{MOTIONS[second]}")
        return tuple(names)


def modes_of(mass: Array, stiffness: Array, loss: Array | None = None) -> Modes:
    """Return the natural modes of a block with mass matrix M and stiffness matrix K, shape (6, 6) each (E6, E7).

    Solved in coordinates in which the mass is one, so that a block with hardly any
    inertia about one axis costs no digits of the others.
    """
    root = np.linalg.cholesky(mass)
    inverse = np.linalg.inv(root)
    scaled = inverse @ stiffness @ inverse.T
    squares, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    squares = np.where(squares > FREE_STIFFNESS * max(squares[-1], 0.0), squares, 0.0)
    shapes = inverse.T @ vectors
    # the sign of a mode is free, and its largest entry is made positive
    shapes *= np.sign(vectors[np.argmax(np.abs(vectors), axis=0), np.arange(6)])
    energy = shapes * (mass @ shapes)
    lost = np.zeros(6) if loss is None else np.einsum("ij,ik,kj->j", shapes, loss, shapes)
    return Modes(squares, shapes, energy, lost / np.where(squares > 0.0, squares, 1.0))


def free_motion(modes: Modes) -> str:
    """Return the motions that no mount resists in words; empty without any."""
    return " and ".join(dict.fromkeys(name for name, free in zip(modes.names, modes.free, strict=True) if free))


def static_motion(modes: Modes, wrench: Array) -> Array:
    """Return the motion (u, theta) under a steady wrench about the centre of gravity, shape (6,) (E9, E10)."""
    drive = modes.shapes.T @ wrench
    loose = modes.free & (np.abs(drive) > 1e-9 * max(np.abs(drive).max(), 1e-300))
    if np.any(loose):
        name = modes.names[int(np.argmax(loose))]
        raise UncarriedLoadError(f"a steady load drives the block in {name}, which no mount resists; add a mount")
    return np.asarray(modes.shapes @ (drive / np.where(modes.free, 1.0, modes.squares)))


def weight_wrench(block: Block) -> Array:
    """Return the weight of the block about its centre of gravity, shape (6,) [N, N m]."""
    return np.array([0.0, 0.0, -block.mass * GRAVITY, 0.0, 0.0, 0.0])


def sag_frequency(sag: float) -> float:
    """Return the natural frequency [Hz] of a mass that sags by `sag` [m] (E9; eq. 41)."""
    return math.sqrt(GRAVITY / sag) / math.tau


def sag_for_critical_speed(speed: float, order: float) -> float:
    """Return the sag [m] that puts the critical speed of an order at `speed` [rad/s] (E9; eq. 41, Fig. 32)."""
    return GRAVITY / (speed * order) ** 2


def torque_roll_axis(block: Block) -> Array:
    """Return the unit vector about which a crank torque starts to turn a free block, I^-1 e over its length (E8)."""
    axis = np.linalg.solve(block.tensor, np.array([1.0, 0.0, 0.0]))
    return np.asarray(axis / np.linalg.norm(axis))
