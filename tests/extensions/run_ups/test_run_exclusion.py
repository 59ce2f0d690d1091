"""Limits that no stiffness keeps together (E67): against random designs, and in few boxes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from extensions.run_ups.test_run_boxes import OF_RUNS, READY, random_problem
from lanes import first_fast
from laufruhe.extensions.run_ups.boxes import RunBoxes
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import evaluate, remounted
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_norms import Under
from laufruhe.prove.mounts.exclusion import LimitBoxes, excluded
from laufruhe.solvers.mounts.limits_kept import LimitsKept, ruled_out


def limits_of(problem: Problem, share: float, seed: int = 0) -> list[dict[str, Any]]:
    """Force and travel of a run as the best of 60 random designs has them together, times a share."""
    r = np.random.default_rng(seed)
    given = evaluate(problem)
    low, high = sides(problem)
    found = np.array([
        [remounted(given, problem.design(x.tolist())).value(measure) for measure in OF_RUNS[:2]]
        for x in low + (high - low) * r.random((60, len(low)))
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


@pytest.mark.parametrize("seed", first_fast([3, 1, 6], 0, 1))
def test_no_design_of_a_box_breaks_limits_by_less(seed: int) -> None:
    """Boxes of several sizes: what is told of the largest excess is under that of every design, and near to some."""
    problem = limited(seed, 1.0)
    given, r = evaluate(problem), np.random.default_rng(seed)
    low, high = sides(problem)
    middles = low + (high - low) * r.random((24, len(low)))
    halves = 0.5 * (high - low) * 10.0 ** -r.uniform(0.3, 2.5, (24, 1)) * r.random((24, len(low)))
    lower, upper = np.clip(middles - halves, low, high), np.clip(middles + halves, low, high)
    bounds, _ = LimitBoxes(problem).bounds(lower, upper)
    near = []
    for below, above, bound in zip(lower, upper, bounds, strict=True):
        shares = np.vstack([r.random((4, len(low))), r.integers(0, 2, (4, len(low)))])
        least = min(
            remounted(given, problem.design(x.tolist())).excess(problem.limits)
            for x in below + shares * (above - below)
        )
        # an infinite bound says that no design keeps all limits
        assert least > 0.0 if bound == np.inf else bound <= least + 2e-3
        near.append((bound == np.inf) == (least > 0.0))
    assert np.mean(near) > 0.6
    assert np.count_nonzero(np.isinf(bounds)) > 0


@pytest.mark.parametrize("share", [0.7, 1.02])
@pytest.mark.parametrize("seed", first_fast([10, 6, 9], 0, 1))
def test_what_is_excluded_no_search_meets(seed: int, share: float) -> None:
    """Limits that random designs keep, and tighter ones: excluded, or a design is met that keeps them."""
    problem = limited(seed, share)
    low, high = sides(problem)
    given = evaluate(problem)

    def excess(x: Array) -> float:
        return remounted(given, problem.design(np.clip(x, low, high).tolist())).excess(problem.limits)

    found = excluded(problem, lambda x: excess(x) <= 0.0)
    assert found.is_proven is (share < 1.0)
    if found.design is not None:
        assert excess(found.design) <= 0.0
        return
    r = np.random.default_rng(seed)
    start = min(low + (high - low) * r.random((60, len(low))), key=excess)
    assert minimize(excess, start, method="Nelder-Mead", options={"maxfev": 120}).fun > 0.0


@pytest.mark.slow
def test_a_conflict_is_named_in_few_boxes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three limits that no stiffness keeps, of which two are kept by some: those are not divided to the end of time."""
    asked = tables_of(READY)
    force = {"limit": "run-up force", "max": "300 N"}
    problem = load_tables({**asked, "constraints": [*asked["constraints"], force]}, Path("single.toml"))
    seen, plain = [0], RunBoxes.under

    def counted(self: RunBoxes, measure: Measure, lower: Array, *more: Any) -> Under:
        seen[0] += len(lower)
        return plain(self, measure, lower, *more)

    monkeypatch.setattr(RunBoxes, "under", counted)
    assert ruled_out(problem) == ("static sag", "run-up travel", "run-up force")
    assert seen[0] < 2000


@pytest.mark.slow
def test_no_more_boxes_are_looked_at_than_are_asked_for() -> None:
    asked = {**tables_of(READY), "search": {"boxes": 1}}
    force = {"limit": "run-up force", "max": "300 N"}
    problem = load_tables({**asked, "constraints": [*asked["constraints"], force]}, Path("single.toml"))
    assert LimitsKept(problem).together(problem.limits).boxes == 1
