"""Decisions: open numbers, their sets of allowed values, and the numbers of the engine that they change (drives).

The kinds of decisions select the method that solves a problem.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Protocol

import numpy as np

from laufruhe.extension import extended
from laufruhe.machine import Engine, Mount
from laufruhe.machine.engine import with_leads
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.rigid_body import turned_axes
from laufruhe.problem.sets import Set, Value

# indices of the fourteen numbers of a spring (E13), and their number
STIFFNESS, LOSS, DAMPING, POSITION, TURNED = slice(0, 3), 3, slice(4, 7), slice(7, 10), slice(10, 13)
LAG, NUMBERS_OF_MOUNT = 13, 14


@dataclass(frozen=True, order=True)
class Kind:
    """Kind of open numbers, distinguished by how loads depend on them.

    Attributes
    ----------
    rank
        Order of the kinds; a decision that drives several kinds has the kind of highest rank.
    name
        Name in messages; the table of a problem file for a kind of an extension.
    words
        Name of such numbers, in the plural.
    is_alone
        True if channels of the core depend on it only where the table of dependences has an entry for it.
    is_affine
        True if every load is affine in such numbers.
    """

    rank: float
    name: str
    words: str = field(default="", compare=False)
    is_alone: bool = field(default=False, compare=False)
    is_affine: bool = field(default=False, compare=False)

    UNBALANCE: ClassVar[Kind]
    """Unbalance: every load is affine in it (P1)."""
    PLACE: ClassVar[Kind]
    """Position of a rotor: every load is affine in it while the unbalances are fixed (P8)."""
    STIFFNESS: ClassVar[Kind]
    """Stiffness of a mount: the stiffness matrix of the mounting is linear in it."""
    MOUNT: ClassVar[Kind]
    """Any other number of a mount."""
    STAR: ClassVar[Kind]
    """Phasing, which is no number: crank star, firing order and optional shafts."""
    PISTON: ClassVar[Kind]
    """Mass of a piston: every load is affine in it, but not the turning inertia."""
    SIZE: ClassVar[Kind]
    """Size of the running gear: stresses fall with it, masses follow from it (Z2)."""
    SHARE: ClassVar[Kind]
    """Inertia on a geared shaft: the roll moment is affine in it while the masses of the pistons are fixed."""
    LEAD: ClassVar[Kind]
    """Phase lead of a geared shaft: loads of order h that it carries come earlier by h times the lead (P13)."""
    NUMBER: ClassVar[Kind]
    """Any other number of the problem file, on which everything may depend."""

    def __hash__(self) -> int:
        # the same in every process, so that sets of kinds have the same order
        return hash(self.rank)

    def __reduce__(self) -> tuple[Callable[[str], Kind], tuple[str]]:
        # unpickling returns the one object of this kind in the process
        return _kind_named, (self.name,)


Kind.UNBALANCE = Kind(1, "unbalance", "unbalances", is_affine=True)
Kind.PLACE = Kind(2, "place", "places of shafts")
Kind.STIFFNESS = Kind(3, "stiffness", "stiffness")
Kind.MOUNT = Kind(4, "mount", "other numbers of mounts")
Kind.STAR = Kind(5, "star", "stars, firing orders, shafts")
Kind.PISTON = Kind(7, "piston", "masses of pistons", is_affine=True)
Kind.SIZE = Kind(9, "size", "sizes")
Kind.SHARE = Kind(10, "share", "shares of geared inertia", is_affine=True)
Kind.LEAD = Kind(11, "lead", "leads")
Kind.NUMBER = Kind(12, "number", "other numbers of the file")

KINDS: Mapping[str, Kind] = extended("kinds", Kind, (
    Kind.UNBALANCE, Kind.PLACE, Kind.STIFFNESS, Kind.MOUNT, Kind.STAR, Kind.PISTON, Kind.SIZE, Kind.SHARE,
    Kind.LEAD, Kind.NUMBER,
))  # fmt: skip
"""Kinds by their names, with those of extensions."""


def _kind_named(name: str) -> Kind:
    return KINDS[name]


@dataclass
class Numbers:
    """Numbers of an engine that decisions may change; also as symbols of a smooth program.

    Attributes
    ----------
    unbalances
        Complex unbalance of each rotor by its name [kg m] (C4).
    places
        Position x of each rotor, and y and z of its shaft, by the name of the rotor [m] (C2).
    mounts
        Fourteen numbers for each spring: stiffness, loss factor, damping, position, turned angles, lag (E13). Empty if
        no decision changes mounts.
    changes
        Changes of all other numbers by kind and key (`NumberDrive`).
    """

    unbalances: dict[str, Any] = field(default_factory=dict)
    places: dict[str, list[Any]] = field(default_factory=dict)
    mounts: list[list[Any]] = field(default_factory=list)
    changes: dict[tuple[Kind, Any], float] = field(default_factory=dict)

    def engine(self, base: Engine) -> Engine:
        """Return the engine `base` with its unbalances, mounts and other open numbers replaced by these."""
        rotors = []
        for rotor in base.rotors:
            unbalance, place = self.unbalances[rotor.name], tuple(self.places[rotor.name])
            updated = rotor if unbalance == rotor.unbalance else replace(rotor, unbalance=unbalance)
            rotors.append(updated if place == rotor.place else updated.placed(*place))
        mounts = base.mounts
        if self.mounts:
            rows = iter(self.mounts)
            mounts = tuple(mount.mapped(lambda spring: mount_from_numbers(spring, next(rows))) for mount in base.mounts)
        shares = self._of_kind(Kind.SHARE.name)
        # a sum of changes may exceed a bound by a rounding error
        geared = tuple(replace(g, share=min(max(g.share + shares.get(g.name, 0.0), 0.0), 1.0)) for g in base.geared)
        parts, pistons = [], self._of_kind(Kind.PISTON.name)
        # the inertia deficit of a rod may be negative
        lower = {"rod_inertia_deficit": -math.inf}
        for part in base.slider_cranks:
            moves = {mass: change for (name, mass), change in pistons.items() if name == part.name}
            masses = {mass: max(getattr(part, mass) + change, lower.get(mass, 0.0)) for mass, change in moves.items()}
            parts.append(replace(part, **masses) if masses else part)
        engine = replace(base, slider_cranks=tuple(parts), rotors=tuple(rotors), mounts=mounts, geared=geared)
        for extra in base.extras:
            engine = extra.move(engine, self._of_kind(extra.name), base.slider_cranks)
        leads = self._of_kind(Kind.LEAD.name)
        return with_leads(engine, leads) if leads else engine

    def _of_kind(self, name: str) -> dict[Any, float]:
        return {key: change for (kind, key), change in self.changes.items() if kind.name == name}


class Drive(Protocol):
    """Effect of a decision on one number of the engine (structural type of the classes below)."""

    @property
    def kind(self) -> Kind:
        """Kind of the number."""

    def move(self, numbers: Numbers, change: Any, /) -> None:
        """Change the number in place for a change of the decision from its start."""


@dataclass(frozen=True)
class RotorDrive:
    """Change of the unbalance of one rotor: gain x change, or gain x conj(change) if mirrored."""

    rotor: str
    gain: complex
    mirrored: bool = False
    kind: ClassVar[Kind] = Kind.UNBALANCE

    def of(self, change: Value) -> Value:
        """Return the change of the unbalance for a change of the decision [kg m]."""
        return self.gain * (change.conjugate() if self.mirrored else change)

    def move(self, numbers: Numbers, change: Any) -> None:
        """Change the unbalance in place."""
        numbers.unbalances[self.rotor] += self.of(change)


@dataclass(frozen=True)
class PlaceDrive:
    """Change of the position of one rotor by the change of the decision: x, or y or z of its shaft [m] (C2)."""

    rotor: str
    axis: int
    kind: ClassVar[Kind] = Kind.PLACE

    def move(self, numbers: Numbers, change: Any) -> None:
        """Change the position in place."""
        numbers.places[self.rotor][self.axis] += change


@dataclass(frozen=True)
class MountDrive:
    """Change of one number of one mount: gain x change of the decision (E13)."""

    mount: int
    number: int
    gain: float

    @property
    def kind(self) -> Kind:
        """STIFFNESS, in which the stiffness matrix is linear, or MOUNT for other numbers."""
        return Kind.STIFFNESS if self.number < STIFFNESS.stop else Kind.MOUNT

    def move(self, numbers: Numbers, change: Any) -> None:
        """Change the number of the mount in place."""
        numbers.mounts[self.mount][self.number] += self.gain * change


@dataclass(frozen=True)
class NumberDrive:
    """Change of any other number of the engine by the change of the decision.

    Attributes
    ----------
    key
        Identifier among numbers of one kind: (slider-crank, mass), size of the running gear, shaft of a phase lead,
        geared inertia of a share, or number of a part of an extension.
    """

    kind: Kind
    key: Any

    def move(self, numbers: Numbers, change: Any) -> None:
        """Add the change to the changes of the number."""
        key = self.kind, self.key
        numbers.changes[key] = numbers.changes.get(key, 0.0) + float(change.real)


@dataclass(frozen=True)
class AddressDrive:
    """Number of the problem file: the engine is built again from the file with each new value.

    Attributes
    ----------
    path
        Address in the file: keys, and indices in lists from zero.
    unit
        SI unit in which the value is written; empty for a plain number.
    """

    path: tuple[str | int, ...]
    unit: str
    kind: ClassVar[Kind] = Kind.NUMBER

    def written(self, value: Value) -> str | float:
        """Return the value as it is written in a file: with its unit, if there is one."""
        number = float(value.real)
        return f"{number!r} {self.unit}" if self.unit else number

    def move(self, _numbers: Numbers, _change: Any) -> None:
        """Raise TypeError: the engine is built again instead (`Problem.fixed_at`)."""
        raise TypeError(
            f"the number at {self.path} of the problem file cannot change in a built engine; use Problem.fixed_at"
        )


def mount_from_numbers(mount: Mount, numbers: Sequence[float]) -> Mount:
    """Return a mount with fourteen other numbers: place, stiffness, damping and inclination (E13)."""
    rows = turned_axes(NUMBERS, numbers[TURNED]).tolist()
    # a sum of changes may fall below zero by a rounding error
    (a, b, c), (p, q, r) = (tuple(max(float(v), 0.0) for v in numbers[s]) for s in (STIFFNESS, DAMPING))
    x, y, z = (float(v) for v in numbers[POSITION])
    return replace(
        mount, stiffness=(a, b, c), loss_factor=max(float(numbers[LOSS]), 0.0), damping=(p, q, r), position=(x, y, z),
        orientation=(tuple(rows[0]), tuple(rows[1]), tuple(rows[2])), lag=max(float(numbers[LAG]), 0.0),
    )  # fmt: skip


@dataclass(frozen=True)
class Decision:
    """Open number with its set of allowed values and its effects.

    Attributes
    ----------
    unit
        SI unit; "" for a plain number such as a balance factor.
    start
        Value in the design as given; complex, size x e^{i angle}, for an unbalance.
    """

    name: str
    unit: str
    set: Set
    start: Value
    drives: tuple[Drive, ...]

    @property
    def angle_name(self) -> str:
        """Name of the angle that belongs to its size."""
        return self.name.rsplit(".", 1)[0] + ".angle"

    @property
    def lower(self) -> float:
        """Lower bound of the number along its direction; zero if its angle is open."""
        return self.set.lower

    @property
    def upper(self) -> float:
        """Upper bound of the number along its direction, or of its absolute value if its angle is open."""
        return self.set.upper

    @property
    def real_start(self) -> float:
        """Start value as a real number."""
        return self.start.real

    @property
    def kind(self) -> Kind:
        """Kind of the highest rank among the drives."""
        return max(drive.kind for drive in self.drives)

    @property
    def has_effect(self) -> bool:
        """True if it changes a number of the engine; unbalances with gain zero stay."""
        return any(not isinstance(drive, RotorDrive) or drive.gain != 0.0 for drive in self.drives)

    @property
    def is_affine(self) -> bool:
        """True if every load is affine in it."""
        return self.kind.is_affine

    @property
    def is_stiffness(self) -> bool:
        """True if it drives stiffness of mounts alone."""
        return self.kind is Kind.STIFFNESS

    @property
    def rotor_drives(self) -> tuple[RotorDrive, ...]:
        """Effects on unbalances of rotors."""
        return tuple(drive for drive in self.drives if isinstance(drive, RotorDrive))

    @property
    def place_drives(self) -> tuple[PlaceDrive, ...]:
        """Effects on positions of rotors."""
        return tuple(drive for drive in self.drives if isinstance(drive, PlaceDrive))

    @property
    def mount_drives(self) -> tuple[MountDrive, ...]:
        """Effects on numbers of mounts."""
        return tuple(drive for drive in self.drives if isinstance(drive, MountDrive))

    @property
    def address_drives(self) -> tuple[AddressDrive, ...]:
        """Effects on numbers of the problem file."""
        return tuple(drive for drive in self.drives if isinstance(drive, AddressDrive))

    def keys(self, kind: Kind) -> tuple[Any, ...]:
        """Return the keys of the numbers of one kind that the decision changes."""
        return tuple(drive.key for drive in self.drives if isinstance(drive, NumberDrive) and drive.kind is kind)


def without_rotors(decisions: Sequence[Decision], names: Collection[str]) -> tuple[Decision, ...]:
    """Return the decisions for an engine without the named rotors; decisions without any other effect are dropped."""
    reduced = (
        replace(d, drives=tuple(v for v in d.drives if getattr(v, "rotor", None) not in names)) for d in decisions
    )
    return tuple(decision for decision in reduced if decision.drives)


def apply_decisions(numbers: Numbers, decisions: Sequence[Decision], values: Sequence[Any]) -> Numbers:
    """Set the values of decisions in the numbers of an engine, in place, and return these numbers."""
    for decision, value in zip(decisions, values, strict=True):
        for drive in decision.drives:
            drive.move(numbers, value - decision.start)
    return numbers


@dataclass(frozen=True)
class Domain:
    """Columns of the decision vector that belong to one decision; `start` is the index of the first one."""

    decision: Decision
    start: int

    @property
    def set(self) -> Set:
        """Set of allowed values."""
        return self.decision.set

    @property
    def width(self) -> int:
        """Number of columns: one for a real number, two for a complex one."""
        return self.decision.set.width

    @property
    def columns(self) -> slice:
        """Slice of its columns in the decision vector."""
        return slice(self.start, self.start + self.width)

    @property
    def scale(self) -> float:
        """Largest absolute value of the decision; one if that is zero."""
        return self.decision.set.scale

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper bound, equal for all its columns."""
        return (self.set.lower, self.set.upper) if self.width == 1 else (-self.scale, self.scale)

    def complex_value(self, x: Array) -> complex:
        """Return the complex value of the decision from the decision vector x."""
        return complex(sum(part * d for part, d in zip(x[self.columns], self.set.directions, strict=True)))

    def columns_of(self, u: Value) -> Array:
        """Return the columns of a value of the decision, shape (width,)."""
        if self.width == 1:
            return np.array([(u * self.set.directions[0].conjugate()).real])
        return np.array([u.real, u.imag])

    def minimum(self, gradient: Array) -> float:
        """Return the minimum of g . x over the allowed columns x of the decision, g its part of `gradient` (P4)."""
        return self.set.minimum(gradient[self.columns])

    def project(self, x: Array) -> Array:
        """Return the allowed columns nearest to those of the decision vector x, shape (width,)."""
        return self.set.project(x[self.columns])


