"""Run-up limits that no stiffness keeps together (E67), compared with random designs and searches."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from extensions.run_ups.test_run_boxes import OF_RUNS, READY, random_problem
from lanes import first_fast
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import evaluate, with_mounts
from laufruhe.problem.problem import Problem
from laufruhe.solvers.mounts.nonlinear import are_contradictory, minimal_conflict


def limits_of(problem: Problem, share: float, seed: int = 0) -> list[dict[str, Any]]:
    """Return force and travel of the best of 30 random designs, times a share."""
    r = np.random.default_rng(seed)
    evaluation = evaluate(problem)
    low, high = sides(problem)
    found = np.array([
        [with_mounts(evaluation, problem.design(x.tolist())).value(measure) for measure in OF_RUNS[:2]]
        for x in low + (high - low) * r.random((30, len(low)))
    ])  # fmt: skip
    middle = np.median(found, axis=0)
    force, travel = share * (found / middle).max(axis=1).min() * middle
    return [
        {"limit": "run-up force", "max": f"{force} N"},
        {"limit": "run-up travel", "max": f"{1e3 * travel} mm"},
        {"limit": "static sag", "max": "1 m"},
    ]


def sides(problem: Problem) -> tuple[Array, Array]:
    decisions = problem.mount_decisions
    return np.array([d.lower for d in decisions]), np.array([d.upper for d in decisions])


def limited(seed: int, share: float) -> Problem:
    given = limits_of(random_problem(seed), share)
    return random_problem(seed, objective={"minimise": "mean mount force"}, constraints=given)


@pytest.mark.parametrize("seed", first_fast([10, 6, 9], 0, 1))
def test_no_search_meets_excluded_limits(seed: int) -> None:
    """Check that limits that random designs keep are not excluded, and that a search breaks excluded ones."""
    attainable = limited(seed, 1.02)
    assert not are_contradictory(attainable, attainable.limits)
    problem = limited(seed, 0.7)
    assert are_contradictory(problem, problem.limits)
    low, high = sides(problem)
    evaluation = evaluate(problem)

    def violation(x: Array) -> float:
        return with_mounts(evaluation, problem.design(np.clip(x, low, high).tolist())).violation(problem.limits)

    r = np.random.default_rng(seed)
    start = min(low + (high - low) * r.random((20, len(low))), key=violation)
    assert minimize(violation, start, method="Nelder-Mead", options={"maxfev": 60}).fun > 0.0


@pytest.mark.slow
def test_a_conflict_of_run_ups_is_named() -> None:
    """Check three limits that no stiffness keeps, of which some stiffness keeps each two."""
    tables = tables_of(READY)
    force = {"limit": "run-up force", "max": "300 N"}
    problem = load_tables({**tables, "constraints": [*tables["constraints"], force]}, Path("single.toml"))
    assert minimal_conflict(problem) == ("static sag", "run-up travel", "run-up force")
