"""[mounts], [block] and [[load_cases]] of a problem file, and the decisions about mounts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from laufruhe.files import fields as f
from laufruhe.files.axes import Axes, AxesTable, axes_of
from laufruhe.files.complaints import Refused, errors_at_key, nearest, refuse_keys, require_distinct, si_value
from laufruhe.files.csv_rows import rows_of
from laufruhe.files.fields import Name, Open, Table
from laufruhe.machine import Block, Mount
from laufruhe.machine.block import LoadCase
from laufruhe.machine.dynamic import Dynamic, FluidTrack, MeasuredStiffness
from laufruhe.physics.elastic_mounts import elastic_mounting
from laufruhe.physics.modes import free_motion
from laufruhe.problem.decision import (
    DAMPING,
    LAG,
    LOSS,
    NUMBERS_OF_MOUNT,
    POSITION,
    STIFFNESS,
    TURNED,
    Decision,
    MountDrive,
    mount_from_numbers,
)

_AXES, _AT = ("x", "y", "z"), "position"
_FIELDS = {
    key: (unit, range(NUMBERS_OF_MOUNT)[part])
    for key, unit, part in (
        ("stiffness", "N/m", STIFFNESS), ("loss_factor", "", slice(LOSS, LOSS + 1)), ("damping", "N s/m", DAMPING),
        ("position", "m", POSITION), ("turned", "rad", TURNED), ("damping_per_stiffness", "s", slice(LAG, LAG + 1)),
    )
}  # fmt: skip
# sign of each number of a mount after mirroring in the plane y = 0
_MIRRORED = [1.0] * 8 + [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0]
_OF_ALL = ("stiffness", "loss_factor", "damping_per_stiffness")
_DYNAMIC = ("fluid_track", "dynamic_stiffness")
_ELASTIC = (*_OF_ALL, *_DYNAMIC, "damping", "like", "mirror_of", "joined_to", "stop")
_NOT_RIGID = ('is for kind = "elastic" only', "leave it out, or set the kind")
_NOT_ELASTIC = ('is for kind = "rigid" only', "give stiffness instead")


class BlockTable(Table):
    """The rigid body that elastic mounts carry."""

    mass: f.PositiveMass = f.required("Mass of everything that the mounts carry, moving parts included.")
    centre_of_gravity: f.Three[f.Length] = Field(default=[0.0, 0.0, 0.0])
    inertia: f.Three[f.Inertia] = f.required("Moments of inertia about x, y and z through the centre of gravity.")
    axes: AxesTable | None = f.optional("Axes of centre_of_gravity and inertia, if not the engine's own.")
    inertia_products: f.Three[f.Inertia] = f.optional(
        "Products of inertia xy, xz, yz of the tensor: xy = - integral of x y dm.", [0.0, 0.0, 0.0]
    )
    turning_inertia: f.Inertia = f.optional(
        "Part of the inertia about x that turns with the crank and does not roll with the block: crankshaft, flywheel.",
        0.0,
    )


class StopTable(Table):
    """Bump stop along each of the mount's own axes; it acts in run-ups and load cases."""

    gap: f.PositiveLength
    stiffness: f.Stiffness


class FluidTrackTable(Table):
    """The fluid of a hydraulic mount, all referred to its travel by the area of the piston."""

    axis: Literal["x", "y", "z"] = f.optional("Own axis of the mount along which it acts.", "z")
    mass: f.PositiveMass = f.required("Effective mass of the fluid in the track: its inertance times the area squared.")
    bulge_stiffness: f.Stiffness = f.required("Stiffness of the rubber against swelling: area squared over compliance.")
    chamber_stiffness: f.Stiffness = f.optional("Of the lower chamber.", 0.0)
    damping: f.Damping = f.optional("Of the flow through the track.", 0.0)


class DynamicStiffnessTable(Table):
    """Complex stiffness along an own axis from a CSV file: frequency, stiffness, and loss or its angle."""

    axis: Literal["x", "y", "z"] = f.optional("Own axis of the mount along which it acts.", "z")
    file: str = f.required("CSV file beside the problem.")
    frequency_unit: str = f.optional("Unit of the first column.", "Hz")
    stiffness_unit: str = f.optional("Unit of the stiffness.", "N/mm")
    columns: Literal["stiffness and loss", "amount and angle"] = f.optional(
        "What follows the frequency: storage and loss stiffness, or its amount and its loss angle in degrees.",
        "amount and angle",
    )


