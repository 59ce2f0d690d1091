"""Answers to a page, compared with results of the commands; files beyond those offered are refused."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import laufruhe
from laufruhe.extensions.served_page import answers
from laufruhe.extensions.served_page.answers import Source
from laufruhe.extensions.served_page.page_state import Edit, PageState
from laufruhe.files.complaints import Refused
from laufruhe.files.reader import load, tables_of
from laufruhe.solvers.result import Status
from problem_files import PROBLEMS
from ready import solved

LANCHESTER, VEE = PROBLEMS / "tractor-four-lanchester.toml", PROBLEMS / "vee-eight-open.toml"
TIGHT = Edit("set", "constraints.1.max", "0.5 kg")


@cache
def source(path: Path) -> Source:
    return Source(tables_of(path), path)


def follow(path: Path, **state: Any) -> dict[str, Any]:
    return json.loads(answers.follow(source(path), PageState(**state)))  # type: ignore[no-any-return]


def settle(path: Path, **state: Any) -> dict[str, Any]:
    return json.loads(answers.settle(source(path), PageState(**state), 600.0))  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def tight() -> dict[str, Any]:
    return settle(LANCHESTER, edits=(TIGHT,))


def test_the_follower_estimates_the_proven_optimum(tight: dict[str, Any]) -> None:
    result = follow(LANCHESTER, edits=(TIGHT,))
    proven = tight["claim"]
    assert proven["kind"] == "proven"
    assert result["claim"]["kind"] == "estimate"
    assert not result["claim"]["is_last"]
    assert result["claim"]["value"] == pytest.approx(proven["value"], rel=2e-3)
    assert result["claim"]["value"] >= proven["value"] * (1 - 1e-6)
    (limit,) = result["limits"]
    assert limit["active"]
    assert limit["price"] == pytest.approx(tight["limits"][0]["price"], rel=0.02)
    assert limit["value"] <= 0.5 * (1 + 1e-6)
    assert "about " in limit["words"]
    assert "about " not in tight["limits"][0]["words"]


def test_the_proven_answer_is_that_of_the_command(tight: dict[str, Any]) -> None:
    result = laufruhe.solve(load(LANCHESTER).with_values({"constraints.balancer mass.max": "0.5 kg"}))
    assert result.objective is not None
    assert tight["claim"]["value"] == pytest.approx(result.objective.value, rel=1e-9)
    assert tight["design"] == pytest.approx({d.name: d.value for d in result.decisions})


def test_a_model_is_sent_once_and_again_where_loads_are_others() -> None:
    first = follow(LANCHESTER)
    assert {"model", "engine", "partners"} <= set(first)
    assert "model" not in follow(LANCHESTER, has=first["key"], edits=(TIGHT,))
    faster = follow(LANCHESTER, has=first["key"], edits=(Edit("set", "operating_points.1.speed", "3000 rpm"),))
    assert faster["model"]["designs"]["given"] != first["model"]["designs"]["given"]
    assert faster["claim"]["value"] > first["claim"]["value"]


@pytest.mark.parametrize(
    ("name", "kind", "words"),
    [
        ("tractor-four-lanchester", "estimate", "mean mount force"),
        ("tractor-four-elastic", "held", "mean mount force of order 2, 4, 6, 8 for these mounts"),
        ("tractor-four-robust", "held", "mean mount force without tolerances"),
        ("deltic-row", "held", "rms shaking force without later objectives"),
    ],
)
def test_a_claim_names_what_it_omits_while_sliders_move(name: str, kind: str, words: str) -> None:
    claim = follow(PROBLEMS / f"{name}.toml")["claim"]
    assert (claim["kind"], claim["words"]) == (kind, words)


def test_a_design_that_breaks_a_limit_is_no_optimum(monkeypatch: pytest.MonkeyPatch) -> None:
    result = solved("tractor-single")
    broken = replace(result, status=Status.FAILED, message="the best design found breaks 'sag'")
    monkeypatch.setattr(answers, "solve", lambda *_, **__: broken)
    actual = settle(PROBLEMS / "tractor-single.toml")
    assert actual["design"] is None
    assert actual["claim"]["kind"] == "no design"
    assert "breaks 'sag'" in actual["claim"]["words"]


def test_limits_that_contradict_each_other_are_named() -> None:
    tables = {**tables_of(LANCHESTER)}
    tables["constraints"] = [*tables["constraints"], {"limit": "maximum mount force", "max": "600 N"}]
    of = Source(tables, LANCHESTER)
    edits = (Edit("set", "constraints.1.max", "0.05 kg"),)
    for found in (
        json.loads(answers.follow(of, PageState(edits))),
        json.loads(answers.settle(of, PageState(edits), 600.0)),
    ):
        assert found["design"] is None
        assert found["claim"]["kind"] == "no design"
        assert sorted(found["conflict"]) == ["balancer mass", "maximum mount force"]
        assert len(found["limits"]) == 2
    assert json.loads(answers.follow(of, PageState()))["design"] is not None


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (Edit("set", "operating_points.1.speed", "fast"), "is not a number"),
        (Edit("set", "operating_points.1.speed", "-3 rpm"), "operating_points"),
        (Edit("set", "engine.rod_ratio", 1.2), "rod_ratio"),
        (Edit("star", "star", {"throws": [0, 90]}), "engine"),
        (Edit("first", "objective", 3), "objective"),
    ],
)
def test_a_bad_state_is_one_line(edit: Edit, said: str) -> None:
    result = follow(LANCHESTER, edits=(edit,))
    assert set(result) == {"error"}
    assert said in result["error"]
    assert len(result["error"].splitlines()) == 1


@pytest.mark.parametrize("name", ["title", "gas.model", "gas.file", "engine.layout", "mounts.positions.1", "assembly"])
def test_numbers_that_were_not_offered_are_refused(name: str) -> None:
    result = follow(LANCHESTER, edits=(Edit("set", name, "../../etc/passwd"),))
    assert "does not offer" in result["error"]


@pytest.mark.parametrize(
    "given",
    [
        [], {"more": 1}, {"edits": {}}, {"edits": [["set", "x"]]}, {"edits": [["run", "x", 1]]},
        {"edits": [["set", 1, 1]]}, {"edits": [["set", "x", [[[1]]]]]}, {"edits": [["set", "x", "1" * 101]]},
        {"edits": [["set", "x", 1]] * 301}, {"edits": [["set", "x", True]]}, {"has": "x" * 101}, {"design": {"a": "b"}},
        {"design": []}, {"edits": [["set", "x", 10**400]]}, {"design": {"a": float("inf")}},
        {"edits": [["set", "x", {"a": {"b": 1}}]]}, {"position": "1"}, {"position": 1.5}, {"position": True},
    ],
)  # fmt: skip
def test_a_malformed_page_state_is_refused(given: object) -> None:
    with pytest.raises(Refused):
        PageState.from_json(given)


def test_a_page_state_is_read() -> None:
    tables = {"edits": [["set", "a", "1 kg"]], "held": [["star", "star", {"throws": [0, 180]}]], "design": {"b": 2}}
    state = PageState.from_json(tables)
    assert state.edits == (Edit("set", "a", "1 kg"),)
    assert state.fixed[0].value == {"throws": [0, 180]}
    assert state.design == {"b": 2.0}


@pytest.mark.slow
def test_a_crank_is_ranked_held_and_chosen() -> None:
    result = settle(VEE)
    assert len(result["ranking"]) == 5
    assert result["claim"]["value"] == pytest.approx(result["ranking"][0]["value"], rel=1e-4)
    held = tuple(Edit(*edit) for edit in result["holds"])
    following = follow(VEE, fixed=held)["claim"]
    assert following["kind"] == "held"
    assert "for this crank" in following["words"]
    assert result["claim"]["value"] <= following["value"] * (1 + 1e-6)
    assert following["value"] == pytest.approx(result["claim"]["value"], rel=5e-3)
    second = result["ranking"][1]
    chosen = settle(VEE, edits=(Edit("star", "star", second["orders"][0]["star"]),))
    assert chosen["claim"]["value"] == pytest.approx(second["value"], rel=1e-4)
    assert chosen["ranking"] == []


def test_a_given_crank_may_be_opened() -> None:
    problem = load(LANCHESTER)
    assert problem.phasing is None
    state = PageState(edits=(Edit("open crank", "crank", 1),))
    tables = state.tables(source(LANCHESTER).tables, with_fixed=True)
    assert load(tables).phasing is not None


@pytest.mark.slow
def test_pictures_are_those_of_what_was_solved_last() -> None:
    state = PageState(edits=(TIGHT,))
    settle(LANCHESTER, edits=state.edits)
    first = json.loads(answers.picture(source(LANCHESTER), state, 0))
    assert first["name"] == "engine"
    assert first["image"].startswith("data:image/svg+xml;base64,")
    assert json.loads(answers.picture(source(LANCHESTER), state, first["of"])) == {"done": True}
    assert json.loads(answers.picture(source(LANCHESTER), PageState(), 0)) == {"done": True}


def test_the_state_is_saved_as_a_problem_that_evaluates_alike(tight: dict[str, Any], tmp_path: Path) -> None:
    state = PageState(edits=(TIGHT,), design=tight["design"])
    record = json.loads(answers.save(source(LANCHESTER), state))
    path = tmp_path / record["file"]
    path.write_text(record["toml"], encoding="utf-8")
    result = laufruhe.evaluate(path)
    assert result.objective is not None
    # at fewer angles than it was proven at
    assert result.objective.value == pytest.approx(tight["claim"]["value"], rel=1e-5)
    assert result.problem.limits[0].maximum == pytest.approx(0.5)
    assert len(result.problem.decisions) == len(load(LANCHESTER).decisions)


def test_a_front_comes_as_a_whole_first_and_no_point_is_dominated() -> None:
    points = [json.loads(answers.front(source(LANCHESTER), PageState(), "balancer mass", k)) for k in range(9)]
    by_mass = sorted(points, key=lambda point: point["across"])
    assert {by_mass[0]["across"], by_mass[-1]["across"]} == {point["across"] for point in points[:2]}
    values = [point["value"] for point in by_mass]
    assert values == sorted(values, reverse=True)
    assert all(point["bound"]["value"] <= point["value"] * (1 + 1e-6) for point in points)
    assert all("no design has less than" in point["words"] for point in points)
    # the optimum under a limit is on the front of that limit
    result = follow(LANCHESTER, edits=(Edit("set", "constraints.1.max", f"{by_mass[4]['across']!r} kg"),))
    assert result["claim"]["value"] == pytest.approx(by_mass[4]["value"], rel=1e-4)
    assert (
        "is not the name of a measure"
        in json.loads(answers.front(source(LANCHESTER), PageState(), "beauty", 0))["error"]
    )


def test_a_front_of_a_simpler_problem_has_no_bound() -> None:
    path = PROBLEMS / "tractor-four-elastic.toml"
    point = json.loads(answers.front(source(path), PageState(), "balancer mass", 0))
    assert point["bound"] is None
    assert point["simpler"] == " for these mounts"
    assert "no design" not in point["words"]


def test_files_that_a_problem_names_are_part_of_its_state() -> None:
    first, other = (replace(source(LANCHESTER), content=content) for content in ("a", "b"))
    keys = [json.loads(answers.follow(of, PageState(has="later")))["key"] for of in (first, other, first)]
    assert keys[0] == keys[2] != keys[1]


@pytest.mark.slow
def test_pictures_of_other_files_are_not_shown() -> None:
    first = replace(source(LANCHESTER), content="a")
    answers.settle(first, PageState(), 600.0)
    assert json.loads(answers.picture(first, PageState(), 0))["name"] == "engine"
    assert json.loads(answers.picture(replace(first, content="b"), PageState(), 0)) == {"done": True}


@pytest.mark.slow
def test_a_number_of_the_file_is_held_where_it_stands_until_it_is_searched() -> None:
    """Check that sliders act on the drawn engine, and that its optimum claims no bound."""
    path = PROBLEMS / "single-stroke-offset.toml"
    first, held = follow(path), follow(path, edits=(Edit("fix", "engine.stroke", "130 mm"),))
    assert [slider["name"] for slider in first["model"]["sliders"]] == ["web.balance_factor"]
    assert "for the other numbers of the file" in first["claim"]["words"]
    assert held["limits"][0]["value"] < 0.99 * first["limits"][0]["value"]
    result = settle(path)["claim"]
    assert result["kind"] == "found"
    assert "no useful bound" in result["words"]
    assert result["value"] == pytest.approx(laufruhe.solve(path).objective.value, rel=1e-9)
