"""[engine] of a problem file: its tables, the slider-cranks of the engine, and decisions about masses and leads."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field

from laufruhe import units
from laufruhe.errors import counted
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key, nearest, refuse_keys, require_one_of
from laufruhe.files.fields import CylinderNumber, Name, Open, Table
from laufruhe.files.numbering import REVERSED, Scheme, place_order
from laufruhe.files.rotors import CounterweightTable, check_factors
from laufruhe.machine import CRANKSHAFT, Cycle, Rod, Shaft, SliderCrank
from laufruhe.machine.drives import DRIVES, Sizes
from laufruhe.machine.engine import parts_with_leads
from laufruhe.machine.facing import minimum_room, with_shared_chambers
from laufruhe.machine.layouts import (
    LAYOUTS,
    Layout,
    LayoutInput,
    LayoutKind,
    Mechanism,
    Throw,
    angles_in_order,
    even_throws,
    rod_of,
)
from laufruhe.numerics.exact_angles import as_turn, cis, direction
from laufruhe.problem.decision import Decision, Kind, NumberDrive

FiringOrder: TypeAlias = Annotated[list[int] | Literal["open"], f.OrWord(list[CylinderNumber], "[1, 3, 4, 2]")]

_CYCLES = {str(cycle): cycle for cycle in Cycle}
_OWNED = tuple(dict.fromkeys(key for k in LAYOUTS.values() for key in (*(option.name for option in k.keys), *k.lists)))
_OF_PISTONS = (
    "drive", "bore", "stroke", "rod_ratio", "rod_length", "offset", "reciprocating_mass", "rod", "rod_inertia_deficit",
)  # fmt: skip
# keys that a slider-crank of a free list takes from [engine] by default
_INHERITED = {"stroke", "bore", "offset", "reciprocating_mass", "rod_inertia_deficit"}
_OPPOSED = "second crankshaft"
_OF_ROD = ("rod_ratio", "rod_length", "rod", "rod_inertia_deficit")
_OF_ORDER = ("throws", "firing_order", "firing_intervals")
_SAME_RADIUS = 1e-9
_SECOND, _RECIPROCATING = "second_reciprocating_mass", "reciprocating_mass"


class RodTable(Table):
    """Connecting rod as a rigid body."""

    mass: f.PositiveMass
    centre_of_gravity: f.Length = f.required(
        "Distance of the centre of gravity from the crank pin, on the line of the pins."
    )
    inertia: f.Inertia = f.required("Moment of inertia about the centre of gravity.")


class BigEndTable(Table):
    """Big-end bearing of the rod on the crank pin."""

    diameter: f.OpenPositiveLength
    width: f.OpenPositiveLength

    @property
    def size(self) -> tuple[float, float]:
        """Diameter and width [m]; open numbers at their start."""
        return Open.from_value(self.diameter).start, Open.from_value(self.width).start


class ShaftTable(Table):
    """Crankshaft in a free list of parts."""

    name: Name
    ratio: f.Ratio = 1.0
    position: f.Pair[f.Length] = f.required("Position of the axis: y to the left, z up.")
    lead: f.OpenAngle = f.optional("Crank angle by which all that it carries comes earlier.", 0.0)


class SliderCrankTable(Table):
    """Slider-crank in a free list of parts; missing keys are those of [engine]."""

    x: f.Length
    bank_angle: f.Angle = f.optional("Angle of the cylinder axis, from upright towards the left.", 0.0)
    throw: f.Angle = 0.0
    firing_angle: f.Angle | None = f.optional("Crank angle at which it fires.")
    shaft: str = "crankshaft"
    stroke: f.PositiveLength | None = None
    bore: f.NonNegativeLength | None = f.optional("Diameter of the cylinder; 0 for a piston on which no gas acts.")
    rod_ratio: f.NonNegative | None = None
    rod_length: f.PositiveLength | None = None
    offset: f.Length | None = None
    reciprocating_mass: f.OpenMass | None = None
    rotating_mass: f.Mass | None = None
    rod_inertia_deficit: f.Inertia | None = None


_KINDS: dict[str, Any] = {
    "length": f.Length,
    "positive length": f.PositiveLength,
    "positive lengths": Annotated[list[f.PositiveLength], f.ListOrSingle(f.PositiveLength)],
    "non-negative length": f.NonNegativeLength,
    "angle": f.Angle,
    "open angle": f.OpenAngle,
    "open lead": f.OpenAngle,
    "angles": list[f.Angle],
    "mass": f.Mass,
    "inertia": f.Inertia,
    "open mass": f.OpenMass,
    "ratio": f.Positive,
    "cylinder": CylinderNumber,
    "sign": Literal[1, -1],
    "rod": RodTable,
    "numbering": Scheme,
    "bank": Literal["left", "right"],
    "end": Literal["front", "flywheel"],
    "rotation": Literal["clockwise", "counter-clockwise"],
}


def _with_owned_keys(table: type[f.TableModel]) -> type[f.TableModel]:
    # [engine] takes the names of all layouts and drives, and their own keys
    names: Any = tuple(LAYOUTS)
    drives: Any = tuple(DRIVES)
    fields: dict[str, Any] = {"layout": (Literal[names], ...), "drive": (Literal[drives], "slider-crank")}
    key_sets = [kind.keys for kind in LAYOUTS.values()] + [kind.keys for kind in DRIVES.values()]
    for key in (key for keys in key_sets for key in keys):
        kind = _KINDS[key.kind] if key.default is not None else _KINDS[key.kind] | None
        fields[key.name] = (kind, Field(default=key.default, description=key.description or None))
    return f.with_keys(table, fields)


def _with_single_keys(table: type[f.TableModel]) -> type[f.TableModel]:
    # single cylinders take keys of layouts too, whose masses are not open here
    keys = {key.name: key for kind in LAYOUTS.values() for key in kind.keys if key.name in kind.single}
    kinds = _KINDS | {"open mass": f.Mass}
    fields = {key.name: (kinds[key.kind] | None, Field(None, description=key.description)) for key in keys.values()}
    return f.with_keys(table, fields)


@_with_single_keys
class SingleCylinderTable(Table):
    """Cylinders that differ from the others; missing keys are those of [engine]."""

    cylinders: Annotated[list[CylinderNumber], f.ListOrSingle(CylinderNumber), Field(min_length=1)] = f.required(
        "Their numbers; with two pistons in a cylinder the keys count for both."
    )
    bore: f.NonNegativeLength | None = f.optional("Diameter of the cylinder; 0 for a piston on which no gas acts.")
    stroke: f.PositiveLength | None = None
    rod_ratio: f.NonNegative | None = None
    rod_length: f.PositiveLength | None = None
    offset: f.Length | None = f.optional("Offset at the crank radius of [engine], or at that of a stroke beside it.")
    reciprocating_mass: f.OpenMass | None = f.optional("Reciprocating mass as weighed; rotating_mass has the rest.")
    rotating_mass: f.Mass | None = f.optional(
        "Rotating mass that belongs to this cylinder, by default an equal share of that of its throw."
    )
    rod: RodTable | None = None
    rod_inertia_deficit: f.Inertia | None = None

    @property
    def numbers(self) -> dict[str, Any]:
        """Keys of [engine] with values of these cylinders alone."""
        values = {key: getattr(self, key) for key in type(self).model_fields if key != "cylinders"}
        return {key: value for key, value in values.items() if value is not None}


@_with_owned_keys
class EngineTable(Table):
    """The engine."""

    layout: str
    drive: str
    cycle: Literal["two-stroke", "four-stroke"]
    cylinders: CylinderNumber | None = f.optional("Number of cylinders; by default that of throws or firing order.")
    bore: f.PositiveLength | None = f.optional("Diameter of the cylinder; needed with gas.")
    stroke: f.PositiveLength | None = f.optional(
        "Travel of the piston; with an offset a little more than twice the crank radius."
    )
    rod_ratio: f.NonNegative | None = f.optional("Crank radius over rod length; 0 is a Scotch yoke.")
    rod_length: f.OpenPositiveLength | None = None
    offset: f.Length = f.optional(
        "Distance of the piston pin's path from the crank axis; with row_angle to the outer side of every row.", 0.0
    )
    reciprocating_mass: f.OpenMass | None = f.optional(
        "Reciprocating mass of a cylinder, with the rod's share unless [engine.rod] is given."
    )
    rotating_mass: f.Mass = f.optional("Rotating mass of a throw, at the crank radius.", 0.0)
    rod: RodTable | None = None
    big_end: BigEndTable | None = f.optional("Big end of the rod; needed for the pressure on crank pins.")
    rod_inertia_deficit: f.Inertia = f.optional("Inertia of the rod less that of two masses at its ends.", 0.0)
    throws: f.Throws | None = f.optional('Angles of the throws at phi = 0, or "open"; by default those of even firing.')
    firing_order: FiringOrder | None = None
    firing_intervals: list[f.Angle] | None = f.optional(
        "Crank angles from each firing of firing_order to the next; by default each cylinder fires at its first dead "
        "centre after the one before."
    )
    fires_together: bool = f.optional("Whether cylinders are meant to fire at once; else you are asked.", False)
    gravity: bool = f.optional(
        "true: the weight of moving parts acts on the crank, with z upwards; stored work and irregularity count it.",
        False,
    )
    shafts: list[ShaftTable] = Field(default_factory=list)
    slider_cranks: list[SliderCrankTable] = Field(default_factory=list)
    single_cylinders: list[SingleCylinderTable] = Field(default_factory=list)

    @property
    def piston_mass(self) -> float:
        """Reciprocating mass without a share of the rod, at its start if it is open [kg]."""
        return Open.from_value(self.reciprocating_mass).start

    @property
    def open_masses(self) -> dict[str, Open]:
        """Open masses by their keys, which are also the names of attributes of mechanisms."""
        keys = ["reciprocating_mass", *(k.name for k in DRIVES[self.drive].keys if k.kind == "open mass")]
        return {key: mass for key in keys if isinstance(mass := getattr(self, key), Open) and mass.is_open}

    @property
    def single(self) -> dict[int, SingleCylinderTable]:
        """Table of each cylinder that differs from [engine], by its index."""
        return {number - 1: row for row in self.single_cylinders for number in row.cylinders}

    @property
    def listed_throws(self) -> list[float] | None:
        """Angles of the throws [rad]; None if they are missing or one is open."""
        angles = [angle for angle in self.throws or () if isinstance(angle, float)]
        return angles if self.throws is not None and len(angles) == len(self.throws) else None

    @property
    def listed_order(self) -> list[int] | None:
        """Firing order; None if it is missing or open."""
        return None if self.firing_order is None or self.firing_order == "open" else self.firing_order

    def value_of(self, key: str) -> Any:
        """Return the value of a key, also of one that a layout or drive adds."""
        return getattr(self, key)

    @property
    def kind(self) -> LayoutKind:
        """Kind of the engine's layout."""
        return LAYOUTS[self.layout]


