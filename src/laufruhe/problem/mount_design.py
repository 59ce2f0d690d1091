"""What of the mounts is open, and what is asked of mounts and modes (E13).

A mount is thirteen numbers. A decision moves any of them, on any mounts, in proportion;
so mounts that are alike or mirror each other follow one decision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from laufruhe.machine import Engine, Mount
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.elastic_mounts import ElasticMounting, elastic_mounting
from laufruhe.physics.modes import (
    MOTIONS,
    static_motion,
    torque_roll_axis,
    weight_wrench,
)
from laufruhe.physics.rigid_body import turned_axes

STIFFNESS, LOSS, DAMPING, POSITION, TURNED = slice(0, 3), 3, slice(4, 7), slice(7, 10), slice(10, 13)
NUMBERS_OF_MOUNT = 13


@dataclass(frozen=True)
class MountDrive:
    """How a decision acts on one number of one mount: number += gain x change."""

    mount: int
    number: int
    gain: float


@dataclass(frozen=True)
class MountDecision:
    """An open number of one mount or of several that follow it [SI].

    Attributes
    ----------
    name
        As in the problem file.
    unit
        SI unit.
    lower, upper, start
        Bounds, and the value of the design as given.
    drives
        The numbers that follow.
    """

    name: str
    unit: str
    lower: float
    upper: float
    start: float
    drives: tuple[MountDrive, ...]

    @property
    def is_stiffness(self) -> bool:
        """Whether K is linear in it."""
        return all(drive.number < STIFFNESS.stop for drive in self.drives)


class MountMeasure(StrEnum):
    """What is asked of a block on its mounts."""

    TRANSMISSIBILITY = "transmissibility"
    SAG = "static sag"
    FREQUENCIES = "natural frequencies"
    DECOUPLING = "kinetic-energy decoupling"
    TORQUE_ROLL = "torque-roll residual"
    TOTAL_STIFFNESS = "total stiffness"

    @property
    def unit(self) -> str:
        """SI unit."""
        units = {MountMeasure.SAG: "m", MountMeasure.FREQUENCIES: "Hz", MountMeasure.TOTAL_STIFFNESS: "N/m"}
        return units.get(self, "")


MOUNT_NAMES = tuple(str(measure) for measure in MountMeasure)


@dataclass(frozen=True)
class MountQuantity:
    """One number of a block on its mounts.

    Attributes
    ----------
    measure
        What is measured.
    points, orders
        Operating points and orders of a transmissibility; all when None.
    motions
        Motions that are to have a mode of their own; all when None.
    frequency
        Natural frequency about the torque-roll axis that is wanted [Hz].
    """

    measure: MountMeasure
    points: tuple[str, ...] | None = None
    orders: tuple[float, ...] | None = None
    motions: tuple[str, ...] | None = None
    frequency: float = 0.0

    @property
    def name(self) -> str:
        """As a report prints it."""
        text = str(self.measure)
        if self.orders is not None:
            text += " of order " + ", ".join(f"{order:g}" for order in self.orders)
        if self.motions is not None:
            text += " of " + ", ".join(self.motions)
        if self.points is not None:
            text += " at " + ", ".join(self.points)
        return text

    @property
    def unit(self) -> str:
        """SI unit."""
        return self.measure.unit

    @property
    def motion_indices(self) -> tuple[int, ...]:
        """Of the motions that count."""
        return tuple(MOTIONS.index(name) for name in self.motions or MOTIONS)


@dataclass(frozen=True)
class MountLimit:
    """Bounds of a quantity [SI]; `outside` keeps every natural frequency out of a band."""

    name: str
    quantity: MountQuantity
    minimum: float | None = None
    maximum: float | None = None
    outside: tuple[float, float] | None = None


@dataclass(frozen=True)
class MountDesign:
    """Elastic mounts as given, what of them is open, and what is asked of them.

    Attributes
    ----------
    numbers
        Per mount: stiffness, loss factor, damping, position, turned angles [SI].
    decisions
        What is open.
    terms
        Quantities of the objective with their weights.
    limits
        What is forbidden.
    starts, seed
        Points that a search starts from where the problem is not convex.
    boxes
        That bounds of stiffness may be divided into for a proof; as is worth it when None.
    """

    numbers: tuple[tuple[float, ...], ...] = ()
    decisions: tuple[MountDecision, ...] = ()
    terms: tuple[tuple[MountQuantity, float], ...] = ()
    limits: tuple[MountLimit, ...] = ()
    starts: int = 16
    seed: int = 0
    boxes: int | None = None

    @property
    def asked(self) -> bool:
        """Whether anything is open or asked."""
        return bool(self.decisions or self.terms or self.limits)

    def numbers_at(self, values: Sequence[Any]) -> list[list[Any]]:
        """Numbers of every mount with decisions at these values; symbols do as well (E13)."""
        numbers: list[list[Any]] = [list(row) for row in self.numbers]
        for decision, value in zip(self.decisions, values, strict=True):
            for drive in decision.drives:
                numbers[drive.mount][drive.number] += drive.gain * (value - decision.start)
        return numbers

    def applied(self, engine: Engine, values: Sequence[float]) -> Engine:
        """The engine with its mounts as decided."""
        if not self.decisions:
            return engine
        rows = self.numbers_at([float(v) for v in values])
        # a sum of changes may leave a bound of zero by a rounding
        mounts = tuple(mount_of(mount, row) for mount, row in zip(engine.mounts, rows, strict=True))
        return replace(engine, mounts=mounts)


def mount_of(mount: Mount, numbers: Sequence[float]) -> Mount:
    """A mount with these numbers in place of its own."""
    rows = turned_axes(NUMBERS, numbers[TURNED]).tolist()
    (a, b, c), (p, q, r) = (tuple(max(float(v), 0.0) for v in numbers[s]) for s in (STIFFNESS, DAMPING))
    x, y, z = (float(v) for v in numbers[POSITION])
    return replace(
        mount, stiffness=(a, b, c), loss_factor=max(float(numbers[LOSS]), 0.0), damping=(p, q, r), position=(x, y, z),
        orientation=(tuple(rows[0]), tuple(rows[1]), tuple(rows[2])),
    )  # fmt: skip


def mounting_in(engine: Engine) -> ElasticMounting:
    """The elastic mounting of an engine that has one."""
    if engine.block is None:
        raise ValueError("this engine has no block, so its mounts are rigid")
    return elastic_mounting(engine.block, engine.mounts)


def sag_of(mounting: ElasticMounting) -> float:
    """How far the centre of gravity sinks under its own weight [m] (E9)."""
    return float(-static_motion(mounting.modes, weight_wrench(mounting.block))[2])


def decoupling_of(energy: Any, motions: Sequence[int]) -> float:
    """Least share of a motion in the mode that is most its own (E7)."""
    return float(min(energy[motion].max() for motion in motions))


def torque_roll_rows(mounting: ElasticMounting) -> tuple[np.ndarray, np.ndarray]:
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
    """|R K R' t / w^2 - t|: zero where turning about the torque-roll axis is a mode at `frequency` (E14)."""
    along, root = torque_roll_rows(mounting)
    square = (2.0 * np.pi * frequency) ** 2
    return float(np.linalg.norm(root @ mounting.stiffness @ root.T @ along / square - along))


def total_stiffness(mounts: Sequence[Mount]) -> float:
    """Sum of all stiffnesses along the mounts' own axes [N/m]."""
    return float(sum(sum(mount.stiffness) for mount in mounts))


NOTHING_ASKED = MountDesign()
