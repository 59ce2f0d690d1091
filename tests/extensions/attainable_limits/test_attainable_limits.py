"""Attainable values of limits that no design keeps (P16), compared with grids of designs, every star, and edges."""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.extensions.attainable_limits.solver import CLOSE, LONG, _bisect, with_attainable_limits
from laufruhe.files.reader import load_tables
from laufruhe.numerics.budget import limit_time, minimum_time, seconds_left
from laufruhe.numerics.progress import Step, progress_listener
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Limit
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof, ProofStrength
from laufruhe.report.json_result import as_dict
from laufruhe.report.sections.values import attainable as attainable_tables
from laufruhe.report.wording import attainable, explained
from laufruhe.solvers import solve
from laufruhe.solvers.accuracy import objective_error
from laufruhe.solvers.conclusion import ProofData, build_result, evaluate_design, infeasible_result
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import AttainableLimit

SINGLE = {
    "layout": "inline", "cycle": "four-stroke", "bore": "100 mm", "stroke": "120 mm", "rod_ratio": 0.28,
    "reciprocating_mass": "1.5 kg", "throws": [0], "firing_order": [1],
}  # fmt: skip
VEE = SINGLE | {"layout": "vee", "bank_angle": 70, "cylinder_spacing": "130 mm", "firing_order": [1, 2]}
BOXER = SINGLE | {
    "layout": "boxer",
    "bank_stagger": "40 mm",
    "cylinder_spacing": "130 mm",
    "throws": [0, 180],
    "firing_order": [1, 2],
}
FIVE = SINGLE | {"cylinders": 5, "throws": "open", "firing_order": "open", "cylinder_spacing": "120 mm"}
POSITIONS = [
    ["200 mm", "250 mm", "0 mm"], ["200 mm", "-250 mm", "0 mm"],
    ["-300 mm", "250 mm", "-20 mm"], ["-300 mm", "-250 mm", "-20 mm"],
]  # fmt: skip
POINTS = [{"name": "idle", "speed": "800 rpm"}, {"name": "rated", "speed": "2500 rpm", "weight": 3.0, "gas": False}]
GAS = {"model": "seiliger", "peak_pressure": "80 bar", "imep": "6 bar"}
WEB = {
    "name": "web", "x": "10 mm", "opposite_throw": 1, "radius": "80 mm",
    "mass": {"between": ["0 kg", "3 kg"]}, "angle": {"between": [-180, 180]},
}  # fmt: skip
BLOCK = {
    "mass": "120 kg", "centre_of_gravity": ["0 mm", "0 mm", "100 mm"],
    "inertia": ["6 kg m^2", "9 kg m^2", "8 kg m^2"],
}  # fmt: skip


def limit(quantity: str, **keys: Any) -> dict[str, Any]:
    return {"limit": quantity, **keys}


LIGHT = limit("counterweight mass", max="0.3 kg", name="light")
QUIET = limit("maximum mount force", max="900 N", operating_points=["rated"], name="quiet")


def problem_of(limits: list[dict[str, Any]], **changes: Any) -> Problem:
    whole = {
        "title": "test", "engine": SINGLE, "mounts": {"positions": POSITIONS}, "operating_points": POINTS, "gas": GAS,
        "counterweights": [WEB], "objective": {"minimise": "mean mount force"}, "fidelity": {"samples": 180},
        "constraints": limits,
    }  # fmt: skip
    return load_tables({key: value for key, value in (whole | changes).items() if value is not None}, Path("t.toml"))


def grid_of(problem: Problem) -> Iterator[Evaluation]:
    """Yield the designs over the whole of the bounds of one weight, by the exact model alone."""
    (weight,) = problem.decisions
    for size, angle in itertools.product(np.linspace(0.0, weight.set.upper, 11), np.linspace(-math.pi, math.pi, 25)):
        yield evaluate(problem, problem.design([cmath.rect(size, angle)]))


def keeps(found: Evaluation, limits: tuple[Limit, ...]) -> bool:
    return found.violation(limits) <= 1e-5


