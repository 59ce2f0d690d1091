"""[engine] of a problem file: its common keys, those that layouts own, and the slider-cranks that it makes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field

from laufruhe import units
from laufruhe.errors import counted
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, blamed_on, nearest, none_of, one_of
from laufruhe.files.engine_keys import BigEndTable, RodTable, ShaftTable, SliderCrankTable, with_owned_keys
from laufruhe.files.fields import CylinderNumber, Open, Table
from laufruhe.machine import CRANKSHAFT, Cycle, Rod, Shaft, SliderCrank
from laufruhe.machine.drives import DRIVES, Sizes
from laufruhe.machine.facing import least_room, with_shared_chambers
from laufruhe.machine.layouts import LAYOUTS, Asked, Layout, LayoutKind, Mechanism, Throw, even_throws, rod_of
from laufruhe.machine.leads import led_parts
from laufruhe.numerics.turns import direction

FiringOrder: TypeAlias = Annotated[list[int] | Literal["open"], f.OrOpen(list[CylinderNumber], "[1, 3, 4, 2]")]

_CYCLES = {str(cycle): cycle for cycle in Cycle}
_OWNED = tuple(dict.fromkeys(key for k in LAYOUTS.values() for key in (*(own.name for own in k.keys), *k.lists)))
_OF_PISTONS = (
    "drive", "bore", "stroke", "rod_ratio", "rod_length", "offset", "reciprocating_mass", "rod", "rod_inertia_deficit",
)  # fmt: skip
# what a slider-crank of a free list takes from [engine] unless it says otherwise
_INHERITED = {"stroke", "bore", "offset", "reciprocating_mass", "rod_inertia_deficit"}


@with_owned_keys
class EngineTable(Table):
    """What the engine is."""

    layout: str
    drive: str
    cycle: Literal["two-stroke", "four-stroke"]
    cylinders: CylinderNumber | None = f.told("Number of cylinders; by default that of throws or firing order.")
    bore: f.PositiveLength | None = f.told("Diameter of the cylinder; needed with gas.")
    stroke: f.PositiveLength | None = None
    rod_ratio: f.NonNegative | None = f.told("Crank radius over rod length; 0 is a Scotch yoke.")
    rod_length: f.OpenPositiveLength | None = None
    offset: f.Length = f.told("Distance of the piston pin's path from the crank axis.", 0.0)
    reciprocating_mass: f.OpenMass | None = f.told(
        "Reciprocating mass of a cylinder, with the rod's share unless [engine.rod] is given."
    )
    rotating_mass: f.Mass = f.told("Rotating mass of a throw, at the crank radius.", 0.0)
    rod: RodTable | None = None
    big_end: BigEndTable | None = f.told("Big end of the rod; needed for the pressure on crank pins.")
    rod_inertia_deficit: f.Inertia = f.told("Inertia of the rod less that of two masses at its ends.", 0.0)
    throws: f.Throws | None = f.told('Angles of the throws at phi = 0, or "open"; by default those of even firing.')
    firing_order: FiringOrder | None = None
    fires_together: bool = f.told("Whether cylinders are meant to fire at once; else you are asked.", False)
    shafts: list[ShaftTable] = Field(default_factory=list)
    slider_cranks: list[SliderCrankTable] = Field(default_factory=list)

    @property
    def piston_mass(self) -> Open:
        """Reciprocating mass without a share of the rod, which may be open."""
        return Open.of(self.reciprocating_mass or 0.0)

    @property
    def open_masses(self) -> dict[str, Open]:
        """Masses that are open, by their keys, which are those of the mechanisms."""
        keys = ["reciprocating_mass", *(k.name for k in DRIVES[self.drive].keys if k.kind == "open mass")]
        return {key: own for key in keys if isinstance(own := getattr(self, key), Open) and own.is_open}

    @property
    def given_throws(self) -> list[float] | None:
        """Throws, where every one is a number."""
        angles = [angle for angle in self.throws or () if isinstance(angle, float)]
        return angles if self.throws is not None and len(angles) == len(self.throws) else None

    @property
    def given_order(self) -> list[int] | None:
        """Firing order, where it is a list."""
        return None if self.firing_order is None or self.firing_order == "open" else self.firing_order

    def own(self, key: str) -> Any:
        """What stands at a key that a layout owns."""
        return getattr(self, key)

    @property
    def kind(self) -> LayoutKind:
        """What its layout takes and builds."""
        return LAYOUTS[self.layout]


def cycle_of(table: EngineTable) -> Cycle:
    """In which its loads repeat."""
    with blamed_on("engine.cycle"):
        return table.kind.cycle(_CYCLES[table.cycle])


def moving_parts(table: EngineTable, gas: bool) -> tuple[tuple[SliderCrank, ...], tuple[Throw, ...]]:
    """Slider-cranks of [engine], and the throws that they work on."""
    kind = table.kind
    for key in _OWNED:
        if table.own(key) and not kind.takes(key):
            raise Refused(f"engine.{key}", None, f"means nothing in layout '{table.layout}'", "leave it out")
    _check_pistons(table)
    _check_drive(table)
    bores = [part.bore for part in table.slider_cranks] or [None]
    if gas and kind.has_pistons and table.bore is None and None in bores:
        raise Refused("engine.bore", None, "is missing, and gas acts on it", "add it")
    if kind.is_free:
        parts = _sharing_chambers(table, _free_parts(table), gas)
        return parts, tuple(Throw(p.x, p.throw, (k,), shaft=p.shaft) for k, p in enumerate(parts))
    asked, layout = _asked(table, gas), layout_of(table)
    throws = _throws(table, layout)
    with blamed_on("engine.firing_order" if table.given_order else "engine"):
        parts, cranks = kind.parts(asked, layout, throws)
    return _sharing_chambers(table, parts, gas), cranks


def _sharing_chambers(table: EngineTable, parts: Sequence[SliderCrank], gas: bool) -> tuple[SliderCrank, ...]:
    """Pistons that face each other: with room between them and, where gas acts, with the chamber that both sweep."""
    for k, part in enumerate(parts):
        for other in parts[:k]:
            if part.faces(other) and least_room(part, other) <= 0.0:
                rule = f"leaves {part.name} and {other.name} no chamber: their pins meet"
                raise Refused("engine", None, rule, "move the cranks apart, or shorten the rods")
    with blamed_on("engine"):
        return with_shared_chambers(parts, cycle_of(table).angle) if gas else tuple(parts)


def _check_pistons(table: EngineTable) -> None:
    if table.kind.has_pistons:
        for key in ("stroke", "reciprocating_mass"):
            if getattr(table, key) is None:
                raise Refused(f"engine.{key}", None, "is missing", "add it")
    else:
        none_of(table, _OF_PISTONS, "engine", f"means nothing in layout '{table.layout}'", "leave it out")


def _check_drive(table: EngineTable) -> None:
    """Refuse keys that mean nothing with the drive."""
    drive, rule = DRIVES[table.drive], f"means nothing with drive '{table.drive}'"
    none_of(table, [key.name for kind in DRIVES.values() for key in kind.keys if key not in drive.keys], "engine",
            rule, "leave it out")  # fmt: skip
    if table.kind.needs_rod and not drive.has_rod:
        remedy = "leave it out, or take another layout"
        raise Refused("engine.drive", table.drive, "has no rod that could carry the others", remedy)
    if not drive.has_rod:
        none_of(table, ("rod_ratio", "rod_length", "rod", "rod_inertia_deficit"), "engine", rule, "leave it out")


def layout_of(table: EngineTable) -> Layout:
    """Places, banks and pins, without masses."""
    _check_pistons(table)
    with blamed_on("engine.cylinders"):
        return table.kind.place(_asked(table))


def _asked(table: EngineTable, gas: bool = False) -> Asked:
    """What [engine] says to its layout."""
    given = {key.name: table.own(key.name) for key in table.kind.keys}
    masses = [key.name for key in table.kind.keys if key.kind in ("open mass", "open lead")]
    own = {
        name: value if not isinstance(value, Open) else value.start if name in masses else None
        for name, value in given.items()
    }
    rods = {name: value.model_dump() for name, value in own.items() if isinstance(value, RodTable)}
    order = None if table.given_order is None else tuple(table.given_order)
    count, (mechanism, rod) = _cylinders(table), _mechanism(table, own)
    return Asked(cycle_of(table), count, mechanism, own | rods, order, table.piston_mass.start, rod, gas)


def _cylinders(table: EngineTable) -> int:
    given = told_cylinders(table)
    if not given:
        raise Refused("engine.cylinders", None, "is missing", "add it, or throws, or firing_order")
    first, count = given[0]
    for key, other in given:
        if other != count:
            rule = f"makes {counted(other, 'cylinder')}, but engine.{first} makes {count}"
            raise Refused(f"engine.{key}", None, rule, "let them agree")
    check_order(table.given_order, count)
    return count


def told_cylinders(table: EngineTable) -> list[tuple[str, int]]:
    """Keys that tell how many cylinders there are, and how many each tells."""
    throws, order, per_throw = table.throws, table.given_order, table.kind.cylinders_per_throw
    told = [("cylinders", table.cylinders)] if table.cylinders is not None else []
    if order is not None and not order:
        raise Refused("engine.firing_order", [], "names no cylinder", "name every cylinder once")
    told += [("firing_order", len(order))] if order is not None else []
    return told + ([("throws", len(throws) * per_throw)] if isinstance(throws, list) else [])


def check_order(order: Sequence[int] | None, count: int) -> None:
    """Refuse a firing order that does not name every cylinder once."""
    if order is not None and sorted(order) != list(range(1, count + 1)):
        rule = f"is no permutation of 1 to {count}"
        raise Refused("engine.firing_order", list(order), rule, "name every cylinder once")


def _throws(table: EngineTable, layout: Layout) -> tuple[float, ...]:
    if table.given_throws is not None:
        return tuple(table.given_throws)
    if layout.throws is not None:
        return layout.throws
    if table.given_order is None:
        if len(layout.throw_positions) == 1:
            return (layout.banks[0] - layout.pin_offsets[0],)
        raise Refused("engine.throws", None, "is missing", "add it, or firing_order for even firing")
    with blamed_on("engine.firing_order"):
        return even_throws(cycle_of(table), layout, table.given_order)


def _mechanism(table: EngineTable, own: Mapping[str, Any] | None = None) -> tuple[Mechanism, Rod | None]:
    """Masses and lengths of one cylinder, and its rod where that is a rigid body."""
    big_end = None if table.big_end is None else table.big_end.size
    if not table.kind.has_pistons:
        return table.kind.mechanism(own or {}, rotating_mass=table.rotating_mass, big_end=big_end), None
    radius, rod_length = _radius_and_rod(table)
    rod = _rod(table, rod_length)
    if rod is not None and table.rod_inertia_deficit != 0.0:
        raise Refused("engine.rod_inertia_deficit", None, "is given twice, here and by [engine.rod]", "keep one")
    plain = Mechanism(
        crank_radius=radius,
        rod_length=rod_length,
        reciprocating_mass=table.piston_mass.start + (rod.reciprocating_mass if rod else 0.0),
        rotating_mass=table.rotating_mass,
        rod_rotating_mass=rod.rotating_mass if rod else 0.0,
        rod_inertia_deficit=rod.inertia_deficit if rod else table.rod_inertia_deficit,
        offset=table.offset,
        bore=table.bore,
        big_end=big_end,
    )
    return DRIVES[table.drive].mechanism(plain, _sizes(table)), rod


def _sizes(table: EngineTable) -> Sizes:
    """What [engine] says of lengths to its drive."""
    own = {key.name: getattr(table, key.name) for key in DRIVES[table.drive].keys}
    told = {name: value.model_dump() if isinstance(value, RodTable) else value for name, value in own.items()}
    told = {name: value.start if isinstance(value, Open) else value for name, value in told.items()}
    length = None if table.rod_length is None else Open.of(table.rod_length).start
    return Sizes(table.stroke or 0.0, table.offset, length, table.rod_ratio, told)


def _rod(table: EngineTable, length: float) -> Rod | None:
    if table.rod is None:
        return None
    if math.isinf(length):
        raise Refused("engine.rod", None, "means nothing in a Scotch yoke (rod_ratio = 0)", "leave it out")
    with blamed_on("engine.rod"):
        return rod_of("rod", table.rod.model_dump(), length, "crank pin")


def _radius_and_rod(table: EngineTable) -> tuple[float, float]:
    """Crank radius and rod length [m] from stroke, offset and one of rod ratio and rod length."""
    drive, sizes = DRIVES[table.drive], _sizes(table)
    ratio, length = sizes.rod_ratio, sizes.rod_length
    if drive.has_rod:
        one_of(table, "engine", "rod_ratio", "rod_length", shown=ratio)
    with blamed_on("engine.offset"):
        radius = drive.radius(sizes)
    rod = length if length is not None else (radius / ratio if ratio else math.inf)
    turning = (radius + abs(table.offset)) / rod
    if turning >= 1.0:
        key, value = ("rod_length", units.shown(rod, "m")) if length is not None else ("rod_ratio", f"{ratio:g}")
        rule = f"does not let the crank turn, (crank radius + |offset|) / rod length = {turning:.4g} must be under 1"
        raise Refused(f"engine.{key}", value, rule, "lengthen the rod")
    return radius, rod


def _free_parts(table: EngineTable) -> tuple[SliderCrank, ...]:
    if not table.slider_cranks:
        raise Refused("engine.slider_cranks", None, "is missing", "list at least one [[engine.slider_cranks]]")
    shafts = {"crankshaft": CRANKSHAFT}
    for k, shaft in enumerate(table.shafts):
        where = f"engine.shafts[{k + 1}]"
        if shaft.name in shafts:
            raise Refused(f"{where}.name", shaft.name, "is the name of another shaft", "give each its own name")
        with blamed_on(where):
            shafts[shaft.name] = Shaft(shaft.name, shaft.ratio, *shaft.position)
    leads = {shaft.name: Open.of(shaft.lead).start for shaft in table.shafts}
    return led_parts([_free_part(table, part, k, shafts) for k, part in enumerate(table.slider_cranks)], leads)


def _sharing(table: EngineTable, part: SliderCrankTable) -> int:
    """Slider-cranks on the throw of this one that share the mass given for every throw."""
    here = (part.shaft, part.x, direction(part.throw))
    return sum(
        (each.shaft, each.x, direction(each.throw)) == here and each.rotating_mass is None
        for each in table.slider_cranks
    )


def _free_part(table: EngineTable, part: SliderCrankTable, k: int, shafts: dict[str, Shaft]) -> SliderCrank:
    where = f"engine.slider_cranks[{k + 1}]"
    if part.shaft not in shafts:
        raise Refused(f"{where}.shaft", part.shaft, "is no shaft of this engine", nearest(part.shaft, list(shafts)))
    own = {key: getattr(part, key) for key in _INHERITED if getattr(part, key) is not None}
    if part.rod_ratio is not None or part.rod_length is not None:
        own |= {"rod_ratio": part.rod_ratio, "rod_length": part.rod_length}
    shaft = shafts[part.shaft]
    with blamed_on(where):
        mechanism, _ = _mechanism(table.model_copy(update=own))
        rotating = part.rotating_mass if part.rotating_mass is not None else table.rotating_mass / _sharing(table, part)
        first = (part.bank_angle - part.throw) / shaft.ratio % (math.tau / abs(shaft.ratio))
        fires = part.firing_angle if part.firing_angle is not None else first
        return mechanism.cylinder(k + 1, part.x, part.throw, part.bank_angle, fires, rotating, shaft)
