"""Mounts and block in axes of a vehicle are those of the same file turned by hand, to rounding."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from laufruhe import InputError, load
from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import channel_samples, evaluate
from laufruhe.problem.problem import Problem

ENGINE = {
    "title": "Three", "engine": {
        "layout": "inline", "cycle": "four-stroke", "firing_order": [1, 3, 2], "stroke": "80 mm",
        "rod_length": "140 mm",
        "reciprocating_mass": "0.5 kg", "cylinder_spacing": "90 mm",
    },
    "operating_points": [{"speed": "2400 rpm"}],
}  # fmt: skip
# positions [m], turns [rad], stiffness [N/m], and block, in the axes of the engine
PLACES = [[0.31, 0.2, -0.05], [0.27, -0.24, 0.03], [-0.4, 0.02, 0.1]]
TURNS = [[0.2, -0.3, 0.9], [0.0, 0.0, 0.0], [-1.1, 0.5, 2.0]]
STIFFNESS = [[2e5, 3e5, 5e5], [1e5, 4e5, 6e5], [3e5, 2e5, 2.5e5]]
CENTRE = [-0.06, 0.02, 0.12]
INERTIA = np.array([[2.7, 0.3, -0.4], [0.3, 6.2, 0.2], [-0.4, 0.2, 5.0]])
ORIGIN = np.array([1.3, -0.2, 0.45])
TILTED = Rotation.from_euler("zyx", [0.7, -0.4, 0.3]).as_matrix()
# axes of the engine as rows in those of the file, and the keys that say so
CASES: dict[str, tuple[Any, dict[str, Any]]] = {
    "same axes": (np.eye(3), {"crank": "+x", "up": "+z"}),
    "x to the rear, y to the right": (np.diag([-1, -1, 1]), {"crank": "-x", "up": "+z"}),
    "across, front to the right": (np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), {"crank": "-y", "up": "+z"}),
    "z down": (np.diag([1, -1, -1]), {"crank": [1, 0, 0], "up": "-z"}),
    "tilted": (TILTED, {"crank": list(map(float, TILTED[0])), "up": list(map(float, 2.0 * TILTED[2]))}),
}


def texts(numbers: Any, unit: str) -> list[str]:
    return [f"{number!r} {unit}" for number in np.asarray(numbers, dtype=float).tolist()]


def problem(rows: Array, axes: dict[str, Any] | None, turned: bool = True, **engine: str) -> Problem:
    """Return the problem with its numbers carried by hand into the axes whose engine has these rows."""
    origin = np.zeros(3) if axes is None else ORIGIN
    places = []
    for position, angles, stiffness in zip(PLACES, TURNS, STIFFNESS, strict=True):
        own = rows.T @ Rotation.from_euler("xyz", angles).as_matrix()
        own = own * np.sign(np.linalg.det(own))
        degrees = np.degrees(Rotation.from_matrix(own).as_euler("xyz")).tolist()
        place = {"position": texts(rows.T @ position + origin, "m"), "stiffness": texts(stiffness, "N/m")}
        places.append({**place, "turned": degrees} if turned else place)
    tensor = rows.T @ INERTIA @ rows
    block = {
        "mass": "150 kg", "centre_of_gravity": texts(rows.T @ CENTRE + origin, "m"),
        "inertia": texts(np.diag(tensor), "kg m^2"),
        "inertia_products": texts([tensor[0, 1], tensor[0, 2], tensor[1, 2]], "kg m^2"),
    }  # fmt: skip
    named = {} if axes is None else {"axes": {**axes, "origin": texts(ORIGIN, "m")}}
    mounts = {"kind": "elastic", "loss_factor": 0.1, "places": places, **named}
    return load({**ENGINE, "engine": ENGINE["engine"] | engine, "mounts": mounts, "block": {**block, **named}})


@pytest.mark.parametrize("rotation", ["clockwise", "counter-clockwise"])
@pytest.mark.parametrize("case", CASES)
def test_axes_of_a_file_are_turned_into_those_of_the_engine(case: str, rotation: str) -> None:
    rows, axes = CASES[case]
    # y of an engine that turns the other way points to the right
    rows = rows * np.array([[1.0], [1.0 if rotation == "clockwise" else -1.0], [1.0]])
    variant, other = problem(np.eye(3), None, rotation=rotation), problem(rows, axes, rotation=rotation)
    for mine, carried in zip(variant.engine.mounts, other.engine.mounts, strict=True):
        assert np.allclose(carried.position, mine.position, rtol=0, atol=1e-12)
        for matrix in ("stiffness_matrix", "loss_matrix"):
            expected = getattr(mine, matrix)
            assert np.abs(getattr(carried, matrix) - expected).max() < 1e-12 * np.abs(expected).max()
    assert variant.engine.block is not None
    assert other.engine.block is not None
    assert np.allclose(other.engine.block.mass_matrix, variant.engine.block.mass_matrix, rtol=0, atol=1e-10)
    forces = [channel_samples(evaluate(one), 0) for one in (variant, other)]
    assert np.abs(forces[1] - forces[0]).max() < 1e-11 * np.abs(forces[0]).max()
    assert any("axes of its own" in text for text in other.assumptions)


def test_open_positions_move_along_the_axes_of_the_file() -> None:
    axes = {"crank": "-y", "up": "+z"}
    across = problem(CASES["across, front to the right"][0], axes)
    assert across.origin is not None
    tables: Any = across.origin.tables
    tables["mounts"]["places"][0]["position"][0] = {"between": ["1 m", "2 m"], "start": "1.6 m"}
    opened = load(tables)
    (decision,) = opened.decisions
    assert (decision.name, decision.start) == ("mount 1.position.x", 1.6)
    # x of the file is y of the engine
    moved = np.subtract(opened.design([1.7]).mounts[0].position, opened.engine.mounts[0].position)
    assert np.allclose(moved, [0.0, 0.1, 0.0], rtol=0, atol=1e-12)
    tables["mounts"]["axes"] |= {"crank": [0.1, -1, 0]}
    with pytest.raises(InputError, match="is open along x of the file, which is inclined to the axes of the engine"):
        load(tables)


def test_a_usual_stiffness_across_the_crank_stays_there() -> None:
    """Check that a rigid mount without numbers carries no load along the crank, in any axes."""
    tables = {**ENGINE, "mounts": {"positions": [["0 m", "0.3 m", "0 m"], ["0 m", "-0.3 m", "0 m"]],
                                   "axes": {"crank": "-y", "up": "+z"}}}  # fmt: skip
    for mount in load(tables).engine.mounts:
        assert np.allclose(mount.stiffness_matrix, np.diag([0.0, 1.0, 1.0]), atol=1e-15)
    assert np.allclose([mount.position for mount in load(tables).engine.mounts], [[-0.3, 0, 0], [0.3, 0, 0]])


@pytest.mark.parametrize(
    ("axes", "line"),
    [
        ({"crank": "+x", "up": [1, 0, 1]}, "lies at 45 deg to the crank; give a direction across the crank, at 90 deg"),
        ({"crank": "+x", "up": "-x"}, "lies at 180 deg to the crank"),
        ({"crank": [0, 0, 0], "up": "+z"}, "has no direction"),
        ({"crank": "front", "up": "+z"}, 'is neither a list nor "+x" nor "-x"'),
    ],
)
def test_axes_that_are_none_are_refused(axes: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=r"mounts\.axes") as refused:
        problem(np.eye(3), axes)
    assert line in str(refused.value)
