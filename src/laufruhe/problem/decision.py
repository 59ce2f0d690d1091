"""Decisions: open numbers, the sets they lie in, and what of the engine they drive.

A decision knows its set and its drives; which method decides it follows from the kinds of
drives. Of a convex set a bound needs the least value of a linear function, a method the
nearest point (P4).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Engine, Mount
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.rigid_body import turned_axes

Array = NDArray[np.float64]
Value: TypeAlias = complex | float

STIFFNESS, LOSS, DAMPING, POSITION, TURNED = slice(0, 3), 3, slice(4, 7), slice(7, 10), slice(10, 13)
NUMBERS_OF_MOUNT = 13


@dataclass(frozen=True)
class Interval:
    """A real number between bounds, along a direction in the plane across the crank (C4)."""

    lower: float
    upper: float
    angle: float = 0.0
    width: ClassVar[int] = 1
    free_angle: ClassVar[bool] = False
    edges: ClassVar[Array] = np.zeros((0, 2))

    @property
    def scale(self) -> float:
        """Largest size."""
        return max(abs(self.lower), abs(self.upper)) or 1.0

    def scaled(self, factor: float) -> Interval:
        """The same in a unit of another size."""
        return replace(self, lower=self.lower * factor, upper=self.upper * factor)

    @property
    def angles(self) -> tuple[float, float]:
        """Bounds of the angle [rad]: one and the same."""
        return self.angle, self.angle

    @property
    def directions(self) -> tuple[complex, ...]:
        """Complex value per unit of each column (C4)."""
        return (cmath.exp(1j * self.angle),) if self.angle else (1.0 + 0.0j,)

    def split(self, u: Value) -> tuple[float, float]:
        """Size and angle [rad] of a value."""
        return (u * self.directions[0].conjugate()).real, self.angle

    def least(self, g: Array) -> float:
        """min g . x over the set."""
        return float(min(g[0] * self.lower, g[0] * self.upper))

    def project(self, v: Array) -> Array:
        """The nearest point of the set."""
        return np.clip(v, self.lower, self.upper)


@dataclass(frozen=True)
class Sector:
    """A complex number of a largest size, its angle between bounds: a disc where these are a whole turn apart (C4)."""

    upper: float
    angles: tuple[float, float] = (0.0, math.tau)
    lower: ClassVar[float] = 0.0
    width: ClassVar[int] = 2
    directions: ClassVar[tuple[complex, ...]] = (1.0 + 0.0j, 1.0j)

    @property
    def scale(self) -> float:
        """Largest size."""
        return self.upper or 1.0

    def scaled(self, factor: float) -> Sector:
        """The same in a unit of another size."""
        return replace(self, upper=self.upper * factor)

    @property
    def free_angle(self) -> bool:
        """Whether every angle is allowed."""
        return self.angles[1] - self.angles[0] >= math.tau * (1.0 - 1e-12)

    @property
    def edges(self) -> Array:
        """Unit vectors along the two sides, shape (2, 2); none of a disc."""
        if self.free_angle:
            return np.zeros((0, 2))
        low, high = self.angles
        return np.array([[np.cos(low), np.sin(low)], [np.cos(high), np.sin(high)]])

    def split(self, u: Value) -> tuple[float, float]:
        """Size and angle [rad] of a value, the angle within the bounds' own turn."""
        low = self.angles[0]
        return abs(u), low + (cmath.phase(u) - low) % math.tau if u != 0 else low

    def least(self, g: Array) -> float:
        """min g . x over the set, in closed form: the negative support function of -g (P4)."""
        if self._inside_cone(-g):
            return -self.upper * float(np.hypot(*g))
        return min(0.0, self.upper * float((self.edges @ g).min()))

    def project(self, v: Array) -> Array:
        """The nearest point of the set."""
        if not self._inside_cone(v):
            along = np.maximum(self.edges @ v, 0.0)
            best = int(np.argmax(along))
            v = along[best] * self.edges[best]
        size = float(np.hypot(*v))
        return v * (self.upper / size) if size > self.upper else v

    def _inside_cone(self, v: Array) -> bool:
        edges = self.edges
        if not len(edges):
            return True
        (ax, ay), (bx, by) = edges
        return bool(ax * v[1] - ay * v[0] >= 0.0 and bx * v[1] - by * v[0] <= 0.0)


Set: TypeAlias = Interval | Sector


@dataclass
class Numbers:
    """The numbers of an engine that decisions may move; symbols do as well.

    Attributes
    ----------
    unbalances
        Of the rotors by name [kg m] (C4).
    mounts
        Of every mount thirteen: stiffness, loss factor, damping, position, turned angles (E13).
    """

    unbalances: dict[str, Any] = field(default_factory=dict)
    mounts: list[list[Any]] = field(default_factory=list)

    def engine(self, given: Engine) -> Engine:
        """The engine with these numbers."""
        rotors = tuple(replace(rotor, unbalance=self.unbalances[rotor.name]) for rotor in given.rotors)
        mounts = given.mounts
        if self.mounts:
            mounts = tuple(mount_of(mount, row) for mount, row in zip(given.mounts, self.mounts, strict=True))
        return replace(given, rotors=rotors, mounts=mounts)


class Drive(Protocol):
    """How a decision acts on one number of the engine.

    Attributes
    ----------
    is_affine
        Whether every load is affine in what it moves (P1).
    """

    is_affine: ClassVar[bool]

    def move(self, numbers: Numbers, change: Any) -> None:
        """Move the number by a change of the decision."""


