"""Rules of every method: limits that no open number changes, and no design worse than the initial one."""

from __future__ import annotations

from pathlib import Path

import pytest

from laufruhe import load, solve
from laufruhe.errors import ModelError
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.prove.certificate import Proof, ProofStrength
from laufruhe.solvers import Status
from laufruhe.solvers.conclusion import ProofData, build_result, evaluate_design
from problem_files import PROBLEMS, loaded

BLOCK = """
title = "Two in line on elastic mounts"
[engine]
layout = "inline"
cycle = "two-stroke"
stroke = "90 mm"
rod_ratio = 0.27
reciprocating_mass = "0.8 kg"
cylinder_spacing = "100 mm"
throws = {throws}
[[operating_points]]
speed = "1500 rpm"
[block]
mass = "150 kg"
inertia = ["5 kg m^2", "12 kg m^2", "10 kg m^2"]
[mounts]
kind = "elastic"
loss_factor = 0.1
[[mounts.places]]
name = "m0"
position = ["300 mm", "200 mm", "0 mm"]
stiffness = ["300 N/mm", "300 N/mm", {stiffness}]
[[mounts.places]]
name = "m1"
mirror_of = "m0"
[[mounts.places]]
name = "m2"
position = ["-300 mm", "0 mm", "0 mm"]
stiffness = ["300 N/mm", "300 N/mm", "300 N/mm"]
{more}
[search]
starts = 1
boxes = 0
[objective]
minimise = "rms mount force"
[[constraints]]
limit = "static sag"
max = "{sag}"
[[constraints]]
limit = "rms shaking force"
max = "{force}"
"""
WEB = """
[[counterweights]]
name = "web"
x = "0 mm"
unbalance = { between = ["0 kg m", "0.02 kg m"] }
angle = { between = [0, 360] }
"""
GIVEN = {"throws": [0, 180], "stiffness": '"300 N/mm"', "more": ""}
OPEN = {
    "nothing": GIVEN,
    "unbalances": {**GIVEN, "more": WEB},
    "stiffness": {**GIVEN, "stiffness": '{ between = ["250 N/mm", "350 N/mm"] }'},
    "a star": {**GIVEN, "throws": '"open"\ncylinders = 2'},
}


@pytest.mark.parametrize("attainable", [True, False])
@pytest.mark.parametrize("what", OPEN)
def test_limits_without_open_numbers(what: str, attainable: bool, tmp_path: Path) -> None:
    """Check that kept limits are in the result, and that broken ones are named."""
    acts_on_sag = what == "stiffness"
    broken = "rms shaking force" if acts_on_sag else "static sag"
    sag, force = "5 mm", "5000 N"
    if not attainable:
        sag, force = (sag, "1 N") if acts_on_sag else ("0.01 mm", force)
    result = solve(loaded(tmp_path, BLOCK.format(sag=sag, force=force, **OPEN[what])))
    assert [limit.name for limit in result.limits] == ["rms shaking force", "static sag"]
    assert result.problem.limits[1].measure.name == "static sag"
    if attainable:
        assert result.status in (Status.OPTIMAL, Status.FEASIBLE)
        assert all(limit.value <= limit.limit for limit in result.limits)
    else:
        assert result.status is Status.INFEASIBLE
        assert result.conflict == (broken,)


@pytest.mark.parametrize("minimum", ["1 N", "3500 N"])
def test_limits_that_no_unbalance_keeps_on_any_mounts(minimum: str, tmp_path: Path) -> None:
    """Check that a limit on the shaking force, which mounts do not change, is infeasible at 1 N."""
    tables = {**OPEN["stiffness"], "throws": [0, 0], "more": WEB}
    result = solve(loaded(tmp_path, BLOCK.format(sag="5 mm", force=minimum, **tables)))
    if minimum == "1 N":
        assert result.status is Status.INFEASIBLE
        assert result.conflict == ("rms shaking force",)
    else:
        assert result.status in (Status.OPTIMAL, Status.FEASIBLE)


def test_no_design_worse_than_the_initial_one_is_returned() -> None:
    """Check that the initial design replaces a worse proposal, with the proven bound."""
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    initial = evaluate(problem)
    worse = evaluate_design(problem, [-decision.upper for decision in problem.decisions])
    value = objective_value(problem, initial)
    assert worse.value > value
    shown = ProofData(0.5 * value, ProofStrength.EXACT, 0.0, "a guess")
    result = build_result(worse, initial, shown, {})
    assert result.objective is not None
    assert result.certificate is not None
    assert result.objective.value == value
    assert result.certificate.kind is Proof.WITHIN_GAP
    assert result.certificate.gap == pytest.approx(0.5)


@pytest.mark.parametrize("what", [what for what in OPEN if what != "nothing"])
def test_nothing_minimised_is_refused(what: str, tmp_path: Path) -> None:
    """Check one line for any open numbers."""
    problem = loaded(tmp_path, BLOCK.format(sag="5 mm", force="5000 N", **OPEN[what]))
    with pytest.raises(ModelError, match="is open, but there is no objective"):
        solve(problem.changed(objective=(), limits=()))
