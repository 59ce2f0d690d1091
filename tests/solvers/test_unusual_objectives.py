"""Objectives of zero, of several units, and problems without open numbers."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from cli import scenes
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.report.wording import explained, headline
from laufruhe.solvers import Status, solve
from mounts.files import BLOCK, ENGINE, MOUNTS, OPEN, changed, problem_of

YOKES = """
title = "Two Scotch yokes turning against each other"
[engine]
layout = "parts"
cycle = "two-stroke"
stroke = "70 mm"
rod_ratio = 0
reciprocating_mass = "0.9 kg"
[[engine.shafts]]
name = "left"
ratio = 1
position = ["60 mm", "0 mm"]
[[engine.shafts]]
name = "right"
ratio = -1
position = ["-60 mm", "0 mm"]
[[engine.slider_cranks]]
shaft = "left"
x = "0 mm"
[[engine.slider_cranks]]
shaft = "right"
x = "0 mm"
[[operating_points]]
speed = "3000 rpm"
[[balancer_shafts]]
name = "L"
ratio = 1
position = ["60 mm", "0 mm"]
[[balancer_shafts.unbalances]]
unbalance = { between = ["0 kg m", "0.1 kg m"] }
angle = { between = [0, 360] }
[[balancer_shafts]]
name = "R"
ratio = -1
position = ["-60 mm", "0 mm"]
[[balancer_shafts.unbalances]]
coupled = { to = "L", as = "mirrored" }
[objective]
minimise = "mean shaking force"
"""


def test_the_conditions_hold_at_an_optimum_of_zero() -> None:
    """Each takes the whole of one piston; alignment is no part of a rounding."""
    result = scenes.solved(YOKES)
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.kkt_residual < 1e-6
    assert result.decisions[0].value == pytest.approx(0.9 * 0.035, rel=1e-6)
    assert "to 0 N" in headline(result)


def test_a_sum_of_several_units_has_none() -> None:
    mixed = (
        scenes.TIGHT
        + """
[[objective.terms]]
quantity = "mean mount force"
[[objective.terms]]
quantity = "rms roll moment"
weight = 2
"""
    )
    result = scenes.stated(mixed)
    assert result.objective is not None
    assert result.objective.unit == ""
    assert headline(result).endswith(f" {result.objective.value:.4g}.")
    assert scenes.stated(scenes.TIGHT).problem.objective_unit == "N"


@pytest.fixture
def closed_problem(tmp_path: Path) -> Problem:
    """Return the elastic mounts without anything open, and a transmissibility to be least."""
    mounts = changed(MOUNTS, (OPEN, '"400 N/mm"'), (OPEN, '"400 N/mm"'))
    objective = '[objective]\nminimise = "transmissibility"\noperating_points = ["idle"]\norders = [1]\n'
    yoke = changed(ENGINE, ("0.26", "0"), ("[0, 180, 180, 0]", "[0]"))
    return problem_of(tmp_path, yoke, BLOCK, mounts, objective)


def test_closed_problems_on_elastic_mounts_are_evaluated(closed_problem: Problem) -> None:
    """The first order of a Scotch yoke is a force through the middle: one mass on one spring (eq. 40)."""
    result = solve(closed_problem)
    assert result.status is Status.FEASIBLE
    assert result.certificate is None
    assert not result.decisions
    assert result.objective is not None
    ratio = closed_problem.points[0].speed ** 2 / (4.0 * 400e3 / 420.0)
    single = math.hypot(1.0, 0.1) / math.hypot(1.0 - ratio, 0.1)
    assert result.objective.value == pytest.approx(single, rel=1e-9)
    assert explained(result).startswith("Nothing was decided")


def test_a_problem_shows_itself_in_a_line(closed_problem: Problem) -> None:
    assert repr(closed_problem) == (
        "<Problem problem, 1 cylinder, four-stroke, 4 mounts, 1 operating point, 0 limits; open: nothing>"
    )
    assert closed_problem._repr_html_().startswith("<strong>test</strong>\n<div>problem, 1 cylinder")
