"""Limits of run-up and shut-down, linear in the loads, compared with integration and search."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.extensions.run_ups.cones import RunRows
from laufruhe.extensions.run_ups.machine import Run
from laufruhe.extensions.run_ups.runs import run_through, runs_of
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.load_models.simulated import simulated_measures
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.speed_map import split_loads
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import domains_of
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import Result, Status
from laufruhe.solvers.conclusion import values_of
from laufruhe.solvers.mounts.nonlinear import are_contradictory
from problem_files import PROBLEMS
from solvers.test_few_angles import SINGLE, mounted, on_open_mounts, second

READY = PROBLEMS / "soft-single-run-up.toml"
SHORT = {"up_to": "1500 rpm", "time": "0.8 s", "shut_down_time": "1 s"}


def problem_of(*limits: tuple[str, str], **more: Any) -> Problem:
    whole = {**tables_of(READY), "fidelity": {"samples": 120}, "run_up": SHORT}
    whole["constraints"] = [{"limit": quantity, "max": maximum} for quantity, maximum in limits]
    return load_tables({**whole, **more}, Path("single.toml"))


def columns(result: Result) -> list[complex]:
    found = {decision.name: decision.value for decision in result.decisions}
    return [found["web.mass"], found["first.unbalance"] * np.exp(1j * found["first.angle"])]


@pytest.fixture(scope="module")
def limited() -> tuple[Problem, Result]:
    problem = problem_of(("run-up twist", "0.06 deg"), ("run-up force", "600 N"))
    return problem, laufruhe.solve(problem)


@pytest.mark.slow
def test_a_linear_run_is_that_of_integration(limited: tuple[Problem, Result]) -> None:
    """Compare peaks of run-up and shut-down with SciPy's eighth order at a tolerance of 1e-9."""
    problem, result = limited
    engine, run, point = result.final.engine, problem.engine.extra(Run), problem.points[0]
    inertia, gas = split_loads(engine, point)
    assert gas is None
    for own, first, last, seconds in zip(
        runs_of(engine, point, problem.fidelity, run), (0.0, run.speed), (run.speed, 0.0), (run.up, run.down),
        strict=True,
    ):  # fmt: skip
        mounting = mounting_in(engine)
        exact = run_through(mounting, inertia.truncated(12.0), None, first, last, seconds, 60, "DOP853", 1e-9)
        for name in ("force", "travel", "twist"):
            assert getattr(own, name) == pytest.approx(getattr(exact, name), rel=2e-3)


@pytest.mark.slow
def test_run_up_limits_hold_the_proven_optimum(limited: tuple[Problem, Result]) -> None:
    """Check active limits, worse random designs, and the price as slope of two more solves."""
    problem, result = limited
    assert result.status is Status.OPTIMAL
    assert result.certificate.kind is Proof.GLOBAL
    twist, force = result.limits
    assert twist.active
    assert twist.value <= twist.limit * (1.0 + 1e-5)
    assert force.value <= force.limit * (1.0 + 1e-5)
    free = laufruhe.solve(problem_of())
    assert free.objective.value < result.objective.value
    rng, feasible = np.random.default_rng(5), 0
    inner = laufruhe.solve(problem_of(("run-up twist", "0.05 deg")))
    best, inside = (np.array([m.real, u.real, u.imag]) for m, u in map(columns, (result, inner)))
    for share in rng.random(30):
        mass, real, imag = best + share * (inside - best) + rng.normal(0.0, [0.01, 3e-4, 3e-4])
        other = evaluate(problem, problem.design([max(mass, 0.0), complex(real, imag)]))
        if other.violation(problem.limits) <= 0.0:
            feasible += 1
            assert other.value(problem.objective[0].measure) >= result.certificate.lower_bound
    assert feasible > 3
    ends = [laufruhe.solve(problem_of(("run-up twist", f"{angle} deg"), ("run-up force", "600 N")))
            for angle in (0.0595, 0.0605)]  # fmt: skip
    slope = (ends[0].objective.value - ends[1].objective.value) / np.radians(0.001)
    assert twist.shadow_price == pytest.approx(slope, rel=0.05)


@pytest.mark.slow
def test_a_run_up_limit_that_no_design_keeps_is_named() -> None:
    result = laufruhe.solve(problem_of(("run-up travel", "0.01 mm"), ("run-up force", "1e6 N")))
    assert result.status is Status.INFEASIBLE
    assert result.conflict == ("run-up travel",)


