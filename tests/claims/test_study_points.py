"""Points of a study are never those of other files, and stay those of the same files."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import xarray as xr
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.errors import SolverError
from laufruhe.files.study_tables import CaseTable
from laufruhe.studies import reader as study_files
from laufruhe.studies import runner, scenes
from laufruhe.studies.scenes import Point, ProblemFiles

PROBLEMS = Path(__file__).parents[2] / "problems"
INPUTS = Path(__file__).parent / "inputs"
FUEL, ENGINE, STUDY = "car-four-fuel.csv", "car-four-willans.toml", "scenes-of-car-four.toml"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for path in (INPUTS / STUDY, PROBLEMS / FUEL, PROBLEMS / ENGINE):
        shutil.copy(path, tmp_path)
    return tmp_path


def thirstier(path: Path) -> None:
    """Add 1 kg/h to each measured consumption."""
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = [line.rpartition(",") for line in lines[2:]]
    more = [f"{begin},{float(fuel) + 1.0:.6g}" for begin, _, fuel in rows]
    path.write_text("\n".join([*lines[:2], *more]) + "\n", encoding="utf-8")


def of_the_first_draw(folder: Path) -> float:
    answer = CliRunner().invoke(app, ["study", str(folder / STUDY), "--out", str(folder / "out")])
    assert answer.exit_code == 0, answer.output
    with xr.open_dataset(folder / "out/scenes.nc") as data:
        return float(data["objective"].values[0, 0])


@pytest.mark.slow
def test_a_changed_measurement_changes_the_points(folder: Path) -> None:
    before = of_the_first_draw(folder)
    assert before == pytest.approx(556.75, abs=0.01)
    thirstier(folder / FUEL)
    assert of_the_first_draw(folder) == pytest.approx(578.48, abs=0.01)


@pytest.mark.parametrize(
    "tables",
    [
        {"friction": {"file": "rows.csv"}},
        {"gas": {"model": "trace", "file": "rows.csv"}},
        {"gas": {"files": ["other.csv", "rows.csv"]}},
        {"mounts": {"elements": [{"name": "a", "dynamic_stiffness": {"axis": "z", "file": "rows.csv"}}]}},
        {"assembly": {"parts": {"file": "rows.csv"}}},
    ],
)
def test_every_file_that_a_scene_names_counts(tables: dict[str, object], tmp_path: Path) -> None:
    point, rows = Point(CaseTable(name="a", problem="a.toml"), base=tables), tmp_path / "rows.csv"

    def mark() -> str:
        return ProblemFiles(tmp_path).fingerprint(point, {})

    absent = mark()
    rows.write_text("1,2\n", encoding="utf-8")
    first = mark()
    rows.write_text("1,3\n", encoding="utf-8")
    changed = mark()
    rows.write_text("1,2\n", encoding="utf-8")
    assert mark() == first
    assert len({absent, first, changed}) == 3


def test_the_content_of_each_file_is_in_the_fingerprint(tmp_path: Path) -> None:
    point = Point(CaseTable(name="a", problem="a.toml"), base={"gas": {"files": ["a.csv", "b.csv"]}})
    (tmp_path / "a.csv").write_text("1,2\n", encoding="utf-8")
    first = ProblemFiles(tmp_path).fingerprint(point, {})
    (tmp_path / "a.csv").rename(tmp_path / "b.csv")
    assert ProblemFiles(tmp_path).fingerprint(point, {}) != first


@pytest.mark.parametrize("text", ["a\x00b", "x" * 5000, "", ".", "/dev/zero", "\ud800"])
def test_texts_that_name_no_file_do_no_harm(text: str, tmp_path: Path) -> None:
    point = Point(CaseTable(name="a", problem="a.toml"), base={"title": text})
    assert ProblemFiles(tmp_path).fingerprint(point, {}) == ProblemFiles(tmp_path).fingerprint(point, {})


@pytest.mark.slow
def test_a_file_that_changes_during_a_run_is_an_error(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solved = runner._answer

    def changed_meanwhile(*words: object) -> runner.Answer:
        thirstier(folder / FUEL)
        return solved(*words)  # type: ignore[arg-type]

    study, points_file = study_files.load_study(folder / STUDY), folder / "kept/points.jsonl"
    with monkeypatch.context() as patched:
        patched.setattr(runner, "_answer", changed_meanwhile)
        with pytest.raises(SolverError, match="had other files") as caught:
            runner.run(study, folder, points_file)
    assert len(str(caught.value).splitlines()) == 1
    assert not points_file.exists()


@pytest.mark.slow
def test_another_library_is_another_program(monkeypatch: pytest.MonkeyPatch) -> None:
    own = scenes.program()
    monkeypatch.setattr(scenes, "library_versions", lambda: {"clarabel": "0.0.1"})
    scenes.program.cache_clear()
    assert scenes.program() != own
    scenes.program.cache_clear()