@dataclass(frozen=True)
class RotorDrive:
    """U += gain u of one rotor, or gain conj(u) when mirrored."""

    rotor: str
    gain: complex
    mirrored: bool = False
    is_affine: ClassVar[bool] = True

    def of(self, change: Value) -> Value:
        """What a change of the decision does to the unbalance."""
        return self.gain * (change.conjugate() if self.mirrored else change)

    def move(self, numbers: Numbers, change: Any) -> None:
        """Of the unbalance."""
        numbers.unbalances[self.rotor] += self.of(change)


@dataclass(frozen=True)
class MountDrive:
    """number += gain x change, of one number of one mount (E13)."""

    mount: int
    number: int
    gain: float
    is_affine: ClassVar[bool] = False

    @property
    def is_stiffness(self) -> bool:
        """Whether K is linear in it."""
        return self.number < STIFFNESS.stop

    def move(self, numbers: Numbers, change: Any) -> None:
        """Of the mount's number."""
        numbers.mounts[self.mount][self.number] += self.gain * change


@dataclass(frozen=True)
class Decision:
    """An open number, and what follows it.

    Attributes
    ----------
    name
        As in the problem file.
    unit
        SI unit; "" for a balance fraction.
    set
        Where it lies.
    start
        Its value in the design as given: a complex u = size e^{i angle} of an unbalance.
    drives
        What of the engine follows.
    """

    name: str
    unit: str
    set: Set
    start: Value
    drives: tuple[Drive, ...]

    @property
    def lower(self) -> float:
        """Least size."""
        return self.set.lower

    @property
    def upper(self) -> float:
        """Largest size."""
        return self.set.upper

    @property
    def start_number(self) -> float:
        """The start of a real number."""
        return self.start.real

    @property
    def is_affine(self) -> bool:
        """Whether every load is affine in it."""
        return all(drive.is_affine for drive in self.drives)

    @property
    def rotor_drives(self) -> tuple[RotorDrive, ...]:
        """Unbalances that follow."""
        return tuple(drive for drive in self.drives if isinstance(drive, RotorDrive))

    @property
    def mount_drives(self) -> tuple[MountDrive, ...]:
        """Numbers of mounts that follow."""
        return tuple(drive for drive in self.drives if isinstance(drive, MountDrive))

    @property
    def is_stiffness(self) -> bool:
        """Whether nothing but stiffness of mounts follows."""
        return all(isinstance(drive, MountDrive) and drive.is_stiffness for drive in self.drives)


def without_rotors(decisions: Sequence[Decision], gone: Collection[str]) -> tuple[Decision, ...]:
    """Decisions as they are once some rotors are left out; those that drive nothing else go with them."""
    fewer = (
        replace(d, drives=tuple(v for v in d.drives if not (isinstance(v, RotorDrive) and v.rotor in gone)))
        for d in decisions
    )
    return tuple(decision for decision in fewer if decision.drives)


def moved_numbers(numbers: Numbers, decisions: Sequence[Decision], values: Sequence[Any]) -> Numbers:
    """The numbers with decisions at these values, changed in place."""
    for decision, value in zip(decisions, values, strict=True):
        change = value - decision.start
        for drive in decision.drives:
            drive.move(numbers, change)
    return numbers


def mount_of(mount: Mount, numbers: Sequence[float]) -> Mount:
    """A mount with these numbers in place of its own."""
    rows = turned_axes(NUMBERS, numbers[TURNED]).tolist()
    # a sum of changes may leave a bound of zero by a rounding
    (a, b, c), (p, q, r) = (tuple(max(float(v), 0.0) for v in numbers[s]) for s in (STIFFNESS, DAMPING))
    x, y, z = (float(v) for v in numbers[POSITION])
    return replace(
        mount, stiffness=(a, b, c), loss_factor=max(float(numbers[LOSS]), 0.0), damping=(p, q, r), position=(x, y, z),
        orientation=(tuple(rows[0]), tuple(rows[1]), tuple(rows[2])),
    )  # fmt: skip


@dataclass(frozen=True)
class Domain:
    """Columns of a decision vector that belong to one decision."""

    decision: Decision
    start: int

    @property
    def set(self) -> Set:
        """Where they lie."""
        return self.decision.set

    @property
    def width(self) -> int:
        """One real number, or two for a complex one."""
        return self.decision.set.width

    @property
    def columns(self) -> slice:
        """In the decision vector."""
        return slice(self.start, self.start + self.width)

    @property
    def scale(self) -> float:
        """Largest size."""
        return self.decision.set.scale

    def complex_value(self, x: Array) -> complex:
        """The decision u from the decision vector."""
        return complex(sum(part * d for part, d in zip(x[self.columns], self.set.directions, strict=True)))

    def columns_of(self, u: Value) -> Array:
        """The columns of a complex decision."""
        if self.width == 1:
            return np.array([(u * self.set.directions[0].conjugate()).real])
        return np.array([u.real, u.imag])

    def least(self, gradient: Array) -> float:
        """min g . x over the set (P4)."""
        return self.set.least(gradient[self.columns])

    def project(self, x: Array) -> Array:
        """The nearest point of the set to the columns of x."""
        return self.set.project(x[self.columns])


def domains_of(decisions: Sequence[Decision]) -> tuple[Domain, ...]:
    """Domains in the order of the decisions, their columns side by side."""
    out: list[Domain] = []
    start = 0
    for decision in decisions:
        out.append(Domain(decision, start))
        start += out[-1].width
    return tuple(out)