def cycle_of(table: EngineTable) -> Cycle:
    """Return the working cycle."""
    with errors_at_key("engine.cycle"):
        return table.kind.cycle(_CYCLES[table.cycle])


def moving_parts(table: EngineTable, gas: bool) -> tuple[tuple[SliderCrank, ...], tuple[Throw, ...]]:
    """Return the slider-cranks and crank throws that [engine] describes; `gas` is True if gas acts on the pistons."""
    kind = table.kind
    for key in _OWNED:
        if table.value_of(key) and not kind.takes(key):
            raise Refused(f"engine.{key}", None, f"means nothing in layout '{table.layout}'", "leave it out")
    _check_pistons(table)
    drive, rule = DRIVES[table.drive], f"means nothing with drive '{table.drive}'"
    foreign_keys = [key.name for other_drive in DRIVES.values() for key in other_drive.keys if key not in drive.keys]
    refuse_keys(table, foreign_keys, "engine", rule, "leave it out")
    if kind.needs_rod and not drive.has_rod:
        remedy = "leave it out, or take another layout"
        raise Refused("engine.drive", table.drive, "has no rod, and this layout needs a master rod", remedy)
    _refuse_rod(table, table, "engine")
    bores = [part.bore for part in table.slider_cranks] or [None]
    if gas and kind.has_pistons and table.bore is None and None in bores:
        raise Refused("engine.bore", None, "is missing, but gas pressure acts on the piston", "add it")
    if kind.is_free:
        parts, masses = _free_parts(table)
        cranks = tuple(
            Throw(p.x, p.throw, (k,), masses[k] * p.crank_radius * cis(as_turn(p.throw)), p.shaft)
            for k, p in enumerate(parts)
        )
        return _sharing_chambers(table, parts, gas), cranks
    inputs, layout = _layout_input(table, gas), layout_of(table)
    throws = _throws(table, layout)
    with errors_at_key("engine.firing_order" if table.listed_order else "engine"):
        parts, cranks = kind.parts(inputs, layout, throws)
    for crank in cranks:
        for k in crank.cylinders[1:]:
            if abs(parts[k].crank_radius / parts[crank.cylinders[0]].crank_radius - 1.0) > _SAME_RADIUS:
                rule = f"gives {parts[crank.cylinders[0]].name} and {parts[k].name} two crank radii on one throw"
                raise Refused("engine.single_cylinders", None, rule, "give both the same stroke and offset")
    return _sharing_chambers(table, parts, gas), cranks