@pytest.fixture(autouse=True)
def _enough_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give all limits enough time on a slow machine, and where calls are traced."""
    monkeypatch.setattr("laufruhe.extensions.attainable_limits.solver.MIN_SECONDS", 600.0)


SCENES = {
    "single, gas, two points": problem_of([LIGHT, QUIET]),
    "single, each by itself": problem_of([limit("rms shaking force", max="2 N"), QUIET]),
    "vee": problem_of([LIGHT, QUIET, limit("rms rocking couple", max="400 N m")], engine=VEE),
    "boxer, on elastic mounts": problem_of(
        [LIGHT, limit("rms rocking couple", max="1 N m", name="couple"), limit("maximum mount travel", max="20 mm")],
        engine=BOXER, block=BLOCK,
        mounts={"kind": "elastic", "loss_factor": 0.1,
                "places": [{"position": at, "stiffness": ["200 N/mm"] * 3} for at in POSITIONS]},
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_no_design_of_a_grid_goes_under_what_a_limit_can_reach(name: str) -> None:
    problem = SCENES[name]
    result = laufruhe.solve(problem)
    assert result.status is Status.INFEASIBLE
    assert [reach.name for reach in result.reached] == list(result.conflict)
    designs = [*grid_of(problem)]
    for reach in result.reached:
        own = next(limit for limit in problem.limits if limit.name == reach.name)
        others = tuple(limit for limit in problem.limits if limit is not own)
        feasible = [found.value(own.measure) for found in designs if keeps(found, others)]
        if reach.why:
            assert not feasible
            assert solve(replace(problem, limits=others)).status is Status.INFEASIBLE
            continue
        assert reach.proof is Proof.GLOBAL
        assert reach.bound > own.maximum
        assert min(feasible, default=math.inf) >= reach.bound * (1.0 - 1e-6)
        values = {decision.name: decision.value for decision in reach.decisions}
        design = evaluate(problem, problem.design([cmath.rect(values["web.mass"], values["web.angle"])]))
        assert design.value(own.measure) == pytest.approx(reach.value, rel=1e-4)
        assert keeps(design, others)
        # the tool finds a design at the value told, and proves that there is none a little lower
        for share, status in ((1.001, (Status.OPTIMAL, Status.FEASIBLE)), (0.999, (Status.INFEASIBLE,))):
            moved = replace(own, maximum=share * reach.value)
            assert solve(replace(problem, limits=(*others, moved))).status in status


@pytest.mark.slow
def test_every_star_is_looked_at() -> None:
    """Compare the attainable value of one couple of five cylinders under the other with all stars."""
    limits = [limit("rms rocking couple", orders=[k], max="300 N m", name=f"order {k}") for k in (1, 2)]
    problem = problem_of([*limits, limit("rms roll moment", max="9 MN m")], engine=FIVE, counterweights=None)
    result = laufruhe.solve(problem)
    assert result.status is Status.INFEASIBLE
    assert result.conflict == ("order 1", "order 2")
    # some stars keep one of them, others the other, whatever one of them breaks
    faint = WEB | {"mass": {"between": ["0 g", "1 g"]}}
    assert solve(problem_of(limits, engine=FIVE, counterweights=[faint])).conflict == ("order 1", "order 2")
    pairs = []
    for steps in itertools.permutations(range(1, 5)):
        fixed = {key: value for key, value in FIVE.items() if key != "firing_order"}
        star = problem_of([], engine=fixed | {"throws": [0, *(72 * k for k in steps)]}, counterweights=None)
        found = evaluate(star)
        pairs.append([found.value(limit.measure) for limit in problem.limits[:2]])
    for k, reach in enumerate(result.reached):
        feasible = [pair[k] for pair in pairs if pair[1 - k] <= 300.0]
        assert reach.proof is Proof.GLOBAL
        assert reach.value == pytest.approx(min(feasible), rel=1e-9)
        assert {decision.name for decision in reach.decisions} == {f"throw {j}" for j in range(1, 6)}
    assert "Without any one of these limits" in explained(result)


OPEN = {"between": ["50 N/mm", "800 N/mm"], "start": "300 N/mm"}


def mounts_of(front: dict[str, Any], rear: Any = OPEN) -> dict[str, Any]:
    """Return two pairs of mounts, each with one open number or more."""
    front = {"name": "front", "position": POSITIONS[0], "stiffness": ["100 N/mm", "100 N/mm", OPEN]} | front
    tables = {"name": "rear", "position": POSITIONS[2], "stiffness": ["100 N/mm", "100 N/mm", rear]}
    return {"kind": "elastic", "loss_factor": 0.1,
            "places": [front, {"mirror_of": "front"}, tables, {"mirror_of": "rear"}]}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("side", ["min", "max"])
def test_limits_that_cannot_be_minimised_are_bisected(side: str) -> None:
    """Compare natural frequencies under a limit on sag with a grid of both stiffnesses."""
    sides = {"min": "1 Hz", "max": "500 Hz"} | {side: "12 Hz"}
    limits = [limit("static sag", max="1 mm"), limit("natural frequencies", **sides)]
    problem = problem_of(
        limits, block=BLOCK, counterweights=None, mounts=mounts_of({}), objective={"minimise": "total stiffness"}
    )
    result = laufruhe.solve(problem)
    assert result.status is Status.INFEASIBLE
    reach = next(each for each in result.reached if each.name == "natural frequencies")
    own = next(limit for limit in problem.limits if limit.name == reach.name)
    others = tuple(limit for limit in problem.limits if limit is not own)
    springs = [np.geomspace(d.set.lower, d.set.upper, 9) for d in problem.decisions]
    # neither limit is of a load
    still = replace(problem, points=())
    designs = (evaluate(still, problem.design(pair)) for pair in itertools.product(*springs))
    extreme = min if side == "min" else max
    feasible = [extreme(found.values(own.measure)) for found in designs if keeps(found, others)]
    sign = 1.0 if side == "min" else -1.0
    best = max(sign * value for value in feasible)
    assert reach.side == ("at least" if side == "min" else "at most")
    assert best <= sign * reach.bound
    assert best - 0.01 * abs(best) <= sign * reach.value <= sign * reach.bound
    assert reach.value == pytest.approx(reach.bound, rel=2e-3)
    values = [decision.value for decision in reach.decisions]
    assert extreme(evaluate(problem, problem.design(values)).values(own.measure)) == pytest.approx(reach.value)


FORCE = {"minimise": "rms mount force"}
LOW = mounts_of({"position": ["200 mm", "250 mm", {"between": ["-50 mm", "50 mm"], "start": "0 mm"}]}, "300 N/mm")


@pytest.mark.slow
def test_the_nearest_design_is_reported_without_a_feasible_one() -> None:
    """Check travel on mounts of open place, where no proof is claimed."""
    limits = [limit("maximum mount travel", max="1 mm"), limit("static sag", max="2 mm")]
    problem = problem_of(limits, block=BLOCK, counterweights=None, mounts=LOW, objective=FORCE,
                         search={"starts": 2, "boxes": 1})  # fmt: skip
    result = laufruhe.solve(problem)
    assert result.status is Status.FAILED
    near = result.nearest
    assert near is not None
    assert near.name == "maximum mount travel"
    design = evaluate(problem, problem.design([decision.value for decision in near.decisions]))
    assert design.value(problem.limits[0].measure) == pytest.approx(near.value, rel=1e-9)
    assert design.violation(problem.limits) == pytest.approx(near.violation, rel=1e-9)
    assert near.broken == ("maximum mount travel",)
    sides = [np.linspace(d.lower, d.upper, 4) for d in problem.decisions]
    grid = [evaluate(problem, problem.design(list(point))) for point in itertools.product(*sides)]
    assert near.violation <= evaluate(problem).violation(problem.limits)
    (reach,) = result.reached
    assert reach.proof is Proof.LOCAL
    feasible = [found.value(problem.limits[0].measure) for found in grid if keeps(found, problem.limits[1:])]
    assert reach.bound <= min(feasible)
    assert reach.value <= 1.05 * min(feasible)
    written = as_dict(result)
    assert written["objective"]["value"] is None
    assert written["nearest"]["decisions"].keys() == {decision.name for decision in near.decisions}
    assert "proven;" not in " ".join(attainable(result))
    (grid,) = attainable_tables(result)
    assert grid.head[-1] == "nearest to all limits"
    assert [row[0] for row in grid.rows] == ["value reached", *written["nearest"]["decisions"]]


def result_with_reach(problem: Problem, status: Status, seconds: float | None = None) -> Result:
    """Return the result with attainable limits, as if a method had ended with this status."""
    actual = replace(solve(problem.changed(decisions=())), status=status, conflict=("quiet",))
    with limit_time(seconds):
        return with_attainable_limits(actual, problem, 1.0, solve)


@pytest.mark.slow
def test_a_design_that_was_overlooked_is_the_result() -> None:
    """Check that a design that keeps all limits by the exact model is returned against a method's claim."""
    for status in (Status.FAILED, Status.INFEASIBLE):
        result = result_with_reach(problem_of([LIGHT | {"max": "2 kg"}, QUIET | {"max": "2 kN"}]), status)
        assert result.status is Status.FEASIBLE
        assert result.final.violation(result.problem.limits) <= 1e-5
        assert result.objective.name == "mean mount force"
        assert result.objective.value == pytest.approx(result.final.value(result.problem.objective[0].measure))
        assert result.certificate.lower_bound == 0.0
        assert result.error_estimate == objective_error(result.problem, result.final) > 0.0
        assert not result.reached


