"""Limits of run-up and shut-down that are designed for: linear in the loads, proven, against integration and search."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.extensions.run_ups.rows import RunRows
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.load_models.run_look import run_measures
from laufruhe.physics.run_up import run_through
from laufruhe.physics.runs import runs_of
from laufruhe.physics.speed_map import split_loads
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import domains_of
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import Result, Status
from problem_files import PROBLEMS

READY = PROBLEMS / "soft-single-run-up.toml"
SHORT = {"up_to": "1500 rpm", "time": "0.8 s", "shut_down_time": "1 s"}


def problem_of(*limits: tuple[str, str], **more: Any) -> Problem:
    whole = {**tables_of(READY), "fidelity": {"samples": 120}, "run_up": SHORT}
    whole["constraints"] = [{"limit": quantity, "max": most} for quantity, most in limits]
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
    """Peaks of run-up and shut-down by SciPy's eighth order at a tolerance of 1e-9."""
    problem, result = limited
    engine, run, point = result.final.engine, problem.engine.run, problem.points[0]
    inertia, gas = split_loads(engine, point)
    assert gas is None
    for own, first, last, seconds in zip(
        runs_of(engine, point, problem.fidelity, run), (0.0, run.speed), (run.speed, 0.0), (run.up, run.down),
        strict=True,
    ):  # fmt: skip
        mounting = mounting_in(engine)
        told = run_through(mounting, inertia.kept(12.0), None, first, last, seconds, 60, "DOP853", 1e-9)
        for name in ("force", "travel", "twist"):
            assert getattr(own, name) == pytest.approx(getattr(told, name), rel=2e-3)


@pytest.mark.slow
def test_run_up_limits_hold_the_proven_optimum(limited: tuple[Problem, Result]) -> None:
    """Limits are kept and met; random designs that keep them are worse; a price is the slope of two more solves."""
    problem, result = limited
    assert result.status is Status.OPTIMAL
    assert result.certificate.kind is Proof.GLOBAL
    twist, force = result.limits
    assert twist.active
    assert twist.value <= twist.limit * (1.0 + 1e-5)
    assert force.value <= force.limit * (1.0 + 1e-5)
    free = laufruhe.solve(problem_of())
    assert free.objective.value < result.objective.value
    rng, kept = np.random.default_rng(5), 0
    inner = laufruhe.solve(problem_of(("run-up twist", "0.05 deg")))
    best, inside = (np.array([m.real, u.real, u.imag]) for m, u in map(columns, (result, inner)))
    for share in rng.random(30):
        mass, real, imag = best + share * (inside - best) + rng.normal(0.0, [0.01, 3e-4, 3e-4])
        other = evaluate(problem, problem.design([max(mass, 0.0), complex(real, imag)]))
        if other.excess(problem.limits) <= 0.0:
            kept += 1
            assert other.value(problem.objective[0].measure) >= result.certificate.lower_bound
    assert kept > 3
    ends = [laufruhe.solve(problem_of(("run-up twist", f"{angle} deg"), ("run-up force", "600 N")))
            for angle in (0.0595, 0.0605)]  # fmt: skip
    slope = (ends[0].objective.value - ends[1].objective.value) / np.radians(0.001)
    assert twist.shadow_price == pytest.approx(slope, rel=0.05)


@pytest.mark.slow
def test_what_no_design_keeps_is_named() -> None:
    result = laufruhe.solve(problem_of(("run-up travel", "0.01 mm"), ("run-up force", "1e6 N")))
    assert result.status is Status.INFEASIBLE
    assert result.conflict == ("run-up travel",)


@pytest.mark.slow
def test_loads_add_up_and_on_bump_stops_they_do_not() -> None:
    """Motion of a design is the sum of what rows tell of its weights; with stops no rows tell it."""
    asked = "run-up travel", "1 mm"
    problem = problem_of(asked)
    (measure,) = run_measures(problem)
    rows = RunRows.of(problem, [measure])
    values = [1.0, 0.02j]
    x = np.concatenate([domain.columns_of(u) for domain, u in zip(domains_of(problem.decisions), values, strict=True)])
    point, worst = problem.points[0], rows.worst(measure, x)
    up, down = runs_of(problem.design(values), point, problem.fidelity, problem.engine.run)
    assert worst == pytest.approx(max(up.worst_travel, down.worst_travel), rel=1e-9)
    mounts = tables_of(READY)["mounts"]
    stop = {"gap": "1 mm", "stiffness": "500 N/mm"}
    stopped = {**mounts, "places": [{**place, "stop": stop} for place in mounts["places"]]}
    assert RunRows.of(problem_of(asked, mounts=stopped), [measure]) is None
