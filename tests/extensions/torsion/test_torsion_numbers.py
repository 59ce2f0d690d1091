"""Open dampers, shafts and flywheels with torsion: optima, bounds, limits and refused input."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, differential_evolution

import laufruhe
from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.flywheel.torque import swing_of
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.result import Result, Status
from problem_files import PROBLEMS

READY = PROBLEMS / "inline-five-damper.toml"
QUICK = {"fidelity": {"samples": 120, "orders": 24}, "tolerance": 1e-2, "search": {"starts": 2}}
STIFF = {"between": ["3e5 N m/rad", "6e5 N m/rad"], "start": "4e5 N m/rad"}


def problem_of(torsion: dict[str, Any] | None = None, **more: Any) -> Problem:
    tables = tables_of(READY)
    tables["torsion"] = {**tables["torsion"], **(torsion or {})}
    return load_tables({**tables, **QUICK, **more}, Path("five.toml"))


def value_at(problem: Problem, x: Any) -> float:
    return objective_value(problem, evaluate(problem, problem.design([float(v) for v in x])))


@pytest.fixture(scope="module")
def damper() -> tuple[Problem, Result]:
    problem = problem_of()
    return problem, laufruhe.solve(problem)


@pytest.mark.slow
def test_a_viscous_damper_is_proven(damper: tuple[Problem, Result]) -> None:
    """Check by a grid over the bounds that no design is better or below the bound."""
    problem, result = damper
    bounds = [(d.lower, d.upper) for d in problem.decisions]
    grid = [value_at(problem, (a, b)) for a in np.linspace(*bounds[0], 5) for b in np.geomspace(*bounds[1], 12)]
    assert result.objective.value <= min(grid) * (1.0 + 1e-6)
    assert result.certificate.lower_bound <= min(grid)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.gap <= 1e-2
    assert result.certificate.kkt_residual < 1e-5
    assert result.objective.value == pytest.approx(value_at(problem, [d.value for d in result.decisions]))
    assert result.objective.value < 0.5 * result.objective.initial


@pytest.mark.slow
def test_other_numbers_agree_with_an_evolution() -> None:
    """Compare a rubber ring and the stiffness of the crank with SciPy's differential evolution."""
    rubber = {
        "name": "ring", "on": "pulley", "loss_factor": 0.15, "inertia": "0.006 kg m^2",
        "stiffness": {"between": ["5e3 N m/rad", "5e4 N m/rad"], "start": "1e4 N m/rad"},
        "damping": {"between": ["0 N m s/rad", "5 N m s/rad"], "start": "1 N m s/rad"},
    }  # fmt: skip
    problem = problem_of({"absorbers": [rubber], "crank": {"stiffness": STIFF, "diameter": "48 mm"}},
                         search={"starts": 6, "boxes": 300})  # fmt: skip
    result = laufruhe.solve(problem)
    bounds = [(d.lower, d.upper) for d in problem.decisions]
    actual = differential_evolution(lambda x: value_at(problem, x), bounds, seed=3, maxiter=12, popsize=8, polish=False)
    assert result.objective.value <= actual.fun * (1.0 + 1e-4)
    assert result.certificate.lower_bound <= actual.fun
    assert result.certificate.kkt_residual < 1e-3


@pytest.mark.slow
def test_a_shaft_under_a_limit_of_its_frequencies() -> None:
    """Check the crank diameter that leaves a band of frequencies, and its bound on a grid."""
    crank = {"pieces": [{"length": "70 mm", "diameter": {"between": ["40 mm", "60 mm"], "start": "48 mm"}}]}
    band = {"limit": "torsional frequencies", "outside": ["300 Hz", "345 Hz"]}
    # fewer starts all end in the worse half beside the band
    four = {"starts": 4}
    problem = problem_of({"crank": crank, "absorbers": []}, constraints=[band], search=four)
    result = laufruhe.solve(problem)
    grid = np.linspace(0.040, 0.060, 41)
    values = {float(d): value_at(problem, [d]) for d in grid}
    feasible = [v for d, v in values.items() if evaluate(problem, problem.design([d])).violation(problem.limits) <= 0.0]
    assert 0 < len(feasible) < len(grid)
    assert result.status in (Status.OPTIMAL, Status.FEASIBLE)
    assert result.final.violation(problem.limits) <= 1e-6
    assert result.objective.value <= min(feasible) * (1.0 + 1e-6)
    assert result.certificate.lower_bound <= result.objective.value
    # without the limit there is more freedom
    free = laufruhe.solve(problem_of({"crank": crank, "absorbers": []}, search=four))
    assert free.objective.value <= result.objective.value * (1.0 + 1e-6)
    assert free.certificate.lower_bound <= min(values.values())


@pytest.mark.slow
def test_peaks_have_a_local_optimum(damper: tuple[Problem, Result]) -> None:
    """Check that a peak, which boxes do not bound, has a local optimum and says so."""
    result = laufruhe.solve(problem_of(objective={"minimise": "maximum shaft stress"}))
    assert result.certificate.kind is Proof.LOCAL
    assert result.certificate.lower_bound == 0.0
    assert result.objective.value < result.objective.initial


