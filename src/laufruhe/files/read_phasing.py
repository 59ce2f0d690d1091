"""From a problem file with open throws, firing order or shafts to a phasing and its designs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from laufruhe import units
from laufruhe.files.assemble_engine import cycle_of, layout_of
from laufruhe.files.complaints import Refused
from laufruhe.files.engine_table import EngineTable
from laufruhe.files.fields import Open
from laufruhe.files.file_models import PhasingTable, ProblemFile
from laufruhe.files.rotors import BalancerShaftTable
from laufruhe.machine import Cycle
from laufruhe.machine.firing import (
    MOST_ORDERS,
    NoEvenStarError,
    even_orders,
    even_patterns,
    firing_lattice,
    firing_turns,
    intervals_of,
    lap_orders,
    star_throws,
)
from laufruhe.machine.layouts import LAYOUTS, Layout, even_throws
from laufruhe.problem.phasing import SOONEST, Candidate, Intervals, Method, OrderCriterion, ShaftChoice, bounded_stars
from laufruhe.problem.problem import Phasing, Problem

Assemble = Callable[[ProblemFile], Problem]


def is_open(file: ProblemFile) -> bool:
    """Whether anything but unbalances is left open."""
    engine = file.engine
    lists = engine.throws if isinstance(engine.throws, list) else []
    return (
        engine.throws == "open"
        or engine.firing_order == "open"
        or isinstance(engine.own("bank_angle"), Open)
        or isinstance(engine.own("split_pin_angle"), Open)
        or any(isinstance(angle, Open) for angle in lists)
        or any(shaft.optional for shaft in file.balancer_shafts)
        or file.phasing is not None
    )


def opened(file: ProblemFile, assemble: Assemble) -> Problem:
    """The problem with the first design that its phasing allows, and the phasing.

    Raises
    ------
    Refused
        If the open parts contradict the file.
    """
    engine, table = file.engine, file.phasing or PhasingTable()
    _check_open_keys(engine)
    cycle, count = cycle_of(engine), _cylinders(engine)
    left = _without_choice(engine, count)
    phasing = Phasing(
        cycle=cycle,
        layout=lambda bank, split: layout_of(_closed_engine(engine, count, bank, split)),
        cylinders=count,
        throws=_fixed_throws(engine) if left is None else left.throws,
        throw_bounds=_throw_bounds(engine),
        firing_order=None if engine.given_order is None else tuple(engine.given_order),
        bank=_bounds(engine.own("bank_angle")),
        split=_bounds(engine.own("split_pin_angle")),
        intervals=_intervals(table, cycle, count, _throw_bounds(engine) is not None, left.spread if left else 0.0),
        realise=lambda candidate: _without(assemble(_with(file, count, candidate)), candidate.left_out),
        steps=table.phases,
        shafts=_shaft_choice(file.balancer_shafts, table),
        best=table.best,
        criteria=tuple(OrderCriterion(name) for name in table.rank_orders_by),
        time_limit=table.time_limit,
        method=Method(table.method),
    )
    _check(phasing, engine)
    problem = replace(phasing.realise(_first(phasing)), phasing=phasing)
    _check_speed(problem, phasing)
    return problem


def _check_speed(problem: Problem, phasing: Phasing) -> None:
    """The smooth program of uneven throws knows a crank that turns evenly (S19)."""
    if phasing.continuous and problem.fidelity.is_uneven:
        raise Refused(
            "fidelity.crank_inertia", f"{problem.fidelity.crank_inertia:g} kg m^2",
            "makes the crank's speed uneven, and throws that leave the even steps are decided at an even one",
            "leave it out, or fix the throws",
        )  # fmt: skip


def _check_open_keys(engine: EngineTable) -> None:
    """Whether the layout lets open what is open."""
    kind = LAYOUTS[engine.layout]
    for key in ("throws", "firing_order", "bank_angle", "split_pin_angle"):
        value = engine.own(key)
        values = value if isinstance(value, list) else [value]
        if key not in kind.openable and any(part == "open" or isinstance(part, Open) for part in values):
            others = " or ".join(name for name, other in LAYOUTS.items() if key in other.openable)
            raise Refused(f"engine.{key}", None, f"cannot be open in layout '{engine.layout}'", f"use layout {others}")


def _cylinders(engine: EngineTable) -> int:
    kind = LAYOUTS[engine.layout]
    if engine.cylinders is not None:
        return engine.cylinders
    if engine.given_order is not None:
        return len(engine.given_order)
    if isinstance(engine.throws, list):
        return len(engine.throws) * kind.cylinders_per_throw
    if kind.is_free:
        return len(engine.slider_cranks)
    raise Refused("engine.cylinders", None, "is missing, and open throws do not tell it", "add it")


def _without_choice(engine: EngineTable, count: int) -> Layout | None:
    """The layout, if it leaves its throws no choice."""
    kind = LAYOUTS[engine.layout]
    if kind.is_free or kind.takes("throws"):
        return None
    return layout_of(_closed_engine(engine, count, None, None))


def _fixed_throws(engine: EngineTable) -> tuple[float, ...] | None:
    given = engine.given_throws
    return None if given is None else tuple(given)


def _throw_bounds(engine: EngineTable) -> tuple[tuple[float, float], ...] | None:
    if not isinstance(engine.throws, list) or engine.given_throws is not None:
        return None
    return tuple(bounds for angle in engine.throws if (bounds := _bounds(angle)) is not None)


def _bounds(value: float | Open | None) -> tuple[float, float] | None:
    if value is None:
        return None
    return (value.lower, value.upper) if isinstance(value, Open) else (value, value)


def _intervals(table: PhasingTable, cycle: Cycle, count: int, bounded: bool, spread: float) -> Intervals:
    even = cycle.angle / count
    given = table.intervals
    if given is None:
        # throws with bounds of their own need no others
        return Intervals(0.0, cycle.angle) if bounded else Intervals(even - spread, even + spread)
    low = given.min if given.min is not None else 0.0
    high = given.max if given.max is not None else cycle.angle
    if given.min is None and given.max is None and given.largest_deviation is None:
        raise Refused("phasing.intervals", None, "says nothing", "give min, max or largest_deviation")
    if given.largest_deviation is not None:
        if given.largest_deviation < 0.0:
            raise Refused(
                "phasing.intervals.largest_deviation",
                units.shown(given.largest_deviation, "rad"),
                "is negative",
                "give 0 for even firing",
            )
        low, high = max(low, even - given.largest_deviation), min(high, even + given.largest_deviation)
    return Intervals(low, high)


def _shaft_choice(tables: Sequence[BalancerShaftTable], table: PhasingTable) -> ShaftChoice:
    sets: list[list[BalancerShaftTable]] = []
    for k, shaft in enumerate(tables):
        if not shaft.optional:
            continue
        for j, unbalance in enumerate(shaft.unbalances):
            at = f"balancer_shafts[{k + 1}].unbalances[{j + 1}]"
            size = unbalance.unbalance if unbalance.unbalance is not None else unbalance.mass
            if unbalance.coupled is None and not isinstance(size, Open):
                raise Refused(at, None, "is fixed on an optional shaft", "leave its size open, or make the shaft fixed")
        leaders = {u.coupled.to.split(".")[0] for u in shaft.unbalances if u.coupled is not None}
        joined = [group for group in sets if any(other.name in leaders for other in group)]
        if leaders - {shaft.name} and not joined:
            raise Refused(
                f"balancer_shafts[{k + 1}].optional", None, "follows a shaft that is not optional", "make both optional"
            )
        merged = [other for group in joined for other in group] + [shaft]
        sets = [group for group in sets if group not in joined] + [merged]
    limited = table.most_shafts is not None or table.most_shaft_mass is not None
    if limited and not sets:
        key = "most_shafts" if table.most_shafts is not None else "most_shaft_mass"
        raise Refused(f"phasing.{key}", None, "limits optional shafts, and none is", "set optional = true on a shaft")
    return ShaftChoice(
        tuple(tuple(shaft.name for shaft in group) for group in sets),
        tuple(sum(shaft.shaft_mass for shaft in group) for group in sets),
        math.inf if table.most_shafts is None else float(table.most_shafts),
        math.inf if table.most_shaft_mass is None else table.most_shaft_mass,
    )


def _check(phasing: Phasing, engine: EngineTable) -> None:
    """What no solver needs to be asked: keys that do not go together."""
    kind, count = LAYOUTS[engine.layout], phasing.cylinders
    for key in kind.keys:
        if key.remedy and engine.own(key.name) is None:
            raise Refused(f"engine.{key.name}", None, "is missing", key.remedy)
    both = all(isinstance(engine.own(key), Open) for key in ("bank_angle", "split_pin_angle"))
    if not phasing.continuous and both:
        rule = "is open beside bank_angle, and even firing binds only their sum"
        raise Refused("engine.split_pin_angle", None, rule, "fix one of the two, or let the firing be uneven")
    for angle, bounds in (("bank_angle", phasing.bank), ("split_pin_angle", phasing.split)):
        if phasing.throws is not None and bounds is not None and bounds[0] < bounds[1]:
            rule = "is open beside throws that are given, and is decided with open ones only"
            raise Refused(f"engine.{angle}", None, rule, 'write throws = "open", or fix the angle')
    throws, rest = divmod(count, kind.cylinders_per_throw)
    if rest:
        rule = f"is no multiple of the {kind.cylinders_per_throw} cylinders that share a throw"
        raise Refused("engine.cylinders", count, rule, "give one that is")
    if isinstance(engine.throws, list) and len(engine.throws) != throws:
        raise Refused("engine.throws", None, f"has {len(engine.throws)} of {throws} throws", "let them agree")
    if phasing.firing_order is not None and sorted(phasing.firing_order) != list(range(1, count + 1)):
        raise Refused(
            "engine.firing_order", list(phasing.firing_order), f"is no permutation of 1 to {count}",
            "name every cylinder once",
        )  # fmt: skip
    if phasing.throw_bounds is not None and phasing.intervals.forbid_unevenness:
        raise Refused(
            "phasing.intervals", None, "allows even firing alone, and throws between bounds fire unevenly",
            'allow more, leave it out, or write throws = "open"',
        )  # fmt: skip
    if phasing.intervals.least > phasing.intervals.most:
        raise Refused("phasing.intervals.min", None, "is more than max", "swap or relax them")


def _first(phasing: Phasing) -> Candidate:
    """The design that stands for the problem as given: throws in the order of their cylinders."""
    for bank, split in phasing.geometries or ((_low(phasing.bank), _low(phasing.split)),):
        layout = phasing.layout(bank, split)
        given = phasing.throws
        if given is not None:
            return Candidate(given, phasing.firing_order, bank, split)
        if phasing.throw_bounds is not None:
            stars = bounded_stars(phasing, layout)
            return next(
                (
                    Candidate(throws, order, bank, split)
                    for throws in stars
                    if (order := _most_even(phasing, layout, throws))
                ),
                Candidate(stars[0], None, bank, split),
            )
        try:
            pattern = even_patterns(phasing.cycle, layout)[0]
        except NoEvenStarError:
            continue
        steps = [step for step, times in enumerate(pattern) for _ in range(times)]
        lattice = firing_lattice(phasing.cycle, phasing.cylinders)
        order = phasing.firing_order or next(even_orders(phasing.cycle, layout, steps), None)
        if phasing.firing_order is not None:
            return Candidate(_of_order(phasing, layout), phasing.firing_order, bank, split)
        return Candidate(star_throws(layout, steps, lattice.steps), order, bank, split)
    bank, split = _low(phasing.bank), _low(phasing.split)
    count = len(phasing.layout(bank, split).throw_positions)
    return Candidate(tuple(math.tau * k / count for k in range(count)), None, bank, split)


def _most_even(phasing: Phasing, layout: Layout, throws: tuple[float, ...]) -> tuple[int, ...] | None:
    """The firing order given, or that of the most even intervals; None if these throws cannot fire so."""
    given = phasing.firing_order
    orders = lap_orders(phasing.cycle, layout, throws) if given is None else [given]
    found = []
    for order in itertools.islice(orders, MOST_ORDERS):
        intervals = intervals_of(phasing.cycle, firing_turns(layout, throws, order))
        if min(intervals) > SOONEST:
            found.append((round(max(intervals) - min(intervals), 9), order))
    return min(found)[1] if found else None


def _of_order(phasing: Phasing, layout: Layout) -> tuple[float, ...]:
    return even_throws(phasing.cycle, layout, phasing.firing_order or ())


def _low(bounds: tuple[float, float] | None) -> float | None:
    return None if bounds is None else bounds[0]


def _closed_engine(engine: EngineTable, count: int, bank: float | None, split: float | None) -> EngineTable:
    update = {"cylinders": count, "throws": None, "firing_order": None}
    return engine.model_copy(update={**update, "bank_angle": bank, "split_pin_angle": split})


def _with(file: ProblemFile, count: int, candidate: Candidate) -> ProblemFile:
    """The file with a candidate's numbers in place of what is open."""
    engine = file.engine
    kind = LAYOUTS[engine.layout]
    if kind.openable:
        engine = _closed_engine(engine, count, candidate.bank_angle, candidate.split_pin)
        order = None if candidate.firing_order is None else list(candidate.firing_order)
        throws = list(candidate.throws) if kind.takes("throws") else None
        engine = engine.model_copy(update={"throws": throws, "firing_order": order})
    update: dict[str, object] = {"engine": engine}
    if candidate.without_gas:
        points = [point.model_copy(update={"gas": False}) for point in file.operating_points]
        update["operating_points"] = points
    return file.model_copy(update=update)


def _without(problem: Problem, shafts: Sequence[str]) -> Problem:
    """The problem without some shafts: their rotors and what decides on them."""
    if not shafts:
        return problem
    gone = {rotor.name for rotor in problem.engine.rotors if rotor.shaft.name in shafts}
    rotors = tuple(rotor for rotor in problem.engine.rotors if rotor.name not in gone)
    kept = tuple(d for d in problem.decisions if not any(drive.rotor in gone for drive in d.rotor_drives))
    return replace(problem, engine=replace(problem.engine, rotors=rotors), decisions=kept)