def _refuse_rod(table: EngineTable, row: f.TableModel, where: str) -> None:
    # keys of a connecting rod, of [engine] or a row of it, if the drive has none
    if not DRIVES[table.drive].has_rod:
        keys = [key for key in _OF_ROD if key in type(row).model_fields]
        refuse_keys(row, keys, where, f"means nothing with drive '{table.drive}'", "leave it out")


def _sharing_chambers(table: EngineTable, parts: Sequence[SliderCrank], gas: bool) -> tuple[SliderCrank, ...]:
    for k, part in enumerate(parts):
        for previous in parts[:k]:
            if part.faces(previous) and minimum_room(part, previous) <= 0.0:
                rule = f"leaves no chamber between {part.name} and {previous.name}, because their pins meet"
                raise Refused("engine", None, rule, "move the cranks further apart, or shorten the rods")
    with errors_at_key("engine"):
        return with_shared_chambers(parts, cycle_of(table).angle) if gas else tuple(parts)


def _check_pistons(table: EngineTable) -> None:
    if table.kind.has_pistons:
        for key in ("stroke", "reciprocating_mass"):
            values = [getattr(part, key) for part in table.slider_cranks] or [None]
            if getattr(table, key) is None and None in values:
                raise Refused(f"engine.{key}", None, "is missing", "add it")
    else:
        refuse_keys(table, _OF_PISTONS, "engine", f"means nothing in layout '{table.layout}'", "leave it out")


