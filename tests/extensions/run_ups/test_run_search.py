"""Open mounts and bump stops designed for run-ups, compared with SciPy and brute force."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import laufruhe
from laufruhe.errors import LaufruheError
from laufruhe.extensions.fidelity.reference import Reference
from laufruhe.extensions.fidelity.trade import ladder
from laufruhe.extensions.run_ups.channels import FORCE, TRAVEL, TWIST
from laufruhe.extensions.run_ups.machine import Run
from laufruhe.extensions.run_ups.peaks import RunPeaks
from laufruhe.extensions.run_ups.runs import run_loads, runs_of
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.machine import Engine
from laufruhe.numerics.arrays import Array
from laufruhe.physics.time_model import time_model
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate, objective_value, with_mounts
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import Result, Status
from problem_files import PROBLEMS

READY = PROBLEMS / "soft-single-run-up-mounts.toml"
OF_RUNS = tuple(Measure(channel) for channel in (FORCE, TRAVEL, TWIST))
SHORT = {"up_to": "700 rpm", "time": "0.4 s", "shut_down_time": "0.5 s"}
STOP = {"gap": "1 mm", "stiffness": "300 N/mm"}


def tables(**more: Any) -> dict[str, Any]:
    small = {"fidelity": {"samples": 120}, "run_up": SHORT, "search": {"starts": 6, "boxes": 4}}
    return {**tables_of(READY), **small, **more}


def limited(*limits: tuple[str, str], **more: Any) -> Problem:
    given = [{"limit": quantity, "max": maximum} for quantity, maximum in limits]
    return load_tables(tables(constraints=given, **more), Path("single.toml"))


def mounts(stop: dict[str, str] | None = None, **opened: Any) -> dict[str, Any]:
    """Return the mounts of the ready problem with given stiffness and further keys."""
    tables = tables_of(READY)["mounts"]
    places = []
    for place in tables["places"]:
        own = dict(place)
        if "stiffness" in own:
            own["stiffness"] = ["120 N/mm", "120 N/mm", "150 N/mm"]
            own |= opened | ({"stop": stop} if stop else {})
        places.append(own)
    return {**tables, "places": places}


@pytest.fixture(scope="module")
def ready() -> tuple[Problem, Result]:
    settings = tables(run_up=tables_of(READY)["run_up"], search={"starts": 1})
    problem = load_tables(settings, Path("single.toml"))
    return problem, laufruhe.solve(problem)


def by_scipy(engine: Engine, problem: Problem) -> tuple[float, float]:
    """Return the largest force and travel of both runs by an independent E25 on the same mount matrices."""
    run, model = problem.engine.extra(Run), time_model(mounting_in(engine))
    inertia, gas = run_loads(engine, problem.points[0], problem.fidelity)
    assert gas is None
    orders, coefficients = 1j * inertia.orders, model.load @ inertia.coefficients.T
    force = travel = 0.0
    for first, last, seconds in ((0.0, run.speed, run.up), (run.speed, 0.0, run.down)):
        gain = (last - first) / seconds

        def rates(t: float, z: Array, first: float = first, gain: float = gain) -> Array:
            speed, angle = first + gain * t, first * t + gain * t * t / 2.0
            driven = speed**2 * (coefficients @ np.exp(orders * angle)).real
            y, rate = z[:6], z[6:]
            moved = model.stops.rows @ y
            stop = model.stops.stiffness * np.sign(moved) * np.maximum(np.abs(moved) - model.stops.gaps, 0.0)
            push = driven - model.stiffness @ y - model.damping @ rate - model.stops.rows.T @ stop
            return np.concatenate([rate, push])

        times = np.linspace(0.0, seconds, 12_000)
        states = solve_ivp(rates, (0.0, seconds), np.zeros(12), "DOP853", times, rtol=1e-7, atol=1e-10, max_step=5e-3).y
        y, rate = states[:6], states[6:]
        force = max(force, float(np.linalg.norm(model.mount_forces(y, rate), axis=-1).max()))
        travel = max(travel, float(np.linalg.norm(model.mount_travels(y), axis=-1).max()))
    return force, travel


@pytest.mark.slow
def test_the_design_keeps_its_limits_when_scipy_integrates_it(ready: tuple[Problem, Result]) -> None:
    problem, result = ready
    assert result.status is Status.OPTIMAL
    assert result.certificate.kind is Proof.GLOBAL
    assert "bounds of mounts and run-ups" in result.certificate.method
    travel = next(limit for limit in result.limits if limit.name == "run-up travel")
    assert travel.active
    assert travel.shadow_price > 0.0
    assert by_scipy(result.final.engine, problem)[1] == pytest.approx(travel.limit, rel=5e-4)
    # both numbers are free, and one limit holds them: its price is the slope of the objective over its own
    stiffness = np.array([decision.value for decision in result.decisions])
    for k in range(2):
        ends = [
            evaluate(problem, problem.design((stiffness * (1.0 + sign * 1e-5 * np.eye(2)[k])).tolist()))
            for sign in (-1, 1)
        ]
        force, moved = (np.diff([end.value(m) for end in ends])[0] for m in (problem.objective[0].measure, OF_RUNS[1]))
        assert travel.shadow_price == pytest.approx(-force / moved, rel=5e-3)
    # the optimum without the limit breaks it
    free = laufruhe.solve(problem.changed(limits=problem.limits[:1]))
    assert not free.final.check_limit(problem.limits[1]).violation <= 0.0
    assert free.objective.value < result.objective.value


@pytest.mark.slow
def test_no_pair_of_stiffnesses_on_a_grid_is_better(ready: tuple[Problem, Result]) -> None:
    """Check that no pair of stiffnesses of a grid of 400 keeps both limits and is better than the optimum."""
    problem, result = ready
    initial = evaluate(problem, samples=180)
    grid = np.exp(np.linspace(np.log(40e3), np.log(600e3), 20))
    best, looked = np.inf, 0
    for pair in np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2).tolist():
        design = with_mounts(initial, problem.design(pair))
        value = objective_value(problem, design)
        if value < 1.1 * result.objective.value and design.check_limit(problem.limits[0]).violation <= 0.0:
            looked += 1
            if design.check_limit(problem.limits[1]).violation <= 0.0:
                best = min(best, value)
    assert looked > 15
    assert result.objective.value <= best * (1.0 + 1e-6) < np.inf


@pytest.mark.slow
def test_run_up_peaks_and_slopes_are_those_of_the_exact_model() -> None:
    """Check run-up peaks and their slopes for damping, place and shaft against the exact run and differences."""
    opened = {
        "damping_per_stiffness": {"between": ["0 ms", "5 ms"], "start": "1 ms"},
        "position": [{"between": ["100 mm", "300 mm"], "start": "200 mm"}, "200 mm", "0 mm"],
    }
    shaft = tables_of(PROBLEMS / "soft-single-run-up.toml")["balancer_shafts"]
    for stop, error in ((None, 1e-4), (STOP, 2e-3)):
        mount_table = mounts(stop)
        mount_table["places"][0] |= opened
        problem = limited(mounts=mount_table, balancer_shafts=shaft)
        unbalance, mount_numbers = 0.004 + 0.003j, [1.2e-3, 0.21]
        order = [d.name.split(".")[1] for d in problem.mount_decisions]
        numbers = dict(zip(("damping_per_stiffness", "position"), mount_numbers, strict=True))
        own = [numbers[name] for name in order]
        x = np.array([*own, unbalance.real, unbalance.imag])
        engine = problem.design([unbalance, *own])
        runs = runs_of(engine, problem.points[0], problem.fidelity, problem.engine.extra(Run))
        for coarser, maximum in ((1, 1e-9), (4, error)):
            peaks = RunPeaks(problem, OF_RUNS, coarser)
            parts = np.split(peaks.values(x), np.cumsum(peaks.counts)[:-1])
            for name, part in zip(("force", "travel", "twist"), parts, strict=True):
                assert part.max() == pytest.approx(
                    max(getattr(run, name).max() for run in runs), rel=max(maximum, 1e-9)
                )
            slopes = peaks.slopes(x)
            at = [int(part.argmax()) + start for part, start in zip(parts, np.cumsum([0, *peaks.counts]), strict=False)]
            for k, step in enumerate(1e-5 * np.maximum(np.abs(x), 1e-3)):
                moved = step * np.eye(len(x))[k]
                differences = (peaks.values(x + moved) - peaks.values(x - moved)) / (2.0 * step)
                assert slopes[at, k] == pytest.approx(differences[at], rel=1e-3, abs=1e-6 * np.abs(slopes[at]).max())


@pytest.mark.parametrize("stop", [None, STOP])
def test_a_peak_at_the_end_of_a_run_counts(stop: dict[str, str] | None) -> None:
    """Check that a run that ends near a resonance has its largest motion there, in search and exact model."""
    mount_table = mounts(stop)
    mount_table["places"][0] |= {"damping_per_stiffness": {"between": ["0 ms", "5 ms"], "start": "1 ms"}}
    at_ends = 0
    for speed in range(360, 480, 10):
        run = {"up_to": f"{speed} rpm", "time": "0.3 s", "shut_down_time": "0.3 s"}
        problem = limited(mounts=mount_table, run_up=run)
        runs = runs_of(problem.engine, problem.points[0], problem.fidelity, problem.engine.extra(Run))
        peaks = RunPeaks(problem, OF_RUNS[:1])
        for values, own in zip(np.split(peaks.values(np.array([1e-3])), 2), runs, strict=True):
            assert values.max() == pytest.approx(own.force.max(), rel=1e-9)
        rows = peaks.rows([np.array([1e-3])])
        if rows is not None:
            sizes = np.linalg.norm(rows[0][OF_RUNS[0]], axis=-1).max(axis=1)
            at_ends += sizes[: len(sizes) // 2].argmax() == len(sizes) // 2 - 1
    assert at_ends > 0 or stop is not None


@pytest.mark.slow
def test_a_design_of_which_one_run_is_not_followed_has_no_peaks() -> None:
    """Check that stops of 30 kN/mm, too stiff for the steps of one run, leave no peaks of either."""
    mount_table = mounts({**STOP, "stiffness": "30000 N/mm"})
    mount_table["places"][0] |= {"damping_per_stiffness": {"between": ["0 ms", "5 ms"], "start": "1 ms"}}
    run = {"up_to": "300 rpm", "time": "0.05 s", "shut_down_time": "1.5 s"}
    peaks = RunPeaks(limited(mounts=mount_table, run_up=run), OF_RUNS)
    values, slopes = peaks.values(np.array([1e-3])), peaks.slopes(np.array([1e-3]))
    assert values.shape == (sum(peaks.counts),)
    assert slopes.shape == (sum(peaks.counts), 1)
    assert np.isnan(values).all()
    assert np.isnan(slopes).all()
    # the shorter run alone is followed
    shorter = RunPeaks(limited(mounts=mount_table, run_up={**run, "shut_down_time": "0.05 s"}), OF_RUNS)
    assert np.isfinite(shorter.values(np.array([1e-3]))).all()


@pytest.mark.slow
def test_runs_on_bump_stops_are_those_of_scipy() -> None:
    problem = limited(mounts=mounts(STOP))
    runs = runs_of(problem.engine, problem.points[0], problem.fidelity, problem.engine.extra(Run))
    force, travel = by_scipy(problem.engine, problem)
    assert travel > 1.3e-3
    assert max(run.force.max() for run in runs) == pytest.approx(force, rel=1e-3)
    assert max(run.travel.max() for run in runs) == pytest.approx(travel, rel=1e-3)


@pytest.mark.slow
def test_a_stiffness_is_designed_for_beside_bump_stops() -> None:
    """Check that every better stiffness of a row of 40 breaks the limit, and compare the peak force with SciPy."""
    mount_table = mounts(STOP)
    mount_table["places"][2]["stiffness"] = [
        "120 N/mm",
        "120 N/mm",
        {"between": ["60 N/mm", "400 N/mm"], "start": "300 N/mm"},
    ]
    problem = limited(("run-up force", "420 N"), mounts=mount_table, objective={"minimise": "static sag"})
    result = laufruhe.solve(problem)
    assert result.status is Status.FEASIBLE
    assert result.certificate.kind is Proof.LOCAL
    force = result.limits[0]
    assert force.value <= force.limit * (1.0 + 1e-5)
    assert by_scipy(result.final.engine, problem)[0] == pytest.approx(force.value, rel=2e-3)
    initial = evaluate(problem)
    for stiffness in np.linspace(60e3, 400e3, 40):
        design = with_mounts(initial, problem.design([float(stiffness)]))
        if objective_value(problem, design) < result.objective.value * (1.0 - 2e-3):
            assert design.check_limit(problem.limits[0]).violation > 0.0


@pytest.mark.slow
def test_weights_beside_stops_out_of_reach_are_those_of_the_cones() -> None:
    """Check that stops beyond reach leave the optimum at that of the cone program."""
    shaft = tables_of(PROBLEMS / "soft-single-run-up.toml")["balancer_shafts"]
    weight = {**tables_of(READY)["counterweights"][0], "mass": {"between": ["0 kg", "3 kg"], "start": "1 kg"}}
    settings = {"objective": {"minimise": "run-up force"}, "balancer_shafts": shaft, "counterweights": [weight]}
    proven = laufruhe.solve(limited(mounts=mounts(), **settings))
    assert proven.certificate.kind is Proof.GLOBAL
    assert proven.final.value(OF_RUNS[1]) < 0.9e-3
    stopped = laufruhe.solve(limited(mounts=mounts(STOP), **settings))
    assert stopped.certificate.kind is Proof.LOCAL
    assert stopped.objective.initial > 1.05 * proven.objective.initial
    assert stopped.objective.value == pytest.approx(proven.objective.value, rel=1e-3)


@pytest.mark.slow
def test_the_least_travel_of_a_start_over_weights_is_proven() -> None:
    """Check that no random design, near or far, is better than the bound of the convex problem."""
    problem = load_tables(
        {**tables_of(PROBLEMS / "soft-single-run-up.toml"), "run_up": SHORT,
         "constraints": [], "objective": {"minimise": "run-up travel"}},
        Path("single.toml"),
    )  # fmt: skip
    result = laufruhe.solve(problem)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.unit == "m"
    assert by_scipy(result.final.engine, problem)[1] == pytest.approx(result.objective.value, rel=1e-3)
    rng = np.random.default_rng(3)
    found = {decision.name: decision.value for decision in result.decisions}
    unbalance = complex(found["first.unbalance"] * np.exp(1j * found["first.angle"]))
    best = np.array([found["web.mass"], unbalance.real, unbalance.imag])
    for scale in (1e-3, 1e-2, 0.1):
        for mass, real, imag in best + scale * rng.normal(size=(15, 3)) * [2.0, 0.02, 0.02]:
            unbalance = complex(real, imag)
            unbalance *= min(1.0, 0.05 / max(abs(unbalance), 1e-12))
            other = evaluate(problem, problem.design([float(np.clip(mass, 0.0, 4.0)), unbalance]))
            assert other.value(OF_RUNS[1]) >= result.certificate.lower_bound


@pytest.mark.slow
def test_weights_and_stiffness_together_are_no_worse_than_either() -> None:
    """Check that mounts with a weight have no larger least force than mounts alone."""
    weight = {**tables_of(READY)["counterweights"][0], "mass": {"between": ["0 kg", "3 kg"], "start": "1 kg"}}
    minimum = {"minimise": "run-up force"}
    # a mount of its own under the weight of the block
    mount_table = mounts()
    mount_table["places"][2]["stiffness"] = [
        "120 N/mm",
        "120 N/mm",
        {"between": ["60 N/mm", "400 N/mm"], "start": "300 N/mm"},
    ]
    settings = {"mounts": mount_table, "objective": minimum, "search": {"starts": 1, "boxes": 1}}
    mounts_alone = laufruhe.solve(limited(("static sag", "5 mm"), **settings))
    both = laufruhe.solve(limited(("static sag", "5 mm"), counterweights=[weight], **settings))
    assert both.objective.value < mounts_alone.objective.value < mounts_alone.objective.initial
    # boxes of stiffness alone bound a run-up
    assert mounts_alone.certificate.lower_bound > 0.0
    assert both.certificate.lower_bound == 0.0
    assert "no bound of a run-up alone" in both.certificate.method
    for result in (mounts_alone, both):
        assert result.certificate.kind is Proof.LOCAL
        assert result.certificate.lower_bound < result.objective.value
        assert max(limit.value / limit.limit for limit in result.limits) <= 1.0 + 1e-5


@pytest.mark.slow
def test_points_gas_fluid_load_cases_and_a_weight_stand_beside_a_run() -> None:
    """Check that a search with all features together keeps limits that the initial design breaks."""
    mount_table = mounts()
    opened = {"between": ["60 N/mm", "600 N/mm"], "start": "200 N/mm"}
    mount_table["places"][0]["stiffness"] = ["120 N/mm", "120 N/mm", opened]
    mount_table["places"][2] |= {
        "fluid_track": {"mass": "25 kg", "bulge_stiffness": "260 N/mm", "damping": "500 N s/m"}
    }
    points = [{"name": "idle", "speed": "900 rpm"}, {"name": "rated", "speed": "1500 rpm"}]
    weight = {**tables_of(READY)["counterweights"][0], "mass": {"between": ["0 kg", "3 kg"], "start": "1 kg"}}
    problem = limited(
        ("run-up travel", "11 mm"), ("static travel", "12 mm"), mounts=mount_table, operating_points=points,
        gas={"model": "seiliger", "peak_pressure": "55 bar", "imep": "3 bar"}, counterweights=[weight],
        load_cases=[{"name": "pot hole", "times_weight": [0, 0, -3]}], search={"starts": 1, "boxes": 1},
    )  # fmt: skip
    result = laufruhe.solve(problem)
    assert result.certificate.kind is not Proof.NONE
    travel, settled = result.limits
    assert travel.value <= travel.limit * (1.0 + 1e-5)
    assert settled.value <= settled.limit * (1.0 + 1e-5)
    assert result.final.value(OF_RUNS[1]) == travel.value
    assert evaluate(problem).value(OF_RUNS[1]) > travel.limit
    other = evaluate(problem, problem.design([2.0 + 0.0j, 300e3]))
    assert other.violation(problem.limits) <= 0.0
    assert result.objective.value < objective_value(problem, other)


def test_fidelities_of_a_run_up_have_its_loads() -> None:
    """Check that every fidelity keeps the operating points if a run-up is minimised, and not for static sag."""
    settings = {"objective": {"minimise": "run-up travel"}, "mounts": mounts()}
    assert all(own.points for _, own in ladder(Reference(limited(**settings))))
    assert any(not own.points for _, own in ladder(Reference(limited(objective={"minimise": "static sag"}))))


@pytest.mark.slow
def test_error_estimates_of_run_ups_hold_at_finer_steps() -> None:
    """Check that SciPy's peak lies within the error estimate, and that all orders stay for a run-up."""
    settings = {"objective": {"minimise": "run-up travel"}, "mounts": mounts()}
    problem = limited(("run-up force", "1 kN"), **settings)
    result = laufruhe.evaluate(problem)
    assert 1e-4 < result.error_estimate < 1e-2
    assert result.limits[0].error_estimate == pytest.approx(result.error_estimate)
    exact = by_scipy(problem.engine, problem)[1]
    value = result.objective.value
    assert value * (1.0 - 1e-6) <= exact <= value * (1.0 + result.error_estimate)
    auto = {"fidelity": {"kinematics": "auto", "tolerance": 1e-2}}
    assert limited(("run-up force", "1 kN"), mounts=mounts(), **auto).fidelity.orders is None


