"""Windows for the natural frequencies of named motions (E6, E7)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import scipy.linalg

from laufruhe import InputError, load, solve
from laufruhe.physics.modes import MOTIONS
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate
from laufruhe.report.sections.values import limits
from laufruhe.solvers import Status

OPEN = {"between": ["50 N/mm", "600 N/mm"], "start": "200 N/mm"}
PROBLEM: dict[str, Any] = {
    "title": "Windows",
    "engine": {
        "layout": "inline", "cycle": "four-stroke", "firing_order": [1, 3, 4, 2], "stroke": "88 mm",
        "rod_length": "150 mm", "reciprocating_mass": "0.6 kg", "cylinder_spacing": "90 mm",
    },
    "operating_points": [{"speed": "900 rpm"}],
    "block": {
        "mass": "160 kg", "centre_of_gravity": ["-20 mm", "10 mm", "60 mm"],
        "inertia": ["5 kg m^2", "11 kg m^2", "9 kg m^2"],
    },
    "mounts": {"kind": "elastic", "places": [
        {"name": "left", "position": ["250 mm", "220 mm", "0 mm"], "stiffness": ["200 N/mm", "150 N/mm", OPEN]},
        {"name": "right", "mirror_of": "left"},
        {"name": "rear", "position": ["-350 mm", "0 mm", "50 mm"], "stiffness": ["200 N/mm", "150 N/mm", "200 N/mm"]},
    ]},
    "objective": {"minimise": "mean mount force"},
    "search": {"starts": 2},
}  # fmt: skip


def windows(*entries: tuple[str, str, str]) -> dict[str, Any]:
    limits = [{"limit": "motion frequencies", "motions": [m], "min": low, "max": high} for m, low, high in entries]
    return PROBLEM | {"constraints": limits}


def frequency_of(problem: Any, engine: Any, motion: str) -> float:
    """Return the frequency of the mode with the largest energy of a motion, by the general eigenproblem [Hz]."""
    mounting = mounting_in(engine)
    mass, stiffness = engine.block.mass_matrix, np.real(mounting.stiffness)
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
    energy = np.abs(shapes * (mass @ shapes))[MOTIONS.index(motion)]
    return math.sqrt(squares[energy.argmax()]) / math.tau


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_motion_has_the_frequency_of_its_dominant_mode(motion: str) -> None:
    problem = load(windows((motion, "1 Hz", "50 Hz")))
    (limit,) = problem.limits
    (value,) = evaluate(problem).values(limit.measure)
    assert value == pytest.approx(frequency_of(problem, problem.engine, motion), rel=1e-10)


def test_a_design_stays_in_its_windows() -> None:
    """Check that a local search moves roll (10.2 Hz) and bounce (8.7 Hz) into their windows, without a proof."""
    problem = load(windows(("roll", "6 Hz", "7 Hz"), ("bounce", "6 Hz", "8 Hz")))
    assert evaluate(problem).violation(problem.limits) > 0.0
    result = solve(problem)
    assert result.status is Status.FEASIBLE
    for motion, low, high in (("roll", 6.0, 7.0), ("bounce", 6.0, 8.0)):
        assert low * (1 - 1e-6) <= frequency_of(problem, result.final.engine, motion) <= high * (1 + 1e-6)
    (table,) = limits(result)
    assert table.head[2] == "bound"
    assert [row[2] for row in table.rows] == ["6 to 7 Hz", "6 to 8 Hz"]


def test_windows_that_no_frequency_meets_are_refused() -> None:
    with pytest.raises(InputError, match="contradicts itself: at least 9 Hz and at most 8 Hz"):
        load(windows(("roll", "9 Hz", "8 Hz")))


def test_a_stiffness_that_depends_on_frequency_has_no_such_modes() -> None:
    problem = windows(("roll", "6 Hz", "7 Hz"))
    left, *others = problem["mounts"]["places"]
    track = {"mass": "28 kg", "bulge_stiffness": "220 N/mm"}
    problem["mounts"] = {"kind": "elastic", "places": [{**left, "fluid_track": track}, *others]}
    with pytest.raises(InputError, match="needs a constant stiffness"):
        load(problem)
