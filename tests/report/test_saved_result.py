"""`read_result`, compared with the result behind `result.json`."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import laufruhe
from cli import scenes
from laufruhe.present.measures import limits_of
from laufruhe.report.json_result import as_json
from laufruhe.solvers import Result
from ready import solved
from report.test_json_result import RESULTS


def saved_result(result: Result, folder: Path, series: bool = False) -> laufruhe.SavedResult:
    place = folder / "result.json"
    laufruhe.write_result(result, place, series)
    assert place.read_text(encoding="utf-8") == as_json(result, series)
    return laufruhe.read_result(place)


def fields(thing: object) -> str:
    """Return the text of an object, in which NaN equals itself."""
    return repr(thing)


def is_read_back(result: Result, folder: Path) -> None:
    """Check that all fields of both are equal to the last bit."""
    actual = saved_result(result, folder, series=True)
    assert (actual.name, actual.title) == (result.problem.name, result.problem.title)
    assert (actual.status, actual.message, actual.conflict) == (result.status, result.message, result.conflict)
    assert fields(actual.certificate) == fields(result.certificate)
    assert fields(actual.decisions) == fields(result.decisions)
    assert fields(actual.objective) == fields(result.objective)
    assert actual.to_dataframe().equals(result.to_dataframe())
    assert repr(actual).partition(" ")[2] == repr(result).partition(" ")[2]
    if result.status.has_design:
        assert fields(actual.limits) == fields(limits_of(result))
    assert actual.record == json.loads((folder / "result.json").read_text(encoding="utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize("name", RESULTS)
def test_a_result_is_read_back(name: str, tmp_path: Path) -> None:
    is_read_back(RESULTS[name](), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["vee-eight-open", "inline-five-torsion", "single-three-balances", "selective-assembly"]
)
def test_a_ready_problem_is_read_back(name: str, tmp_path: Path) -> None:
    is_read_back(solved(name), tmp_path)


@pytest.mark.slow
def test_decided_values_go_into_the_problem_again(tmp_path: Path) -> None:
    result = solved("tractor-single")
    again = result.problem.with_values(saved_result(result, tmp_path).values)
    assert result.objective is not None
    assert laufruhe.evaluate(again).objective.value == pytest.approx(result.objective.value, rel=1e-5)  # type: ignore[union-attr]
    assert [d.start for d in again.decisions] == [d.value for d in result.decisions]


def test_a_folder_of_results_is_enough(tmp_path: Path) -> None:
    result = scenes.solved(scenes.TIGHT)
    assert repr(saved_result(result, tmp_path)) == repr(laufruhe.read_result(str(tmp_path)))


def _without(key: str) -> Callable[[dict[str, Any]], Any]:
    return lambda record: {name: value for name, value in record.items() if name != key}


@pytest.mark.parametrize(
    ("damaged", "said"),
    [
        (
            lambda _: [1, 2],
            "file: is no result of laufruhe solve or evaluate; give a result.json of one of these commands",
        ),
        (lambda _: {"problem": "a", "rows": []}, "file: is no result of laufruhe solve or evaluate"),
        (_without("certificate"), "certificate: is missing"),
        (lambda r: r | {"status": "fine"}, "status"),
        (lambda r: r | {"decisions": {"left.unbalance": {"value": "much"}}}, "left.unbalance"),
        (lambda r: r | {"decisions": {"left.unbalance": 3.0}}, "left.unbalance"),
        (lambda r: r | {"objective": {**r["objective"], "value": "much"}}, "objective.value"),
    ],
)
def test_a_damaged_result_is_refused_in_one_line(damaged: Any, said: str, tmp_path: Path) -> None:
    place = tmp_path / "result.json"
    place.write_text(json.dumps(damaged(json.loads(as_json(scenes.solved(scenes.TIGHT))))), encoding="utf-8")
    with pytest.raises(laufruhe.InputError) as caught:
        laufruhe.read_result(place)
    assert str(caught.value).startswith(f"{place}: ")
    assert said in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "\x00", "[" * 100_000])
def test_a_result_that_is_no_json_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text(text, encoding="utf-8")
    with pytest.raises(laufruhe.InputError, match="file: is no JSON"):
        laufruhe.read_result(tmp_path)


def test_a_missing_result_is_refused(tmp_path: Path) -> None:
    with pytest.raises(laufruhe.InputError, match=r"result\.json: file: does not exist"):
        laufruhe.read_result(tmp_path)
    with pytest.raises(laufruhe.InputError, match="path = 3: is of type int"):
        laufruhe.read_result(3)  # type: ignore[arg-type]


def test_null_is_no_number(tmp_path: Path) -> None:
    result = saved_result(scenes.solved(scenes.IMPOSSIBLE), tmp_path)
    assert result.objective is None
    assert result.certificate is None
    prices = [limit.shadow_price for limit in saved_result(scenes.stated(scenes.GIVEN), tmp_path).limits]
    assert all(math.isnan(price) for price in prices)
