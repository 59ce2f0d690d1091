"""Run-ups in files and reports: decisions, refused input, and tables of the results."""

from __future__ import annotations

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import InputError
from laufruhe.extensions.run_ups.runs import run_through
from laufruhe.physics.speed_map import split_loads
from laufruhe.plots import names
from laufruhe.problem.channels import mounting_in
from laufruhe.report.json_result import as_dict
from laufruhe.report.sections import tables_of
from laufruhe.report.tables import number_tables
from laufruhe.solvers import evaluate_only
from problem_files import PROBLEMS, loaded

RPM = np.pi / 30.0
RUN = '[run_up]\nup_to = "1000 rpm"\ntime = "0.5 s"\nshut_down_time = "0.8 s"\n'


def limited(maximum: str) -> str:
    return f'[[constraints]]\nlimit = "run-up travel"\nmax = "{maximum}"\n'


@pytest.fixture(scope="module")
def soft() -> str:
    text = (PROBLEMS / "soft-mounts-run-up.toml").read_text(encoding="utf-8")
    return text[: text.index("[run_up]")]


@pytest.mark.slow
def test_a_run_up_that_the_best_design_keeps_changes_nothing(soft, tmp_path):
    """Check that the best design stays proven if it keeps the limit of the run-up."""
    soft += "[search]\nstarts = 1\n"
    alone = laufruhe.solve(loaded(tmp_path, soft))
    result = laufruhe.solve(loaded(tmp_path, soft + RUN + limited("2 mm")))
    assert result.objective.value == pytest.approx(alone.objective.value)
    assert result.certificate.kind == alone.certificate.kind
    actual = next(limit for limit in result.limits if limit.name == "run-up travel")
    assert 0.0 < actual.value < 2e-3
    record = as_dict(result)["run_up"]
    assert record["up_to"] == pytest.approx(1000.0 * RPM)
    assert max(record[way]["travel"] for way in ("up", "down")) == actual.value
    # integrated at ten times the steps and a thousandth of the tolerance
    design = result.final
    point = min(result.problem.points, key=lambda p: p.speed)
    loads = split_loads(design.engine, point, design.fidelity)
    fine = run_through(mounting_in(design.engine), *loads, 0.0, 1000.0 * RPM, 0.5, 600, tolerance=1e-8)
    assert record["up"]["travel"] == pytest.approx(fine.travel.max(), rel=1e-2)
    assert record["up"]["twist"] == pytest.approx(fine.twist.max(), rel=1e-2)
    assert record["up"]["force"] == pytest.approx(fine.force.max(), rel=1e-2)


@pytest.mark.parametrize(
    ("run", "rule"),
    [
        ("", "needs elastic mounts that an engine is run up on"),
        (
            RUN.replace("up_to", 'operating_point = "sprint"\nup_to'),
            "is not the name of an operating point of this problem",
        ),
        (RUN.replace('"0.5 s"', '"0 s"'), "must be more than"),
    ],
)
def test_run_ups_that_say_too_little(soft, run, rule, tmp_path):
    with pytest.raises(InputError, match=rule):
        loaded(tmp_path, soft + run + limited("1 mm"))


def test_a_run_up_needs_springs(tmp_path):
    rigid = (PROBLEMS / "tractor-single.toml").read_text(encoding="utf-8")
    with pytest.raises(InputError, match="needs elastic mounts, because rigid mounts have no resonance"):
        loaded(tmp_path, rigid + RUN)


@pytest.mark.slow
def test_tables_files_and_picture_show_the_same_run() -> None:
    result = evaluate_only(laufruhe.load(PROBLEMS / "soft-single-run-up.toml"))
    record, sheets = as_dict(result)["run_up"], number_tables(result)
    (grid,) = (grid for grid in tables_of(result) if grid.title == "Through resonance")
    assert [row[0] for row in grid.rows] == ["run-up", "shut-down"]
    assert "through-resonance" in sheets
    rows = [row for row in sheets["run-up"].rows if row[1] == "run-up"]
    assert max(row[3] for row in rows) == pytest.approx(record["up"]["force"])
    assert max(row[4] for row in rows) == pytest.approx(record["up"]["travel"])
    assert "run_up" in names(result)


@pytest.mark.slow
def test_soft_mounts_without_a_run_have_one_of_three_seconds() -> None:
    result = evaluate_only(laufruhe.load(PROBLEMS / "study-soft-mounts.toml"))
    assert as_dict(result)["run_up"]["up"]["time"] == 3.0
    assert "run-up" in number_tables(result)
    assert "through-resonance" not in number_tables(result)