class MountTable(Table):
    """Mount of the engine."""

    name: Name | None = None
    position: f.Three[f.OpenLength] | None = None
    relative_stiffness: f.Three[f.NonNegative] | None = f.optional(
        "Relative stiffness along the mount's own x, y, z; 0 carries nothing."
    )
    turned: f.Three[f.OpenAngle] | None = f.optional(
        "Turns about x, then y, then z that bring the axes of C2 to its own."
    )
    stiffness: f.Three[f.OpenStiffness] | None = f.optional("Stiffness along the mount's own x, y, z.")
    loss_factor: f.OpenLossFactor | None = f.optional(
        "Hysteretic loss factor: energy lost in a cycle over 2 pi times the energy stored."
    )
    damping: f.Three[f.OpenDamping] | None = f.optional("Viscous damping along the mount's own x, y, z.")
    damping_per_stiffness: f.OpenDelay | None = f.optional(
        "Further viscous damping along each axis, over the stiffness there, which it follows."
    )
    like: Name | None = f.optional("Stiffness, loss and damping follow those of this mount.")
    mirror_of: Name | None = f.optional("All follows this mount, mirrored in the plane y = 0.")
    fluid_track: FluidTrackTable | None = None
    dynamic_stiffness: DynamicStiffnessTable | None = None
    joined_to: Name | None = f.optional("It stands where this mount stands, and their forces count together as one.")
    stop: StopTable | None = None


class MountsTable(Table):
    """Mounts of the engine."""

    kind: Literal["rigid", "elastic"] = "rigid"
    axes: AxesTable | None = f.optional("Axes of all positions, stiffnesses and turns, if not the engine's own.")
    positions: list[f.Three[f.Length]] = Field(default_factory=list)
    names: list[Name] | None = None
    relative_stiffness: f.Three[f.NonNegative] = f.optional(
        "Relative stiffness along x, y, z of every mount that gives none; not for elastic mounts.", [0.0, 1.0, 1.0]
    )
    stiffness: f.Three[f.Stiffness] | None = f.optional(
        "Stiffness along x, y, z of every elastic mount that gives none."
    )
    loss_factor: f.LossFactor = f.optional("Loss factor of every elastic mount that gives none.", 0.0)
    damping_per_stiffness: f.Delay = f.optional(
        "Viscous damping over stiffness of every elastic mount that gives none.", 0.0
    )
    stop: StopTable | None = None
    places: list[MountTable] = Field(default_factory=list)


class LoadCaseTable(Table):
    """Static load: weight, a bump, a torque. Travel counts from the position of the engine without it."""

    name: Name
    times_weight: f.Three[f.Factor] | None = f.optional("The weight of the block, so many times along x, y and z.")
    torque: f.Moment | None = f.optional("Moment about x, as that of the crank on the block.")
    force: f.Three[f.SignedForce] | None = f.optional("A force along x, y and z.")
    place: f.Three[f.Length] | None = f.optional("Where the force acts.")


@dataclass(frozen=True)
class MountsInput:
    """Mounts of a file with joined springs in one place, and the block that elastic ones carry.

    `numbers` has the fourteen numbers of each elastic spring (E13); `decisions` are about these numbers.
    """

    mounts: tuple[Mount, ...] = ()
    block: Block | None = None
    numbers: tuple[tuple[float, ...], ...] = ()
    decisions: tuple[Decision, ...] = ()


def mounts_of(
    table: MountsTable | None, block: BlockTable | None, folder: Path, is_mirrored: bool = False
) -> MountsInput:
    """Return the mounts of a file: rigid ones, or elastic ones with the block on them.

    `folder` contains the problem file and its CSV files. With `is_mirrored`, y of the engine points to the right.
    """
    axes = axes_of(table.axes if table else None, "mounts.axes", is_mirrored)
    if table is None or table.kind == "rigid":
        if block is not None:
            raise Refused(
                "block", None, "needs elastic mounts", 'add [mounts] with kind = "elastic", or remove [block]'
            )
        return MountsInput(_rigid(table, axes)) if table else MountsInput()
    if block is None:
        rule = "is missing, but elastic mounts need the mass and inertia of the block"
        raise Refused("block", None, rule, "add [block] with mass and inertia")
    (a, b, c), (xy, xz, yz) = block.inertia, block.inertia_products
    of_block = axes_of(block.axes, "block.axes", is_mirrored)
    rows = of_block.tensor(np.array([[a, xy, xz], [xy, b, yz], [xz, yz, c]])).tolist()
    x, y, z = of_block.place(block.centre_of_gravity)
    with errors_at_key("block"):
        body = Block(block.mass, (tuple(rows[0]), tuple(rows[1]), tuple(rows[2])), (x, y, z), block.turning_inertia)
    return _elastic(table, body, folder, axes)