def three(**more: Any) -> dict[str, Any]:
    """Return three cylinders in line."""
    engine = {**tables_of(READY)["engine"], "cylinders": 3, "cylinder_spacing": "120 mm"}
    weights = [
        {"name": name, "x": x, "radius": "70 mm", "mass": {"between": ["0 kg", "1 kg"]}, "angle": {"between": [0, 360]}}
        for name, x in (("front", "120 mm"), ("rear", "-120 mm"))
    ]
    return {"engine": engine | more, "counterweights": weights}


@pytest.mark.slow
def test_the_star_that_starts_with_least_travel_is_proven() -> None:
    """Compare with both stars solved by themselves, and their bound."""
    settings = {"objective": {"minimise": "run-up travel"}, "mounts": mounts()}
    opened = laufruhe.solve(limited(**settings, **three(throws="open", firing_order="open")))
    assert opened.certificate.kind is Proof.GLOBAL
    given = [
        laufruhe.solve(limited(**settings, **three(throws=throws, firing_order=order)))
        for throws, order in (([0, 240, 120], [1, 3, 2]), ([0, 120, 240], [1, 2, 3]))
    ]
    values = [result.objective.value for result in given]
    assert max(values) > 1.001 * min(values)
    assert opened.objective.value == pytest.approx(min(values), rel=1e-4)
    # as a limit between both it leaves one star
    limit = ("run-up travel", f"{0.5e3 * (values[0] + values[1])} mm")
    held = laufruhe.solve(limited(limit, mounts=mounts(), **three(throws="open", firing_order="open")))
    assert held.certificate.kind is Proof.GLOBAL
    assert held.limits[0].value <= held.limits[0].limit * (1.0 + 1e-5)


def test_run_ups_over_crank_stars_are_refused() -> None:
    """Check that a crank star on open mounts under a run-up is refused with a reason."""
    with pytest.raises(LaufruheError, match="run-up travel is minimised over unbalances and mounts, not over star"):
        laufruhe.solve(limited(objective={"minimise": "run-up travel"}, **three(throws="open", firing_order="open")))
