"""[phasing] of a problem file, and open throws, firing orders, bank angles and shafts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from laufruhe import units
from laufruhe.errors import ModelError
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused
from laufruhe.files.engine import EngineTable, check_order, cycle_of, cylinder_counts, idle_cylinders, layout_of
from laufruhe.files.fields import Open, Table
from laufruhe.files.rotors import BalancerShaftTable
from laufruhe.machine import Cycle
from laufruhe.machine.firing import (
    MAX_ORDERS,
    NoEvenStarError,
    even_patterns,
    firing_lattice,
    firing_turns,
    intervals_of,
    lap_orders,
)
from laufruhe.machine.layouts import LAYOUTS, Layout, even_throws
from laufruhe.problem.decision import without_rotors
from laufruhe.problem.phasing import SOONEST, Candidate, Intervals, OrderCriterion, ShaftChoice, bounded_stars
from laufruhe.problem.problem import Phasing, Problem

Assemble = Callable[[EngineTable, bool], Problem]
"""Function that returns the problem of another [engine], without gas if its second argument is True."""
_OPENABLE = ("throws", "firing_order", "bank_angle", "split_pin_angle")


class IntervalsTable(Table):
    """Bounds on the crank angle from each firing to the next."""

    closed: ClassVar[str] = "is a limit of the search"

    min: f.Angle | None = None
    max: f.Angle | None = None
    largest_deviation: f.Angle | None = f.optional("Largest deviation of an interval from equal firing.")


class PhasingTable(Table):
    """Search of open throws, firing orders and shafts."""

    closed: ClassVar[str] = "is a limit or a setting of the search"

    phases: Annotated[int, Field(ge=1, le=96)] | None = f.optional(
        "Equal steps of a turn on which throws may stand; by default those of even firing."
    )
    intervals: IntervalsTable | None = f.optional("Bounds on firing intervals; even firing by default.")
    best: Annotated[int, Field(ge=1, le=200)] = f.optional("Number of crank stars in the ranking.", 10)
    rank_orders_by: list[Literal["roll moment", "neighbours", "longest gap"]] = Field(
        default=["neighbours", "longest gap"],
        min_length=1,
        description="What ranks the firing orders of a star; the first counts most.",
    )
    most_shafts: Annotated[int, Field(ge=0, le=48)] | None = f.optional(
        "Largest number of optional balancer shafts that are built."
    )
    most_shaft_mass: f.Mass | None = f.optional("Largest mass of the optional shafts that are built.")
    time_limit: f.Time = f.optional("Time after which the search ends with the best design so far.", 600.0)
    method: Literal["auto", "search", "program", "enumeration"] = "auto"


def is_open(engine: EngineTable, shafts: Sequence[BalancerShaftTable]) -> bool:
    """Return True if throws, firing order, bank angles or shafts are open."""
    return any(_has_open(engine.value_of(key)) for key in _OPENABLE) or any(shaft.optional for shaft in shafts)


def open_phasing(
    engine: EngineTable, shafts: Sequence[BalancerShaftTable], table: PhasingTable | None, assemble: Assemble
) -> Problem:
    """Return the problem with open phasing; its engine is the first candidate that the phasing allows."""
    table = table or PhasingTable()
    for key in _OPENABLE:
        if key not in engine.kind.openable and _has_open(engine.value_of(key)):
            allowed = " or ".join(name for name, other in LAYOUTS.items() if key in other.openable)
            raise Refused(f"engine.{key}", None, f"cannot be open in layout '{engine.layout}'", f"use layout {allowed}")
    if engine.firing_intervals is not None:
        rule, remedy = "cannot stand beside open throws, orders, angles or shafts", "give intervals in [phasing]"
        raise Refused("engine.firing_intervals", None, rule, remedy)
    idle, open_keys = idle_cylinders(engine), [key for key in _OPENABLE if _has_open(engine.value_of(key))]
    if idle and open_keys:
        rule = f"cannot be open: cylinder {idle[0]} has no bore and never fires, so even firing leaves its throw open"
        raise Refused(f"engine.{open_keys[0]}", None, rule, 'fix it, or list the pistons in layout "parts"')
    counts = [count for _, count in cylinder_counts(engine)]
    counts += [len(engine.slider_cranks)] if engine.kind.is_free else []
    if not counts:
        raise Refused(
            "engine.cylinders", None, "is missing, and open throws do not determine the number of cylinders", "add it"
        )
    cycle, count, bounds = cycle_of(engine), counts[0], None
    if isinstance(engine.throws, list) and engine.listed_throws is None:
        bounds = tuple(Open.from_value(angle).bounds for angle in engine.throws)
    # some layouts fix their throws
    fixed = None if engine.kind.is_free or engine.kind.takes("throws") else layout_of(_closed(engine, count))
    throws = fixed.throws if fixed else engine.listed_throws

    def problem_of(candidate: Candidate) -> Problem:
        closed_engine = engine
        if engine.kind.openable:
            order = None if candidate.firing_order is None else list(candidate.firing_order)
            throws = list(candidate.throws) if engine.kind.takes("throws") else None
            bank, split = candidate.bank_angle, candidate.split_pin
            closed_engine = _closed(engine, count, bank, split, throws=throws, firing_order=order)
        try:
            return without_shafts(assemble(closed_engine, candidate.without_gas), candidate.left_out)
        except Refused as refusal:
            # an impossible candidate of a search is not a fault of the file
            raise ModelError(str(refusal)) from refusal

    phasing = Phasing(
        cycle=cycle,
        layout=lambda bank, split: layout_of(_closed(engine, count, bank, split)),
        cylinders=count,
        throws=None if throws is None else tuple(throws),
        throw_bounds=bounds,
        firing_order=_order_of(engine, cycle, count),
        bank=_bounds(engine.value_of("bank_angle")),
        split=_bounds(engine.value_of("split_pin_angle")),
        intervals=_intervals(table.intervals, engine, cycle, count, fixed.spread if fixed else 0.0),
        problem_of=problem_of,
        steps=table.phases,
        shafts=_shaft_choice(shafts, table),
        best=table.best,
        criteria=tuple(OrderCriterion(name) for name in table.rank_orders_by),
        time_limit=table.time_limit,
        lists_all=table.method == "enumeration",
    )
    _check(phasing, engine)
    try:
        problem = replace(phasing.problem_of(_first(phasing)), phasing=phasing)
    except ModelError as error:
        raise (error.__cause__ if isinstance(error.__cause__, Refused) else error) from None
    # the smooth program of uneven throws needs an even speed (S19)
    if phasing.continuous and problem.fidelity.has_uneven_speed:
        inertia = f"{problem.fidelity.crank_inertia:g} kg m^2"
        rule = "makes the crank speed uneven, and uneven throws are optimised at even speed only"
        raise Refused("fidelity.crank_inertia", inertia, rule, "remove this key, or fix the throws")
    if engine.kind.fires_evenly and problem.depends_on_firing_order:
        rule = f"cannot be open in layout '{engine.layout}' while loads depend on the firing order"
        raise Refused("engine.throws", None, rule, "fix the throws, or measure loads on the block of equal gas")
    return problem


def _has_open(value: object) -> bool:
    # a key of [engine] may be open, or an entry of its list
    return any(part == "open" or isinstance(part, Open) for part in (value if isinstance(value, list) else [value]))


def _bounds(value: float | Open | None) -> tuple[float, float] | None:
    return None if value is None else Open.from_value(value).bounds


def _order_of(engine: EngineTable, cycle: Cycle, count: int) -> tuple[int, ...] | None:
    # the order is that of the file, or that of the first dead centres of given throws
    if engine.kind.is_free:
        return None
    if engine.listed_order is not None:
        return tuple(engine.listed_order)
    throws = engine.listed_throws
    if throws is None or engine.firing_order == "open" or any(_has_open(engine.value_of(key)) for key in _OPENABLE):
        return None
    layout = layout_of(_closed(engine, count, engine.value_of("bank_angle"), engine.value_of("split_pin_angle")))
    order = next(lap_orders(cycle, layout, throws), None)
    # one of two cylinders at one angle fires in a later turn
    return order if order is not None and max(firing_turns(layout, throws, order)) < 1.0 else None


def _intervals(table: IntervalsTable | None, engine: EngineTable, cycle: Cycle, count: int, spread: float) -> Intervals:
    even = cycle.angle / count
    if table is None:
        # throws with angles or bounds of their own need no limits of intervals
        is_free = isinstance(engine.throws, list) and (_has_open(engine.throws) or engine.firing_order != "open")
        return Intervals(0.0, cycle.angle) if is_free else Intervals(even - spread, even + spread)
    deviation = table.largest_deviation
    if table.min is None and table.max is None and deviation is None:
        raise Refused("phasing.intervals", None, "is empty", "give phasing.intervals min, max or largest_deviation")
    low = table.min if table.min is not None else 0.0
    high = table.max if table.max is not None else cycle.angle
    if deviation is not None:
        if deviation < 0.0:
            where, text = "phasing.intervals.largest_deviation", units.quantity_text(deviation, "rad")
            raise Refused(where, text, "is negative", "give 0 for even firing")
        low, high = max(low, even - deviation), min(high, even + deviation)
    return Intervals(low, high)


def _shaft_choice(tables: Sequence[BalancerShaftTable], table: PhasingTable) -> ShaftChoice:
    sets: list[list[BalancerShaftTable]] = []
    optional = {shaft.name for shaft in tables if shaft.optional}
    for k, shaft in enumerate(tables):
        where = f"balancer_shafts[{k + 1}]"
        leaders = {u.coupled.to.split(".")[0] for u in shaft.unbalances if u.coupled is not None} - {shaft.name}
        for j, unbalance in enumerate(shaft.unbalances if shaft.optional else (), 1):
            size = unbalance.unbalance if unbalance.unbalance is not None else unbalance.mass
            if unbalance.coupled is None and not isinstance(size, Open):
                rule, remedy = "is fixed on an optional shaft", "leave its size open, or make the shaft fixed"
                raise Refused(f"{where}.unbalances[{j}]", None, rule, remedy)
        if any((leader in optional) != shaft.optional for leader in leaders):
            rule = f"follows a shaft that is {'not ' if shaft.optional else ''}optional"
            raise Refused(f"{where}.optional", None, rule, "make both optional")
        if not shaft.optional:
            continue
        joined = [group for group in sets if any(member.name in leaders for member in group)]
        merged = [member for group in joined for member in group] + [shaft]
        sets = [group for group in sets if group not in joined] + [merged]
    for key in ("most_shafts", "most_shaft_mass"):
        if getattr(table, key) is not None and not sets:
            rule = "limits optional shafts, and there are none"
            raise Refused(f"phasing.{key}", None, rule, "set optional = true in a [[balancer_shafts]] table")
    return ShaftChoice(
        tuple(tuple(shaft.name for shaft in group) for group in sets),
        tuple(sum(shaft.shaft_mass for shaft in group) for group in sets),
        math.inf if table.most_shafts is None else float(table.most_shafts),
        math.inf if table.most_shaft_mass is None else table.most_shaft_mass,
    )


def _check(phasing: Phasing, engine: EngineTable) -> None:
    """Raise `Refused` for keys of phasing that exclude each other."""
    kind, count = engine.kind, phasing.cylinders
    if phasing.throws is None and phasing.continuous:
        layout = phasing.layout(*phasing.minimum_geometry)
        centres = [layout.throw_centre_turn(pin) for pin in range(len(layout.throw_positions))]
        if max(centres) > min(centres):
            key = "row_angle" if kind.takes("row_angle") and engine.value_of("row_angle") else "single_cylinders"
            rule = (
                "puts the dead centres of throws at different angles, and firing intervals are searched for equal ones"
            )
            remedy = 'fire evenly with throws = "open" and without phasing.intervals, or fix the throws'
            raise Refused(f"engine.{key}", None, rule, remedy)
    if kind.fires_evenly and phasing.continuous:
        where = "engine.throws" if phasing.throw_bounds is not None else "phasing.intervals"
        rule = f"allows uneven firing, and layout '{engine.layout}' fires evenly"
        raise Refused(where, None, rule, 'write throws = "open", and remove phasing.intervals')
    for angle in ("bank_angle", "split_pin_angle"):
        if phasing.throws is not None and Open.from_value(engine.value_of(angle)).is_open:
            rule = "is open while throws are given, and needs open throws"
            remedy = f'write throws = "open" and cylinders = {count}, or fix the angle'
            raise Refused(f"engine.{angle}", None, rule, remedy)
    both_open = all(isinstance(engine.value_of(key), Open) for key in ("bank_angle", "split_pin_angle"))
    if not phasing.continuous and both_open:
        rule = "is open together with bank_angle, and even firing fixes only their sum"
        uneven = 'intervals = { min = "...", max = "..." } in [phasing]'
        remedy = f"fix one of the two, or let the firing be uneven: {uneven}"
        raise Refused("engine.split_pin_angle", None, rule, remedy)
    numbers = engine.value_of("numbering") if kind.takes("numbering") else None
    if isinstance(numbers, list) and (phasing.throws is None or phasing.firing_order is None):
        # mirror images of a crank exchange throws at equal ends of their list
        places = list(phasing.layout(*phasing.minimum_geometry).throw_positions)
        if places not in (sorted(places), sorted(places, reverse=True)):
            rule = "counts throws out of their order along the crank, and open throws and firing orders need this order"
            raise Refused("engine.numbering", numbers, rule, "number along the crank, or give throws and firing_order")
    # the layout refuses a count that is no multiple
    throws, remainder = divmod(count, kind.cylinders_per_throw)
    if isinstance(engine.throws, list) and not remainder and len(engine.throws) != throws:
        raise Refused(
            "engine.throws", None, f"has angles for {len(engine.throws)} of {throws} throws", "make the numbers agree"
        )
    check_order(phasing.firing_order, count)
    if phasing.throw_bounds is not None and phasing.intervals.forbid_unevenness:
        rule = "allows even firing alone, and throws between bounds fire unevenly"
        remedy = 'allow uneven intervals, leave the key out, or write throws = "open"'
        raise Refused("phasing.intervals", None, rule, remedy)
    if phasing.intervals.minimum > phasing.intervals.maximum:
        raise Refused("phasing.intervals.min", None, "is more than max", "swap or relax them")


def _first(phasing: Phasing) -> Candidate:
    """Return the candidate crank of the initial design."""
    lowest = (phasing.bank and phasing.bank[0], phasing.split and phasing.split[0])
    for geometry in phasing.geometries or (lowest,):
        layout = phasing.layout(*geometry)
        if phasing.throws is not None:
            return Candidate(phasing.throws, phasing.firing_order, *geometry)
        if phasing.throw_bounds is not None:
            stars = bounded_stars(phasing, layout)
            ordered = ((throws, _most_even(phasing, layout, throws)) for throws in stars)
            throws, order = next((pair for pair in ordered if pair[1]), (stars[0], None))
            return Candidate(throws, order, *geometry)
        try:
            pattern = even_patterns(phasing.cycle, layout)[0]
        except NoEvenStarError:
            continue
        if phasing.firing_order is not None:
            throws = even_throws(phasing.cycle, layout, phasing.firing_order)
            return Candidate(throws, phasing.firing_order, *geometry)
        steps = [step for step, times in enumerate(pattern) for _ in range(times)]
        return phasing.star(steps, firing_lattice(phasing.cycle, phasing.cylinders).steps, geometry)
    count = len(phasing.layout(*lowest).throw_positions)
    return Candidate(tuple(math.tau * k / count for k in range(count)), None, *lowest)


def _most_even(phasing: Phasing, layout: Layout, throws: tuple[float, ...]) -> tuple[int, ...] | None:
    # the order is that of the file, or the one with the most even intervals; some throws allow none
    fixed_order = phasing.firing_order
    orders = lap_orders(phasing.cycle, layout, throws) if fixed_order is None else [fixed_order]
    allowed = []
    for order in itertools.islice(orders, MAX_ORDERS):
        intervals = intervals_of(phasing.cycle, firing_turns(layout, throws, order))
        if min(intervals) > SOONEST:
            allowed.append((round(max(intervals) - min(intervals), 9), order))
    return min(allowed)[1] if allowed else None


def _closed(
    engine: EngineTable, count: int, bank: float | None = None, split: float | None = None, **keys: list[Any] | None
) -> EngineTable:
    # the table keeps these throws, firing order and angles and no others
    update = {"cylinders": count, "throws": None, "firing_order": None, "bank_angle": bank, "split_pin_angle": split}
    return engine.model_copy(update=update | keys)


def without_shafts(problem: Problem, shafts: Collection[str]) -> Problem:
    """Return the problem without the named shafts, their rotors and decisions."""
    if not shafts:
        return problem
    gone = {rotor.name for rotor in problem.engine.rotors if rotor.shaft.name in shafts}
    engine = replace(problem.engine, rotors=tuple(r for r in problem.engine.rotors if r.name not in gone))
    return replace(problem, engine=engine, decisions=without_rotors(problem.decisions, gone))