def test_a_failed_search_is_infeasible_by_its_bound() -> None:
    result = result_with_reach(problem_of([LIGHT, QUIET]), Status.FAILED)
    assert result.status is Status.INFEASIBLE
    assert set(result.conflict) == {"light", "quiet"}
    assert "none that meets the other limits meets 'quiet'" in result.message
    # the light limit may be one of those that are not needed for that
    assert "needed" not in explained(result)
    assert result.decisions == ()


def test_a_search_out_of_time_evaluates_no_design() -> None:
    result = result_with_reach(SCENES["vee"], Status.INFEASIBLE, 1e-9)
    assert [each.why for each in result.reached] == [LONG]
    assert all(math.isnan(each.value) for each in result.reached)
    assert "no time left" in attainable(result)[0]


class Clock:
    """Clock of the budget that moves only by hand."""

    now = 0.0

    def monotonic(self) -> float:
        return self.now


def test_every_limit_has_its_share_of_the_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem, shares, clock = problem_of([LIGHT, QUIET | {"max": "1.6 kN"}]), [], Clock()
    monkeypatch.setattr("laufruhe.numerics.budget.time", clock)

    def slow(limits: Problem) -> Result:
        shares.append(seconds_left())
        clock.now += seconds_left()
        with minimum_time(60.0):
            return replace(solve(limits), certificate=None)

    steps: list[Step] = []
    none = infeasible_result(problem, solve(problem.changed(decisions=())).final, ("light", "quiet"), {})
    with limit_time(0.4), progress_listener(steps.append):
        result = with_attainable_limits(none, problem, 1.0, slow)
    assert [(each.ended, each.why) for each in result.reached] == [(True, "")] * 2
    assert all("at the time limit" in text for text in attainable(result)[:2])
    assert shares[:2] == pytest.approx([0.2, 0.2])
    reach = [(step.done, step.whole) for step in steps if step.what == "attainable limits"]
    assert reach == [(0, 2), (1, 2)]
    # a listener gets the known result before the slow part
    assert {step.within[0] for step in steps} == {none.message}
    assert "contradict" in none.message


