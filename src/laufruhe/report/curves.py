"""Curves of pictures as sheets: torque, chambers, shares, friction, bearings and their wear, critical speeds."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator

import numpy as np

from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.physics.bearing_wear import wear_of
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.irregularity import swing_of
from laufruhe.physics.reduced_inertia import turning_inertia
from laufruhe.physics.torque import torque_parts
from laufruhe.physics.willans import FrictionTest
from laufruhe.present.chambers import indicator_of, points_with_chambers
from laufruhe.present.measures import (
    BEARINGS,
    as_crank_turns,
    asks_torque,
    bearing_paths,
    has_bearings,
    has_loads,
    has_ranking,
    loaded,
    objective_unit,
    ranking_of,
)
from laufruhe.present.mounting import critical_speed, facts_of, is_elastic
from laufruhe.present.numbers import RPM
from laufruhe.present.twins import KINDS, is_twin, parts_of
from laufruhe.problem.curves import STEPS
from laufruhe.report.sheet import Cells, Sheet, Sheets
from laufruhe.solvers.result import Result

DIRECTIONS = 180
"""In which wear is told."""
TURN = math.tau * np.arange(STEPS) / STEPS


def _torque(result: Result) -> Sheet:
    """Torque part by part, the work that it stores and the speed that it makes, of every design and point."""
    points, fidelity = result.problem.points, result.problem.fidelity
    angles = result.final.engine.cycle.angle * np.arange(STEPS) / STEPS
    found = [
        {f"{name}: {of}": values for name, design in result.designs.items()
         for of, values in _torques(design.engine, point, fidelity, angles).items()}
        for point in points
    ]  # fmt: skip
    # without gas at one point there is none of that part
    names = list(dict.fromkeys(name for columns in found for name in columns))
    rows = [
        [point.name, *row]
        for point, columns in zip(points, found, strict=True)
        for row in np.column_stack([np.degrees(angles), *(columns.get(name, 0.0 * angles) for name in names)]).tolist()
    ]
    return Sheet(["point", "angle [deg]", *names], rows)


def _torques(engine: Engine, point: OperatingPoint, fidelity: Fidelity, angles: Array) -> dict[str, Array]:
    """Columns of one design at one point; no speed of a crank that would stop."""
    parts = torque_parts(engine, point, fidelity)
    work = parts["all"].integral.values(angles)
    columns = {f"torque of {part} [N m]": torque.values(angles) for part, torque in parts.items()}
    columns["work stored [J]"] = work - work.min()
    swing, inertia = swing_of(engine, point, fidelity), turning_inertia(engine, fidelity)
    if inertia is not None and swing.irregularity(inertia) <= 1.0:
        speeds = RPM * swing.speeds(inertia)[: len(swing.work)]
        at = engine.cycle.angle * np.arange(len(speeds)) / len(speeds)
        columns["speed [rpm]"] = np.interp(angles, at, speeds, period=engine.cycle.angle)
    return columns


def _uneven_firing(result: Result) -> Sheet:
    """What deviations from even firing buy, and what no design with them goes under."""
    unit = objective_unit(result) or "-"
    rows = [
        [math.degrees(one.allowed), math.degrees(one.deviation), one.value, one.lower_bound]
        for one in ranking_of(result).trade
    ]
    return Sheet(["allowed deviation [deg]", "deviation [deg]", f"objective [{unit}]", f"not under [{unit}]"], rows)


def _indicator(result: Result) -> Sheet:
    """Pressure in every chamber on both sides of pistons, and what drives the rods, of the final design."""
    parts, rows, named = result.final.engine.slider_cranks, [], dict[str, None]()
    found = [
        (point.name, part.name, indicator_of(gas, part, point, TURN))
        for point, gas in points_with_chambers(result)
        for part in parts
        if gas.of(part)
    ]
    for _, _, one in found:
        named |= dict.fromkeys(one.pressures)
    for point, part, one in found:
        # a cylinder has not every chamber
        pressures = (one.pressures.get(name, np.full(STEPS, math.nan)) for name in named)
        columns = np.column_stack([np.degrees(TURN), one.travel, one.force, one.needed, *pressures])
        rows += [[point, part, *row] for row in columns.tolist()]
    head = ["point", "cylinder", "angle from its dead centre [deg]", "part of the stroke", "force of the chambers [N]",
            "force that accelerates the rod [N]", *(f"pressure in {name} [Pa]" for name in named)]  # fmt: skip
    return Sheet(head, rows)


def _willans(result: Result) -> Sheet:
    """Readings of friction tests, the line through them, what is asked of it, and the friction that it tells."""
    rows = [row for test in result.problem.friction for row in _of_test(test)]
    head = ["point", "what", "brake mean pressure [Pa]", "speed [rpm]", "fuel, as measured", "drag [Pa]",
            "least squares, as measured", "standard deviation [Pa]"]  # fmt: skip
    return Sheet(head, rows)


def _of_test(test: FrictionTest) -> Iterator[Cells]:
    (intercept, slope), none = test.line, math.nan
    friction = test.friction
    for x, y in zip(test.x, test.y, strict=True):
        places = (none, RPM * x, none, y) if test.is_motored else (x, none, y, none)
        yield [test.at, "measured", *places, intercept + slope * x, none]
    asked, line = test.asked, intercept + slope * test.asked
    yield [test.at, "asked", *((none, RPM * asked) if test.is_motored else (asked, none)), none, none, line, none]
    told = (none, RPM * asked, none, friction.mean) if test.is_motored else (-friction.mean, none, 0.0, none)
    yield [test.at, "friction", *told, line if test.is_motored else 0.0, friction.deviation]


def _on_crank(result: Result) -> Sheet:
    """Forces on main bearings along and across the crank as it turns, of every design and point (B4)."""
    names, rows, heads = BEARINGS.channel.places(result.final.engine), [], []
    designs = loaded(result)
    for k, point in enumerate(result.problem.points):
        columns = []
        for design in designs.values():
            paths = bearing_paths(design, k)
            turned = paths * as_crank_turns(design, len(paths))[:, None]
            columns += [part for path in turned.T for part in (path.real, path.imag)]
        angles = np.degrees(result.final.engine.cycle.angle) * np.arange(len(paths)) / len(paths)
        rows += [[point.name, *row] for row in np.column_stack([angles, *columns]).tolist()]
    for name in designs:
        lead = f"{name}: force on " if len(designs) > 1 else "force on "
        heads += [f"{lead}{bearing} {way} the crank [N]" for bearing in names for way in ("along", "across")]
    return Sheet(["point", "angle [deg]", *heads], rows)


def _wear(result: Result) -> Sheet:
    """Load that every direction of each main bearing takes over a cycle, over that of the most loaded (B10)."""
    names, angles = BEARINGS.channel.places(result.final.engine), math.tau * np.arange(DIRECTIONS) / DIRECTIONS
    rows = []
    for name, design in loaded(result).items():
        for k, point in enumerate(result.problem.points):
            shares = [wear_of(path, angles) for path in bearing_paths(design, k).T]
            rows += [[name, point.name, *row] for row in np.column_stack([np.degrees(angles), *shares]).tolist()]
    head = ["design", "point", "direction from upright towards y [deg]", *(f"wear of {name} [-]" for name in names)]
    return Sheet(head, rows)


def _turning(result: Result) -> Sheet:
    """Forward and backward parts of force and couple of a twin, of every design and point."""
    rows = [
        [name, point.name, kind, order, abs(forward), math.degrees(cmath.phase(forward)), abs(backward),
         math.degrees(cmath.phase(backward)), KINDS[kind][1]]
        for name, design in loaded(result).items()
        for k, point in enumerate(result.problem.points)
        for (kind, order), (forward, backward) in parts_of(result, design.engine, k).items()
    ]  # fmt: skip
    head = ["design", "point", "of", "order", "turns with the crank", "its angle [deg]", "turns against it",
            "its angle against it [deg]", "unit"]  # fmt: skip
    return Sheet(head, rows)


def _mount_criticals(result: Result) -> Sheet:
    """Where the orders that load a block most meet its natural frequencies on its mounts."""
    rows = []
    for name, design in loaded(result).items():
        facts = facts_of(design)
        for j, (mode, frequency) in enumerate(zip(facts.modes.names, facts.modes.frequencies.tolist(), strict=True)):
            rows += [
                [name, j + 1, mode, frequency, j in facts.excited, order, RPM * critical_speed(frequency, order)]
                for order in facts.orders
            ]
    head = ["design", "mode", "name", "natural frequency [Hz]", "excited", "order", "critical speed [rpm]"]
    return Sheet(head, rows)


CURVES: Sheets = {
    "torque": (lambda result: asks_torque(result) and has_loads(result), _torque),
    "indicator": (points_with_chambers, _indicator),
    "uneven-firing": (has_ranking, _uneven_firing),
    "willans": (lambda result: result.problem.friction, _willans),
    "bearings-on-crank": (has_bearings, _on_crank),
    "wear": (has_bearings, _wear),
    "turning-parts": (is_twin, _turning),
    "mount-critical-speeds": (is_elastic, _mount_criticals),
}
