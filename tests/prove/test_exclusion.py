"""Limits that no stiffness keeps together (E67): against linear programs and random designs, and in few boxes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog, minimize

from lanes import first_fast
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import evaluate, remounted
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_lines import BoxLines
from laufruhe.prove.mounts.box_norms import Under
from laufruhe.prove.mounts.box_runs import RunBoxes
from laufruhe.prove.mounts.exclusion import LimitBoxes, excluded
from laufruhe.solvers.mounts.limits_kept import LimitsKept, ruled_out
from prove.test_run_boxes import OF_RUNS, READY, random_problem


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


def test_the_least_excess_is_never_over_that_of_a_linear_program() -> None:
    """Of two limits it is that exactly; of more it is under it, and mostly tells what it tells."""
    r = np.random.default_rng(6)
    tight = []
    for _ in range(80):
        n, count = int(r.integers(1, 5)), int(r.integers(1, 4))
        overs, by = r.uniform(-1.5, 0.5, count), r.normal(size=(count, n))
        lines = BoxLines(np.zeros(1), np.zeros((1, n)), [(overs[k : k + 1], by[k : k + 1]) for k in range(count)])
        # least t with over + by x <= t
        exact = linprog(
            [*np.zeros(n), 1.0], A_ub=np.column_stack([by, -np.ones(count)]), b_ub=-overs,
            bounds=[(-1.0, 1.0)] * n + [(None, None)],
        ).fun  # fmt: skip
        found = float(lines.excess[0])
        assert found <= exact + 1e-9
        if count <= 2:
            assert found == pytest.approx(exact, abs=1e-9)
        tight.append(found >= exact - 1e-6)
    assert np.mean(tight) > 0.8


def test_three_limits_exclude_a_box_that_no_two_of_them_do() -> None:
    """Every two leave a side along which both are kept; (n1 + n2) / 2 is mixed with n3 until no side is left."""
    over, n = 0.1, np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]])

    def excess(which: list[int]) -> float:
        limits = [(np.array([over]), n[k : k + 1]) for k in which]
        return float(BoxLines(np.zeros(1), np.zeros((1, 2)), limits).excess[0])

    assert excess([0, 1, 2]) == pytest.approx(over)
    assert all(excess(pair) < 0.0 for pair in ([0, 1], [0, 2], [1, 2]))


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