def axes_sentences(table: MountsTable | None, block: BlockTable | None) -> tuple[str, ...]:
    """Return the sentence of a report about mounts or a block in axes of the file; empty without them."""
    names = [name for name, part in (("mounts", table), ("block", block)) if part is not None and part.axes is not None]
    text = (
        f"The file gives {' and '.join(names)} in axes of its own. Results are in the engine's axes: x along the crank "
        "to the front, y to the left, z up (C2); open positions keep the axes of the file."
    )
    return (text,) if names else ()


def _places(table: MountsTable) -> tuple[list[MountTable], list[str]]:
    if bool(table.positions) == bool(table.places):
        state = "is missing" if not table.positions else "is given twice, as positions and as places"
        raise Refused("mounts.positions", None, state, "give either positions or [[mounts.places]]")
    places = list(table.places) or [MountTable.model_construct(position=list(p)) for p in table.positions]
    names = table.names or [place.name or f"mount {k + 1}" for k, place in enumerate(places)]
    if len(names) != len(places):
        raise Refused("mounts.names", names, f"names {len(names)} of {len(places)} mounts", "name each once")
    require_distinct(list(names), "mounts.names", "mounts have one name")
    return places, list(names)


def _rigid(table: MountsTable, axes: Axes) -> tuple[Mount, ...]:
    refuse_keys(table, ("stiffness", "loss_factor", "damping_per_stiffness", "stop"), "mounts", *_NOT_RIGID)
    places, names = _places(table)
    mounts = []
    for k, (name, place) in enumerate(zip(names, places, strict=True), 1):
        where = f"mounts.places[{k}]"
        refuse_keys(place, _ELASTIC, where, *_NOT_RIGID)
        stiffness = place.relative_stiffness or table.relative_stiffness
        if not any(stiffness):
            prefix = f"places[{k}]." if place.relative_stiffness else ""
            rule = "is a stiffness of zero in every direction"
            remedy = "give at least one direction a value above zero, such as 1"
            raise Refused(f"mounts.{prefix}relative_stiffness", stiffness, rule, remedy)
        position, turned = (
            [Open.from_value(value).start for value in _values(table, place, key, where, "add it, or mirror_of")]
            for key in ("position", "turned")
        )
        # the usual stiffness is that across the crank
        is_usual = place.relative_stiffness is None and "relative_stiffness" not in table.model_fields_set
        turned = turned if is_usual and place.turned is None else axes.turned(turned)
        numbers = [*stiffness, 0.0, 0.0, 0.0, 0.0, *axes.place(position), *turned]
        mounts.append(mount_from_numbers(Mount(name, (0.0, 0.0, 0.0)), [*numbers, 0.0]))
    require_distinct([m.position for m in mounts], "mounts.positions", "mounts stand in one place", "move one")
    return tuple(mounts)


def _values(table: MountsTable, place: MountTable, key: str, where: str, remedy: str) -> Sequence[float | Open]:
    value = getattr(place, key)
    if value is None and key in _OF_ALL:
        value = getattr(table, key)
    if value is None and key in ("stiffness", "position"):
        raise Refused(f"{where}.{key}", None, "is missing", remedy)
    return [value] if len(_FIELDS[key][1]) == 1 else value or [0.0, 0.0, 0.0]


def _elastic(table: MountsTable, block: Block, folder: Path, axes: Axes) -> MountsInput:
    refuse_keys(table, ("relative_stiffness",), "mounts", *_NOT_ELASTIC)
    places, names = _places(table)
    numbers, joins, laws = _Numbers([], []), list[int](), list[tuple[Dynamic, ...]]()
    springs = []
    for k, (name, place) in enumerate(zip(names, places, strict=True)):
        where, stop = f"mounts.places[{k + 1}]", place.stop or table.stop
        refuse_keys(place, ("relative_stiffness",), where, *_NOT_ELASTIC)
        leader, followed = _leader(place, names, k, where), _followed(place)
        joined = _joined(place, names, joins, where)
        joins.append(joined)
        laws.append(_laws(place, folder, where) if leader is None else laws[leader])
        spring = Mount(name, (0.0, 0.0, 0.0), dynamic=laws[k])
        springs.append(spring if stop is None else replace(spring, stop_gap=stop.gap, stop_stiffness=stop.stiffness))
        numbers.rows.append([0.0] * NUMBERS_OF_MOUNT)
        if leader is not None:
            keys = [key for key in followed if key in _FIELDS and (key != _AT or joined == k)]
            numbers.follow(leader, keys, mirrored=place.mirror_of is not None)
        if joined != k:
            numbers.follow(joined, [_AT], mirrored=False)
        for key in _FIELDS:
            if key not in followed and (key != _AT or joined == k):
                values = _values(table, place, key, where, "add it, or like, or mirror_of")
                numbers.take(name, key, values, axes, where)
    springs = [mount_from_numbers(spring, row) for spring, row in zip(springs, numbers.rows, strict=True)]
    mounts = tuple(
        replace(springs[k], joined=tuple(springs[j] for j in range(k + 1, len(joins)) if joins[j] == k))
        for k in sorted(set(joins))
    )
    numbers.sort([j for k in sorted(set(joins)) for j, first in enumerate(joins) if first == k])
    with errors_at_key("mounts"):
        loose = free_motion(elastic_mounting(block, mounts).modes)
    if loose:
        remedy = "add a mount or a stiffness in this direction; an open stiffness may need a start above zero"
        raise Refused("mounts", None, f"leave the block free in {loose}", remedy)
    return MountsInput(mounts, block, tuple(map(tuple, numbers.rows)), tuple(numbers.decisions))


