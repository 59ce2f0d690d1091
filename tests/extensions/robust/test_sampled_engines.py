"""Results for built engines at few angles, compared with the same engines at many angles (R4)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.extensions.robust.result import RobustResult
from laufruhe.extensions.robust.tolerance import tolerances_of, with_errors
from laufruhe.files.reader import load_tables
from laufruhe.numerics.budget import limit_time
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.solvers import Status, solve
from laufruhe.solvers.cones.unbalances import FEASIBILITY_TOL

ENGINE: dict[str, Any] = {
    "layout": "inline", "cycle": "two-stroke", "stroke": "100 mm", "rod_ratio": 0.3, "reciprocating_mass": "1 kg ± 5 %",
    "throws": [0],
}  # fmt: skip
SINGLE: dict[str, Any] = {
    "title": "single", "engine": ENGINE, "operating_points": [{"speed": "3000 rpm"}], "fidelity": {"samples": 48},
    "robust": {"over": "worst case", "engines": 100},
}  # fmt: skip
SECOND = {"minimise": "mean shaking force", "orders": [2]}
WEIGHT = {"name": "w", "x": "0 mm", "angle": 180, "radius": "1 m", "unbalance": {"between": ["0 kg m", "0.1 kg m"]}}
QUIET = {"limit": "mean shaking force", "orders": [2], "name": "second"}


def problem(**changes: Any) -> Problem:
    return load_tables({**SINGLE, **changes}, Path("built.toml"))


def heaviest(nominal: Problem) -> float:
    """Return the objective of the engine with the heaviest piston, the worst one, at many angles."""
    built_problem = with_errors(nominal, np.ones(tolerances_of(nominal).count))
    return objective_value(built_problem, evaluate(built_problem, samples=5760))


@pytest.mark.parametrize("weights", [[], [WEIGHT]], ids=["nothing open", "a weight"])
@pytest.mark.parametrize("throw", [0, 3])
def test_the_worst_case_is_that_of_many_angles(throw: float, weights: list[Any]) -> None:
    """Check order 2, which no weight moves and 48 angles misread by up to 0.6 %, against many angles."""
    case = problem(engine={**ENGINE, "throws": [throw]}, counterweights=weights, objective=SECOND)
    result = solve(case)
    assert result.objective is not None
    assert result.certificate is not None
    assert result.objective.value == pytest.approx(heaviest(case), rel=case.tolerance)
    assert result.certificate.lower_bound <= heaviest(case) * (1.0 + 1e-9)
    assert result.status is Status.OPTIMAL


@pytest.mark.parametrize(("throw", "samples"), [(1, 120), (2, 240), (5, 480), (0, 1440)])
def test_no_bound_is_over_what_an_engine_has(throw: float, samples: int) -> None:
    """Check that the bound without open numbers agrees with the heaviest engine at many angles."""
    case = problem(engine={**ENGINE, "throws": [throw]}, objective=SECOND, fidelity={"samples": samples})
    result = solve(case)
    assert result.certificate is not None
    assert heaviest(case) * (1.0 - case.tolerance) <= result.certificate.lower_bound <= heaviest(case) * (1.0 + 1e-9)


def test_the_share_of_engines_agrees_with_many_angles() -> None:
    tables = {"objective": SECOND, "robust": {"over": "90 %", "engines": 40}}
    few, many = (solve(problem(**tables, fidelity={"samples": n})) for n in (48, 1440))
    assert few.objective is not None
    assert many.objective is not None
    assert few.objective.value == pytest.approx(many.objective.value, rel=1e-4)


def test_the_worst_of_drawn_engines_is_that_of_many_angles() -> None:
    engine = {**ENGINE, "rod_ratio": "0.3 ± 3 %", "reciprocating_mass": "1 kg"}
    tables = {"engine": engine, "objective": SECOND, "robust": {"over": "worst case", "engines": 20}}
    few, many = (solve(problem(**tables, fidelity={"samples": n})) for n in (48, 1440))
    assert few.objective is not None
    assert many.objective is not None
    assert few.objective.value == pytest.approx(many.objective.value, rel=1e-4)


def test_the_error_estimate_is_that_of_the_worst_engine() -> None:
    """Check that samples are judged on the engine of the objective, not on the drawing."""
    case = problem(counterweights=[WEIGHT], objective=SECOND)
    result = solve(case)
    assert isinstance(result.details, RobustResult)
    assert objective_value(case, result.measured) == pytest.approx(result.objective.value, rel=1e-3)  # type: ignore[union-attr]
    assert result.measured is result.details.worst_engine


@pytest.mark.parametrize("rod_ratio", [0.3, "0.3 ± 3 %"], ids=["every error", "drawn"])
def test_a_closed_problem_that_breaks_a_limit_in_some_engine_is_infeasible(rod_ratio: float | str) -> None:
    """Check that the attainable value is that of the worst engine, while the drawing keeps the limit."""
    tables = {"engine": {**ENGINE, "rod_ratio": rod_ratio}, "robust": {"over": "worst case", "engines": 20}}
    free = problem(**tables, objective=SECOND)
    worst, drawn = solve(free), evaluate(free, samples=5760)
    assert worst.objective is not None
    limit = {**QUIET, "max": f"{0.5 * (objective_value(free, drawn) + worst.objective.value)!r} N"}
    result = laufruhe.solve(problem(**tables, objective=SECOND, constraints=[limit]))
    assert result.status is Status.INFEASIBLE
    assert result.conflict == ("second",)
    assert result.objective is None
    assert result.limits[0].value == pytest.approx(worst.objective.value, rel=1e-3)
    (reached,) = result.reached
    assert reached.value == pytest.approx(worst.objective.value, rel=1e-3)


@pytest.mark.parametrize("over", ["worst case", "90 %"])
def test_a_closed_drawing_that_breaks_a_limit_is_infeasible(over: str) -> None:
    limit = {"limit": "added mass", "max": "1 kg", "name": "light"}
    tables = {"objective": SECOND, "constraints": [limit], "robust": {"over": over, "engines": 20}}
    weight = {"name": "w", "x": "0 mm", "angle": 180, "radius": "50 mm", "mass": "2 kg"}
    assert solve(problem(**tables, counterweights=[weight])).status is Status.INFEASIBLE
    assert solve(problem(**tables, counterweights=[{**weight, "mass": "0.5 kg"}])).status.has_design


@pytest.mark.parametrize(("share", "status"), [(1.0005, Status.OPTIMAL), (0.998, Status.INFEASIBLE)])
@pytest.mark.parametrize("throw", [0, 3])
def test_few_angles_decide_no_limit_without_open_numbers(throw: int, share: float, status: Status) -> None:
    engine = {**ENGINE, "throws": [throw]}
    worst = heaviest(problem(engine=engine, objective=SECOND))
    limit = {**QUIET, "max": f"{share * worst!r} N"}
    result = solve(problem(engine=engine, objective={"minimise": "rms shaking force"}, constraints=[limit]))
    assert result.status is status
    if status is Status.OPTIMAL:
        assert result.limits[0].value <= result.limits[0].limit * (1.0 + FEASIBILITY_TOL)


def test_built_engines_of_the_initial_design_may_break_a_limit_slightly() -> None:
    """Check that a limit that built engines of the initial design break by a hair leaves no design."""
    case = problem(
        **{
            "engine": {
                "layout": "inline", "cycle": "four-stroke", "stroke": "0.103788 m", "rod_length": "0.165566 m",
                "reciprocating_mass": "1.87674 kg ± 1.5 %", "rotating_mass": "0.884581 kg", "offset": "0.00647653 m",
                "cylinder_spacing": "0.127015 m", "throws": [0.0, 199.656, 322.448, 201.495, 152.787],
            },
            "operating_points": [{"speed": "297.3 rad/s"}],
            "counterweights": [{
                "name": "w", "x": "-0.02141 m", "radius": "0.06 m", "mass": {"between": ["0 kg", "6.53601 kg"]},
                "angle": {"between": [0, 360]},
            }],
        },
        robust={"over": "worst case"}, tolerance=1e-3, objective={"minimise": "maximum rocking couple"},
        constraints=[{"name": "quiet", "limit": "mean rocking couple", "max": "3766.81209972 N m"}],
    )  # fmt: skip
    assert not solve(case).status.has_design


@pytest.mark.parametrize("throw", [0, 3])
def test_time_that_is_over_leaves_no_proof_that_few_angles_alone_have(throw: float) -> None:
    """Check that a search without time proves no bound above the heaviest engine at many angles."""
    engine = {**ENGINE, "throws": [throw]}
    case = problem(engine=engine, objective=SECOND)
    with limit_time(1e-9):
        result = solve(case)
    assert result.objective is not None
    assert result.certificate is not None
    assert result.objective.value == pytest.approx(heaviest(case), rel=1e-4)
    assert result.certificate.lower_bound <= heaviest(case) * (1.0 + 1e-9)


@pytest.mark.parametrize(("throw", "share", "status"), [(0, 0.998, Status.INFEASIBLE), (3, 1.0005, Status.OPTIMAL)])
def test_limits_of_built_engines_are_what_the_cycle_has_in_the_worst_of_them(
    throw: float, share: float, status: Status
) -> None:
    """Check limits on order 2 in the worst engine, which the sampling error of the drawing does not show."""
    engine = {**ENGINE, "throws": [throw]}
    weight = {"name": "w", "x": "0 mm", "angle": 180, "radius": "1 m", "unbalance": {"between": ["0 kg m", "0.1 kg m"]}}
    limit = {"limit": "mean shaking force", "orders": [2], "name": "second"}
    case = {
        "engine": engine, "counterweights": [weight], "robust": {"over": "worst case", "engines": 100},
        "objective": {"minimise": "rms shaking force"},
    }  # fmt: skip
    free = problem(**case, constraints=[{**limit, "max": "1e6 N"}])
    heaviest = evaluate(with_errors(free, np.ones(1)), samples=5760).value(free.limits[0].measure)
    result = solve(problem(**case, constraints=[{**limit, "max": f"{share * heaviest!r} N"}]))
    assert result.status is status
    if status is Status.OPTIMAL:
        assert result.limits[0].value == pytest.approx(heaviest, rel=1e-6)


def test_a_tolerance_costs_what_a_little_less_of_it_saves() -> None:
    """Compare the price with the heaviest piston, to which the load of a single is proportional."""
    result = solve(problem(engine={**ENGINE, "throws": [2]}, objective=SECOND, fidelity={"samples": 240}))
    assert isinstance(result.details, RobustResult)
    (priced,) = result.details.tolerances
    assert priced.saving == pytest.approx(result.objective.value * 0.05 / 1.05, rel=1e-3)
