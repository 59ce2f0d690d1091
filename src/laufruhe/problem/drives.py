"""What decisions drive: kinds of numbers of an engine, and how a change moves each."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Protocol

from laufruhe.extension import extended
from laufruhe.machine import Engine, Flywheel, Mount, Rotor, SliderCrank
from laufruhe.machine.leads import led
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.rigid_body import turned_axes
from laufruhe.problem.sets import Value

STIFFNESS, LOSS, DAMPING, POSITION, TURNED = slice(0, 3), 3, slice(4, 7), slice(7, 10), slice(10, 13)
LAG, NUMBERS_OF_MOUNT = 13, 14


@dataclass(frozen=True, order=True)
class Kind:
    """A kind of what may be open, by what a method has to know of it.

    Attributes
    ----------
    rank
        Of several kinds the highest one counts.
    name
        In messages, and of the table of a problem file that its numbers stand in where it is of an extension.
    words
        Of its numbers, in the plural.
    is_alone
        Whether no channel of the core depends on it but those that a line of dependences names.
    """

    rank: float
    name: str
    words: str = field(default="", compare=False)
    is_alone: bool = field(default=False, compare=False)

    UNBALANCE: ClassVar[Kind]
    """Every load is affine in it (P1)."""
    PLACE: ClassVar[Kind]
    """Every load is affine in it while the unbalances are held (P8)."""
    STIFFNESS: ClassVar[Kind]
    """K is linear in it."""
    MOUNT: ClassVar[Kind]
    STAR: ClassVar[Kind]
    """Of the phasing: no number."""
    FLYWHEEL: ClassVar[Kind]
    """Nothing but the flywheel and how evenly the crank turns feels it."""
    PISTON: ClassVar[Kind]
    """Every load is affine in it, not so the inertia that turns."""
    SIZE: ClassVar[Kind]
    """Of the running gear: stresses fall with it, and masses follow (Z2)."""
    SHARE: ClassVar[Kind]
    """Of inertia on a geared shaft: the roll moment is affine in it while the masses of the pistons are held."""
    LEAD: ClassVar[Kind]
    """Of a geared shaft: every load of order h that it carries comes earlier by h times as much (P13)."""
    NUMBER: ClassVar[Kind]
    """Any other number of the problem file: nothing is known of what depends on it, so everything may."""

    def __hash__(self) -> int:
        # the same in every process, and so is the order of sets
        return hash(self.rank)

    def __reduce__(self) -> tuple[Callable[[str], Kind], tuple[str]]:
        # a kind is one and the same in every process
        return _kind, (self.name,)


Kind.UNBALANCE = Kind(1, "unbalance", "unbalances")
Kind.PLACE = Kind(2, "place", "places of shafts")
Kind.STIFFNESS = Kind(3, "stiffness", "stiffness")
Kind.MOUNT = Kind(4, "mount", "other numbers of mounts")
Kind.STAR = Kind(5, "star", "stars, firing orders, shafts")
Kind.FLYWHEEL = Kind(6, "flywheel", "flywheel", is_alone=True)
Kind.PISTON = Kind(7, "piston", "masses of pistons")
Kind.SIZE = Kind(9, "size", "sizes")
Kind.SHARE = Kind(10, "share", "shares of geared inertia")
Kind.LEAD = Kind(11, "lead", "leads")
Kind.NUMBER = Kind(12, "number", "other numbers of the file")

KINDS: Mapping[str, Kind] = extended("kinds", Kind, (
    Kind.UNBALANCE, Kind.PLACE, Kind.STIFFNESS, Kind.MOUNT, Kind.STAR, Kind.FLYWHEEL, Kind.PISTON, Kind.SIZE,
    Kind.SHARE, Kind.LEAD, Kind.NUMBER,
))  # fmt: skip
"""Kinds by their names, with those of extensions."""


def _kind(name: str) -> Kind:
    return KINDS[name]


@dataclass
class Numbers:
    """The numbers of an engine that decisions may move; symbols do as well.

    Attributes
    ----------
    unbalances
        Of the rotors by name [kg m] (C4).
    places
        Of the rotors by name: x, and y and z of their shafts [m] (C2).
    mounts
        Of every spring fourteen: stiffness, loss factor, damping, position, turned angles, lag (E13).
    changes
        Of all others, by their kind and what each kind tells them apart by (`NumberDrive`).
    """

    unbalances: dict[str, Any] = field(default_factory=dict)
    places: dict[str, list[Any]] = field(default_factory=dict)
    mounts: list[list[Any]] = field(default_factory=list)
    changes: dict[tuple[Kind, Any], float] = field(default_factory=dict)

    @classmethod
    def of(cls, engine: Engine, mounts: Sequence[Sequence[float]] = ()) -> Numbers:
        """Those of an engine as given, and of its mounts where these may move."""
        rotors = {rotor.name: rotor for rotor in engine.rotors}
        unbalances = {name: rotor.unbalance for name, rotor in rotors.items()}
        places: dict[str, list[Any]] = {name: list(rotor.place) for name, rotor in rotors.items()}
        return cls(unbalances, places, [list(row) for row in mounts])

    def of_kind(self, kind: Kind, given: Mapping[Any, Any]) -> dict[Any, Any]:
        """Numbers of a kind with their changes; some may be none that no change moves."""
        changed = {key: change for (own, key), change in self.changes.items() if own is kind}
        return {key: value + changed[key] if key in changed else value for key, value in given.items()}

    def engine(self, given: Engine) -> Engine:
        """The engine with these numbers."""
        rotors = tuple(self._turned(rotor) for rotor in given.rotors)
        mounts = given.mounts
        if self.mounts:
            rows = iter(self.mounts)
            mounts = tuple(mount.each(lambda spring: mount_of(spring, next(rows))) for mount in given.mounts)
        shares = self.of_kind(Kind.SHARE, {geared.name: geared.share for geared in given.geared})
        # a sum of changes may leave a bound by a rounding
        geared = tuple(replace(g, share=min(max(shares[g.name], 0.0), 1.0)) for g in given.geared)
        kinds, parts = {kind for kind, _ in self.changes}, given.slider_cranks
        if Kind.PISTON in kinds:
            parts = tuple(self._loaded(part) for part in parts)
        flywheel = given.flywheel and self.flywheel(given.flywheel)
        found = replace(given, slider_cranks=parts, rotors=rotors, mounts=mounts, flywheel=flywheel, geared=geared)
        if Kind.SIZE in kinds:
            found = found.resized(self.of_kind(Kind.SIZE, given.moving.sizes))
        for extra in given.extras:
            changes = {key: change for (kind, key), change in self.changes.items() if kind.name == extra.name}
            found = found.with_extra(extra.moved(changes, given.slider_cranks, found.slider_cranks))
        leads = {shaft: change for (kind, shaft), change in self.changes.items() if kind is Kind.LEAD}
        return led(found, leads) if leads else found

    def flywheel(self, given: Flywheel) -> Flywheel:
        """The flywheel with these numbers."""
        return given.moved(self.of_kind(Kind.FLYWHEEL, dict(enumerate(given.numbers))).values())

    def _turned(self, rotor: Rotor) -> Rotor:
        unbalance, place = self.unbalances[rotor.name], tuple(self.places[rotor.name])
        moved = rotor if unbalance == rotor.unbalance else replace(rotor, unbalance=unbalance)
        return moved if place == rotor.place else moved.placed(*place)

    def _loaded(self, part: SliderCrank) -> SliderCrank:
        changes = ((key, change) for (kind, key), change in self.changes.items() if kind is Kind.PISTON)
        own = {mass: change for (name, mass), change in changes if name == part.name}
        # a sum of changes may leave a bound of zero by a rounding; what a rod lacks of inertia may be less than nothing
        least = {"rod_inertia_deficit": -math.inf}
        moved = {mass: max(getattr(part, mass) + change, least.get(mass, 0.0)) for mass, change in own.items()}
        return replace(part, **moved)


class Drive(Protocol):
    """How a decision acts on one number of the engine."""

    @property
    def kind(self) -> Kind:
        """What a method has to know of it."""

    @property
    def acts(self) -> bool:
        """Whether anything of the engine follows."""

    def move(self, numbers: Numbers, change: Any, /) -> None:
        """Move the number by a change of the decision."""


@dataclass(frozen=True)
class RotorDrive:
    """U += gain u of one rotor, or gain conj(u) when mirrored."""

    rotor: str
    gain: complex
    mirrored: bool = False
    kind: ClassVar[Kind] = Kind.UNBALANCE

    @property
    def acts(self) -> bool:
        """Unless the gain is nothing."""
        return self.gain != 0.0

    def of(self, change: Value) -> Value:
        """What a change of the decision does to the unbalance."""
        return self.gain * (change.conjugate() if self.mirrored else change)

    def move(self, numbers: Numbers, change: Any) -> None:
        """Of the unbalance."""
        numbers.unbalances[self.rotor] += self.of(change)


@dataclass(frozen=True)
class PlaceDrive:
    """Place of one rotor += change, along x, or by the y or z of its shaft (C2)."""

    rotor: str
    axis: int
    kind: ClassVar[Kind] = Kind.PLACE
    acts: ClassVar[bool] = True

    def move(self, numbers: Numbers, change: Any) -> None:
        """Of the rotor."""
        numbers.places[self.rotor][self.axis] += change


@dataclass(frozen=True)
class MountDrive:
    """number += gain x change, of one number of one mount (E13)."""

    mount: int
    number: int
    gain: float

    @property
    def kind(self) -> Kind:
        """K is linear in stiffness alone."""
        return Kind.STIFFNESS if self.number < STIFFNESS.stop else Kind.MOUNT

    @property
    def acts(self) -> bool:
        """Unless the gain is nothing."""
        return self.gain != 0.0

    def move(self, numbers: Numbers, change: Any) -> None:
        """Of the mount's number."""
        numbers.mounts[self.mount][self.number] += self.gain * change


