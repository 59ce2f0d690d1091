"""Initial design on an undamped resonance: refused itself, and left by a search of open mounts."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.errors import ModelError
from laufruhe.physics.elastic_mounts import ResonanceError
from laufruhe.plots import draw
from laufruhe.problem.evaluation import evaluate, objective_value, place_measures
from laufruhe.problem.mount_resonance import evaluate_start, off_resonance
from laufruhe.problem.problem import Problem
from laufruhe.report.json_result import as_json
from laufruhe.report.result_report import result_document
from laufruhe.solvers import evaluate_only, solve
from laufruhe.solvers.result import Status
from mounts.files import BLOCK, ENGINE, MOUNTS, SAG, changed, problem_of

# bounce at order 2 of 700 rpm: k = m (2 W)^2 / 4 on each of four mounts
STRUCK = 420.0 * (2.0 * 700.0 * math.pi / 30.0) ** 2 / 4.0 / 1e3
UNDAMPED = changed(MOUNTS, ("loss_factor = 0.1\n", ""))
RESONANT = UNDAMPED.replace('start = "400 N/mm"', f'start = "{STRUCK!r} N/mm"')
FORCE = '[objective]\nminimise = "rms mount force"\n[search]\nstarts = 4\n'


def resonant(folder: Path, objective: str = FORCE, mounts: str = RESONANT) -> Problem:
    return problem_of(folder, ENGINE, BLOCK, mounts, objective)


def test_only_what_stands_on_the_resonance_is_infinite(tmp_path: Path) -> None:
    problem = resonant(tmp_path)
    with pytest.raises(ResonanceError):
        evaluate(problem)
    start = evaluate_start(problem)
    assert start.resonance == "the bounce mode at 23.3333 Hz is driven at its own frequency and nothing damps it"
    forces = start.loads[0].mount_forces
    assert forces is not None
    assert np.isinf(np.abs(forces.at(2))).all()
    assert np.isfinite(np.abs(forces.at(4))).all()
    assert np.abs(forces.at(4)).max() > 0.0
    assert math.isinf(objective_value(problem, start))
    assert all(math.isinf(m.mean) for m in place_measures(start, 0))
    fourth = resonant(tmp_path, FORCE.replace("[search]", "orders = [4]\n[search]"))
    assert math.isfinite(objective_value(fourth, evaluate_start(fourth)))


def test_a_result_that_stays_on_the_resonance_shows_what_is_finite(tmp_path: Path) -> None:
    result = replace(evaluate_only(resonant(tmp_path), allow_resonance=True), status=Status.FAILED)
    drawn = draw(result, tmp_path)
    assert drawn == ("engine.png", "transmissibility.png", "campbell.png", "modes.png", "run_up.png")
    text = result_document(result, [name.removesuffix(".png") for name in drawn], "").as_markdown(".png")
    for curves in (result.forces, result.orders):
        with pytest.raises(ModelError, match="there are no finite loads"):
            curves()
    assert "## Natural modes" in text
    assert "## Orders" not in text
    assert json.loads(as_json(result))["mounts"][0]["mean"] is None


def test_a_design_off_resonance_is_evaluated_as_ever(tmp_path: Path) -> None:
    problem = resonant(tmp_path, mounts=UNDAMPED)
    start, usual = evaluate_start(problem), evaluate(problem)
    assert not start.resonance
    assert objective_value(problem, start) == objective_value(problem, usual)
    assert off_resonance(problem) is problem


@pytest.mark.slow
def test_the_search_ends_where_it_does_from_elsewhere(tmp_path: Path) -> None:
    objective = FORCE.replace("starts = 4", "starts = 1")
    result, usual = solve(resonant(tmp_path, objective)), solve(resonant(tmp_path, objective, UNDAMPED))
    assert result.objective is not None
    assert usual.objective is not None
    assert result.certificate is not None
    assert result.objective.value == pytest.approx(usual.objective.value, rel=1e-5)
    assert math.isinf(result.objective.initial)
    assert math.isnan(result.objective.reduction)
    # an infinite start is no scale for a gap
    assert result.certificate.gap == pytest.approx(
        1.0 - result.certificate.lower_bound / result.objective.value, rel=1e-6
    )
    assert "on a resonance" in repr(result)
    assert result.message.endswith("nothing damps it")


def test_a_convex_problem_keeps_its_proof(tmp_path: Path) -> None:
    result = solve(resonant(tmp_path, SAG))
    assert result.status == "optimal"
    assert result.objective is not None
    assert math.isfinite(result.objective.initial)


def test_a_resonance_that_no_open_number_moves_is_refused(tmp_path: Path) -> None:
    """Check bounce at its own frequency with only a lateral stiffness open."""
    text = f"{STRUCK!r} N/mm"
    stiff = f'stiffness = ["120 N/mm", {{ between = ["100 N/mm", "140 N/mm"] }}, "{text}"]'
    given = f'stiffness = ["120 N/mm", "120 N/mm", {{ between = ["20 N/mm", "4000 N/mm"], start = "{text}" }}]'
    mounts = RESONANT.replace(given, stiff)
    assert mounts != RESONANT
    with pytest.raises(ResonanceError, match="bounce"):
        solve(resonant(tmp_path, mounts=mounts))


@pytest.mark.slow
def test_from_the_shell(tmp_path: Path) -> None:
    """Check that evaluate refuses the design, check and solve accept it, and infinite values are null."""
    resonant(tmp_path, FORCE.replace("starts = 4", "starts = 1"))
    path, out = tmp_path / "problem.toml", tmp_path / "out"
    refused = CliRunner().invoke(app, ["evaluate", str(path), "--out", str(out)])
    assert (refused.exit_code, out.exists()) == (2, False)
    assert CliRunner().invoke(app, ["check", str(path)]).exit_code == 0
    solved = CliRunner().invoke(app, ["solve", str(path), "--no-plots", "--out", str(out)])
    assert solved.exit_code == 0, solved.output
    assert "the initial design is on a resonance" in solved.output
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert (result["objective"]["initial"], result["objective"]["reduction"]) == (None, None)
    assert result["mounts"][0]["initial"] == {"mean": None, "max": None, "rms": None}
    assert "bounce mode at 23.3333 Hz" in result["message"]
    report = (out / "report.md").read_text(encoding="utf-8")
    assert "The initial design has no finite loads: the bounce mode" in report
    assert " inf" not in report
    assert " nan" not in report
