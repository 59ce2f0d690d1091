"""result.json: the contract with scripts."""

from __future__ import annotations

import io
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from cli import scenes
from laufruhe.files.reader import load
from laufruhe.numerics.norms import NORMS
from laufruhe.problem import channels
from laufruhe.problem.measure import Measure
from laufruhe.report.json_result import as_json
from laufruhe.report.result_report import result_document
from laufruhe.report.screen import show
from laufruhe.report.sections.values import limits as limit_tables
from laufruhe.report.wording import fired
from laufruhe.solvers import Result, evaluate_only
from laufruhe.solvers.conclusion import violated_limits
from problem_files import PROBLEMS
from report.result_schema import SCHEMA

RESULTS = {
    "shaking only": lambda: scenes.solved(scenes.SHAKING_ONLY),
    "tight": lambda: scenes.solved(scenes.TIGHT),
    "impossible": lambda: scenes.solved(scenes.IMPOSSIBLE),
    "two points": lambda: scenes.solved(scenes.TWO_POINTS),
    "parts": lambda: scenes.solved(scenes.PARTS),
    "given": lambda: scenes.stated(scenes.GIVEN),
}


def parsed(result: Result) -> dict[str, Any]:
    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is no JSON")

    found: dict[str, Any] = json.loads(as_json(result), parse_constant=refuse)
    return found


@pytest.mark.parametrize("name", RESULTS)
def test_every_result_keeps_the_contract(name: str) -> None:
    Draft202012Validator(SCHEMA).validate(parsed(RESULTS[name]()))


def test_the_schema_finds_what_is_missing() -> None:
    written = parsed(scenes.solved(scenes.TIGHT))
    del written["certificate"]["gap"]
    assert not Draft202012Validator(SCHEMA).is_valid(written)


@pytest.mark.parametrize(("excess", "is_broken"), [(9e-6, False), (2e-5, True)])
def test_a_report_and_a_solver_call_the_same_limits_broken(excess: float, is_broken: bool) -> None:
    initial = scenes.stated(scenes.IMPOSSIBLE)
    (limit,) = (limit for limit in initial.problem.limits if limit.name == "quiet mounts")
    limits = (replace(limit, maximum=initial.final.values(limit.measure)[0] / (1.0 + excess)),)
    result = evaluate_only(initial.problem.changed(limits=limits))
    names = {limit.name for limit in limits if is_broken}
    assert set(violated_limits(limits, result.final)) == names
    assert {limit["name"] for limit in parsed(result)["constraints"] if not limit["met"]} == names
    (table,) = limit_tables(result)
    assert {row[0] for row in table.rows if row[3] == "broken"} == names


def test_numbers_are_those_of_the_result() -> None:
    result = scenes.solved(scenes.TIGHT)
    written = parsed(result)
    assert result.objective is not None
    assert result.certificate is not None
    # full precision: what is read back is the same float
    assert written["objective"]["value"] == result.objective.value
    assert written["objective"]["initial"] == result.objective.initial
    assert written["certificate"]["lower_bound"] == result.certificate.lower_bound
    assert written["decisions"]["left.unbalance"]["value"] == result.decisions[0].value
    assert written["constraints"][0]["shadow_price"] == result.limits[0].shadow_price > 0.0
    assert written["constraints"][0]["active"]
    assert written["firing_intervals"] == [math.pi] * 4
    assert written["timing"] == result.timing


def test_mounts_agree_with_the_model() -> None:
    result = scenes.solved(scenes.TIGHT)
    mounts = parsed(result)["mounts"]
    assert [mount["name"] for mount in mounts] == result.final.mount_names
    for mount in mounts:
        for measure, key in (("mean", "mean"), ("maximum", "max"), ("rms", "rms")):
            quantity = Measure(channels.MOUNT_FORCE, NORMS[measure], at=(mount["name"],))
            assert mount[key] == pytest.approx(result.final.value(quantity), rel=1e-12)
            assert mount["initial"][key] == pytest.approx(result.initial.value(quantity), rel=1e-12)


def test_mounts_over_two_points_are_weighted() -> None:
    result = scenes.solved(scenes.TWO_POINTS)
    # the first is idle, where least shakes
    assert parsed(result)["shaking"] == parsed(result)["points"][1]["shaking"] != parsed(result)["points"][0]["shaking"]
    written = parsed(result)
    assert [point["name"] for point in written["points"]] == ["idle", "rated"]
    mean = np.mean([mount["mean"] for mount in written["mounts"]])
    assert result.objective is not None
    assert mean == pytest.approx(result.objective.value, rel=1e-9)
    for k, mount in enumerate(written["mounts"]):
        idle, rated = (point["mounts"][k] for point in written["points"])
        assert mount["mean"] == pytest.approx(0.25 * idle["mean"] + 0.75 * rated["mean"])
        assert mount["max"] == rated["max"]


def test_every_key_is_explained() -> None:
    reference = Path(__file__).parents[2] / "docs" / "reference"
    text = "".join((reference / name).read_text(encoding="utf-8") for name in ("results.md", "result-json.md"))
    written = parsed(scenes.solved(scenes.TIGHT))
    keys = {*written, *written["objective"], *written["certificate"], *written["constraints"][0], *written["mounts"][0]}
    keys |= {*written["shaking"], *written["points"][0], *next(iter(written["decisions"].values()))}
    explained = {name.rpartition(".")[2].removesuffix("[]") for name in re.findall(r"`([\w.\[\]]+)`", text)}
    assert not keys - explained