def layout_of(table: EngineTable) -> Layout:
    """Return the layout of [engine]: positions, banks and pins by the cylinder numbers of the file, without masses."""
    _check_pistons(table)
    with errors_at_key("engine.cylinders"):
        inputs = _layout_input(table)
        return table.kind.layout(inputs)


def _layout_input(table: EngineTable, gas: bool = False) -> LayoutInput:
    """Return the numbers that the cylinder layout needs; open masses and lead angles have their start values."""
    values = {key.name: table.value_of(key.name) for key in table.kind.keys}
    masses = [key.name for key in table.kind.keys if key.kind in ("open mass", "open lead")]
    numbers = {
        name: value if not isinstance(value, Open) else value.start if name in masses else None
        for name, value in values.items()
    }
    rods = {name: value.model_dump() for name, value in numbers.items() if isinstance(value, RodTable)}
    order = None if table.listed_order is None else tuple(table.listed_order)
    counts = cylinder_counts(table)
    if not counts:
        raise Refused("engine.cylinders", None, "is missing", "add it, or throws, or firing_order")
    first, count = counts[0]
    for key, other_count in counts:
        if other_count != count:
            rule = f"gives {counted(other_count, 'cylinder')}, but engine.{first} gives {count}"
            raise Refused(f"engine.{key}", None, rule, "make both give the same number of cylinders")
    check_order(table.listed_order, count, idle_cylinders(table))
    mechanism, rod = _mechanism(table, numbers)
    stagger = numbers.get("bank_stagger")
    if stagger and table.value_of("rotation") == REVERSED:
        # the layout is the mirror image of the engine
        numbers["bank_stagger"] = -stagger
    cycle, places = cycle_of(table), place_order(table, table.kind, count)
    intervals = _intervals(table, cycle)
    single = _single_inputs(table, count, gas)
    return LayoutInput(
        cycle, count, mechanism, numbers | rods, places, order, intervals, table.piston_mass, rod, gas, single
    )


