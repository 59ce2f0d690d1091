"""[load_torque] of a problem file: periods, units, columns, and refused input."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import InputError
from laufruhe.extensions.flywheel.torque import torque_facts
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.machine import LoadTorque
from laufruhe.physics.fidelity import EXACT
from laufruhe.physics.load_torque import less_load
from laufruhe.problem.problem import Problem
from problem_files import PROBLEMS

SET = tables_of(PROBLEMS / "compressor-set.toml")


def problem_of(folder: Path, text: str, **keys: Any) -> Problem:
    (folder / "load.csv").write_text(text, encoding="utf-8")
    return load_tables({**SET, "load_torque": {"file": "load.csv", **keys}}, folder / "set.toml")


def written(head: str, degrees: np.ndarray, factor: float = 1.0, times: int = 1) -> str:
    rows = (
        f"{d:g};" + ";".join([f"{factor * (50.0 + 20.0 * np.cos(3.0 * np.radians(d))):.6f}"] * times) for d in degrees
    )
    return "\n".join([head, *rows])


def load_of(problem: Problem) -> LoadTorque:
    load = problem.engine.load_torque
    assert load is not None
    return load


@pytest.mark.parametrize(
    ("degrees", "periods"),
    [
        (np.arange(0.0, 720.0, 2.0), 1), (np.arange(0.0, 721.0, 2.0), 1), (np.arange(-180.0, 180.0, 5.0), 2),
        (np.arange(0.0, 361.0, 5.0), 2), (np.arange(0.0, 120.0, 5.0), 6), (np.arange(0.0, 1440.0, 2.0), 1),
    ],
)  # fmt: skip
def test_a_file_of_a_part_of_the_cycle_repeats(tmp_path: Path, degrees: np.ndarray, periods: int) -> None:
    problem = problem_of(tmp_path, written("angle [deg];torque [N m]", degrees), smooth=False, angle_zero="10 deg")
    assert load_of(problem).periods == periods
    angles = np.radians(np.arange(0.0, 720.0, 5.0) + 10.0)
    still = laufruhe.physics.torque.crank_torque(problem.engine, problem.points[0]).mapped(lambda values: 0.0 * values)
    result = less_load(still, problem.engine, problem.points[0], EXACT).values(angles)
    assert result == pytest.approx(-20.0 * np.cos(3.0 * (angles - np.radians(10.0))), abs=0.3)


@pytest.mark.parametrize(
    ("head", "factor", "keys"),
    [
        ("KW [°KW];M [kNm]", 1e-3, {}), ("angle;torque", 1.0, {}), ("a;b;c", 1.0, {"torque_column": 2}),
        ("x;M", 1e-3, {"angle_column": "x", "torque_column": "m", "torque_unit": "kN m"}), ("KW;Nm;Nm", 1.0, {}),
    ],
)  # fmt: skip
def test_units_and_columns_are_those_of_pressure(
    tmp_path: Path, head: str, factor: float, keys: dict[str, Any]
) -> None:
    problem = problem_of(tmp_path, written(head, np.arange(0.0, 360.0, 5.0), factor, head.count(";")), **keys)
    load = load_of(problem)
    assert (min(load.torques), max(load.torques)) == pytest.approx((30.0, 70.0))
    assert any("30 N m to 70 N m" in sentence for sentence in problem.assumptions)


@pytest.mark.parametrize(
    ("text", "keys", "words"),
    [
        (written("angle [deg];pressure [bar]", np.arange(0.0, 360.0, 5.0)), {}, "another unit"),
        (written("angle [deg];torque", np.arange(0.0, 300.0, 5.0)), {}, "of the 360 deg"),
        (written("angle;torque", np.arange(0.0, 360.0, 60.0)), {}, "add points"),
        (written("angle;torque", np.arange(0.0, 360.0, 5.0)), {"torque_unit": "kg"}, "load_torque.torque_unit"),
        (written("angle;torque", np.arange(0.0, 360.0, 5.0)), {"torque_column": 3}, "is not among 2 columns"),
        ("angle;torque\n0;1\n", {}, "too few for a cycle"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_torque_is_refused_in_one_line(
    tmp_path: Path, text: str, keys: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=words) as error:
        problem_of(tmp_path, text, **keys)
    assert "load_torque." in str(error.value)
    assert "pressure" not in str(error.value).replace("'pressure [bar]'", "")


@pytest.mark.parametrize("turned", [45.0, 300.0])
def test_the_coupling_counts_from_the_dead_centre_of_cylinder_1(turned: float) -> None:
    """Check that throws turned alike only move the zero of phi."""
    engine = {key: value for key, value in SET["engine"].items() if key != "firing_order"}
    problems = [
        load_tables({**SET, "engine": engine | {"throws": throws}}, PROBLEMS / "compressor-set.toml")
        for throws in ([0, 0], [turned, turned])
    ]
    excursions = [torque_facts(problem.engine, problem.points[0]).excursion for problem in problems]
    assert excursions[1] == pytest.approx(excursions[0], rel=1e-6)


def test_the_angle_of_the_coupling_may_be_open(tmp_path: Path) -> None:
    """The best angle needs a smaller flywheel than angles 45 degrees from it."""
    engine_of = {
        angle: load_tables({**SET, "load_torque": {**SET["load_torque"], "angle_zero": f"{angle} deg"}},
                           PROBLEMS / "compressor-set.toml") for angle in (0, 45, 90, 135, 180)
    }  # fmt: skip
    works = {angle: torque_facts(p.engine, p.points[0]).excursion for angle, p in engine_of.items()}
    assert works[0] == pytest.approx(works[180], rel=2e-3)
    assert works[45] > 1.1 * works[135]
    load = {**SET["load_torque"], "angle_zero": {"between": ["90 deg", "180 deg"], "start": "100 deg"}}
    wheel = {"inertia": "2 kg m^2"}
    tables = {**SET, "load_torque": load, "flywheel": wheel, "constraints": [], "fidelity": {"samples": 240},
              "objective": {"minimise": "degree of irregularity"}, "search": {"starts": 1}}  # fmt: skip
    result = laufruhe.solve(load_tables(tables, PROBLEMS / "compressor-set.toml"))
    best = result.final.engine.load_torque
    assert best is not None
    assert np.degrees(best.angles[0]) == pytest.approx(144.0, abs=3.0)