@pytest.mark.slow
def test_heat_is_a_limit(damper: tuple[Problem, Result]) -> None:
    """Check that a damper with a lower limit of heat is no better."""
    free = damper[1]
    few = {"starts": 2, "boxes": 20}
    problem = problem_of(constraints=[{"limit": "absorber heat", "max": "250 W"}], search=few)
    heat = free.final.value(problem.limits[0].measure)
    allowed = problem_of(constraints=[{"limit": "absorber heat", "max": f"{0.9 * heat} W"}], search=few)
    result = laufruhe.solve(allowed)
    assert result.final.value(problem.limits[0].measure) == pytest.approx(0.9 * heat, rel=1e-3)
    assert result.objective.value > free.objective.value
    assert laufruhe.solve(problem).objective.value == pytest.approx(free.objective.value, rel=1e-3)


@pytest.mark.slow
def test_a_stress_limit_that_no_design_keeps_is_named() -> None:
    low = [{"limit": "rms shaft stress", "max": "2 N/mm^2", "name": "low"}]
    result = laufruhe.solve(problem_of(constraints=low, search={"starts": 1}))
    assert result.status is Status.INFEASIBLE
    assert result.conflict == ("low",)


def test_unsupported_open_numbers_of_torsion_are_refused() -> None:
    wide, open_ring = {"between": ["40 mm", "60 mm"]}, {"between": ["0 N m s/rad", "9 N m s/rad"]}
    pieces = [{"length": "30 mm", "diameter": wide}, {"length": "20 mm", "diameter": "50 mm"}]
    with pytest.raises(InputError, match="is open, but its shaft has several pieces"):
        problem_of({"crank": {"pieces": pieces}})
    with pytest.raises(InputError, match="then nothing holds the ring"):
        problem_of({"absorbers": [{"name": "d", "on": "pulley", "inertia": "1 kg m^2", "damping": open_ring}]})
    with pytest.raises(InputError, match="must be more than"):
        problem_of({"absorbers": [{"name": "d", "on": "pulley", "damping": "1 N m s/rad",
                                   "inertia": {"between": ["0 kg m^2", "1 kg m^2"]}}]})  # fmt: skip


@pytest.mark.slow
def test_a_disc_is_sized_for_irregularity_and_stress() -> None:
    """Compare the least turning inertia with a bisection (T4); no smaller disc keeps the degree."""
    tables = tables_of(READY)["torsion"]
    pulley, wheel = tables["discs"]
    wheel = {**wheel, "inertia": {"between": ["0.05 kg m^2", "0.5 kg m^2"], "start": "0.14 kg m^2"}}
    ring = {**tables["absorbers"][0], "inertia": "0.006 kg m^2"}
    own = {"discs": [pulley, wheel], "absorbers": [ring]}
    limits = [
        {"limit": "degree of irregularity", "max": "1/60"},
        {"limit": "rms shaft stress", "max": "20 N/mm^2"},
    ]
    one = {"starts": 1}
    inertia = {"minimise": "flywheel inertia"}
    problem = problem_of(own, constraints=limits, objective=inertia, tolerance=2e-3, search=one)
    result = laufruhe.solve(problem)
    assert result.certificate.kind is Proof.GLOBAL
    swings = [swing_of(problem.engine, point, problem.fidelity) for point in problem.points]
    minimum = max(brentq(lambda own, at=at: at.irregularity(own) - 1.0 / 60.0, 1e-2, 1e4, rtol=1e-12) for at in swings)
    assert result.certificate.lower_bound <= minimum * (1.0 + 1e-9)
    assert result.objective.value == pytest.approx(minimum, rel=2e-3)
    assert result.limits[1].value <= 20e6
    narrow = {**wheel, "inertia": {"between": ["0.05 kg m^2", "0.1 kg m^2"]}}
    none = laufruhe.solve(
        problem_of({**own, "discs": [pulley, narrow]}, constraints=limits, objective=inertia, search=one)
    )
    assert none.status is Status.INFEASIBLE
    assert "degree of irregularity" in none.conflict


@pytest.mark.slow
def test_a_damper_beside_counterweights(damper: tuple[Problem, Result]) -> None:
    """Check that value and bound of damper and counterweights together are the sums of both alone."""
    webs = [
        {"name": f"web {k}", "opposite_throw": k, "radius": "60 mm", "mass": {"between": ["0 kg", "2 kg"]}}
        for k in (1, 5)
    ]
    couple = {"quantity": "rms rocking couple", "weight": 1e5}
    limit = {"limit": "counterweight mass", "max": "1 kg"}
    alone = laufruhe.solve(
        load_tables({**tables_without_torsion(), "counterweights": webs, "constraints": [limit],
                     "objective": {"terms": [couple]}}, Path("webs.toml"))
    )  # fmt: skip
    both = problem_of(
        counterweights=webs, constraints=[limit], objective={"terms": [couple, {"quantity": "rms shaft stress"}]}
    )
    result = laufruhe.solve(both)
    assert result.objective.value == pytest.approx(alone.objective.value + damper[1].objective.value, rel=1e-6)
    assert result.certificate.kind is Proof.GLOBAL
    bounds = alone.certificate.lower_bound + damper[1].certificate.lower_bound
    assert result.certificate.lower_bound == pytest.approx(bounds, rel=1e-6)
    assert {decision.name for decision in result.decisions} >= {"web 1.mass", "torsion.damper.damping"}
    assert result.objective.value == pytest.approx(objective_value(both, result.final), rel=1e-7)
    with pytest.raises(ModelError, match="torsion is open, but no objective term depends on this number"):
        laufruhe.solve(problem_of(counterweights=webs, objective={"terms": [couple]},
                                  constraints=[{"limit": "rms shaft stress", "max": "20 N/mm^2"}]))  # fmt: skip


def tables_without_torsion() -> dict[str, Any]:
    return {key: value for key, value in {**tables_of(READY), **QUICK}.items() if key != "torsion"}
