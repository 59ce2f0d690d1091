"""Tables, files and pictures of built engines and of chosen parts, compared with their results."""

from __future__ import annotations

from typing import Any

import pytest

from cli import scenes
from laufruhe.extensions.robust.result import SHARES, AssemblyResult, RobustResult
from laufruhe.plots import figure, names
from laufruhe.report.json_result import as_dict
from laufruhe.report.sections import tables_of
from laufruhe.report.tables import number_tables
from laufruhe.solvers.result import Result
from picture_faults import faults_of
from problem_files import FOUR, MOUNTS, changed, shaft
from ready import solved

BUILT = 'unbalance = { between = ["0 kg m", "0.05 kg m"], tolerance = "± 10 %" }\nradius = "20 mm"\nangle = 180\n'
TEXT = (
    changed(FOUR, "1.25 kg", "2 kg ± 2 %")
    + MOUNTS
    + shaft("left", 2, "60 mm", BUILT)
    + shaft("right", -2, "-60 mm", BUILT)
    + """
[[operating_points]]
speed = "2500 rpm"
[objective]
minimise = "rms mount force"
[robust]
[fidelity]
samples = 48
"""
)


@pytest.fixture(scope="module")
def built() -> Result:
    return scenes.solved(TEXT)


@pytest.fixture(scope="module")
def chosen() -> Result:
    return solved("selective-assembly")


def table(result: Result, title: str) -> Any:
    return next(grid for grid in tables_of(result) if grid.title == title)


def test_two_designs_and_every_tolerance_have_a_row(built: Result) -> None:
    found = built.details
    assert isinstance(found, RobustResult)
    assert [row[0] for row in table(built, "Under tolerance").rows] == ["nominal design", "robust design", "price"]
    assert [row[0] for row in table(built, "Tolerances").rows] == [one.name for one in found.tolerances]
    record = as_dict(built)["robust"]
    assert record["over"] == "worst case"
    assert record["decided"]["worst"] == found.robust.worst == built.objective.value  # type: ignore[union-attr]
    assert record["best_drawing"]["quantiles"] == list(found.nominal.quantiles)
    assert [one["saving"] for one in record["tolerances"]] == [one.saving for one in found.tolerances]
    assert record["decided"]["decisions"].keys() == {d.name for d in built.decisions}


def test_every_cylinder_has_a_row_with_its_parts(chosen: Result) -> None:
    found = chosen.details
    assert isinstance(found, AssemblyResult)
    rows = table(chosen, "Assembly").rows
    assert [row[0] for row in rows] == [place.cylinder for place in found.places]
    assert [row[1] for row in rows] == [f"no. {place.parts[0]}" for place in found.places]
    record = as_dict(chosen)["assembly"]
    assert [(one["piston"], one["rod"]) for one in record["places"]] == [place.parts for place in found.places]
    assert record["mean_parts"] == found.mean_parts


def test_shares_are_a_file(built: Result, chosen: Result) -> None:
    for result, columns in ((built, 2), (chosen, 1)):
        sheet = number_tables(result)["shares"]
        assert [row[0] for row in sheet.rows] == pytest.approx([100.0 * share for share in SHARES])
        assert all(len(row) == len(sheet.head) == columns + 1 for row in sheet.rows)
    assert {"under-tolerance", "tolerances"} <= set(number_tables(built))
    assert "assembly" in number_tables(chosen)


def test_pictures_have_no_fault(built: Result, chosen: Result) -> None:
    for result, name in ((built, "robust"), (chosen, "assembly")):
        assert name in names(result)
        assert all(axes.has_data() for axes in figure(result, name).axes)
        assert not faults_of(figure(result, name), result.problem.title)
