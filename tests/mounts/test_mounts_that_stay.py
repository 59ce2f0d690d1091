"""Limits without effect of any open number, which hold for every design or for none."""

from __future__ import annotations

from pathlib import Path

import pytest

from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from laufruhe.solvers.result import Status
from mounts.files import BLOCK, ENGINE, MOUNTS, OPEN, problem_of

GIVEN = MOUNTS.replace(OPEN, '"400 N/mm"')
CHEAPEST = '[objective]\nminimise = "rms mount force"\n'


def limited(limit: str, maximum: str) -> str:
    """Return a limit of a problem file."""
    return f'[[constraints]]\nlimit = "{limit}"\nmax = "{maximum}"\n'


@pytest.mark.parametrize(
    ("limit", "maximum", "status"),
    [
        ("static sag", "50 mm", Status.FEASIBLE),
        ("static sag", "0.1 mm", Status.INFEASIBLE),
        ("peak to peak mount force", "1 N", Status.INFEASIBLE),
    ],
)
def test_limits_apply_to_a_design_without_open_numbers(
    tmp_path: Path, limit: str, maximum: str, status: Status
) -> None:
    parts = (ENGINE, BLOCK, GIVEN, CHEAPEST, limited(limit, maximum))
    result = solve(problem_of(tmp_path, *parts))
    assert result.status is status
    assert [entry.name for entry in result.limits] == [limit]
    assert result.conflict == ((limit,) if status is Status.INFEASIBLE else ())


def test_a_star_on_mounts_that_stay_is_proven_beside_a_limit_on_sag(tmp_path: Path) -> None:
    star = ENGINE.replace("throws = [0, 180, 180, 0]", 'throws = "open"\ncylinders = 4')
    parts = (star, BLOCK, GIVEN, CHEAPEST)
    free = solve(problem_of(tmp_path, *parts))
    result = solve(problem_of(tmp_path, *parts, limited("static sag", "50 mm")))
    broken = solve(problem_of(tmp_path, *parts, limited("static sag", "0.1 mm")))
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    assert free.objective is not None
    assert result.objective is not None
    assert result.objective.value == pytest.approx(free.objective.value, rel=1e-9)
    assert broken.status is Status.INFEASIBLE
    assert broken.conflict == ("static sag",)