def test_a_limit_without_open_numbers_keeps_its_value() -> None:
    shaft = {"name": "s", "ratio": 1, "position": ["90 mm", "-90 mm"],
             "unbalances": [{"x": "0 mm", "unbalance": "1e-3 kg m", "radius": "30 mm"}]}  # fmt: skip
    problem = problem_of([limit("envelope radius", max="50 mm"), LIGHT], balancer_shafts=[shaft])
    result = laufruhe.solve(problem)
    assert result.status is Status.INFEASIBLE
    (reach,) = result.reached
    assert reach.value == pytest.approx(evaluate(problem).value(problem.limits[-1].measure))
    assert "stays at" in attainable(result)[0]
    assert "needed" not in explained(result)


def test_an_infeasible_design_gives_no_proof() -> None:
    problem = SCENES["vee"]
    design = evaluate_design(problem, problem.start)
    shown = ProofData(0.9 * design.value, ProofStrength.EXACT, 0.0, "a bound")
    result = build_result(design, design.evaluation, shown, {})
    assert result.status is Status.FAILED
    assert result.certificate.kind is Proof.NONE
    assert result.certificate.lower_bound == shown.bound
    assert "No design within the bounds and limits has less than" in explained(result)
    assert "so it has no proof" in explained(result)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_an_edge_is_halved_to_the_same_share_in_every_unit(unit: float) -> None:
    problem, edge = problem_of([LIGHT, QUIET]), 1.37 * unit
    own = replace(problem.limits[1], maximum=unit)

    def known(limits: Problem) -> Any:
        maximum = min((limit.maximum for limit in limits.limits if limit.measure == own.measure), default=2.0 * unit)
        status = Status.FEASIBLE if maximum >= edge else Status.INFEASIBLE
        return SimpleNamespace(status=status, final=SimpleNamespace(values=lambda _: (maximum,)), decisions=())

    entry = AttainableLimit("quiet", "at most", unit, "N")
    reach = _bisect(entry, own, problem, problem.limits[:1], Status.INFEASIBLE, known).attainable
    assert reach.bound < edge <= reach.value
    assert reach.value - reach.bound <= CLOSE * unit