def idle_cylinders(table: EngineTable) -> tuple[int, ...]:
    """Return the numbers of cylinders without a bore, which never fire."""
    return tuple(k + 1 for k, row in table.single.items() if row.bore == 0.0)


def _single_inputs(table: EngineTable, count: int, gas: bool) -> dict[int, LayoutInput]:
    inputs: dict[int, LayoutInput] = {}
    for j, row in enumerate(table.single_cylinders, 1):
        where, keys = f"engine.single_cylinders[{j}]", row.numbers
        for key in keys:
            if key not in table.kind.single:
                rule, remedy = f"cannot be that of a single cylinder in layout '{table.layout}'", "leave it out"
                raise Refused(f"{where}.{key}", None, rule, remedy)
        _refuse_rod(table, row, where)
        if "offset" in keys and not DRIVES[table.drive].has_rod:
            rule = f"cannot be that of a single cylinder with drive '{table.drive}'"
            raise Refused(f"{where}.offset", None, rule, "leave it out")
        for number in row.cylinders:
            if number > count or number - 1 in inputs:
                rule = f"is not among {counted(count, 'cylinder')}" if number > count else "is given twice"
                raise Refused(f"{where}.cylinders", number, rule, "name each cylinder at most once, counted from 1")
            if {"rod_ratio", "rod_length"} & keys.keys():
                keys = {"rod_ratio": None, "rod_length": None} | keys
            update = {key: keys[key] for key in keys.keys() - {"rotating_mass"}}
            if "offset" in keys and "stroke" not in keys:
                # crank and rod stay, and the stroke follows from the offset
                update |= {"stroke": 2.0 * _radius_and_rod(table)[0], "offset": 0.0}
            one = table.model_copy(
                update=update | dict.fromkeys(_OF_ORDER) | {"cylinders": count, "single_cylinders": []}
            )
            with errors_at_key(where):
                values = _layout_input(one, gas)
                part = values.mechanism.part
                part = replace(part, name=f"{part.noun} {number}", offset=keys.get("offset", part.offset))
                mechanism = replace(values.mechanism, part=part, pin_mass=keys.get("rotating_mass"))
            inputs[number - 1] = replace(values, mechanism=mechanism)
    return inputs


def _intervals(table: EngineTable, cycle: Cycle) -> tuple[float, ...]:
    """Return the firing intervals of the file [rad]; empty if it gives none."""
    intervals, where = table.firing_intervals, "engine.firing_intervals"
    if intervals is None:
        return ()
    degrees = [round(math.degrees(angle), 6) for angle in intervals]
    if table.listed_order is None or len(intervals) != len(table.listed_order):
        rule = "needs a firing_order with as many cylinders, whose firings it lies between"
        raise Refused(where, degrees, rule, "give one interval for each cylinder")
    if min(intervals) < 0.0 or abs(sum(intervals) - cycle.angle) > 1e-9:
        rule = f"adds up to {sum(degrees):g} deg" if min(intervals) >= 0.0 else "has a negative interval"
        raise Refused(
            where, degrees, rule, f"give intervals that make the {math.degrees(cycle.angle):g} deg of a cycle"
        )
    return tuple(intervals)