@pytest.mark.slow
def test_loads_add_up_and_on_bump_stops_they_do_not() -> None:
    """Check that motion is the sum of rows of the weights, and that stops leave no rows."""
    limit = "run-up travel", "1 mm"
    problem = problem_of(limit)
    (measure,) = simulated_measures(problem)
    rows = RunRows.from_problem(problem, [measure])
    values = [1.0, 0.02j]
    x = np.concatenate([domain.columns_of(u) for domain, u in zip(domains_of(problem.decisions), values, strict=True)])
    point, worst = problem.points[0], rows.worst(measure, x)
    run = problem.engine.extra(Run)
    up, down = runs_of(problem.design(values), point, problem.fidelity, run)
    assert (up.speeds[-1], down.speeds[-1]) == (run.speed, 0.0)
    assert worst == pytest.approx(max(up.travel.max(), down.travel.max()), rel=1e-9)
    mounts = tables_of(READY)["mounts"]
    stop = {"gap": "1 mm", "stiffness": "500 N/mm"}
    stopped = {**mounts, "places": [{**place, "stop": stop} for place in mounts["places"]]}
    assert RunRows.from_problem(problem_of(limit, mounts=stopped), [measure]) is None


def test_a_run_up_is_designed_for_where_few_angles_forbid_a_mean() -> None:
    """Check a force of 7.073 N that no design keeps at 48 angles and one keeps over the cycle."""
    left, right = SINGLE["balancer_shafts"]
    turned = {**left, "unbalances": [{**left["unbalances"][0], "angle": 183}]}
    tables = {
        **SINGLE, "engine": {**SINGLE["engine"], "throws": [3]}, "balancer_shafts": [turned, right],
        **mounted(),
        "run_up": {"up_to": "3000 rpm", "time": "0.5 s"},
        "objective": {"minimise": "run-up travel"},
        "constraints": [{"limit": "mean mount force", "max": "7.0745 N"}],
    }  # fmt: skip
    result = laufruhe.solve(load_tables(tables, Path("mounted.toml")))
    assert result.status is Status.OPTIMAL


def test_few_angles_exclude_no_limits_of_run_ups() -> None:
    travel = {"name": "travel", "limit": "run-up travel", "max": "1 m"}
    problem = on_open_mounts(
        0, run_up={"up_to": "1500 rpm", "time": "0.2 s"}, objective={"minimise": "rms mount force"},
        constraints=[second(1.0001), travel],
    )  # fmt: skip
    assert not are_contradictory(problem, problem.limits)
    tighter = on_open_mounts(0, objective={"minimise": "rms mount force"}, constraints=[second(0.99)])
    assert are_contradictory(tighter, tighter.limits)


@pytest.mark.slow
def test_a_worst_mean_is_decided_under_a_limit_of_a_run_up() -> None:
    """Check that the worst mean over one operating point is proven and equal to the mean."""
    travel = {"limit": "run-up travel", "max": "1.9 mm"}
    results = [
        laufruhe.solve(on_open_mounts(
            0, run_up={"up_to": "1500 rpm", "time": "0.2 s"}, objective={"minimise": quantity}, constraints=[travel]
        ))
        for quantity in ("worst mean mount force", "mean mount force")
    ]  # fmt: skip
    assert [result.certificate.kind for result in results] == [Proof.GLOBAL] * 2
    worst, mean = (result.objective.value for result in results)
    assert worst == pytest.approx(mean, rel=1e-4)
    assert worst > 29.2


@pytest.mark.slow
def test_limits_of_a_run_up_are_decided_by_from_a_good_start_too() -> None:
    """Check that a search from a feasible design finds the same optimum."""
    problem = laufruhe.load(READY).at(Fidelity(samples=720, mounts="rigid"))
    whole = laufruhe.solve(problem)
    start = laufruhe.solve(problem.at(Fidelity(samples=720)))
    assert start.objective is not None
    values = values_of(problem, start)
    decisions = tuple(replace(d, start=value) for d, value in zip(problem.decisions, values, strict=True))
    again = laufruhe.solve(replace(problem, engine=start.final.engine, decisions=decisions))
    assert whole.objective is not None
    assert again.objective is not None
    assert again.objective.value == pytest.approx(whole.objective.value, rel=1e-5)
    assert again.status is Status.OPTIMAL
