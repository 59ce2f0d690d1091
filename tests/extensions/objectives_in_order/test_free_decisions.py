"""Decisions that an optimum leaves free (P17): against grids by the exact model, and against optima with one held."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.extensions.objectives_in_order.equal_designs import FREE, free_decisions, ranges_of
from laufruhe.files.reader import load, load_tables
from laufruhe.problem.decision import domains_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Interval
from laufruhe.prove.certificate import Proof, ProofStrength
from laufruhe.report.json_result import as_dict
from laufruhe.report.sections.values import decisions
from laufruhe.report.wording import explained
from laufruhe.solvers import solve
from laufruhe.solvers.conclusion import ProofData, build_result, evaluate_design
from laufruhe.solvers.prices import Price
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import relevant_decisions
from problem_files import PROBLEMS

ENGINE = {
    "layout": "inline", "cycle": "four-stroke", "bore": "100 mm", "stroke": "120 mm", "rod_ratio": 0.28,
    "reciprocating_mass": "1.5 kg", "throws": [0], "firing_order": [1],
}  # fmt: skip
VEE = ENGINE | {"layout": "vee", "bank_angle": 70, "cylinder_spacing": "130 mm", "firing_order": [1, 2]}
THREE = ENGINE | {"cylinders": 3, "throws": "open", "firing_order": "open", "cylinder_spacing": "120 mm"}
POSITIONS = [["200 mm", "250 mm", "0 mm"], ["200 mm", "-250 mm", "0 mm"], ["-300 mm", "0 mm", "-20 mm"]]
SPRINGS = {
    "kind": "elastic", "loss_factor": 0.1,
    "places": [{"position": place, "stiffness": ["200 N/mm"] * 3} for place in POSITIONS],
}  # fmt: skip
BLOCK = {"mass": "120 kg", "inertia": ["6 kg m^2", "9 kg m^2", "8 kg m^2"]}
POINTS = [{"name": "idle", "speed": "800 rpm"}, {"name": "rated", "speed": "2500 rpm", "gas": False}]


def web(name: str, maximum: str = "2 kg", x: str = "0 mm") -> dict[str, Any]:
    return {"name": name, "x": x, "opposite_throw": 1, "radius": "80 mm", "mass": {"between": ["0 kg", maximum]}}


def problem_of(
    minimise: str, webs: list[dict[str, Any]], narrowed: dict[str, Any] | None = None, **changes: Any
) -> Problem:
    whole = {
        "title": "test", "engine": ENGINE, "mounts": {"positions": POSITIONS}, "operating_points": POINTS,
        "gas": {"model": "seiliger", "peak_pressure": "80 bar", "imep": "6 bar"}, "fidelity": {"samples": 360},
        "counterweights": webs, "objective": {"minimise": minimise} | (narrowed or {}),
    }  # fmt: skip
    return load_tables(whole | changes, Path("t.toml"))


def ends_of(result: Result) -> dict[str, tuple[float, float]]:
    assert result.status is Status.OPTIMAL
    assert result.free is not None
    return {found.name: (found.low, found.high) for found in result.free}


TWINS = [web("one", "2 kg", "200 mm"), web("two", "0.8 kg", "200 mm")]
SCENES = {
    "single": {}, "vee": {"engine": VEE}, "on elastic mounts": {"mounts": SPRINGS, "block": BLOCK},
    "stars, with gas": {"engine": THREE},
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_two_weights_in_one_place_are_free_against_each_other(name: str) -> None:
    """Check the ends that follow from the fixed sum and the bounds of each weight."""
    settings = SCENES[name]
    result = laufruhe.solve(problem_of("mean mount force", TWINS, **settings))
    alone = laufruhe.solve(problem_of("mean mount force", [web("both", "2.8 kg", "200 mm")], **settings))
    assert alone.free == ()
    whole = sum(decision.value for decision in result.decisions if decision.unit == "kg")
    assert whole == pytest.approx(next(d.value for d in alone.decisions if d.unit == "kg"), rel=1e-3, abs=1e-4)
    ends = ends_of(result)
    for own, other in (("one", 0.8), ("two", 2.0)):
        low, high = ends[f"{own}.mass"]
        maximum = {"one": 2.0, "two": 0.8}[own]
        assert low == pytest.approx(max(whole - other, 0.0), abs=5e-3 * whole)
        assert high == pytest.approx(min(whole, maximum), abs=5e-3 * whole)


def test_a_decision_without_effect_is_free_from_bound_to_bound() -> None:
    """A weight on the crank makes no force of second order."""
    result = laufruhe.solve(problem_of("rms mount force", [web("web")], {"orders": [2]}))
    assert ends_of(result)["web.mass"] == pytest.approx((0.0, 2.0), abs=1e-6)
    assert "not unique" in decisions(result)[0].note
    (record,) = as_dict(result)["free_decisions"]
    assert record == {"name": "web.mass", "unit": "kg", "low": pytest.approx(0.0), "high": pytest.approx(2.0)}


GRIDS = [
    ("maximum mount force", {}), ("maximum mount force", {"engine": VEE}), ("mean mount force", {}),
    ("maximum mount force", {"mounts": SPRINGS, "block": BLOCK}), ("maximum roll moment", {"engine": VEE}),
    ("maximum mount force", {"operating_points": POINTS[:1]}),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("minimise", "settings"), GRIDS)
def test_a_grid_shows_the_same(minimise: str, settings: dict[str, Any]) -> None:
    """Check by a grid of 41 masses that all between the free ends are optimal, and no other distant pair."""
    problem = problem_of(minimise, [web("web", "4 kg")], **settings)
    result = laufruhe.solve(problem)
    best, masses = result.objective.value, np.linspace(0.0, 4.0, 41)
    values = np.array([objective_value(problem, evaluate(problem, problem.design([mass]))) for mass in masses])
    assert values.min() >= result.certificate.lower_bound * (1.0 - 1e-9)
    ends = ends_of(result)
    assert bool(ends) == (minimise == "maximum roll moment")
    low, high = ends.get("web.mass", (math.inf, -math.inf))
    assert np.all(values[(masses >= low) & (masses <= high)] <= best * (1.0 + problem.tolerance))
    equal = masses[values <= best * (1.0 + 1e-7)]
    assert ends or not len(equal) or np.ptp(equal) <= FREE * 4.0


READY = ("twin-parallel-180", "tractor-three-bearings")


@pytest.mark.slow
@pytest.mark.parametrize("name", READY)
def test_the_optimum_is_as_good_with_a_free_decision_fixed(name: str) -> None:
    """Check that the optimum stays as good with a free decision held at both ends and between."""
    problem = load(PROBLEMS / f"{name}.toml")
    result = laufruhe.solve(problem)
    found = [free_decision for free_decision in result.free if not free_decision.name.endswith(".angle")]
    assert found
    best, free_decision = result.objective.value, found[0]
    k = next(k for k, decision in enumerate(problem.decisions) if decision.name == free_decision.name)
    for share in (0.0, 0.5, 1.0):
        size = free_decision.low + share * (free_decision.high - free_decision.low)
        held = holding(problem, k, size)
        again = solve(held)
        assert again.objective.value <= best * (1.0 + 2.0 * problem.tolerance)
        assert again.final.violation(problem.limits) <= 1e-5


def holding(problem: Problem, k: int, size: float) -> Problem:
    """Return the problem with one decision at a size, in the plane at most this size."""
    decision = problem.decisions[k]
    own = decision.set.within(size) if decision.set.width > 1 else Interval(size, size, decision.set.angle)
    decisions = (*problem.decisions[:k], replace(decision, set=own), *problem.decisions[k + 1 :])
    return problem.changed(decisions=decisions)


@pytest.mark.slow
def test_unchecked_results_claim_no_free_decisions() -> None:
    assert solve(problem_of("mean mount force", TWINS)).free is None
    moving = load(PROBLEMS / "tractor-four-shaft-heights.toml")
    result = solve(replace(problem_of("mean mount force", TWINS)))
    assert free_decisions(replace(result, problem=moving)) is None
    assert as_dict(result)["free_decisions"] is None
    assert not decisions(result)[0].note


def test_prices_within_the_accuracy_are_none() -> None:
    """Check that a slope below the gap of the proof has no price, and a larger one has."""
    problem = problem_of("mean mount force", [web("web")])
    design = evaluate_design(problem, [0.0])
    scale = design.value / 2.0
    for slope, priced in ((1e-10, False), (5e-5, False), (1e-2, True)):
        shown = ProofData(
            design.value * (1.0 - 1e-4), ProofStrength.EXACT, 0.0, "", {}, {"web.mass": Price.both(slope * scale)}
        )
        (decision,) = build_result(design, design.evaluation, shown, {}).decisions
        assert decision.at_bound
        assert decision.shadow_price == (pytest.approx(slope * scale) if priced else 0.0)


def test_the_angle_of_a_zero_unbalance_is_not_shown() -> None:
    result = solve(problem_of("rms mount force", [web("web") | {"angle": {"between": [0, 360]}}], {"orders": [2]}))
    assert [decision.name for decision in relevant_decisions(result.decisions)] == ["web.mass"]
    assert "web.angle" not in repr(result)
    assert decisions(result)[0].rows[1][2] == "-"


def test_a_large_residual_of_the_conditions_is_no_percentage() -> None:
    result = solve(problem_of("mean mount force", [web("web")]))
    loose = replace(result, certificate=replace(result.certificate, gap=0.0, kkt_residual=6.7e-2))
    assert "which leaves no gap" in explained(loose)
    assert "conditions" not in explained(loose)
    assert "hold with a residual" in explained(result)
    local = replace(loose, certificate=replace(loose.certificate, kind=Proof.LOCAL, lower_bound=0.0, gap=1.0))
    assert "conditions are not confirmed" in explained(local)
    assert "%" not in explained(local)
    unproven = replace(local, certificate=replace(local.certificate, kind=Proof.NONE))
    assert explained(unproven) == "No useful lower bound was found."
    bounded = replace(unproven, certificate=replace(unproven.certificate, lower_bound=1.0, gap=0.5))
    assert explained(bounded).startswith("No design is below 1.00000 N; designs between this bound and this design")


def test_a_free_angle_runs_from_the_first_to_the_last_of_its_designs() -> None:
    """Check the range of the angle for three designs at 0.2, 0.5 and 0.9 rad."""
    table = {"title": "one weight", "engine": ENGINE, "operating_points": [{"speed": "1000 rpm"}],
             "counterweights": [{"name": "web", "x": "0 mm", "unbalance": {"between": ["0 kg m", "0.1 kg m"]},
                                 "angle": {"between": [0, 360]}}],
             "objective": {"minimise": "rms shaking force"}}  # fmt: skip
    (domain,) = domains_of(load_tables(table, Path("one.toml")).decisions)
    turns = (0.5, 0.2, 0.9)
    ranges = ranges_of(domain, [0.05 * np.array([math.cos(turn), math.sin(turn)]) for turn in turns])
    assert [(one.name, one.unit) for one in ranges] == [("web.angle", "rad")]
    assert (ranges[0].low, ranges[0].high) == pytest.approx((0.2, 0.9))
