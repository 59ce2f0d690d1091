"""From the tables of a problem file to slider-cranks, gas, mounts and operating points."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from laufruhe import units
from laufruhe.files.complaints import Refused, blamed_on, nearest
from laufruhe.files.engine_table import EngineTable, RodTable, SliderCrankTable
from laufruhe.files.fields import Open
from laufruhe.files.file_models import (
    OperatingPointTable,
    ProblemFile,
    SeiligerTable,
    TraceTable,
    WiebeTable,
)
from laufruhe.files.read_trace import trace_of
from laufruhe.machine import CRANKSHAFT, Cycle, OperatingPoint, PressureTrace, Rod, Shaft, SliderCrank
from laufruhe.machine.gas import GasModel, Seiliger, Wiebe
from laufruhe.machine.layouts import LAYOUTS, Asked, Layout, Mechanism, Throw, even_throws, rod_of
from laufruhe.machine.slider_crank import radius_for_stroke
from laufruhe.physics.seiliger_cycle import motored_cycle

_CYCLES = {str(cycle): cycle for cycle in Cycle}
_OWNED = tuple(dict.fromkeys(key for k in LAYOUTS.values() for key in (*(own.name for own in k.keys), *k.lists)))


def cycle_of(table: EngineTable) -> Cycle:
    """Two- or four-stroke."""
    return _CYCLES[table.cycle]


def moving_parts(table: EngineTable, gas: bool) -> tuple[tuple[SliderCrank, ...], tuple[Throw, ...]]:
    """Slider-cranks of [engine], and the throws that they work on."""
    kind = LAYOUTS[table.layout]
    for key in _OWNED:
        if getattr(table, key) and not kind.takes(key):
            raise Refused(f"engine.{key}", None, f"means nothing in layout '{table.layout}'", "leave it out")
    bores = [part.bore for part in table.slider_cranks] or [None]
    if gas and table.bore is None and None in bores:
        raise Refused("engine.bore", None, "is missing, and gas acts on it", "add it")
    if kind.is_free:
        parts = _free_parts(table)
        return parts, tuple(Throw(p.x, p.throw, (k,)) for k, p in enumerate(parts) if p.shaft == CRANKSHAFT)
    asked, layout = _asked(table, gas), layout_of(table)
    throws = _throws(table, layout)
    with blamed_on("engine.firing_order" if table.given_order else "engine"):
        return kind.parts(asked, layout, throws)


def layout_of(table: EngineTable) -> Layout:
    """Places, banks and pins, without masses."""
    with blamed_on("engine.cylinders"):
        return LAYOUTS[table.layout].place(_asked(table))


def _asked(table: EngineTable, gas: bool = False) -> Asked:
    """What [engine] says to its layout."""
    given = {key.name: table.own(key.name) for key in LAYOUTS[table.layout].keys}
    own = {name: None if isinstance(value, Open) else value for name, value in given.items()}
    rods = {name: value.model_dump() for name, value in own.items() if isinstance(value, RodTable)}
    order = None if table.given_order is None else tuple(table.given_order)
    count, mechanism = _cylinders(table), _mechanism(table)
    rod = _rod(table, mechanism.rod_length)
    return Asked(cycle_of(table), count, mechanism, own | rods, order, table.reciprocating_mass, rod, gas)


def _cylinders(table: EngineTable) -> int:
    per_throw = LAYOUTS[table.layout].cylinders_per_throw
    told = {
        "engine.cylinders": table.cylinders,
        "engine.firing_order": len(table.given_order) if table.given_order is not None else None,
        "engine.throws": len(table.given_throws) * per_throw if table.given_throws is not None else None,
    }
    given = {key: count for key, count in told.items() if count is not None}
    if not given:
        raise Refused("engine.cylinders", None, "is missing", "add it, or throws, or firing_order")
    count = next(iter(given.values()))
    for key, other in given.items():
        if other != count:
            raise Refused(
                key, None, f"makes {other} cylinder(s), but {next(iter(given))} makes {count}", "let them agree"
            )
    order = table.given_order
    if order is not None and sorted(order) != list(range(1, count + 1)):
        raise Refused("engine.firing_order", order, f"is no permutation of 1 to {count}", "name every cylinder once")
    return count


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


def _mechanism(table: EngineTable) -> Mechanism:
    radius, rod_length = _radius_and_rod(table)
    rod = _rod(table, rod_length)
    if rod is not None and table.rod_inertia_deficit != 0.0:
        raise Refused("engine.rod_inertia_deficit", None, "is given twice, here and by [engine.rod]", "keep one")
    return Mechanism(
        crank_radius=radius,
        rod_length=rod_length,
        reciprocating_mass=table.reciprocating_mass + (rod.reciprocating_mass if rod else 0.0),
        rotating_mass=table.rotating_mass,
        rod_rotating_mass=rod.rotating_mass if rod else 0.0,
        rod_inertia_deficit=rod.inertia_deficit if rod else table.rod_inertia_deficit,
        offset=table.offset,
        bore=table.bore,
    )


def _rod(table: EngineTable, length: float) -> Rod | None:
    if table.rod is None:
        return None
    if math.isinf(length):
        raise Refused("engine.rod", None, "means nothing in a Scotch yoke (rod_ratio = 0)", "leave it out")
    with blamed_on("engine.rod"):
        return rod_of("rod", table.rod.model_dump(), length, "crank pin")


def _radius_and_rod(table: EngineTable) -> tuple[float, float]:
    """Crank radius and rod length [m] from stroke, offset and one of rod ratio and rod length."""
    ratio, length = table.rod_ratio, table.rod_length
    if (ratio is None) == (length is None):
        state = "is missing" if ratio is None else "is given twice, also as rod_length"
        raise Refused("engine.rod_ratio", ratio, state, "give rod_ratio or rod_length, one of them")
    with blamed_on("engine.offset"):
        radius = radius_for_stroke(table.stroke, table.offset, rod_length=length, rod_ratio=ratio or 0.0)
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
        if shaft.name in shafts:
            rule = "is the name of another shaft"
            raise Refused(f"engine.shafts[{k + 1}].name", shaft.name, rule, "give each its own name")
        with blamed_on(f"engine.shafts[{k + 1}]"):
            shafts[shaft.name] = Shaft(shaft.name, shaft.ratio, *shaft.position)
    return tuple(_free_part(table, part, k, shafts) for k, part in enumerate(table.slider_cranks))


def _free_part(table: EngineTable, part: SliderCrankTable, k: int, shafts: dict[str, Shaft]) -> SliderCrank:
    where = f"engine.slider_cranks[{k + 1}]"
    if part.shaft not in shafts:
        raise Refused(f"{where}.shaft", part.shaft, "is no shaft of this engine", nearest(part.shaft, list(shafts)))
    own = part.rod_ratio is not None or part.rod_length is not None
    merged = table.model_copy(
        update={
            **{
                key: value
                for key in ("stroke", "bore", "offset", "reciprocating_mass", "rod_inertia_deficit")
                if (value := getattr(part, key)) is not None
            },
            **({"rod_ratio": part.rod_ratio, "rod_length": part.rod_length} if own else {}),
        }
    )
    shaft = shafts[part.shaft]
    with blamed_on(where):
        mechanism = _mechanism(merged)
        rotating = part.rotating_mass if part.rotating_mass is not None else table.rotating_mass
        first = (part.bank_angle - part.throw) / shaft.ratio % (math.tau / abs(shaft.ratio))
        fires = part.firing_angle if part.firing_angle is not None else first
        return mechanism.cylinder(k + 1, part.x, part.throw, part.bank_angle, fires, rotating, shaft)


def all_different(things: list[Any], where: str, rule: str) -> None:
    """Refuse two of the same."""
    for k, thing in enumerate(things):
        if thing in things[:k]:
            raise Refused(f"{where}[{k + 1}]", thing, f"two {rule}", "move or rename one")


def operating_points(file: ProblemFile, folder: Path) -> tuple[OperatingPoint, ...]:
    """Speeds and loads."""
    gas, cycle = gas_of(file, folder), cycle_of(file.engine)
    points = []
    for k, table in enumerate(file.operating_points):
        speeds = _speeds(table, file.engine.stroke, f"operating_points[{k + 1}]")
        for speed in speeds:
            at = units.shown(speed, "rad/s", 6)
            name = (f"{table.name} {at}" if len(speeds) > 1 else table.name) if table.name else at
            points.append(OperatingPoint(name, speed, _loaded(gas, table, cycle, k), table.weight / len(speeds)))
    all_different([p.name for p in points], "operating_points", "operating points have one name")
    return tuple(points)


def _speeds(table: OperatingPointTable, stroke: float, where: str) -> tuple[float, ...]:
    """One speed, or equal steps over a range that share the weight."""
    first = _speed(table, stroke, where)
    if table.up_to is None and table.steps is None:
        return (first,)
    if table.up_to is None or table.steps is None:
        missing = "up_to" if table.up_to is None else "steps"
        raise Refused(f"{where}.{missing}", None, "is missing", "give up_to and steps for a range, or neither")
    if table.up_to <= first:
        value = units.shown(table.up_to, "rad/s")
        raise Refused(f"{where}.up_to", value, "does not lie above the first speed", "give a higher one")
    return tuple(first + (table.up_to - first) * k / (table.steps - 1) for k in range(table.steps))


def _speed(table: OperatingPointTable, stroke: float, where: str) -> float:
    if (table.speed is None) == (table.mean_piston_speed is None):
        state = "is missing" if table.speed is None else "is given twice, also as mean_piston_speed"
        raise Refused(f"{where}.speed", None, state, "give speed or mean_piston_speed, one of them")
    if table.speed is not None:
        return table.speed
    # c_m = 2 s n (Roetscher eq. 290)
    return math.pi * float(table.mean_piston_speed or 0.0) / stroke


def _loaded(gas: GasModel | None, table: OperatingPointTable, cycle: Cycle, k: int) -> GasModel | None:
    where = f"operating_points[{k + 1}]"
    if table.motored and table.imep is not None:
        rule = "is given to a motored engine, which burns nothing"
        raise Refused(f"{where}.imep", None, rule, "leave imep or motored out")
    if not table.gas:
        return None
    if not table.motored and table.imep is None:
        return gas
    if gas is None or isinstance(gas, PressureTrace):
        key = "motored" if table.motored else "imep"
        raise Refused(f"{where}.{key}", None, "needs [gas] with model seiliger or wiebe", "give that, or leave it out")
    return motored_cycle(gas, cycle) if table.imep is None else replace(gas, imep=table.imep)


def gas_of(file: ProblemFile, folder: Path) -> GasModel | None:
    """The working gas of [gas]."""
    table = file.gas
    if table is None:
        return None
    with blamed_on("gas"):
        if isinstance(table, TraceTable):
            return trace_of(table, folder)
        given = {key: value for key, value in table.model_dump().items() if value is not None and key != "model"}
        kinds: dict[type, type[Seiliger] | type[Wiebe]] = {SeiligerTable: Seiliger, WiebeTable: Wiebe}
        return kinds[type(table)](**given)
