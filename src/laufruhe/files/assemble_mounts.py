"""From [mounts] and [block] of a problem file to mounts, block, and what of them is open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from laufruhe.files.assemble_engine import all_different
from laufruhe.files.complaints import Refused, blamed_on, nearest
from laufruhe.files.fields import Open
from laufruhe.files.file_models import BlockTable, MountsTable, MountTable, StopTable
from laufruhe.machine import Block, Mount
from laufruhe.physics.elastic_mounts import elastic_mounting
from laufruhe.physics.modes import free_motion
from laufruhe.problem.decision import (
    DAMPING,
    LOSS,
    NUMBERS_OF_MOUNT,
    POSITION,
    STIFFNESS,
    TURNED,
    Decision,
    MountDrive,
    mount_of,
)
from laufruhe.problem.sets import Interval

_AXES = ("x", "y", "z")
_FIELDS = (
    ("stiffness", "N/m", STIFFNESS.start), ("loss_factor", "", LOSS), ("damping", "N s/m", DAMPING.start),
    ("position", "m", POSITION.start), ("turned", "rad", TURNED.start),
)  # fmt: skip
_ELASTIC_ONLY = ("stiffness", "loss_factor", "damping", "like", "mirror_of", "stop")
# what mirroring in y = 0 does to each number of a mount
_MIRRORED = [1.0] * 8 + [-1.0, 1.0, -1.0, 1.0, -1.0]


@dataclass(frozen=True)
class MountsFound:
    """Mounts of a file, the block they carry, and what of them is open."""

    mounts: tuple[Mount, ...] = ()
    block: Block | None = None
    numbers: tuple[tuple[float, ...], ...] = ()
    decisions: tuple[Decision, ...] = ()


def mounts_of(table: MountsTable | None, block: BlockTable | None) -> MountsFound:
    """Rigid mounts, or elastic ones with the block on them."""
    if table is None or table.kind == "rigid":
        if block is not None:
            raise Refused("block", None, "needs elastic mounts", 'add [mounts] with kind = "elastic", or leave it out')
        return MountsFound(_rigid(table)) if table else MountsFound()
    if block is None:
        raise Refused("block", None, "is missing, and elastic mounts carry it", "add [block] with mass and inertia")
    return _elastic(table, _block(block))


def _places(table: MountsTable) -> tuple[list[MountTable], list[str]]:
    if bool(table.positions) == bool(table.places):
        state = "is missing" if not table.positions else "is given twice, as positions and as places"
        raise Refused("mounts.positions", None, state, "give positions or [[mounts.places]], one of them")
    places = list(table.places) or [MountTable.model_construct(position=list(p)) for p in table.positions]
    names = table.names or [place.name or f"mount {k + 1}" for k, place in enumerate(places)]
    if len(names) != len(places):
        raise Refused("mounts.names", names, f"names {len(names)} of {len(places)} mounts", "name each once")
    all_different(list(names), "mounts.names", "mounts have one name")
    return places, list(names)


def _rigid(table: MountsTable) -> tuple[Mount, ...]:
    for key in ("stiffness", "loss_factor", "stop"):
        if getattr(table, key):
            raise Refused(f"mounts.{key}", None, 'goes with kind = "elastic"', "leave it out, or set the kind")
    places, names = _places(table)
    mounts = []
    for k, (name, place) in enumerate(zip(names, places, strict=True)):
        where = f"mounts.places[{k + 1}]"
        for key in _ELASTIC_ONLY:
            if getattr(place, key) is not None:
                raise Refused(f"{where}.{key}", None, 'goes with kind = "elastic"', "leave it out, or set the kind")
        stiffness = place.relative_stiffness or table.relative_stiffness
        if not any(stiffness):
            own = f"places[{k + 1}]." if place.relative_stiffness else ""
            raise Refused(f"mounts.{own}relative_stiffness", stiffness, "carries nothing", "give one a value")
        mounts.append(Mount(name, (0.0, 0.0, 0.0), (stiffness[0], stiffness[1], stiffness[2])))
        numbers = [*stiffness, 0.0, 0.0, 0.0, 0.0]
        for key in ("position", "turned"):
            values = _given(place, key, where)
            if any(isinstance(value, Open) for value in values):
                raise Refused(f"{where}.{key}", None, "is open, and rigid mounts stay", 'fix it, or use kind "elastic"')
            numbers += [float(value) for value in values if not isinstance(value, Open)]
        mounts[-1] = mount_of(mounts[-1], numbers)
    all_different([m.position for m in mounts], "mounts.positions", "mounts stand in one place")
    return tuple(mounts)


def _given(place: MountTable, key: str, where: str) -> Sequence[float | Open]:
    value = getattr(place, key)
    if value is None and key == "position":
        raise Refused(f"{where}.position", None, "is missing", "add it, or mirror_of")
    return value if value is not None else [0.0, 0.0, 0.0]


def _block(table: BlockTable) -> Block:
    (a, b, c), (xy, xz, yz) = table.inertia, table.inertia_products
    x, y, z = table.centre_of_gravity
    with blamed_on("block"):
        return Block(table.mass, ((a, xy, xz), (xy, b, yz), (xz, yz, c)), (x, y, z))


def _elastic(table: MountsTable, block: Block) -> MountsFound:
    if table.relative_stiffness != MountsTable.model_fields["relative_stiffness"].default:
        raise Refused("mounts.relative_stiffness", None, 'goes with kind = "rigid"', "give stiffness instead")
    places, names = _places(table)
    rows: list[list[float]] = []
    decisions: list[Decision] = []
    for k, (name, place) in enumerate(zip(names, places, strict=True)):
        where = f"mounts.places[{k + 1}]"
        if place.relative_stiffness is not None:
            raise Refused(f"{where}.relative_stiffness", None, 'goes with kind = "rigid"', "give stiffness instead")
        leader = _leader(place, names, k, where)
        rows.append([0.0] * NUMBERS_OF_MOUNT)
        followed = _followed(place)
        if leader is not None:
            _follow(rows, decisions, leader, k, followed, mirrored=place.mirror_of is not None)
        for key, unit, first in _FIELDS:
            if key not in followed:
                _read(table, place, key, unit, first, where, name, k, rows[k], decisions)
    stops = [place.stop or table.stop for place in places]
    bare = [_stopped(Mount(name, (0.0, 0.0, 0.0)), stop) for name, stop in zip(names, stops, strict=True)]
    mounts = tuple(mount_of(mount, row) for mount, row in zip(bare, rows, strict=True))
    _check_held(block, mounts)
    return MountsFound(mounts, block, tuple(tuple(row) for row in rows), tuple(decisions))


def _stopped(mount: Mount, stop: StopTable | None) -> Mount:
    return mount if stop is None else replace(mount, stop_gap=stop.gap, stop_stiffness=stop.stiffness)


def _leader(place: MountTable, names: list[str], k: int, where: str) -> int | None:
    if place.like is not None and place.mirror_of is not None:
        raise Refused(f"{where}.like", place.like, "is given beside mirror_of", "keep one")
    leader = place.like or place.mirror_of
    if leader is None:
        return None
    if leader not in names[:k]:
        key = "like" if place.like else "mirror_of"
        remedy = nearest(leader, names[:k]) if k else "define the other one first"
        raise Refused(f"{where}.{key}", leader, "is no mount defined before this one", remedy)
    clash = next((key for key in _followed(place) if getattr(place, key) is not None), None)
    if clash is not None:
        raise Refused(f"{where}.{clash}", None, f"follows '{leader}' already", "leave one out")
    return names.index(leader)


def _followed(place: MountTable) -> tuple[str, ...]:
    if place.mirror_of is not None:
        return tuple(key for key, _, _ in _FIELDS)
    return ("stiffness", "loss_factor", "damping") if place.like is not None else ()


def _follow(
    rows: list[list[float]],
    decisions: list[Decision],
    leader: int,
    k: int,
    followed: Sequence[str],
    mirrored: bool,
) -> None:
    numbers = [first + j for key, _, first in _FIELDS if key in followed for j in range(_width(key))]
    for number in numbers:
        gain = _MIRRORED[number] if mirrored else 1.0
        rows[k][number] = gain * rows[leader][number]
        for d, decision in enumerate(decisions):
            new = tuple(
                MountDrive(k, number, gain * drive.gain)
                for drive in decision.mount_drives
                if drive.mount == leader and drive.number == number
            )
            decisions[d] = replace(decision, drives=(*decision.drives, *new))


def _width(key: str) -> int:
    return 1 if key == "loss_factor" else 3


def _read(
    table: MountsTable,
    place: MountTable,
    key: str,
    unit: str,
    first: int,
    where: str,
    name: str,
    k: int,
    row: list[float],
    decisions: list[Decision],
) -> None:
    """One field of one mount into its row, open numbers into decisions as well."""
    value = getattr(place, key)
    if value is None:
        value = getattr(table, key, None) if key in ("stiffness", "loss_factor") else None
    if value is None and key in ("stiffness", "position"):
        raise Refused(f"{where}.{key}", None, "is missing", "add it, or like, or mirror_of")
    values = [value] if key == "loss_factor" else value if value is not None else [0.0, 0.0, 0.0]
    for j, number in enumerate(values):
        row[first + j] = number.start if isinstance(number, Open) else float(number)
        if isinstance(number, Open) and number.lower < number.upper:
            label = f"{name}.{key}" + ("" if key == "loss_factor" else f".{_AXES[j]}")
            drive = (MountDrive(k, first + j, 1.0),)
            decisions.append(Decision(label, unit, Interval(number.lower, number.upper), number.start, drive))


def _check_held(block: Block, mounts: tuple[Mount, ...]) -> None:
    with blamed_on("mounts"):
        mounting = elastic_mounting(block, mounts)
    loose = free_motion(mounting.modes)
    if loose:
        raise Refused(
            "mounts", None, f"leave the block free in {loose}",
            "add a mount or a stiffness there; an open stiffness may be given a start",
        )  # fmt: skip
