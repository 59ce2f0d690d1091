"""Decisions: open numbers, the sets they lie in, and what of the engine they drive.

A decision knows its set and its drives; which method decides it follows from their kinds. Of a convex
set a bound needs the least value of a linear function, a method the nearest point (P4).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.problem.drives import (
    DAMPING,
    KINDS,
    LAG,
    LOSS,
    NUMBERS_OF_MOUNT,
    POSITION,
    STIFFNESS,
    TURNED,
    AddressDrive,
    Drive,
    Kind,
    MountDrive,
    NumberDrive,
    Numbers,
    PlaceDrive,
    RotorDrive,
    mount_of,
)
from laufruhe.problem.sets import Set, Value

__all__ = [
    "DAMPING",
    "KINDS",
    "LAG",
    "LOSS",
    "NUMBERS_OF_MOUNT",
    "POSITION",
    "STIFFNESS",
    "TURNED",
    "AddressDrive",
    "Decision",
    "Domain",
    "Drive",
    "Kind",
    "MountDrive",
    "NumberDrive",
    "Numbers",
    "PlaceDrive",
    "RotorDrive",
    "columns_of",
    "domains_of",
    "mount_of",
    "moved_numbers",
    "without_rotors",
]


@dataclass(frozen=True)
class Decision:
    """An open number, and what follows it.

    Attributes
    ----------
    name
        As in the problem file.
    unit
        SI unit; "" for a balance factor.
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
    def kind(self) -> Kind:
        """Of what follows."""
        return max(drive.kind for drive in self.drives)

    @property
    def is_affine(self) -> bool:
        """Whether every load is affine in it."""
        return self.kind in (Kind.UNBALANCE, Kind.PISTON, Kind.SHARE)

    @property
    def rotor_drives(self) -> tuple[RotorDrive, ...]:
        """Unbalances that follow."""
        return tuple(drive for drive in self.drives if isinstance(drive, RotorDrive))

    def keys(self, kind: Kind) -> tuple[Any, ...]:
        """Of the numbers of a kind that follow."""
        return tuple(drive.key for drive in self.drives if isinstance(drive, NumberDrive) and drive.kind is kind)

    @property
    def address_drives(self) -> tuple[AddressDrive, ...]:
        """Numbers of the file that follow."""
        return tuple(drive for drive in self.drives if isinstance(drive, AddressDrive))

    @property
    def place_drives(self) -> tuple[PlaceDrive, ...]:
        """Places of rotors that follow."""
        return tuple(drive for drive in self.drives if isinstance(drive, PlaceDrive))

    @property
    def is_stiffness(self) -> bool:
        """Whether nothing but stiffness of mounts follows."""
        return self.kind is Kind.STIFFNESS

    @property
    def mount_drives(self) -> tuple[MountDrive, ...]:
        """Numbers of mounts that follow."""
        return tuple(drive for drive in self.drives if isinstance(drive, MountDrive))


def without_rotors(decisions: Sequence[Decision], gone: Collection[str]) -> tuple[Decision, ...]:
    """Decisions as they are once some rotors are left out; those that drive nothing else go with them."""
    fewer = (replace(d, drives=tuple(v for v in d.drives if getattr(v, "rotor", None) not in gone)) for d in decisions)
    return tuple(decision for decision in fewer if decision.drives)


def moved_numbers(numbers: Numbers, decisions: Sequence[Decision], values: Sequence[Any]) -> Numbers:
    """The numbers with decisions at these values, changed in place."""
    for decision, value in zip(decisions, values, strict=True):
        change = value - decision.start
        for drive in decision.drives:
            drive.move(numbers, change)
    return numbers


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

    @property
    def ends(self) -> tuple[float, float]:
        """Least and largest that each of its columns is within the bounds."""
        return (self.set.lower, self.set.upper) if self.width == 1 else (-self.scale, self.scale)

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


def ends_of(domains: Sequence[Domain]) -> tuple[Array, Array]:
    """Least and most of every column of a decision vector within the bounds."""
    low, high = (np.array([d.ends[k] for d in domains for _ in range(d.width)], dtype=float) for k in (0, 1))
    return low, high


def sides_of(decisions: Sequence[Decision]) -> tuple[Array, Array]:
    """Bounds of decisions that are one number each."""
    lower, upper = (np.array([getattr(d, side) for d in decisions], dtype=float) for side in ("lower", "upper"))
    return lower, upper


def scales_of(domains: Sequence[Domain]) -> Array:
    """Largest size of every column of a decision vector."""
    return np.concatenate([np.zeros(0), *(np.full(d.width, d.scale) for d in domains)])


def vector_of(domains: Sequence[Domain], values: Sequence[Value] | Array | None = None) -> Array:
    """Decision vector of complex unbalances, of those of the design as given unless told."""
    own = [domain.decision.start for domain in domains] if values is None else values
    return np.concatenate([np.zeros(0), *(d.columns_of(value) for d, value in zip(domains, own, strict=True))])


def columns_of(domains: Sequence[Domain], values: Sequence[Value]) -> Array:
    """Decision vector of complex unbalances, each brought into its set."""
    out = vector_of(domains, values)
    for domain in domains:
        out[domain.columns] = domain.project(out)
    return out
