"""[[electric_machines]] of a problem file (T16)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Annotated, Any, Literal, TypeAlias

from laufruhe.extensions.electric_torque.channels import ELECTRIC_TORQUE as CHANNEL
from laufruhe.extensions.electric_torque.machine import (
    ELECTRIC_TORQUE,
    ElectricMachine,
    ElectricMachines,
    Harmonic,
    TorqueDrive,
)
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, nearest, require_distinct
from laufruhe.files.fields import Name, Number, Open, Table
from laufruhe.files.nested import Place
from laufruhe.files.problem_file import ExtensionContext, Key
from laufruhe.files.rotors import sector_of
from laufruhe.machine import CRANKSHAFT
from laufruhe.numerics.exact_angles import as_turn, cis
from laufruhe.numerics.norms import NORMS
from laufruhe.problem.decision import Decision
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Interval, Sector, Set

Torque: TypeAlias = Annotated[float, Number("N m", above=0.0)]
Order: TypeAlias = Annotated[float, Number("", above=0.0, maximum=60.0, closed="is counted in turns of the crank")]
OpenTorque: TypeAlias = Annotated[float | Open, Number("N m", minimum=0.0, openable=True)]
FUNDAMENTAL = 4.0 / math.pi
"""Largest amplitude of one order over the largest torque: that of a torque which switches between its bounds."""


class HarmonicTable(Table):
    """Torque of one order of the crank."""

    order: Order = f.required("Order of the crank.")
    torque: OpenTorque = f.required("Amplitude.")
    angle: f.OpenAngle = f.optional("Phase lead: the torque is that of cos(order x crank angle + angle).", 0.0)
    operating_point: str | None = f.optional("Operating point at which it acts; all by default.")


class ElectricMachineTable(Table):
    """A motor or generator whose torque follows the crank angle."""

    name: Name
    shaft: str = f.optional("Crankshaft, or the balancer shaft that it drives.", CRANKSHAFT.name)
    stator: Literal["block", "ground"] = f.optional(
        "What takes the reaction: the engine block, or another body.", "block"
    )
    disc: str | None = f.optional("Disc of [torsion] that it drives; that of the load by default.")
    mean_torque: f.Moment = f.optional("Mean torque; negative for a generator.", 0.0)
    orders: list[Order] = f.optional("Orders whose torque and angle are decided at each operating point.", [])
    harmonics: list[HarmonicTable] = f.optional("Torque of single orders, fixed or open.", [])
    max_torque: Torque | None = f.optional("Largest torque at any crank angle, the mean torque included.")
    torque_constant: Annotated[float, Number("N m/A", above=0.0)] | None = f.optional("Torque over current.")
    max_current: Annotated[float, Number("A", above=0.0)] | None = f.optional("Largest current at any crank angle.")
    resistance: Annotated[float, Number("ohm", above=0.0)] | None = f.optional(
        "Copper loss over the square of the current."
    )
    max_loss: Annotated[float, Number("W", above=0.0)] | None = f.optional(
        "Largest copper loss, as a mean over the cycle at each operating point."
    )


def _read(tables: list[ElectricMachineTable], problem: Problem, context: ExtensionContext) -> Problem:
    require_distinct([table.name for table in tables], "electric_machines", "electric machines have one name")
    if getattr(context.file, "run_up", None) is not None:
        rule = "acts at a steady speed, and [run_up] changes the speed"
        raise Refused("electric_machines", None, rule, "remove one of them")
    machines, decisions, limits = list[ElectricMachine](), list[Decision](), list[Limit]()
    for k, table in enumerate(tables, 1):
        where = f"electric_machines[{k}]"
        if table.disc is not None and getattr(context.file, "torsion", None) is None:
            raise Refused(f"{where}.disc", table.disc, "is a disc of [torsion], which is missing", "leave it out")
        largest = _largest_torque(table, where)
        harmonics, of_orders = _harmonics(table, problem, largest, where)
        ratio, is_on_block = _ratio(table, problem, where), table.stator == "block"
        machine = ElectricMachine(
            table.name, ratio, is_on_block, table.disc or "", table.mean_torque, harmonics, table.torque_constant,
            table.resistance,
        )  # fmt: skip
        machines.append(machine)
        decisions += of_orders
        limits += _limits(table, problem, largest)
    engine = problem.engine.with_extra(ElectricMachines(tuple(machines)))
    return replace(
        problem, engine=engine, decisions=(*decisions, *problem.decisions), limits=(*problem.limits, *limits)
    )


def _ratio(table: ElectricMachineTable, problem: Problem, where: str) -> float:
    shafts = {CRANKSHAFT.name: CRANKSHAFT} | {shaft.name: shaft for shaft in problem.engine.shafts}
    if table.shaft not in shafts:
        raise Refused(f"{where}.shaft", table.shaft, "is no shaft of this engine", nearest(table.shaft, [*shafts]))
    return shafts[table.shaft].ratio


def _largest_torque(table: ElectricMachineTable, where: str) -> float:
    for key in ("max_current", "resistance", "max_loss"):
        if getattr(table, key) is not None and table.torque_constant is None:
            raise Refused(f"{where}.{key}", None, "needs the torque over the current", "add torque_constant")
    if table.max_loss is not None and table.resistance is None:
        raise Refused(f"{where}.max_loss", None, "needs the resistance that makes the loss", "add resistance")
    by_current = (table.max_current or math.inf) * (table.torque_constant or math.inf)
    return min(table.max_torque or math.inf, by_current)


def _harmonics(
    table: ElectricMachineTable, problem: Problem, largest: float, where: str
) -> tuple[tuple[Harmonic, ...], list[Decision]]:
    """Return the torques of all orders, and the decisions about the open ones."""
    points = [point.name for point in problem.points]
    harmonics, decisions = list[Harmonic](), list[Decision]()

    def add(order: Fraction, start: complex, allowed: Set | None, point: str | None) -> None:
        if any(one.order == order and (None in (one.point, point) or one.point == point) for one in harmonics):
            rule = f"has order {float(order):g} twice at one operating point"
            raise Refused(where, None, rule, "give each order once")
        if allowed is not None:
            name = f"{table.name}.order {float(order):g}{f' at {point}' if point is not None else ''}.torque"
            drive = TorqueDrive(ELECTRIC_TORQUE, (table.name, len(harmonics)))
            decisions.append(Decision(name, "N m", allowed, start, (drive,)))
        harmonics.append(Harmonic(order, start, point))

    for j, row in enumerate(table.harmonics, 1):
        key = f"{where}.harmonics[{j}]"
        if row.operating_point is not None and row.operating_point not in points:
            remedy = nearest(row.operating_point, points)
            raise Refused(f"{key}.operating_point", row.operating_point, "is no operating point", remedy)
        size, angle = Open.from_value(row.torque), Open.from_value(row.angle)
        start = size.start * cis(as_turn(angle.start))
        fixed = not size.is_open and not angle.is_open
        allowed: Set = sector_of("torque", size, angle, key) if angle.is_open else Interval(*size.bounds, angle.lower)
        add(_order(row.order, problem, f"{key}.order"), start, None if fixed else allowed, row.operating_point)
    if table.orders and largest == math.inf:
        raise Refused(f"{where}.orders", None, "needs a largest torque", "add max_torque, or max_current")
    for order in table.orders:
        for point in points if len(points) > 1 else [None]:
            add(_order(order, problem, f"{where}.orders"), 0j, Sector(FUNDAMENTAL * largest), point)
    return tuple(harmonics), decisions


def _order(value: float, problem: Problem, where: str) -> Fraction:
    cycle = problem.engine.cycle
    multiple = round(value * cycle.turns)
    if multiple == 0 or abs(multiple - value * cycle.turns) > 1e-9:
        turns = "an integer" if cycle.turns == 1 else "an integer or half an integer"
        rule = f"does not repeat within the {cycle} cycle"
        raise Refused(where, f"{value:g}", rule, f"give {turns}, such as {max(round(value), 1)}")
    return multiple * cycle.base_order


def _limits(table: ElectricMachineTable, problem: Problem, largest: float) -> Iterator[Limit]:
    """Yield the limits of the largest torque, and of the copper loss R (T_rms / k)^2 at each operating point."""
    if largest < math.inf:
        key = "max_torque" if largest == table.max_torque else "max_current"
        yield Limit(f"{table.name}.{key}", Measure(CHANNEL, NORMS["maximum"], at=(table.name,)), largest)
    if table.max_loss is not None and table.resistance is not None and table.torque_constant is not None:
        rms = table.torque_constant * math.sqrt(table.max_loss / table.resistance)
        for point in problem.points:
            place = f" at {point.name}" if len(problem.points) > 1 else ""
            measure = Measure(CHANNEL, NORMS["rms"], at=(table.name,), points=(point.name,))
            yield Limit(f"{table.name}.max_loss{place}", measure, rms)


def _numbers(tables: list[Mapping[str, Any]]) -> Iterator[tuple[str, Place]]:
    for k, table in enumerate(tables):
        for j, row in enumerate(table.get("harmonics", ())):
            place = f" at {row['operating_point']}" if row.get("operating_point") is not None else ""
            yield f"{table.get('name')}.order {row.get('order'):g}{place}", ("electric_machines", k, "harmonics", j)


KEY = Key("electric_machines", list[ElectricMachineTable], _read, _numbers)