@dataclass(frozen=True)
class NumberDrive:
    """A number of the engine += change.

    Attributes
    ----------
    key
        What tells it from others of its kind: of the flywheel its place among its numbers, of a mass of a slider-crank
        the names of both, of the running gear its size, of a lead its shaft, of a share its geared inertia.
    """

    kind: Kind
    key: Any
    acts: ClassVar[bool] = True

    def move(self, numbers: Numbers, change: Any) -> None:
        """Of the number."""
        key = self.kind, self.key
        numbers.changes[key] = numbers.changes.get(key, 0.0) + float(change.real)


@dataclass(frozen=True)
class AddressDrive:
    """A number of the problem file: the engine is put together anew with the value at its address.

    Attributes
    ----------
    path
        Keys, and numbers in lists from zero.
    unit
        SI unit in which the value is written; empty for a plain number.
    """

    path: tuple[str | int, ...]
    unit: str
    kind: ClassVar[Kind] = Kind.NUMBER
    acts: ClassVar[bool] = True

    def written(self, value: Value) -> str | float:
        """Return the value as a file has it."""
        number = float(value.real)
        return f"{number!r} {self.unit}" if self.unit else number

    def move(self, _numbers: Numbers, _change: Any) -> None:
        """Refuse: no number of an engine that is put together follows by a change (`Problem.held`)."""
        raise TypeError(f"{self.path} is a number of the file; the engine is put together anew with it")


def mount_of(mount: Mount, numbers: Sequence[float]) -> Mount:
    """A mount with these numbers in place of its own."""
    rows = turned_axes(NUMBERS, numbers[TURNED]).tolist()
    # a sum of changes may leave a bound of zero by a rounding
    (a, b, c), (p, q, r) = (tuple(max(float(v), 0.0) for v in numbers[s]) for s in (STIFFNESS, DAMPING))
    x, y, z = (float(v) for v in numbers[POSITION])
    return replace(
        mount, stiffness=(a, b, c), loss_factor=max(float(numbers[LOSS]), 0.0), damping=(p, q, r), position=(x, y, z),
        orientation=(tuple(rows[0]), tuple(rows[1]), tuple(rows[2])), lag=max(float(numbers[LAG]), 0.0),
    )  # fmt: skip