def cylinder_counts(table: EngineTable) -> list[tuple[str, int]]:
    """Return (key, number) for each key of [engine] that determines the number of cylinders."""
    throws, order, per_throw = table.throws, table.listed_order, table.kind.cylinders_per_throw
    counts = [("cylinders", table.cylinders)] if table.cylinders is not None else []
    if order == []:
        raise Refused("engine.firing_order", [], "names no cylinder", "name every cylinder once")
    if throws == []:
        raise Refused("engine.throws", [], "names no throw", "give the angle of each throw, as in [0, 180, 180, 0]")
    counts += [("firing_order", len(order) + len({*idle_cylinders(table)} - {*order}))] if order is not None else []
    return counts + ([("throws", len(throws) * per_throw)] if isinstance(throws, list) else [])


def check_order(order: Sequence[int] | None, count: int, idle: Sequence[int] = ()) -> None:
    """Raise `Refused` for a firing order that is not a permutation of the cylinders without the idle ones."""
    firing = [number for number in range(1, count + 1) if number not in idle]
    if order is not None and sorted(order) != firing:
        rule = f"is no permutation of {', '.join(map(str, firing))}" if idle else f"is no permutation of 1 to {count}"
        remedy = "name every cylinder with a bore once" if idle else "name every cylinder once"
        raise Refused("engine.firing_order", list(order), rule, remedy)


def _throws(table: EngineTable, layout: Layout) -> tuple[float, ...]:
    if table.listed_throws is not None:
        return tuple(table.listed_throws)
    if layout.throws is not None:
        return layout.throws
    if table.listed_order is None:
        if len(layout.throw_positions) == 1:
            return (layout.banks[0] - layout.pin_offsets[0],)
        raise Refused("engine.throws", None, "is missing", "add it, or firing_order for even firing")
    cycle = cycle_of(table)
    with errors_at_key("engine.firing_order"):
        return even_throws(cycle, layout, table.listed_order, _intervals(table, cycle))


def _mechanism(table: EngineTable, values: Mapping[str, Any] | None = None) -> tuple[Mechanism, Rod | None]:
    """Return masses and lengths of one cylinder, and its rod as a rigid body; None without [engine.rod]."""
    big_end = None if table.big_end is None else table.big_end.size
    if not table.kind.has_pistons:
        return table.kind.mechanism(values or {}, rotating_mass=table.rotating_mass, big_end=big_end), None
    radius, rod_length = _radius_and_rod(table)
    rod = None
    if table.rod is not None:
        if math.isinf(rod_length):
            raise Refused("engine.rod", None, "has no effect in a Scotch yoke (rod_ratio = 0)", "leave it out")
        with errors_at_key("engine.rod"):
            rod = rod_of("rod", table.rod.model_dump(), rod_length, "crank pin")
        if table.rod_inertia_deficit != 0.0:
            raise Refused(
                "engine.rod_inertia_deficit", None, "is given here and also follows from [engine.rod]", "keep one"
            )
    drive = DRIVES[table.drive]
    part = SliderCrank(
        "cylinder 1", 0.0, radius, rod_length, table.piston_mass + (rod.reciprocating_mass if rod else 0.0),
        offset=table.offset if drive.has_rod else 0.0, rotating_mass=rod.rotating_mass if rod else 0.0,
        rod_inertia_deficit=rod.inertia_deficit if rod else table.rod_inertia_deficit, bore=table.bore, big_end=big_end,
    )  # fmt: skip
    return Mechanism(drive.mechanism(part, _sizes(table)), table.rotating_mass), rod


def _sizes(table: EngineTable) -> Sizes:
    options = {key.name: getattr(table, key.name) for key in DRIVES[table.drive].keys}
    values = {name: value.model_dump() if isinstance(value, RodTable) else value for name, value in options.items()}
    values = {name: value.start if isinstance(value, Open) else value for name, value in values.items()}
    length = None if table.rod_length is None else Open.from_value(table.rod_length).start
    return Sizes(table.stroke or 0.0, table.offset, length, table.rod_ratio, values)


