"""Bounds of the largest violation of limits over boxes (E67): against linear programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog

from laufruhe.prove.mounts.box_norms import LinearRelaxation
from laufruhe.solvers import solve
from laufruhe.solvers.result import Status
from mounts.files import BLOCK, ENGINE, MOUNTS, problem_of


def test_the_least_excess_is_never_over_that_of_a_linear_program() -> None:
    """Compare the least excess with a linear program: equal for two limits, not above for more."""
    r = np.random.default_rng(6)
    tight = []
    for _ in range(80):
        n, count = int(r.integers(1, 5)), int(r.integers(1, 4))
        overs, by = r.uniform(-1.5, 0.5, count), r.normal(size=(count, n))
        lines = LinearRelaxation(
            np.zeros(1), np.zeros((1, n)), [(overs[k : k + 1], by[k : k + 1]) for k in range(count)]
        )
        # least t with over + by x <= t
        exact = linprog(
            [*np.zeros(n), 1.0], A_ub=np.column_stack([by, -np.ones(count)]), b_ub=-overs,
            bounds=[(-1.0, 1.0)] * n + [(None, None)],
        ).fun  # fmt: skip
        result = float(lines.violation[0])
        assert result <= exact + 1e-9
        if count <= 2:
            assert result == pytest.approx(exact, abs=1e-9)
        tight.append(result >= exact - 1e-6)
    assert np.mean(tight) > 0.8


def test_three_limits_exclude_a_box_that_no_two_of_them_do() -> None:
    """Check that three limits exclude a box that each two of them allow."""
    over, n = 0.1, np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]])

    def violation(which: list[int]) -> float:
        limits = [(np.array([over]), n[k : k + 1]) for k in which]
        return float(LinearRelaxation(np.zeros(1), np.zeros((1, 2)), limits).violation[0])

    assert violation([0, 1, 2]) == pytest.approx(over)
    assert all(violation(pair) < 0.0 for pair in ([0, 1], [0, 2], [1, 2]))


def test_feasible_limits_are_no_part_of_a_conflict(tmp_path: Path) -> None:
    """Check that an infeasible limit on forces does not name sag, which all designs keep."""
    text = """
    [search]
    starts = 1
    [[counterweights]]
    name = "front"
    x = "200 mm"
    unbalance = { between = ["0 kg m", "0.05 kg m"] }
    [objective]
    minimise = "rms mount force"
    [[constraints]]
    limit = "static sag"
    max = "1 m"
    [[constraints]]
    limit = "maximum mount force"
    max = "1e-3 N"
    """
    result = solve(problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, text))
    assert result.status is Status.FAILED
    assert result.conflict == ()
