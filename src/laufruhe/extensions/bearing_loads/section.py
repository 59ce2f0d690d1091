"""Files of numbers of main bearings: forces along and across the turning crank, and wear (B4, B10)."""

from __future__ import annotations

import math

import numpy as np

from laufruhe.extensions.bearing_loads.channels import MAIN_BEARING_FORCE
from laufruhe.extensions.bearing_loads.physics import wear_of
from laufruhe.numerics.arrays import ComplexArray
from laufruhe.present.measures import designs_with_loads, has_loads
from laufruhe.present.pictures import ResultPicture
from laufruhe.present.tables import Table
from laufruhe.problem.evaluation import Evaluation, channel_samples
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result

DIRECTIONS = 180
"""Number of directions of the wear table."""


def has_bearings(result: Result) -> bool:
    """Return True if there are main-bearing loads to draw."""
    return MAIN_BEARING_FORCE.is_displayed(result.problem.engine, result.problem.fidelity) and has_loads(result)


def bearing_paths(design: Evaluation, k: int) -> ComplexArray:
    """Return main-bearing forces at an operating point, upward + i leftward, shape (angles, bearings) [N]."""
    samples = channel_samples(design, k, MAIN_BEARING_FORCE)
    return np.asarray(samples[..., 2] + 1j * samples[..., 1])


def as_crank_turns(design: Evaluation, steps: int) -> ComplexArray:
    """Return factors that turn forces into the frame of the crank, shape (steps,)."""
    return np.asarray(np.exp(-1j * design.engine.cycle.angle * np.arange(steps) / steps))


def _on_crank(result: Result) -> Table:
    """Return a table of forces on main bearings over the cycle, along and across the turning crank (B4)."""
    names, rows, heads = MAIN_BEARING_FORCE.places(result.final.engine), [], []
    designs = designs_with_loads(result)
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
        heads += [
            f"{lead}{bearing} {direction} the crank [N]" for bearing in names for direction in ("along", "across")
        ]
    return Table(["point", "angle [deg]", *heads], rows)


def _wear(result: Result) -> Table:
    names, angles = MAIN_BEARING_FORCE.places(result.final.engine), math.tau * np.arange(DIRECTIONS) / DIRECTIONS
    rows = []
    for name, design in designs_with_loads(result).items():
        for k, point in enumerate(result.problem.points):
            wear = [wear_of(path, angles) for path in bearing_paths(design, k).T]
            rows += [[name, point.name, *row] for row in np.column_stack([np.degrees(angles), *wear]).tolist()]
    head = ["design", "point", "direction from z towards y [deg]", *(f"wear of {name} [-]" for name in names)]
    return Table(head, rows)


SECTION = Section(
    "bearing_loads", has_bearings,
    number_tables={"bearings-on-crank": (has_bearings, _on_crank), "wear": (has_bearings, _wear)},
)  # fmt: skip
PICTURE = ResultPicture(
    "bearings", "Force on each main bearing over a cycle, on block and crankshaft, and its wear.",
    "laufruhe.extensions.bearing_loads.picture",
)  # fmt: skip