def _radius_and_rod(table: EngineTable) -> tuple[float, float]:
    """Return crank radius and rod length [m] from stroke, offset and one of rod ratio and rod length."""
    drive, sizes = DRIVES[table.drive], _sizes(table)
    ratio, length = sizes.rod_ratio, sizes.rod_length
    if drive.has_rod:
        require_one_of(table, "engine", "rod_ratio", "rod_length", value=ratio)
    with errors_at_key("engine.offset"):
        radius = drive.radius(sizes)
    rod = length if length is not None else (radius / ratio if ratio else math.inf)
    turning = (radius + abs(table.offset)) / rod
    if turning >= 1.0:
        rule = f"blocks the crank: (crank radius + |offset|) / rod length = {turning:.4g} must be under 1"
        if length is not None:
            raise Refused("engine.rod_length", units.quantity_text(rod, "m"), rule, "lengthen the rod")
        is_length = ratio is not None and ratio >= 1.0
        advice = "give crank radius over rod length, for example 0.27; for a length write rod_length"
        raise Refused("engine.rod_ratio", f"{ratio:g}", rule, advice if is_length else "lengthen the rod")
    return radius, rod


def _free_parts(table: EngineTable) -> tuple[tuple[SliderCrank, ...], list[float]]:
    # slider-cranks, and the rotating mass without rods at the pin of each [kg]
    if not table.slider_cranks:
        raise Refused("engine.slider_cranks", None, "is missing", "list at least one [[engine.slider_cranks]]")
    shafts = {"crankshaft": CRANKSHAFT}
    for k, shaft in enumerate(table.shafts):
        where = f"engine.shafts[{k + 1}]"
        if shaft.name in shafts:
            raise Refused(f"{where}.name", shaft.name, "is already the name of another shaft", "give each its own name")
        with errors_at_key(where):
            shafts[shaft.name] = Shaft(shaft.name, shaft.ratio, *shaft.position)
    # slider-cranks on one throw share the rotating mass of the throw
    pins = [(part.shaft, part.x, direction(part.throw)) for part in table.slider_cranks if part.rotating_mass is None]
    parts, masses = [], []
    for k, part in enumerate(table.slider_cranks, 1):
        where = f"engine.slider_cranks[{k}]"
        if part.shaft not in shafts:
            rule = "is not the name of a shaft of this engine"
            raise Refused(f"{where}.shaft", part.shaft, rule, nearest(part.shaft, list(shafts)))
        _refuse_rod(table, part, where)
        overrides = {key: getattr(part, key) for key in _INHERITED if getattr(part, key) is not None}
        if part.rod_ratio is not None or part.rod_length is not None:
            overrides |= {"rod_ratio": part.rod_ratio, "rod_length": part.rod_length}
        carrying_shaft, rotating = shafts[part.shaft], part.rotating_mass
        if rotating is None:
            rotating = table.rotating_mass / pins.count((part.shaft, part.x, direction(part.throw)))
        masses.append(rotating)
        with errors_at_key(where):
            mechanism, _ = _mechanism(table.model_copy(update=overrides))
            centre = part.bank_angle - part.throw + mechanism.part.fires_at
            first = centre / carrying_shaft.ratio % (math.tau / abs(carrying_shaft.ratio))
            fires = part.firing_angle if part.firing_angle is not None else first
            parts.append(mechanism.cylinder(k, part.x, part.throw, part.bank_angle, fires, carrying_shaft))
    parts, leads = _in_order(table, parts), {shaft.name: Open.from_value(shaft.lead).start for shaft in table.shafts}
    return parts_with_leads(parts, leads), masses


