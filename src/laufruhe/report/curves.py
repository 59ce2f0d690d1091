"""Curves of pictures as sheets: torque over a cycle, chambers, twist over speed, modes of the crankshaft, shares."""

from __future__ import annotations

import math

import numpy as np

from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.irregularity import swing_of
from laufruhe.physics.reduced_inertia import turning_inertia
from laufruhe.physics.torque import torque_parts
from laufruhe.physics.torsion import chain_of
from laufruhe.present.chambers import indicator_of, points_with_chambers, rotor_chambers, rotors_of
from laufruhe.present.measures import asks_torque, has_loads, has_ranking, objective_unit, ranking_of
from laufruhe.present.numbers import RPM
from laufruhe.present.torsion import facts_of, is_twisted, speed_range, speeds_between, torque_over_speed
from laufruhe.problem.curves import STEPS
from laufruhe.report.part_curves import PART_CURVES
from laufruhe.report.sheet import Sheet, Sheets
from laufruhe.solvers.result import Result
from laufruhe.solvers.tolerances.result import SHARES

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


def _twist_response(result: Result) -> Sheet:
    """Half of the peak to peak torque in every section of the crankshaft, over its speed."""
    speeds = speeds_between(result.final, *speed_range(result))
    head, columns = ["speed [rpm]"], [RPM * speeds]
    for name, design in result.designs.items():
        sections = [section.name for section in chain_of(design.engine).sections]
        head += [f"{name}: alternating torque in {section} [N m]" for section in sections]
        columns += list(torque_over_speed(design, speeds).T)
    return Sheet(head, np.column_stack(columns).tolist())


def _twist_modes(result: Result) -> Sheet:
    """Swing of every disc in every natural mode of the crankshaft."""
    rows = []
    for name, design in result.designs.items():
        modes = facts_of(design, *speed_range(result)).modes
        discs = [disc.name for disc in chain_of(design.engine).discs]
        for m, frequency in enumerate(modes.frequencies.tolist()):
            rows += [
                [name, m + 1, frequency, disc, swing]
                for disc, swing in zip(discs, modes.shapes[:, m].tolist(), strict=True)
            ]
    return Sheet(["design", "mode", "natural frequency [Hz]", "disc", "swing"], rows)


def _critical_speeds(result: Result) -> Sheet:
    """Where orders meet natural modes of the crankshaft: all of them."""
    rows = [
        [name, RPM * each.speed, each.order, each.mode, each.vector_sum, each.is_main,
         math.nan if each.torque is None else each.torque]
        for name, design in result.designs.items()
        for each in facts_of(design, *speed_range(result)).criticals
    ]  # fmt: skip
    return Sheet(["design", "speed [rpm]", "order", "mode", "vector sum", "main order", "torque [N m]"], rows)


def _uneven_firing(result: Result) -> Sheet:
    """What deviations from even firing buy, and what no design with them goes under."""
    unit = objective_unit(result) or "-"
    rows = [
        [math.degrees(one.allowed), math.degrees(one.deviation), one.value, one.lower_bound]
        for one in ranking_of(result).trade
    ]
    return Sheet(["allowed deviation [deg]", "deviation [deg]", f"objective [{unit}]", f"not under [{unit}]"], rows)


def _shares(result: Result) -> Sheet:
    """Share of engines built, or of assemblies, that stay below a value."""
    unit, columns = objective_unit(result) or "-", dict[str, list[float]]()
    if result.robust is not None:
        columns["best drawing"] = list(result.robust.nominal.quantiles)
        columns["decided"] = list(result.robust.robust.quantiles)
    if result.assembly is not None:
        columns["assemblies at random"] = list(result.assembly.quantiles)
    rows = [[100.0 * share, *values] for share, *values in zip(SHARES, *columns.values(), strict=True)]
    return Sheet(["below [%]", *(f"{name} [{unit}]" for name in columns)], rows)


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


def _chambers(result: Result) -> Sheet:
    """Volume, pressure and torque of every chamber of every rotor, of the final design."""
    rows = []
    for point in result.problem.points:
        for part in rotors_of(result.final.engine):
            found = rotor_chambers(result.problem, part, point, STEPS * len(part.swept.lags) + 1)
            nothing = np.full_like(found.volume, math.nan)
            pressure, torque = (nothing if each is None else each for each in (found.pressure, found.torque))
            for k, columns in enumerate(zip(found.volume, pressure, torque, strict=True)):
                values = np.column_stack([np.degrees(found.angles), *columns]).tolist()
                rows += [[point.name, part.name, k + 1, *row] for row in values]
    head = ["point", "rotor", "chamber", "angle [deg]", "volume over the least [m^3]",
            "pressure over the crankcase [Pa]", "torque [N m]"]  # fmt: skip
    return Sheet(head, rows)


CURVES: Sheets = {
    "torque": (lambda result: asks_torque(result) and has_loads(result), _torque),
    "indicator": (points_with_chambers, _indicator),
    "chambers": (lambda result: rotors_of(result.final.engine), _chambers),
    "twist-response": (is_twisted, _twist_response),
    "twist-modes": (is_twisted, _twist_modes),
    "critical-speeds": (is_twisted, _critical_speeds),
    "uneven-firing": (has_ranking, _uneven_firing),
    "shares": (lambda result: result.robust or result.assembly, _shares),
    **PART_CURVES,
}
