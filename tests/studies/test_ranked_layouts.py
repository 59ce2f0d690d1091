"""Layouts at equal power, each decided, and ranked by several quantities."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import laufruhe
from laufruhe.extensions.bearing_loads.machine import bearings_of
from laufruhe.extensions.bearing_loads.physics import main_bearing_forces, pin_forces
from laufruhe.extensions.sweeps.layout_comparison import LayoutComparison, _places
from laufruhe.files.reader import load_tables
from laufruhe.plots.picture import draw
from laufruhe.problem.problem import Problem
from laufruhe.studies.equal_power import at_equal_power
from laufruhe.studies.scenes import ProblemFiles
from one_cylinder import irregularity
from problem_files import PROBLEMS

FURTHER = ["mean mount force", "added mass", "maximum main-bearing force", "maximum crank-pin force",
           "degree of irregularity"]  # fmt: skip
RANKED = [*FURTHER, "flywheel for 1/200"]
FORCE = {"minimise": "mean mount force"}


def tables(name: str) -> dict[str, Any]:
    return tomllib.loads((PROBLEMS / f"compare-{name}.toml").read_text(encoding="utf-8"))


def problem(name: str, cylinders: int, **more: Any) -> Problem:
    settings = tables(name)
    settings["engine"] |= {"cylinders": cylinders}
    return load_tables({**settings, **more}, Path(f"{name}.toml"))


@pytest.mark.slow
def test_an_open_crank_is_decided_in_its_new_size() -> None:
    """Check that forces of similar engines go as one over the number of cylinders (eq. 23)."""
    drawn = problem("inline", 3, objective=FORCE)
    rebuilt = at_equal_power(drawn, 4)
    assert rebuilt.phasing is not None
    solution, scaled = laufruhe.solve(drawn), laufruhe.solve(rebuilt)
    assert scaled.objective.value == pytest.approx(solution.objective.value * 4.0 / 3.0, rel=2e-3)
    small, large = (result.final.engine.slider_cranks for result in (solution, scaled))
    assert [part.x for part in large] == pytest.approx([part.x * (4.0 / 3.0) ** 0.5 for part in small])
    assert large[0].bore == pytest.approx(0.1 * (4.0 / 3.0) ** 0.5)


@pytest.fixture(scope="module")
def data() -> xr.Dataset:
    """Return the three engines of the ready study."""
    part_table = tomllib.loads((PROBLEMS / "layouts-equal-power.toml").read_text(encoding="utf-8"))["study"]["parts"][0]
    layouts = ("in line 6", "boxer 2", "radial 3")
    part_table["cases"] = [case for case in part_table["cases"] if case["name"] in layouts]
    part, problem_files = LayoutComparison.model_validate(part_table), ProblemFiles(PROBLEMS)
    points = part.points(problem_files)
    return part.dataset(points, [part.answer(point, problem_files) for point in points])


def test_values_equal_on_the_page_share_a_place() -> None:
    values = np.array([262.678125, 262.678129, 263.0196, math.nan, 1000.0])
    assert _places(values) == [1, 1, 3, 0, 4]


@pytest.mark.slow
def test_engines_are_ranked_by_what_their_designs_do(data: xr.Dataset) -> None:
    """Compare with numbers of the problem files, least first; a radial has bearings too."""
    assert data["proof"].values.tolist() == ["global"] * 3
    assert data["quantity"].values.tolist() == RANKED
    boxer = at_equal_power(load_tables({**tables("boxer"), "engine": {
        **tables("boxer")["engine"], "cylinders": 2, "firing_order": [1, 2]}}, Path("b.toml")), 4)  # fmt: skip
    result = laufruhe.solve(boxer)
    forces = pin_forces(result.final.engine, boxer.points[0]).sample(20000)
    row = data["further"].values[data["case"].values.tolist().index("boxer 2")]
    assert row[3] == pytest.approx(np.linalg.norm(forces, axis=-1).max(), rel=1e-3)
    bearings = main_bearing_forces(result.final.engine, boxer.points[0]).sample(20000)
    assert row[2] == pytest.approx(np.linalg.norm(bearings, axis=-1).max(), rel=1e-3)
    engine, point = result.final.engine, boxer.points[0]
    assert irregularity(engine, point, row[5]) == pytest.approx(1.0 / 200.0, rel=1e-9)
    assert irregularity(engine, point, 1.0) == pytest.approx(row[4])
    masses = sum(abs(r.unbalance) / r.radius for r in result.final.engine.rotors if r.radius)
    assert row[1] == pytest.approx(masses, rel=1e-2)
    # a study ends at the tolerance of the problem, 1e-3; a solve goes on to the last digits
    assert result.certificate.lower_bound <= row[0] + row[1] <= result.objective.value * (1.0 + 1e-5)
    assert np.isfinite(data["further"].values).all()
    assert set(data["why_none"].values.ravel().tolist()) == {""}


@pytest.mark.slow
def test_the_page_has_a_row_and_the_picture_a_panel_for_each(data: xr.Dataset) -> None:
    *_, rows = LayoutComparison.table(data)
    assert [row[0] for row in rows.rows] == ["in line 6", "boxer 2", "radial 3"]
    assert [row[2].split()[-1] for row in rows.rows] == ["(1)", "(2)", "(3)"]
    figure = draw(LayoutComparison.picture(data))
    assert [axes.get_title(loc="left").split("\n")[0] for axes in figure.axes[:6]] == RANKED


def test_the_ready_study_has_every_layout_from_one_to_twelve_cylinders() -> None:
    part_table = tomllib.loads((PROBLEMS / "layouts-equal-power.toml").read_text(encoding="utf-8"))["study"]["parts"][0]
    part, problem_files = LayoutComparison.model_validate(part_table), ProblemFiles(PROBLEMS)
    engines = [problem_files.problem(point).engine for point in part.points(problem_files)]
    assert len(engines) == 33
    assert {case.equal_power_to for case in part.cases} == {4}
    assert part.further == FURTHER
    assert all(len(bearings_of(engine)) > 1 for engine in engines)
    power = [sum(p.piston_area * p.crank_radius for p in e.slider_cranks) for e in engines]
    speeds = [problem_files.problem(point).points[0].speed for point in part.points(problem_files)]
    assert np.array(power) * np.array(speeds) == pytest.approx(power[3] * speeds[3])