def _in_order(table: EngineTable, parts: list[SliderCrank]) -> list[SliderCrank]:
    # a firing order counts the slider-cranks of a free list as they stand
    if table.listed_order is None:
        return parts
    firing = [k for k, part in enumerate(parts, 1) if part.bore != 0.0]
    if sorted(table.listed_order) != firing:
        rule = f"does not name cylinders {', '.join(map(str, firing))} once each"
        raise Refused("engine.firing_order", table.listed_order, rule, "name every piston with a bore once")
    for k, row in enumerate(table.slider_cranks, 1):
        if row.firing_angle is not None:
            rule = "is given twice, also by engine.firing_order"
            raise Refused(f"engine.slider_cranks[{k}].firing_angle", None, rule, "leave one of the two out")
    cycle, centres = cycle_of(table), [as_turn(part.firing_angle) for part in parts]
    with errors_at_key("engine.firing_order"):
        angles = angles_in_order(cycle, centres, table.listed_order, _intervals(table, cycle))
    return [replace(part, firing_angle=angle) for part, angle in zip(parts, angles, strict=True)]


def piston_masses(
    table: EngineTable, parts: Sequence[SliderCrank], weights: Sequence[CounterweightTable]
) -> list[Decision]:
    """Return decisions about open masses: common masses of [engine], and masses of single slider-cranks.

    Counterweights may not have balance factors if a mass is open.
    """
    second = getattr(table, _SECOND)
    decisions = list[Decision]()

    def decide(name: str, mass: Open, names: Sequence[str], key: str = _RECIPROCATING) -> None:
        decisions.extend(mass.decisions(name, "kg", *(NumberDrive(Kind.PISTON, (part, key)) for part in names)))

    count = 1 if table.kind.is_free else cylinder_counts(table)[0][1]
    rows: Sequence[Any] = table.slider_cranks or [table.single.get(k % count) for k in range(len(parts))]
    for key, mass in table.open_masses.items():
        part_masses = [getattr(row, key, None) for row in rows]
        if second is not None and key == _RECIPROCATING:
            part_masses = [
                m if part.shaft == CRANKSHAFT else second for m, part in zip(part_masses, parts, strict=True)
            ]
        names = [part.name for part, mass_of in zip(parts, part_masses, strict=True) if mass_of is None]
        decide(key.replace("_", " "), mass, names, key)
    if isinstance(second, Open):
        decide("second reciprocating mass", second, [part.name for part in parts if part.shaft != CRANKSHAFT])
    for part, row in zip(parts, table.slider_cranks, strict=False):
        if isinstance(row.reciprocating_mass, Open):
            decide(f"reciprocating mass of {part.name}", row.reciprocating_mass, [part.name])
    for single in table.single_cylinders:
        if isinstance(single.reciprocating_mass, Open):
            pistons = [k for k in range(len(parts)) if k % count + 1 in single.cylinders]
            names = [parts[k].name for k in pistons if second is None or parts[k].shaft == CRANKSHAFT]
            word = "cylinders" if single.cylinders[1:] else "cylinder"
            name = f"reciprocating mass of {word} {', '.join(map(str, single.cylinders))}"
            decide(name, single.reciprocating_mass, names)
    if decisions:
        check_factors(weights, f"counts the {decisions[0].name}, which is open")
    return decisions


def leads_of(table: EngineTable) -> list[Decision]:
    """Return one decision for each shaft with an open lead angle."""
    lead, ports = table.value_of("crank_lead"), table.value_of("port_arc")
    # the layout checks the start only
    if isinstance(lead, Open) and ports is not None and max(map(abs, lead.bounds)) >= ports:
        rule = f"may exceed the angle for which the ports are open, {units.quantity_text(ports, 'rad')}"
        raise Refused("engine.crank_lead", None, rule, "narrow its bounds")
    leads = [(f"{shaft.name}.lead", shaft.name, shaft.lead) for shaft in table.shafts]
    return [
        decision
        for name, shaft, lead_angle in (*leads, ("crank lead", _OPPOSED, lead))
        for decision in Open.from_value(lead_angle).decisions(name, "rad", NumberDrive(Kind.LEAD, shaft))
    ]