def _laws(place: MountTable, folder: Path, where: str) -> tuple[Dynamic, ...]:
    # these springs depend on frequency (E50, E51)
    laws: list[Dynamic] = []
    if (track := place.fluid_track) is not None:
        if track.bulge_stiffness == 0.0:
            raise Refused(
                f"{where}.fluid_track.bulge_stiffness", None, "is zero, so no fluid moves in the track", "give a value"
            )
        axis = _AXES.index(track.axis)
        laws.append(FluidTrack(axis, track.mass, track.bulge_stiffness, track.chamber_stiffness, track.damping))
    if place.dynamic_stiffness is not None:
        laws.append(_measured(place.dynamic_stiffness, folder, f"{where}.dynamic_stiffness"))
    return tuple(laws)


def _measured(table: DynamicStiffnessTable, folder: Path, where: str) -> MeasuredStiffness:
    hertz = si_value(f"1 {table.frequency_unit}", "Hz", f"{where}.frequency_unit", table.frequency_unit)
    unit = si_value(f"1 {table.stiffness_unit}", "N/m", f"{where}.stiffness_unit", table.stiffness_unit)
    by_angle = table.columns == "amount and angle"
    names = ("frequency", *(("stiffness", "loss angle") if by_angle else ("stiffness", "loss stiffness")))
    rows = rows_of(table.file, folder / table.file, f"{where}.file", names)
    if len(rows) < 2:
        raise Refused(f"{where}.file", table.file, "has fewer than two rows", "measure more frequencies")
    values = []
    for k, (_, amount, second) in enumerate(rows, 1):
        if by_angle and not 0.0 <= second < 180.0:
            rule = f"has a loss angle of {second:g} deg in row {k}"
            raise Refused(
                f"{where}.file", table.file, rule, "give loss angles from 0 to 180 deg, or set the key columns"
            )
        value = amount * np.exp(1j * math.radians(second)) if by_angle else complex(amount, second)
        values.append(complex(unit * value))
    with errors_at_key(f"{where}.file", table.file):
        return MeasuredStiffness(
            _AXES.index(table.axis), tuple(math.tau * hertz * row[0] for row in rows), tuple(values)
        )


def _leader(place: MountTable, names: list[str], k: int, where: str) -> int | None:
    if place.like is not None and place.mirror_of is not None:
        raise Refused(f"{where}.like", place.like, "is given, but this mount also has mirror_of", "keep one")
    leader = place.like or place.mirror_of
    if leader is None:
        return None
    number = _number_before(leader, names[:k], f"{where}.{'like' if place.like else 'mirror_of'}")
    refuse_keys(
        place, _followed(place), where, f"already follows from mount '{leader}', by like or mirror_of", "leave one out"
    )
    return number


def _number_before(name: str, earlier: Sequence[str], where: str) -> int:
    if name not in earlier:
        remedy = nearest(name, earlier) if earlier else "define the other mount first"
        raise Refused(where, name, "is not the name of a mount that stands before this one in the file", remedy)
    return earlier.index(name)


def _joined(place: MountTable, names: list[str], joins: Sequence[int], where: str) -> int:
    """Return the index of the mount that the next mount is joined to; its own index if it is not joined."""
    k, leader = len(joins), place.joined_to
    if leader is None:
        return k
    first = joins[_number_before(leader, names[:k], f"{where}.joined_to")]
    if names[first] != leader:
        remedy = f"name that one, '{names[first]}'"
        raise Refused(f"{where}.joined_to", leader, "is itself joined to another mount", remedy)
    refuse_keys(
        place, (_AT,), where, f"already follows from mount '{leader}', to which this one is joined", "leave one out"
    )
    return first