def domains_of(decisions: Sequence[Decision]) -> tuple[Domain, ...]:
    """Return the domain of each decision: its allowed set, and its columns in the decision vector."""
    domains: list[Domain] = []
    for decision in decisions:
        domains.append(Domain(decision, domains[-1].columns.stop if domains else 0))
    return tuple(domains)


def column_bounds(domains: Sequence[Domain]) -> tuple[Array, Array]:
    """Return lower and upper bounds of all columns of the decision vector, shape (columns,) each."""
    low, high = (np.array([d.ends[k] for d in domains for _ in range(d.width)], dtype=float) for k in (0, 1))
    return low, high


def real_bounds(decisions: Sequence[Decision]) -> tuple[Array, Array]:
    """Return lower and upper bounds of real decisions, shape (decisions,) each."""
    lower, upper = (np.array([getattr(d, side) for d in decisions], dtype=float) for side in ("lower", "upper"))
    return lower, upper


def column_scales(domains: Sequence[Domain]) -> Array:
    """Return the largest absolute value of each column of the decision vector, shape (columns,)."""
    return np.array([d.scale for d in domains for _ in range(d.width)], dtype=float)


def decision_vector(domains: Sequence[Domain], values: Sequence[Value] | Array | None = None) -> Array:
    """Return the decision vector of values, shape (columns,); by default of the design as given."""
    starts = [domain.decision.start for domain in domains] if values is None else values
    return np.concatenate([np.zeros(0), *(d.columns_of(value) for d, value in zip(domains, starts, strict=True))])


def projected_vector(domains: Sequence[Domain], values: Sequence[Value]) -> Array:
    """Return the decision vector, shape (columns,), from values that are moved to the nearest allowed value."""
    vector = decision_vector(domains, values)
    for domain in domains:
        vector[domain.columns] = domain.project(vector)
    return vector
