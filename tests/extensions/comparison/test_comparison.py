"""Designs side by side: their numbers against results, evaluations by other ways, and bad input."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import laufruhe
from laufruhe.cli import app
from laufruhe.extensions.comparison.designs import Design, designs_of
from laufruhe.extensions.comparison.rows import INPUTS, OBJECTIVES, assumptions_of, rows_of, tables_of
from laufruhe.problem.evaluation import place_measures
from problem_files import PROBLEMS

SINGLE = (PROBLEMS / "tractor-single.toml").read_text(encoding="utf-8")
FIXED = SINGLE.replace("balance_factor = { between = [0, 1] }", "balance_factor = 0.25")


def compare(*words: object) -> Result:
    return CliRunner().invoke(app, ["compare", *map(str, words)])


def numbers(path: Path) -> dict[tuple[str, str], list[str]]:
    rows = csv.reader(path.read_text(encoding="utf-8").splitlines())
    return {(table, name): values for table, name, _, *values in rows}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a decided design, its saved result, and a design of other numbers."""
    place = tmp_path_factory.mktemp("designs")
    assert FIXED != SINGLE
    (place / "open.toml").write_text(SINGLE, encoding="utf-8")
    other = FIXED.replace('stroke = "120 mm"', 'stroke = "0.12 m"').replace('"10 m/s"', '"8 m/s"')
    assert "0.12 m" in other
    assert '"8 m/s"' in other
    (place / "fixed.toml").write_text(other, encoding="utf-8")
    answer = CliRunner().invoke(app, ["solve", str(place / "open.toml"), "--out", str(place / "saved"), "--no-plots"])
    assert answer.exit_code == 0
    return place


@pytest.fixture(scope="module")
def designs(folder: Path) -> list[Design]:
    return designs_of([folder / "saved", folder / "fixed.toml"], lambda _: None)


def test_numbers_are_those_of_the_results(folder: Path) -> None:
    answer = compare(folder / "saved", folder / "fixed.toml", "--out", folder / "out")
    assert answer.exit_code == 0, answer.output
    rows, result = numbers(folder / "out" / "comparison.csv"), laufruhe.read_result(folder / "saved")
    fixed = laufruhe.evaluate(folder / "fixed.toml")
    assert float(rows["Decisions", "web.balance_factor"][0]) == result["web.balance_factor"]
    assert float(rows["Designs", "lower bound"][0]) == result.certificate.lower_bound
    mean = [float(value) for value in rows["Mount forces", "left, mean"]]
    assert mean == pytest.approx([result.record["mounts"][0]["mean"], place_measures(fixed.final, 0)[0].mean])
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert "data:image/svg+xml" in page
    assert "operating_points.1.mean_piston_speed" in page
    assert f"laufruhe compare {folder / 'saved'} {folder / 'fixed.toml'} --out" in page


def test_inputs_that_differ_are_compared_as_quantities(designs: list[Design]) -> None:
    names = {row.name for row in rows_of(designs) if row.group == INPUTS}
    assert names == {"operating_points.1.mean_piston_speed", "counterweights.web.balance_factor"}


def test_assumptions_name_their_designs(designs: list[Design]) -> None:
    first, second = designs
    pair = [replace(design, record={**design.record, "assumptions": texts})
            for design, texts in ((first, ["common", "one"]), (second, ["common"]))]  # fmt: skip
    assert assumptions_of(pair) == ["common", f"{first.name}: one"]


def test_the_note_about_dashes_stands_where_one_is(designs: list[Design]) -> None:
    row = next(row for row in rows_of(designs) if row.group == INPUTS and None not in row.values)
    for values, has_note in ((row.values, False), ((None, 1.0), True)):
        (table,) = tables_of([replace(row, values=values)], designs)
        assert ("dash" in table.note) == has_note


def test_every_objective_is_evaluated_for_every_design(folder: Path, designs: list[Design]) -> None:
    """The speeds differ, so each design is also evaluated at the other's speed."""
    own, other = [row.values for row in rows_of(designs) if row.group == OBJECTIVES]
    factor = laufruhe.read_result(folder / "saved")["web.balance_factor"]
    crossed = [
        laufruhe.evaluate(laufruhe.load(FIXED)).objective.value,
        laufruhe.evaluate(laufruhe.load(folder / "fixed.toml").fix("web.balance_factor", factor)).objective.value,
    ]
    assert [own[1], other[0]] == pytest.approx(crossed, rel=1e-4)
    assert own[0] < own[1]


def test_designs_of_other_places_have_no_common_objective(folder: Path, tmp_path: Path) -> None:
    text = FIXED.replace('"left", "right"', '"front", "rear"')
    (tmp_path / "moved.toml").write_text(text, encoding="utf-8")
    one, two = designs_of([folder / "fixed.toml", tmp_path / "moved.toml"], lambda _: None)
    assert one.value_for(two) is None
    assert two.value_for(one) is None
    assert one.value_for(one) is not None


@pytest.mark.parametrize(("words", "line"), [
    (["fixed.toml"], "is a single design; name two or more"),
    (["fixed.toml", "missing.toml"], "missing.toml: file: does not exist"),
    (["fixed.toml", "."], "result.json: file: does not exist"),
])  # fmt: skip
def test_bad_input_gets_one_line(folder: Path, words: list[str], line: str) -> None:
    answer = compare(*(folder / word for word in words))
    assert answer.exit_code == 2
    assert line in answer.stderr
    assert len(answer.stderr.splitlines()) == 1


def test_a_path_that_is_named_twice_has_two_columns(folder: Path) -> None:
    names = [design.name for design in designs_of([folder / "saved", folder / "saved" / "result.json"], lambda _: None)]
    assert names == ["saved", "saved (2)"]