def test_shaking_orders_are_amplitudes_of_the_wrench() -> None:
    result = scenes.solved(scenes.SHAKING_ONLY)
    shaking = parsed(result)["shaking"]
    wrench = result.final.loads[0].wrench
    # one direction only: the amplitude is the coefficient's size
    k = shaking["orders"].index(4.0)
    assert shaking["force"][k] == pytest.approx(abs(wrench.at(4.0)[2]), rel=1e-12)
    whole = np.array(shaking["real"]) + 1j * np.array(shaking["imag"])
    assert whole[k] == pytest.approx(wrench.at(4.0))


def test_infeasible_says_what_was_minimised_and_proves_nothing() -> None:
    written = parsed(scenes.solved(scenes.IMPOSSIBLE))
    assert written["status"] == "infeasible"
    assert written["objective"]["name"] == "mean mount force"
    assert written["objective"]["value"] is None
    assert written["objective"]["initial"] > 0.0
    assert written["certificate"]["kind"] == "none"
    assert written["certificate"]["lower_bound"] is None
    assert written["decisions"] == {}
    assert set(written["conflict"]) == {"light shafts", "quiet mounts"}
    assert [entry["met"] for entry in written["constraints"]] == [True, False, True]


@pytest.mark.parametrize("odd", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_not_finite_is_null(odd: float) -> None:
    result = replace(scenes.solved(scenes.TIGHT), error=lambda: odd)
    assert parsed(result)["fidelity"]["error_estimate"] is None


def test_every_order_is_written() -> None:
    """Check that all orders, read back in full precision, add up to the loads."""
    result = scenes.solved(scenes.TIGHT)
    written, wrench = parsed(result)["shaking"], result.final.loads[0].wrench
    used = np.flatnonzero(np.any(wrench.coefficients != 0.0, axis=1))
    assert written["orders"] == wrench.orders[used].tolist()
    read = np.array(written["real"]) + 1j * np.array(written["imag"])
    assert np.array_equal(read, wrench.coefficients[used])
    smallest = min(force for force in written["force"] if force)
    assert smallest < 1e-3 * max(written["force"])
    forces = result.final.loads[0].mount_forces
    assert forces is not None
    orders = parsed(result)["mounts"][0]["orders"]
    assert [entry["order"] for entry in orders] == forces.orders[np.any(forces.coefficients, axis=(1, 2))].tolist()


def test_loads_over_the_cycle_are_written_on_request() -> None:
    result = scenes.solved(scenes.TIGHT)
    assert "series" not in parsed(result)["points"][0]
    written = json.loads(as_json(result, series=True))
    Draft202012Validator(SCHEMA).validate(written)
    series = written["points"][0]["series"]
    forces = np.array(series["mounts"])
    assert forces.shape == (result.final.samples, len(written["mounts"]), 3)
    assert len(series["angle"]) == len(series["shaking"]) == len(forces)
    mean = np.linalg.norm(forces[:, 0], axis=1).mean()
    assert mean == pytest.approx(written["mounts"][0]["mean"], rel=1e-6)


TWIN = """
title = "Two pistons side by side"
[engine]
layout = "parts"
cycle = "four-stroke"
stroke = "80 mm"
rod_ratio = 0.25
reciprocating_mass = "1 kg"
slider_cranks = [{ x = "0 mm" }, { x = "100 mm" }, { x = "200 mm", throw = 180 }]
[[operating_points]]
speed = "1000 rpm"
[objective]
minimise = "mean shaking force"
"""


def test_cylinders_that_fire_at_once_are_named(tmp_path: Path) -> None:
    path = tmp_path / "twin.toml"
    path.write_text(TWIN, encoding="utf-8")
    result, text = evaluate_only(load(path)), io.StringIO()
    show(result, text)
    words = "Firing order 1-2-3, intervals 0, 180, 540 deg. Cylinder 1 and cylinder 2 fire at once."
    assert fired(result) == words
    assert words in text.getvalue()
    page = result_document(result, (), "laufruhe evaluate twin.toml").as_markdown("")
    assert words in page
    assert "firing: occurs at once in cylinder 1 and cylinder 2; give a firing order" in page
    assert parsed(result)["warnings"] == [str(doubt) for doubt in result.problem.plausibility_warnings]
    assert fired(scenes.stated(scenes.GIVEN)) == "Firing order 1-3-4-2, every 180 deg."


def test_a_steam_engine_does_not_fire() -> None:
    steam = evaluate_only(load(PROBLEMS / "steam-two-crank.toml"))
    assert fired(steam) == "Dead centres at the head end in the order 1-2, intervals 270, 90 deg."


def test_cylinders_that_are_meant_to_fire_at_once_raise_no_question(tmp_path: Path) -> None:
    path = tmp_path / "twin.toml"
    path.write_text(TWIN.replace("[engine]", "[engine]\nfires_together = true"), encoding="utf-8")
    assert load(path).plausibility_warnings == ()


def test_roll_and_rocking_are_the_parts_of_the_moment() -> None:
    shaking = parsed(scenes.solved(scenes.PARTS))["shaking"]
    whole = np.array(shaking["real"]) + 1j * np.array(shaking["imag"])
    assert shaking["roll"] == pytest.approx(np.abs(whole[:, 3]))
    assert np.all(np.maximum(shaking["roll"], shaking["rocking"]) <= np.array(shaking["moment"]) * (1.0 + 1e-12))
    assert max(shaking["rocking"]) > 0.0
