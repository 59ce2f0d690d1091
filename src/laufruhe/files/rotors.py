"""[[counterweights]] and [[balancer_shafts]] of a problem file, and the rotors and decisions that they make."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

from pydantic import Field

from laufruhe import units
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key, nearest, refuse_keys, require_one_of
from laufruhe.files.fields import CylinderNumber, Name, Open, Table
from laufruhe.machine import CRANKSHAFT, Role, Rotor, Shaft, SliderCrank
from laufruhe.machine.layouts import Throw
from laufruhe.numerics.exact_angles import as_turn, cis
from laufruhe.problem.decision import Decision, PlaceDrive, RotorDrive
from laufruhe.problem.sets import Interval, Sector, Set

_HOW = {"equal": (1.0, False), "opposite": (-1.0, False), "mirrored": (1.0, True), "mirrored opposite": (-1.0, True)}
_UNITS = {"unbalance": "kg m", "mass": "kg", "torque": "N m"}


EVERY = "every"
FACTORS = ("balance_factor", "balance_fraction")
"""Keys of the balance factor (C9), the earlier name last."""


class CounterweightTable(Table):
    """A counterweight on a crankshaft, or one opposite every throw."""

    name: Name
    shaft: str = f.optional(
        'Shaft that it turns with; "every" puts a balance factor opposite the throws of all shafts.', CRANKSHAFT.name
    )
    balance_factor: f.OpenFraction | None = f.optional(
        "Share of the reciprocating mass that is balanced, with the rotating mass, opposite each throw."
    )
    balance_fraction: f.OpenFraction | None = f.optional("Earlier name of balance_factor.")
    throws: list[CylinderNumber] | None = None
    x: f.OpenLength | None = None
    opposite_throw: CylinderNumber | None = f.optional("Number of the throw from which angle and place are counted.")
    unbalance: f.OpenUnbalance | None = None
    mass: f.OpenMass | None = None
    radius: f.PositiveLength | None = None
    angle: f.OpenAngle = 0.0

    @property
    def factor_key(self) -> str | None:
        """Key under which a balance factor is given; None without one."""
        return next((key for key in FACTORS if getattr(self, key) is not None), None)


class CoupledTable(Table):
    """Unbalance that follows another one."""

    to: str
    how: Literal["equal", "opposite", "mirrored", "mirrored opposite"] = Field(alias="as")


class UnbalanceTable(Table):
    """Unbalance of a shaft."""

    name: Name | None = None
    x: f.OpenLength = 0.0
    unbalance: f.OpenUnbalance | None = None
    mass: f.OpenMass | None = None
    radius: f.PositiveLength | None = None
    angle: f.OpenAngle = 0.0
    coupled: CoupledTable | None = None


SizedTable: TypeAlias = CounterweightTable | UnbalanceTable


class BalancerShaftTable(Table):
    """A balancer shaft."""

    name: Name
    ratio: f.Ratio
    position: f.Pair[f.OpenLength] = f.required("Position of the axis: y to the left, z up.")
    unbalances: list[UnbalanceTable] = Field(min_length=1)
    optional: bool = f.optional("Whether the shaft is built is decided too.", False)
    shaft_mass: f.Mass = f.optional("Mass of an optional shaft without its unbalances.", 0.0)


@dataclass
class RotorList:
    """Rotors and decisions collected from a file."""

    rotors: list[Rotor] = field(default_factory=list)
    decisions: list[Decision] = field(default_factory=list)

    def add(self, rotor: Rotor, where: str) -> None:
        """Add a rotor; raise `Refused` at the key `where` if its name is in use."""
        if any(other.name == rotor.name for other in self.rotors):
            raise Refused(where, rotor.name, "is already the name of another unbalance", "give each its own name")
        self.rotors.append(rotor)

    def move(self, name: str, rotors: Sequence[str], axis: int, place: float | Open | None) -> None:
        """Add the decision `name` about the position of rotors along an axis (0 = x, 1 = y, 2 = z) if it is open.

        Rotors without an unbalance do not move.
        """
        sized = {rotor.name for rotor in self.rotors if rotor.unbalance != 0.0}
        sized |= {drive.rotor for decision in self.decisions for drive in decision.rotor_drives}
        drives = (PlaceDrive(rotor, axis) for rotor in rotors if rotor in sized)
        self.decisions += Open.from_value(place).decisions(name, "m", *drives)

    def drive(self, rotor: str, source: str, gain: float, mirrored: bool) -> None:
        """Let the unbalance of a rotor follow that of the rotor `source`, times `gain` and possibly mirrored."""
        for k, decision in enumerate(self.decisions):
            for drive in decision.rotor_drives:
                if drive.rotor == source:
                    followed = drive.gain.conjugate() if mirrored else drive.gain
                    new = RotorDrive(rotor, gain * followed, drive.mirrored != mirrored)
                    self.decisions[k] = replace(decision, drives=(*decision.drives, new))
                    break


def counterweights(
    tables: Sequence[CounterweightTable], cylinders: Sequence[SliderCrank], throws: Sequence[Throw], into: RotorList
) -> None:
    """Add the counterweights of a file to a list of rotors: opposite each throw, or single ones."""
    for k, table in enumerate(tables, 1):
        where = f"counterweights[{k}]"
        on_shaft = [throw for throw in throws if throw.shaft.name == table.shaft]
        if table.shaft == EVERY and table.factor_key is not None:
            on_shaft = list(throws)
        elif not on_shaft and table.shaft != CRANKSHAFT.name:
            names = list(dict.fromkeys(throw.shaft.name for throw in throws))
            raise Refused(f"{where}.shaft", table.shaft, "is no shaft with throws", nearest(table.shaft, names))
        if table.factor_key is not None:
            if not all(part.is_balanced_by_share for part in cylinders):
                rule = "needs pistons on crank pins, and this drive moves its pistons or rams differently"
                raise Refused(f"{where}.{table.factor_key}", None, rule, "give an unbalance or a mass")
            _opposite_throws(table, cylinders, on_shaft, where, into)
        else:
            _single_counterweight(table, on_shaft, where, into)


def check_factors(weights: Sequence[CounterweightTable], rule: str) -> None:
    """Raise `Refused` with this rule if a counterweight has a balance factor, for files with open masses."""
    for k, weight in enumerate(weights, 1):
        if weight.factor_key is not None:
            remedy = "give the counterweights a mass, or fix the other"
            raise Refused(f"counterweights[{k}].{weight.factor_key}", None, rule, remedy)


def _opposite_throws(
    table: CounterweightTable, cylinders: Sequence[SliderCrank], throws: Sequence[Throw], where: str, into: RotorList
) -> None:
    key = table.factor_key or FACTORS[0]
    excluded = [name for name in ("x", "opposite_throw", "unbalance", "mass", *FACTORS) if name != key]
    refuse_keys(table, excluded, where, f"cannot stand beside {key}", "leave one of them out")
    fraction, drives = Open.from_value(getattr(table, key)), []
    for number in range(1, len(throws) + 1) if table.throws is None else table.throws:
        throw = _throw(throws, number, f"{where}.throws")
        # eq. 13
        parts = [cylinders[k] for k in throw.cylinders]
        rotating = throw.unbalance + sum(p.rotating_mass * p.crank_radius * cis(as_turn(p.throw)) for p in parts)
        gain = -sum(part.reciprocating_mass * part.crank_radius for part in parts) * cis(as_turn(throw.angle))
        name = f"{table.name}.{number}"
        size = -rotating + fraction.start * gain
        into.add(Rotor(name, throw.x, size, throw.shaft, radius=table.radius), f"{where}.name")
        drives.append(RotorDrive(name, gain))
    if fraction.is_open:
        name, start = f"{table.name}.{key}", complex(fraction.start)
        into.decisions.append(Decision(name, "", Interval(*fraction.bounds), start, tuple(drives)))


def _throw(throws: Sequence[Throw], number: int, where: str) -> Throw:
    if number > len(throws):
        name = throws[0].shaft.name if throws else CRANKSHAFT.name
        raise Refused(where, number, f"is no throw, the {name} has {len(throws)}", "count throws from 1 at the front")
    return throws[number - 1]


def _single_counterweight(table: CounterweightTable, throws: Sequence[Throw], where: str, into: RotorList) -> None:
    reference, x = 0.0, None if table.x is None else Open.from_value(table.x).start
    refuse_keys(table, ("throws",), where, "is only for counterweights with balance_factor", "use opposite_throw")
    if table.opposite_throw is not None:
        throw = _throw(throws, table.opposite_throw, f"{where}.opposite_throw")
        reference, x = throw.angle + math.pi, throw.x if x is None else x
    if x is None:
        raise Refused(f"{where}.x", None, "is missing", "give the counterweight a position, or opposite_throw")
    shaft = throws[0].shaft if throws else CRANKSHAFT
    _place(Rotor(table.name, x, 0j, shaft, radius=table.radius), table, reference, where, into)
    into.move(f"{table.name}.x", [table.name], 0, table.x)


def balancer_shafts(tables: Sequence[BalancerShaftTable], into: RotorList) -> None:
    """Add the unbalances of balancer shafts to a list of rotors; coupled ones follow earlier ones."""
    names = [table.name for table in tables]
    for k, table in enumerate(tables):
        where = f"balancer_shafts[{k + 1}]"
        if table.name in names[:k] or table.name == CRANKSHAFT.name:
            raise Refused(f"{where}.name", table.name, "is already the name of another shaft", "give each its own name")
        with errors_at_key(f"{where}.ratio"):
            shaft = Shaft(table.name, table.ratio, *(Open.from_value(place).start for place in table.position))
        for j, unbalance in enumerate(table.unbalances):
            key = f"{where}.unbalances[{j + 1}]"
            name = name_of_unbalance(table.name, [other.name for other in table.unbalances], j)
            if unbalance.coupled is not None:
                _follow(name, unbalance, unbalance.coupled, shaft, key, into)
            else:
                rotor = Rotor(name, Open.from_value(unbalance.x).start, 0j, shaft, Role.BALANCER, unbalance.radius)
                _place(rotor, unbalance, 0.0, key, into)
            into.move(f"{name}.x", [name], 0, unbalance.x)
        rotors_of_shaft = [rotor.name for rotor in into.rotors if rotor.shaft == shaft]
        for axis, coordinate in enumerate(table.position, start=1):
            into.move(f"{table.name}.{'xyz'[axis]}", rotors_of_shaft, axis, coordinate)


def name_of_unbalance(shaft: str, names: Sequence[str | None], j: int) -> str:
    """Return the name of the j-th unbalance of a shaft in results; a single unnamed one is named as the shaft."""
    return shaft if len(names) == 1 and names[0] is None else f"{shaft}.{names[j] or j + 1}"


def _follow(name: str, table: UnbalanceTable, coupled: CoupledTable, shaft: Shaft, where: str, into: RotorList) -> None:
    if table.unbalance is not None or table.mass is not None or table.angle != 0.0:
        rule = "cannot stand beside a size or an angle of its own"
        raise Refused(f"{where}.coupled", coupled.to, rule, "leave one out")
    leaders = {rotor.name: rotor for rotor in into.rotors if rotor.role is Role.BALANCER}
    if coupled.to not in leaders:
        remedy = nearest(coupled.to, list(leaders)) if leaders else "define the other one first"
        rule = "is not the name of an unbalance that stands before this one in the file"
        raise Refused(f"{where}.coupled.to", coupled.to, rule, remedy)
    leader = leaders[coupled.to]
    sign, mirrored = _HOW[coupled.how]
    value = sign * (leader.unbalance.conjugate() if mirrored else leader.unbalance)
    x, radius = Open.from_value(table.x).start, table.radius or leader.radius
    into.add(Rotor(name, x, value, shaft, Role.BALANCER, radius), where)
    into.drive(name, coupled.to, sign, mirrored)


def _place(rotor: Rotor, table: SizedTable, reference: float, where: str, into: RotorList) -> None:
    """Add a rotor with size and angle of its table, and a decision if these are open.

    `reference` is the angle from which the angle of the table counts [rad].
    """
    require_one_of(table, where, "unbalance", "mass")
    key, size, gain = "unbalance", Open.from_value(table.unbalance), 1.0
    if table.mass is not None:
        if table.radius is None:
            raise Refused(f"{where}.radius", None, "is missing, but an unbalance given by its mass needs it", "add it")
        key, size, gain = "mass", Open.from_value(table.mass), table.radius
    angle, direction = Open.from_value(table.angle), gain * cis(as_turn(reference))
    start = size.start * cis(as_turn(angle.start))
    allowed: Set = sector_of(key, size, angle, where) if angle.is_open else Interval(*size.bounds, angle.lower)
    into.add(replace(rotor, unbalance=direction * start), f"{where}.name")
    if size.is_open:
        drive = RotorDrive(rotor.name, direction)
        into.decisions.append(Decision(f"{rotor.name}.{key}", _UNITS[key], allowed, start, (drive,)))


def sector_of(key: str, size: Open, angle: Open, where: str) -> Sector:
    """Return the set of allowed values of an unbalance or a torque with open size and angle.

    Raise `Refused` if the set is not convex.
    """
    if not size.is_open:
        rule, remedy = "is open while the size is fixed", "leave the size open too, or fix the angle"
        raise Refused(f"{where}.angle", None, rule, remedy)
    if size.lower > 0.0:
        smallest, remedy = units.quantity_text(size.lower, _UNITS[key]), "let the size start at zero, or fix the angle"
        raise Refused(f"{where}.{key}", smallest, "is a lower bound above zero, but the angle is open", remedy)
    low, high = angle.bounds
    if high - low >= math.tau * (1.0 - 1e-9):
        return Sector(size.upper, (low, low + math.tau))
    if high - low > math.pi * (1.0 + 1e-9):
        text = f"{math.degrees(low):g} to {math.degrees(high):g} deg"
        rule, remedy = "spans more than 180 deg but no full turn", "open it by at most 180 deg, or by 360 deg"
        raise Refused(f"{where}.angle", text, rule, remedy)
    return Sector(size.upper, (low, high))
