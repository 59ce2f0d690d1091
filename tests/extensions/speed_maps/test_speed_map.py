"""Speed maps: values are those of the exact model at that speed, and peaks stand where the modes are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from laufruhe import load
from laufruhe.cli import app
from laufruhe.errors import InputError, LaufruheWarning
from laufruhe.numerics.norms import NORMS
from laufruhe.plots.picture import draw
from laufruhe.problem.channels import MOUNT_FORCE, MOUNT_TRAVEL, mounting_in
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure
from laufruhe.solvers import solve
from laufruhe.studies.kinds import KINDS
from laufruhe.studies.reader import load_study
from laufruhe.studies.runner import run
from mounts.files import BLOCK, ENGINE, MOUNTS, OPEN
from problem_files import PROBLEMS, written

RPM = np.pi / 30.0
CASE = '[[study.parts.cases]]\nname = "{name}"\nproblem = "{problem}"\n'


def part(problem: str, speeds: str, more: str = "") -> str:
    head = (
        f'title = "t"\n[study]\n[[study.parts]]\nname = "p"\nkind = "speed map"\ntitle = "t"\nspeeds = {{ {speeds} }}\n'
    )
    return f"{head}{more}\n" + CASE.format(name="one", problem=problem)


def computed(folder: Path, text: str) -> xr.Dataset:
    return run(load_study(written(folder, text, "study")), folder, folder / "kept")[0]["p"]


def elastic(folder: Path, damping: str = "0.1") -> Path:
    mounts = MOUNTS.replace("loss_factor = 0.1", f"loss_factor = {damping}").replace(OPEN, '"400 N/mm"')
    path = folder / "elastic.toml"
    path.write_text(ENGINE + BLOCK + mounts, encoding="utf-8")
    return path


def test_values_are_those_of_the_exact_model(tmp_path: Path) -> None:
    """Compare the initial and the optimal design at every speed, and at that of the operating point."""
    path = PROBLEMS / "tractor-four-lanchester.toml"
    problem = load(path)
    data = computed(tmp_path, part(str(path), 'from = "1000 rpm", to = "2600 rpm", step = "500 rpm"'))
    rated = problem.points[0].speed / RPM
    speeds = sorted({1000.0, 1500.0, 2000.0, 2500.0, round(rated, 9)})
    result = solve(problem)
    assert data["measure"].values.tolist() == ["mean mount force"]
    for design, engine in (("initial", problem.engine), ("final", result.final.engine)):
        one = data.isel(point=np.flatnonzero(data["design"].values == design))
        assert one["speed"].values.tolist() == pytest.approx(speeds)
        for speed, value in zip(one["speed"].values, one["value"].values[:, 0], strict=True):
            at = replace(problem, points=(replace(problem.points[0], speed=speed * RPM),))
            assert value == pytest.approx(evaluate(at, engine).value(Measure(MOUNT_FORCE)), rel=1e-9)
    assert set(data["proof"].values) == {"nothing open", "global"}
    assert result.objective is not None
    found = data["value"].values[(data["design"].values == "final") & np.isclose(data["speed"].values, rated)]
    # a solve ends on finer steps than an evaluation asks for
    assert found.item() == pytest.approx(result.objective.value, rel=2e-5)


def test_old_names_of_designs_are_read_with_a_warning(tmp_path: Path) -> None:
    text = part(str(elastic(tmp_path)), 'from = "100 rpm", to = "1500 rpm", points = 3', 'designs = ["as decided"]')
    with pytest.warns(LaufruheWarning, match="'as decided' is now 'final'"):
        (table,) = load_study(written(tmp_path, text, "study")).study.parts
    assert table.settings()["designs"] == ["final"]


@pytest.mark.slow
def test_orders_peak_where_they_meet_a_mode(tmp_path: Path) -> None:
    """Find the highest peak of order 2 of a damped block within two percent of half a natural frequency."""
    path = elastic(tmp_path)
    speeds, more = 'from = "100 rpm", to = "1500 rpm", step = "2 rpm"', 'by_order = true\ndesigns = ["initial"]'
    measures = '\nmeasures = [{ quantity = "maximum mount travel", limit = "1 mm" }]'
    data = computed(tmp_path, part(str(path), speeds, more + measures))
    modes = mounting_in(load(path).engine).modes.frequencies
    assert data["frequency"].values[0] == pytest.approx(modes)
    second = data["amplitude"].sel(order=2.0).values
    peak = float(data["speed"].values[np.argmax(second)])
    assert min(abs(30.0 * modes / peak - 1.0)) < 0.02
    problem = load(path)
    at = replace(problem, points=(replace(problem.points[0], speed=500.0 * RPM),))
    here = data.isel(point=np.flatnonzero(data["speed"].values == 500.0))
    travel = evaluate(at).value(Measure(MOUNT_TRAVEL, NORMS["maximum"]))
    assert here["value"].item() == pytest.approx(travel, rel=1e-12)
    assert set(data["limit"].values.ravel()) == {1e-3}
    table = KINDS["speed map"].table(data)[0]
    assert table.rows[0][5] == f"{data['speed'].values[np.argmax(data['value'].values[:, 0])]:.4g}"
    draw(KINDS["speed map"].picture(data))


def test_a_resonance_that_nothing_damps_is_a_gap(tmp_path: Path) -> None:
    path = elastic(tmp_path, "0")
    mode = float(mounting_in(load(path).engine).modes.frequencies[0])
    speeds = f'from = "{20.0 * mode!r} rpm", to = "{40.0 * mode!r} rpm", points = 3'
    data = computed(tmp_path, part(str(path), speeds, 'designs = ["initial"]'))
    struck = np.isnan(data["value"].values[:, 0])
    assert struck.tolist() == [False, True, False]


def test_limits_of_the_problem_are_drawn_at_its_points(tmp_path: Path) -> None:
    text = (PROBLEMS / "tractor-three.toml").read_text(encoding="utf-8")
    limit = '\n[[constraints]]\nlimit = "maximum mount force"\nmax = "2 kN"\n'
    (tmp_path / "three.toml").write_text(text + limit, encoding="utf-8")
    data = computed(tmp_path, part("three.toml", 'from = "1000 rpm", to = "3000 rpm", points = 3'))
    assert data["measure"].values.tolist() == ["mean mount force", "maximum mount force"]
    assert np.isnan(data["limit"].values[:, 0]).all()
    assert set(data["limit"].values[:, 1]) == {2000.0}


def test_speeds_without_a_design_are_listed_and_not_drawn(tmp_path: Path) -> None:
    text = (PROBLEMS / "tractor-three.toml").read_text(encoding="utf-8")
    limit = '\n[[constraints]]\nlimit = "maximum mount force"\nmax = "1 N"\n'
    (tmp_path / "quiet.toml").write_text(text + limit, encoding="utf-8")
    data = computed(tmp_path, part("quiet.toml", 'from = "1000 rpm", to = "3000 rpm", points = 3', "by_order = true"))
    decided = data["design"].values == "final"
    assert np.isnan(data["value"].values[decided]).all()
    assert np.isfinite(data["value"].values[~decided]).all()
    assert [row[-1] for row in KINDS["speed map"].table(data)[0].rows] == [*["nothing open"] * 2, *["infeasible"] * 2]
    draw(KINDS["speed map"].picture(data))


BAD = [
    (
        'from = "3000 rpm", to = "1000 rpm", points = 3',
        "",
        "do not ascend; write the lower speed as from and the higher as to",
    ),
    ('from = "1000 rpm", to = "3000 rpm"', "", "either points or step"),
    ('from = "1000 rpm", to = "3000 rpm", step = "5000 rpm"', "", "is above their range"),
    ('from = "1 m", to = "3000 rpm", points = 3', "", "is not a unit of a speed of rotation"),
    ('from = "1000 rpm", to = "3000 rpm", points = 3', 'operating_point = "idle"', "has no 'idle'"),
    ('from = "1000 rpm", to = "3000 rpm", points = 3', 'measures = [{ quantity = "mean force" }]', "mean mount force"),
    ('from = "1000 rpm", to = "3000 rpm", points = 3', 'measures = [{ quantity = "balancer mass" }]', "on speed"),
    (
        'from = "1000 rpm", to = "3000 rpm", points = 3',
        'measures = [{ quantity = "mean mount force", limit = "1 m" }]',
        "is not a unit of a force",
    ),
]


@pytest.mark.parametrize(("speeds", "more", "said"), BAD)
def test_bad_maps_are_one_line(tmp_path: Path, speeds: str, more: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        computed(tmp_path, part(str(PROBLEMS / "tractor-four-lanchester.toml"), speeds, more))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_map_by_its_command(tmp_path: Path) -> None:
    """Check two cases of different measures: missing values are empty, and files are whole."""
    text = part(str(elastic(tmp_path)), 'from = "600 rpm", to = "900 rpm", points = 3', "by_order = true")
    text += CASE.format(name="two", problem=PROBLEMS / "tractor-three-shafts.toml")
    out = tmp_path / "out"
    answer = CliRunner().invoke(app, ["study", str(written(tmp_path, text, "study")), "--out", str(out)])
    assert answer.exit_code == 0, answer.output
    assert {file.name for file in out.glob("[!.]*")} == {
        "report.md",
        "report.html",
        "tables.xlsx",
        "p.nc",
        "p.csv",
        "p.svg",
    }
    with xr.open_dataset(out / "p.nc") as data:
        assert set(data["case"].values) == {"one", "two"}
        assert np.isnan(data["frequency"].values[data["case"].values == "two"]).all()
    head = (out / "p.csv").read_text(encoding="utf-8").splitlines()[0]
    assert "value: mean mount force [N]" in head