def _followed(place: MountTable) -> tuple[str, ...]:
    if place.mirror_of is not None:
        return (*_FIELDS, *_DYNAMIC)
    return (*_OF_ALL, "damping", *_DYNAMIC) if place.like is not None else ()


@dataclass
class _Numbers:
    """Numbers of elastic springs, one row for each, and decisions about them."""

    rows: list[list[float]]
    decisions: list[Decision]

    def take(self, name: str, key: str, values: Sequence[float | Open], axes: Axes, where: str) -> None:
        """Set the numbers of one key for the last mount, and add decisions for open values."""
        unit, numbers = _FIELDS[key]
        numbers_of_file = list(map(Open.from_value, values))
        starts, gains = [value.start for value in numbers_of_file], np.eye(len(numbers))
        if key == _AT:
            starts, gains = axes.place(starts), axes.rows
        elif key == "turned":
            is_fixed = not any(value.is_open for value in numbers_of_file)
            if not is_fixed and not axes.are_own:
                remedy = "remove mounts.axes, and give the engine's own axes"
                raise Refused(f"{where}.{key}", None, "may not be open in axes of a vehicle", remedy)
            starts = axes.turned(starts) if is_fixed and not axes.are_own else starts
        for number, start in zip(numbers, starts, strict=True):
            self.rows[-1][number] = start
        for axis, gain, value in zip(_AXES, gains.T, numbers_of_file, strict=False):
            label = f"{name}.{key}" if len(numbers) == 1 else f"{name}.{key}.{axis}"
            moved = np.flatnonzero(gain)
            if value.is_open and len(moved) != 1:
                rule = f"is open along {axis} of the file, which is inclined to the axes of the engine"
                raise Refused(f"{where}.{key}", None, rule, "give mounts.axes along the engine, or fix the position")
            drives = (MountDrive(len(self.rows) - 1, numbers[i], float(gain[i])) for i in moved)
            self.decisions += value.decisions(label, unit, *drives)

    def sort(self, order: Sequence[int]) -> None:
        """Reorder the rows and the drives of decisions, so that springs of one place are neighbours."""
        self.rows = [self.rows[k] for k in order]
        new = {old: k for k, old in enumerate(order)}
        for d, decision in enumerate(self.decisions):
            drives = (replace(drive, mount=new[drive.mount]) for drive in decision.mount_drives)
            self.decisions[d] = replace(decision, drives=tuple(drives))

    def follow(self, leader: int, keys: Sequence[str], mirrored: bool) -> None:
        """Let some keys of the last spring follow those of the spring `leader`, perhaps mirrored in y = 0."""
        last = len(self.rows) - 1
        for number in (number for key in keys for number in _FIELDS[key][1]):
            gain = _MIRRORED[number] if mirrored else 1.0
            self.rows[last][number] = gain * self.rows[leader][number]
            for d, decision in enumerate(self.decisions):
                drives = [v for v in decision.mount_drives if v.mount == leader and v.number == number]
                new = (MountDrive(last, number, gain * drive.gain) for drive in drives)
                self.decisions[d] = replace(decision, drives=(*decision.drives, *new))


def load_cases_of(tables: Sequence[LoadCaseTable], block: Block | None) -> tuple[LoadCase, ...]:
    """Return the static load cases."""
    if tables and block is None:
        raise Refused("load_cases", None, "needs elastic mounts", 'add [mounts] with kind = "elastic", and [block]')
    require_distinct([table.name for table in tables], "load_cases", "load cases have one name")
    cases = []
    for k, table in enumerate(tables, 1):
        if not any((*(table.times_weight or ()), table.torque, *(table.force or ()))):
            remedy = "give the load case one of times_weight, torque and force"
            raise Refused(f"load_cases[{k}]", table.name, "has no load", remedy)
        if table.place is not None and table.force is None:
            remedy = "give the load case a force, or remove its position"
            raise Refused(f"load_cases[{k}].place", table.place, "has no force", remedy)
        weight, force, place = (
            (three[0], three[1], three[2]) if three else (0.0, 0.0, 0.0)
            for three in (table.times_weight, table.force, table.place)
        )  # fmt: skip
        cases.append(LoadCase(table.name, weight, force, place, (table.torque or 0.0, 0.0, 0.0)))
    return tuple(cases)
