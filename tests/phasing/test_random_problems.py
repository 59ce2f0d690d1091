"""Valid problems with stars open end in a design that is no worse than the one given, or in an infeasibility."""

from __future__ import annotations

import pytest

from lanes import first_fast
from laufruhe.errors import InputError
from laufruhe.problem.evaluation import evaluate
from laufruhe.solvers import solve
from laufruhe.solvers.conclusion import FEASIBILITY_TOL
from laufruhe.solvers.result import Status
from phasing.random_problems import OPEN, RIGID, Writer
from problem_files import loaded


def problem_of(folder, seed):
    """Return the problem of a seed, or None if the reader refuses it with a line."""
    try:
        return loaded(folder, Writer(seed).text())
    except InputError:
        return None


def judge(problem):
    if problem is None:
        return
    result = solve(problem)
    initial = evaluate(problem)
    phasing = problem.phasing
    if result.status is Status.FAILED:
        # no bound rules uneven throws out: that no search found one is all that is known
        assert phasing is not None, result.message
        assert phasing.continuous, result.message
        assert initial.violation(problem.limits) > 0.0, result.message
        return
    if result.status is Status.INFEASIBLE:
        assert result.message or result.conflict
        return
    assert result.final.violation(result.problem.limits) <= FEASIBILITY_TOL
    assert phasing is None or phasing.intervals.holds(result.final.engine.firing_intervals, 1e-6)
    if initial.violation(problem.limits) <= 0.0 and (phasing is None or phasing.throw_bounds is None):
        assert result.objective.value <= result.objective.initial * (1.0 + 1e-6) + 1e-9
    assert result.certificate.lower_bound <= result.objective.value


RIGID_SEEDS = [seed for seed in range(2, 160) if Writer(seed).mounts == RIGID]
OTHER_SEEDS = [seed for seed in range(120) if Writer(seed).mounts not in (RIGID, OPEN)]
OPEN_SEEDS = [seed for seed in range(50) if Writer(seed).mounts == OPEN]
# seeds that take seconds each, and seven of eight outside the fast lane
LONG_RIGID = sorted(
    {9, 36, 60, 65, 102, 105, 111, 117, 121, 154, 155, *set(RIGID_SEEDS[16:]) - set(RIGID_SEEDS[16::8])}
)
LONG_OTHER = sorted({25, 75, 88, *set(OTHER_SEEDS[8:]) - set(OTHER_SEEDS[8::8])})
LONG_OPEN = sorted({0, 3, 10, 22, 33, *set(OPEN_SEEDS) - set(OPEN_SEEDS[::3])})


@pytest.mark.parametrize("seed", first_fast(RIGID_SEEDS, 16, long=LONG_RIGID))
def test_on_rigid_mounts(tmp_path, seed):
    judge(problem_of(tmp_path, seed))


@pytest.mark.parametrize("seed", first_fast(OTHER_SEEDS, 8, long=LONG_OTHER))
def test_on_elastic_mounts(tmp_path, seed):
    judge(problem_of(tmp_path, seed))


@pytest.mark.parametrize("seed", first_fast(OPEN_SEEDS, 0, long=LONG_OPEN))
def test_together_with_mounts(tmp_path, seed):
    judge(problem_of(tmp_path, seed))
