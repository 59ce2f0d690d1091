"""The error estimate is not below the error, of choices by hand and of the automatic one, and close to it."""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np
import pytest

from fidelity.scenes import finer, random_problem
from lanes import first_fast
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.error_bounds import ROUNDING
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.solvers.accuracy import objective_error

# the first of ten thousand engines, and all of them a thousand at a time
SHARES = [(0, 30), (30, 20), *((first, 1000) for first in range(0, 10_000, 1000))]


def _sampling_errors(seed: int) -> tuple[float, float]:
    """Return the true and stated error of samples with all physics."""
    rng = random.Random(seed)
    problem = random_problem(rng)
    variant = replace(problem, fidelity=Fidelity(samples=rng.choice([48, 96, 360, 1440])))
    evaluation, truth = evaluate(variant), objective_value(problem, evaluate(finer(problem, 14401)))
    value = objective_value(variant, evaluation)
    return abs(value - truth) / value if value else 0.0, objective_error(variant, evaluation)


@pytest.mark.parametrize(("first", "count"), first_fast(SHARES, 1, 1))
def test_estimate_is_not_below_the_error(first: int, count: int) -> None:
    """Check that half of the estimates are below ten times the error, and none below it."""
    pairs = {seed: _sampling_errors(100_000 + seed) for seed in range(first, first + count)}
    assert [seed for seed, (true, stated) in pairs.items() if true > stated] == []
    assert np.median([stated / true for true, stated in pairs.values() if true > ROUNDING]) < 10.0
