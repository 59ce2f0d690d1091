"""Curves of single pictures as sheets: friction, bearings as the crank feels them, wear, twins, critical speeds."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator

import numpy as np

from laufruhe.physics.bearing_wear import wear_of
from laufruhe.physics.willans import FrictionTest
from laufruhe.present.measures import BEARINGS, as_crank_turns, bearing_paths, has_bearings, loaded
from laufruhe.present.mounting import critical_speed, facts_of, is_elastic
from laufruhe.present.numbers import RPM
from laufruhe.present.twins import KINDS, is_twin, parts_of
from laufruhe.report.sheet import Cells, Sheet, Sheets
from laufruhe.solvers.result import Result

DIRECTIONS = 180
"""In which wear is told."""


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


PART_CURVES: Sheets = {
    "willans": (lambda result: result.problem.friction, _willans),
    "bearings-on-crank": (has_bearings, _on_crank),
    "wear": (has_bearings, _wear),
    "turning-parts": (is_twin, _turning),
    "mount-critical-speeds": (is_elastic, _mount_criticals),
}
