"""Claims about two kinds of open numbers together, and lies about them that the judges must find."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from attack.claims import Verdict, judge, solved
from attack.plain_scene import Table
from attack.run_attack import attacked, drawn, summary
from laufruhe.solvers.result import Result

SEED = 500000
SEEDS = {"transmissibility and weights": 500004, "ranks with limits": 500001}
"""First seeds of families whose earlier ones take long."""
QUICK = ("stars on mounts", "optional shafts and uneven throws")


@pytest.mark.slow
@pytest.mark.parametrize("family", [*QUICK, "transmissibility and weights", "robust and star"])
def test_no_claim_falls(family: str) -> None:
    verdict = attacked(family, SEEDS.get(family, SEED), 1)
    assert verdict.wrong == []
    assert verdict.status in ("optimal", "feasible", "infeasible", "refused")


def raised(result: Result) -> Result:
    """Return the result with a bound one percent above its value."""
    assert result.certificate is not None
    assert result.objective is not None
    bound = 1.01 * result.objective.value
    ranks = tuple(replace(rank, lower_bound=1.01 * rank.minimum) for rank in result.ranks)
    return replace(result, certificate=replace(result.certificate, lower_bound=bound), ranks=ranks)


@cache
def solution(family: str) -> tuple[Table, Result]:
    table, _ = drawn(family, SEEDS.get(family, SEED))
    with tempfile.TemporaryDirectory(prefix="attack-") as folder:
        return table, solved(table, Path(folder))


@pytest.mark.slow
@pytest.mark.parametrize("family", ["pistons and stars", "ranks with limits"])
@pytest.mark.parametrize(("change", "is_true"), [(raised, False), (lambda result: result, True)], ids=["lie", "truth"])
def test_only_a_false_claim_is_reported(family: str, change: Callable[[Any], Any], is_true: bool) -> None:
    table, result = solution(family)
    verdict = Verdict(family, SEEDS.get(family, SEED))
    judge(verdict, table, change(result), np.random.default_rng(0), 1)
    assert verdict.wrong == [] if is_true else any("bound" in line for line in verdict.wrong)


def test_a_summary_counts_what_is_false_and_what_is_unknown() -> None:
    known = {"family": "a", "seed": 1, "kind": "global", "status": "optimal", "bound": 2.0, "seconds": 1.0, "wrong": []}
    blank = {**known, "seed": 2, "kind": "local", "bound": 0.0}
    false = {**known, "seed": 3, "wrong": ["bound 3, a rival has 2"]}
    none = {**known, "seed": 4, "kind": "", "status": "infeasible"}
    text = summary([known, blank, false, none])
    assert text.startswith("4 problems, 1 with a false claim")
    assert "a 3: bound 3, a rival has 2" in text
    assert "1 of 3 designs are local with bound 0" in text
