"""Means at few angles, which decide no result: sizes, leads, throws, built engines (P7)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from laufruhe.files.reader import load_tables
from laufruhe.load_models.affine import AffineModel
from laufruhe.problem.evaluation import evaluate, with_fine_sampling
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import best_bound
from laufruhe.solvers import Status, solve
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, violated_limits
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.throws.uneven_throws import evaluate_crank

ENGINE: dict[str, Any] = {
    "layout": "inline", "cycle": "two-stroke", "stroke": "100 mm", "rod_ratio": 0.3, "reciprocating_mass": "1 kg",
    "throws": [0],
}  # fmt: skip
SINGLE: dict[str, Any] = {
    "title": "single", "engine": ENGINE, "operating_points": [{"speed": "3000 rpm"}], "fidelity": {"samples": 48},
}  # fmt: skip
SECOND = {"minimise": "mean shaking force", "orders": [2]}


def problem(tables: dict[str, Any], **more: Any) -> Problem:
    return load_tables({**SINGLE, **tables, **more}, Path("told.toml"))


@pytest.mark.parametrize(("maximum", "met"), [(5820.0, False), (5821.0, True)])
def test_leads_keep_limits_over_the_cycle(maximum: float, met: bool) -> None:
    """No lead has less than 5820.56 N; 48 angles read 5819.25 N of the best."""
    shaft = {"name": "led", "ratio": -1, "position": ["0 mm", "0 mm"], "lead": {"between": [0, 90], "start": 20}}
    cranks = [
        {"x": "0 mm", "throw": 0, "shaft": "crankshaft"}, {"x": "100 mm", "throw": 40, "shaft": "led"},
    ]  # fmt: skip
    engine = {k: v for k, v in ENGINE.items() if k != "throws"}
    case = problem(
        {"engine": {**engine, "layout": "parts", "shafts": [shaft], "slider_cranks": cranks}},
        objective={"minimise": "rms rocking couple"},
        constraints=[{"name": "quiet", "limit": "mean shaking force", "max": f"{maximum} N"}],
    )
    result = solve(case)
    assert result.status is (Status.OPTIMAL if met else Status.INFEASIBLE)
    assert not met or with_fine_sampling(result.final).violation(case.limits) <= FEASIBILITY_TOL


def test_a_constant_limit_is_judged_at_many_angles() -> None:
    """The cycle has 964.63 N of second order, 48 angles have 959.1 N."""
    limit = {"name": "second", "limit": "mean shaking force", "orders": [2], "max": "962 N"}
    case = problem({}, objective={"minimise": "rms shaking force"}, constraints=[limit])
    assert evaluate(case).violation(case.limits) <= 0.0
    assert violated_limits(case.limits, with_fine_sampling(evaluate(case))) == ("second",)


def test_a_program_without_open_numbers_is_its_own_solution() -> None:
    """Check the bound of a program without open numbers, as of a box of one point."""
    model = AffineModel(problem({}, objective={"minimise": "rms shaking force"})).at(48)
    result = solve_cones(model)
    assert result.x is not None
    assert best_bound(model, result.x, result.multipliers).value == pytest.approx(model.objective(result.x), rel=1e-12)


def test_a_crank_of_a_box_that_breaks_a_limit_is_no_design() -> None:
    vee = {**ENGINE, "layout": "vee", "cylinder_spacing": "100 mm", "bank_angle": {"between": [60, 90]}, "cylinders": 2}
    case = problem(
        {"engine": {**vee, "throws": "open", "firing_order": [1, 2]}},
        phasing={"intervals": {"min": 1.0, "max": 359.0}},
        objective={"minimise": "rms rocking couple"},
        constraints=[{"name": "quiet", "limit": "rms shaking force", "max": "1 N"}],
    )
    phasing = case.phasing
    assert phasing is not None
    candidate = Candidate((0.0,), (1, 2), np.radians(75.0))
    free = case.changed(limits=())
    assert free.phasing is not None
    assert evaluate_crank(free.phasing, candidate) is not None
    assert evaluate_crank(phasing, candidate) is None


def test_a_proven_optimum_that_breaks_a_peak_between_angles_is_solved_anew() -> None:
    """The least mass under the least peak there is: a gap that is closed at few angles ends no search."""
    weight = {"name": "w", "x": "0 mm", "radius": "1 m", "angle": {"between": [0, 360]},
              "unbalance": {"between": ["0 kg m", "0.1 kg m"]}}  # fmt: skip
    tables = {"engine": {**ENGINE, "throws": [3]}, "counterweights": [weight]}
    peak = {"minimise": "maximum shaking force"}
    minimum = solve(problem(tables, objective=peak, fidelity={"samples": 5760})).objective.value
    limit = {"limit": "maximum shaking force", "max": f"{minimum} N"}
    result = solve(problem(tables, objective={"minimise": "added mass"}, constraints=[limit], fidelity={"samples": 48}))
    assert result.status is Status.OPTIMAL
    assert result.final.violation(result.problem.limits) <= FEASIBILITY_TOL
