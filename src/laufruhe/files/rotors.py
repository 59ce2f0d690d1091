"""Counterweights and balancer shafts: their tables in a problem file, and the rotors and decisions they make."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from pydantic import Field

from laufruhe import units
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, blamed_on, nearest
from laufruhe.files.fields import CylinderNumber, Name, Open, Table
from laufruhe.machine import CRANKSHAFT, Role, Rotor, Shaft, SliderCrank
from laufruhe.machine.layouts import Throw
from laufruhe.numerics.turns import as_turn, cis
from laufruhe.problem.decision import Decision, RotorDrive
from laufruhe.problem.sets import Interval, Sector, Set

_HOW = {"equal": (1.0, False), "opposite": (-1.0, False), "mirrored": (1.0, True), "mirrored opposite": (-1.0, True)}


FACTORS = ("balance_factor", "balance_fraction")
"""Names of the balance factor (C9), the earlier one last."""


class CounterweightTable(Table):
    """A counterweight on the crankshaft, or one opposite every throw."""

    name: Name
    balance_factor: f.OpenFraction | None = Field(
        default=None, description="kappa: rotating mass and this share of the reciprocating mass, opposite each throw."
    )
    balance_fraction: f.OpenFraction | None = Field(default=None, description="An earlier name of balance_factor.")
    throws: list[CylinderNumber] | None = None
    x: f.Length | None = None
    opposite_throw: CylinderNumber | None = Field(default=None, description="Angle and place are counted from it.")
    unbalance: f.OpenUnbalance | None = None
    mass: f.OpenMass | None = None
    radius: f.PositiveLength | None = None
    angle: f.OpenAngle = 0.0

    @property
    def factor_key(self) -> str | None:
        """The name under which a balance factor is given; None without one."""
        return next((key for key in FACTORS if getattr(self, key) is not None), None)


class CoupledTable(Table):
    """Follows another unbalance."""

    to: str
    how: Literal["equal", "opposite", "mirrored", "mirrored opposite"] = Field(alias="as")


class UnbalanceTable(Table):
    """One unbalance of a shaft."""

    name: Name | None = None
    x: f.Length = 0.0
    unbalance: f.OpenUnbalance | None = None
    mass: f.OpenMass | None = None
    radius: f.PositiveLength | None = None
    angle: f.OpenAngle = 0.0
    coupled: CoupledTable | None = None


class BalancerShaftTable(Table):
    """A balancer shaft."""

    name: Name
    ratio: f.Ratio
    position: f.Pair[f.Length] = Field(description="y and z of its axis.")
    unbalances: list[UnbalanceTable] = Field(min_length=1)
    optional: bool = Field(default=False, description="Whether it is built is decided too.")
    shaft_mass: f.Mass = Field(default=0.0, description="Of an optional shaft, its unbalances not included.")


@dataclass
class RotorList:
    """Rotors and decisions as they are collected from a file."""

    rotors: list[Rotor] = field(default_factory=list)
    decisions: list[Decision] = field(default_factory=list)

    def add(self, rotor: Rotor, where: str) -> None:
        """A rotor whose name is not yet used."""
        if any(other.name == rotor.name for other in self.rotors):
            raise Refused(where, rotor.name, "is the name of another unbalance", "give each its own name")
        self.rotors.append(rotor)

    def drive(self, rotor: str, source: str, gain: float, mirrored: bool) -> None:
        """Let a rotor follow whatever decides another one."""
        for k, decision in enumerate(self.decisions):
            for drive in decision.rotor_drives:
                if drive.rotor == source:
                    followed = drive.gain.conjugate() if mirrored else drive.gain
                    new = RotorDrive(rotor, gain * followed, drive.mirrored != mirrored)
                    self.decisions[k] = replace(decision, drives=(*decision.drives, new))
                    break


@dataclass(frozen=True)
class _Size:
    """The size of an unbalance as given or left open, in its own unit."""

    unit: str
    lower: float
    upper: float
    start: float
    gain: float

    @property
    def open(self) -> bool:
        return self.lower < self.upper


def counterweights(
    tables: Sequence[CounterweightTable], cylinders: Sequence[SliderCrank], throws: Sequence[Throw], into: RotorList
) -> None:
    """Counterweights on the crankshaft: opposite every throw, or one at a time."""
    pins = [_pin_of(throw, cylinders) for throw in throws]
    for k, table in enumerate(tables):
        where = f"counterweights[{k + 1}]"
        if table.factor_key is not None:
            _opposite_throws(table, pins, where, into)
        else:
            _single_counterweight(table, pins, where, into)


@dataclass(frozen=True)
class _Pin:
    """What a counterweight opposite one throw has to balance (eq. 13)."""

    x: float
    angle: float
    rotating: complex
    reciprocating: float


def _pin_of(throw: Throw, cylinders: Sequence[SliderCrank]) -> _Pin:
    parts = [cylinders[k] for k in throw.cylinders]
    rods = sum(part.rotating_mass * part.crank_radius * cis(as_turn(part.throw)) for part in parts)
    reciprocating = sum(part.reciprocating_mass * part.crank_radius for part in parts)
    return _Pin(throw.x, throw.angle, rods + throw.unbalance, reciprocating)


def _opposite_throws(table: CounterweightTable, pins: Sequence[_Pin], where: str, into: RotorList) -> None:
    key = table.factor_key or FACTORS[0]
    single = {
        name: getattr(table, name) for name in ("x", "opposite_throw", "unbalance", "mass", *FACTORS) if name != key
    }
    clash = next((name for name, value in single.items() if value is not None), None)
    if clash is not None:
        raise Refused(f"{where}.{clash}", None, f"does not go with {key}", "leave one of them out")
    chosen = range(1, len(pins) + 1) if table.throws is None else table.throws
    given = getattr(table, key)
    start = given.start if isinstance(given, Open) else float(given or 0.0)
    drives = []
    for number in chosen:
        pin = _pin(pins, number, f"{where}.throws")
        gain = -pin.reciprocating * cis(as_turn(pin.angle))
        name = f"{table.name}.{number}"
        into.add(Rotor(name, pin.x, -pin.rotating + start * gain, radius=table.radius), f"{where}.name")
        drives.append(RotorDrive(name, gain))
    if isinstance(given, Open) and given.lower < given.upper:
        into.decisions.append(
            Decision(
                f"{table.name}.{key}",
                "",
                Interval(given.lower, given.upper),
                complex(start),
                tuple(drives),
            )
        )


def _pin(pins: Sequence[_Pin], number: int, where: str) -> _Pin:
    if number > len(pins):
        raise Refused(where, number, f"is no throw, the crankshaft has {len(pins)}", "count them from the front")
    return pins[number - 1]


def _single_counterweight(table: CounterweightTable, pins: Sequence[_Pin], where: str, into: RotorList) -> None:
    reference, x = 0.0, table.x
    if table.throws is not None:
        raise Refused(f"{where}.throws", None, "goes with balance_factor only", "use opposite_throw")
    if table.opposite_throw is not None:
        pin = _pin(pins, table.opposite_throw, f"{where}.opposite_throw")
        reference, x = pin.angle + math.pi, pin.x if x is None else x
    if x is None:
        raise Refused(f"{where}.x", None, "is missing", "give its place, or opposite_throw")
    _place(table.name, x, CRANKSHAFT, Role.COUNTERWEIGHT, table, reference, where, into)


def balancer_shafts(tables: Sequence[BalancerShaftTable], into: RotorList) -> None:
    """Balancer shafts and their unbalances; coupled ones follow those named before them."""
    names = [table.name for table in tables]
    for k, table in enumerate(tables):
        where = f"balancer_shafts[{k + 1}]"
        if table.name in names[:k] or table.name == CRANKSHAFT.name:
            raise Refused(f"{where}.name", table.name, "is the name of another shaft", "give each its own name")
        with blamed_on(f"{where}.ratio"):
            shaft = Shaft(table.name, table.ratio, *table.position)
        for j, unbalance in enumerate(table.unbalances):
            at = f"{where}.unbalances[{j + 1}]"
            single = len(table.unbalances) == 1 and unbalance.name is None
            name = table.name if single else f"{table.name}.{unbalance.name or j + 1}"
            if unbalance.coupled is not None:
                _follow(name, unbalance, unbalance.coupled, shaft, at, into)
            else:
                _place(name, unbalance.x, shaft, Role.BALANCER, unbalance, 0.0, at, into)


def _follow(name: str, table: UnbalanceTable, coupled: CoupledTable, shaft: Shaft, where: str, into: RotorList) -> None:
    if table.unbalance is not None or table.mass is not None or table.angle != 0.0:
        raise Refused(f"{where}.coupled", coupled.to, "does not go with a size or an angle of its own", "leave one out")
    leaders = {rotor.name: rotor for rotor in into.rotors if rotor.role is Role.BALANCER}
    if coupled.to not in leaders:
        remedy = nearest(coupled.to, list(leaders)) if leaders else "define the other one first"
        raise Refused(f"{where}.coupled.to", coupled.to, "is no unbalance defined before this one", remedy)
    leader = leaders[coupled.to]
    sign, mirrored = _HOW[coupled.how]
    value = sign * (leader.unbalance.conjugate() if mirrored else leader.unbalance)
    into.add(Rotor(name, table.x, value, shaft, Role.BALANCER, table.radius or leader.radius), where)
    into.drive(name, coupled.to, sign, mirrored)


def _place(
    name: str,
    x: float,
    shaft: Shaft,
    role: Role,
    table: CounterweightTable | UnbalanceTable,
    reference: float,
    where: str,
    into: RotorList,
) -> None:
    """One rotor, and the decision about it if its size or angle is open."""
    size, angle = _size(table, where), table.angle
    direction = cis(as_turn(reference))
    low, high, start_angle = (angle.lower, angle.upper, angle.start) if isinstance(angle, Open) else (angle,) * 3
    _check_convex(size, low, high, where)
    high = low + math.tau if _is_whole_turn(low, high) else high
    start = size.start * _direction(start_angle)
    into.add(Rotor(name, x, size.gain * direction * start, shaft, role, table.radius), f"{where}.name")
    if size.open:
        drive = RotorDrive(name, size.gain * direction)
        noun = "mass" if size.unit == "kg" else "unbalance"
        into.decisions.append(Decision(f"{name}.{noun}", size.unit, _set(size, low, high), start, (drive,)))


def _set(size: _Size, low: float, high: float) -> Set:
    return Interval(size.lower, size.upper, low) if low == high else Sector(size.upper, (low, high))


def _direction(angle: float) -> complex:
    turn = as_turn(angle)
    return cis(turn) if not isinstance(turn, float) else cmath.exp(1j * angle)


def _is_whole_turn(low: float, high: float) -> bool:
    return high - low >= math.tau * (1.0 - 1e-9)


def _check_convex(size: _Size, low: float, high: float, where: str) -> None:
    if low == high:
        return
    if not size.open:
        raise Refused(
            f"{where}.angle", None, "is open while the size is fixed", "leave the size open too, or fix the angle"
        )
    if size.lower > 0.0:
        raise Refused(
            f"{where}.{'mass' if size.unit == 'kg' else 'unbalance'}",
            units.shown(size.lower, size.unit),
            "is a least size above zero while the angle is open",
            "let the size start at zero, or fix the angle",
        )
    if high - low > math.pi * (1.0 + 1e-9) and not _is_whole_turn(low, high):
        raise Refused(
            f"{where}.angle",
            f"{math.degrees(low):g} to {math.degrees(high):g} deg",
            "leaves out a sector of less than half a turn",
            "open it by at most 180 deg, or wholly",
        )


def _size(table: CounterweightTable | UnbalanceTable, where: str) -> _Size:
    given = {"unbalance": table.unbalance, "mass": table.mass}
    named = [key for key, value in given.items() if value is not None]
    if len(named) != 1:
        state = "is missing" if not named else "is given twice, also as mass"
        raise Refused(f"{where}.unbalance", None, state, "give unbalance or mass, one of them")
    key = named[0]
    if key == "mass" and table.radius is None:
        raise Refused(f"{where}.radius", None, "is missing, and a mass needs one", "add it")
    value = given[key]
    bounds = (value.lower, value.upper, value.start) if isinstance(value, Open) else (float(value or 0.0),) * 3
    gain = float(table.radius or 1.0) if key == "mass" else 1.0
    return _Size("kg" if key == "mass" else "kg m", *bounds, gain)
