"""Provers of open mounts, which work in rounds of growing effort until one closes the gap."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from laufruhe.numerics.budget import limit_time
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.mounts import provers
from laufruhe.prove.mounts.provers import Prover, Question, run_provers
from mounts.files import BLOCK, ENGINE, MOUNTS, problem_of

FORCE = '[objective]\nminimise = "rms mount force"\n'
PLACE = (np.zeros(2),)


@pytest.mark.parametrize(
    ("first", "second", "bound", "boxes", "order"),
    [
        # bound and boxes of two provers, after less and more work
        ([(0.95, 2)], [], 0.95, 2, "f"),
        ([(0.5, 2)], [(0.95, 10)], 0.95, 12, "fs"),
        ([(0.5, 2), (0.95, 7)], [(0.6, 10)], 0.95, 17, "fsf"),
        ([(0.5, 2), (0.6, 7)], [(0.4, 10), (0.7, 50)], 0.7, 57, "fsfs"),
        ([(0.5, 2), (0.8, 7)], [(0.4, 10), (0.7, 50)], 0.8, 57, "fsfs"),
        ([], [(0.4, 10), (0.7, 50)], 0.7, 50, "ss"),
        ([], [], 0.0, 0, ""),
    ],
)
def test_each_has_its_turn_until_one_closes(
    first: list[tuple[float, int]], second: list[tuple[float, int]], bound: float, boxes: int, order: str,
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """A value of 1 is closed from 0.9, and the best bound is the answer."""
    calls = []

    def bounds_of(name: str, answers: list[tuple[float, int]]):
        def bounds(question: Question) -> Iterator[BoxResult]:
            for answer in answers:
                calls.append((name, question.bound))
                yield BoxResult(*answer, PLACE)

        return Prover(name, lambda _: True, bounds)

    never = Prover("never", lambda _: False, bounds_of("n", [(1.0, 1)]).bounds)
    monkeypatch.setattr(provers, "provers", lambda: (never, bounds_of("f", first), bounds_of("s", second)))
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, FORCE)
    result = run_provers(Question(problem, 1.0, 0.1))
    assert (result.bound, result.boxes, "".join(name for name, _ in calls)) == (bound, boxes, order)
    assert bool(result.places) is bool(order)
    # each knows the best bound before its own
    known_bounds = [0.0, *(answer[0] for answer in (first + second))]
    assert all(known in known_bounds for _, known in calls)
    with limit_time(1e-9):
        calls.clear()
        run_provers(Question(problem, 1.0, 0.1))
        assert "".join(name for name, _ in calls) == order[:1]


@pytest.mark.slow
def test_provers_find_no_bound_without_a_design(tmp_path: Path) -> None:
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, FORCE)
    assert run_provers(Question(problem, math.inf, math.inf)).bound < math.inf
