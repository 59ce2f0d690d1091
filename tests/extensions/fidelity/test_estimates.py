"""The error estimate of fidelities set by hand is not below the error, and close to it."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
import pytest

from fidelity.scenes import finer, random_elastic_problem, random_problem
from lanes import first_fast
from laufruhe.errors import UncarriedLoadError
from laufruhe.extensions.fidelity.reference import Reference, reference
from laufruhe.extensions.fidelity.trade import ladder
from laufruhe.files.reader import load
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.error_bounds import ROUNDING
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Problem
from problem_files import PROBLEMS

# the first of ten thousand engines, and all of them a thousand at a time
SHARES = [(0, 30), (30, 20), *((first, 1000) for first in range(0, 10_000, 1000))]


def _fidelity(rng: random.Random) -> Fidelity:
    return Fidelity(
        rng.choice(["exact", "exact", "two-order"]), rng.choice([48, 60, 96, 130, 360, 720]),
        orders=rng.choice([None, 1, 2, 4, 7, 16]), rod=rng.choice(["rigid", "mass-only"]), gas=rng.random() < 0.8,
        gas_samples=rng.choice([None, 720]),
    )  # fmt: skip


def _errors(seed: int) -> tuple[float, float]:
    """Return the true error and stated error of a fidelity, relative to its objective."""
    rng = random.Random(seed)
    problem = random_problem(rng)
    variant = replace(problem, fidelity=_fidelity(rng))
    evaluation, best = evaluate(variant), reference(variant, samples=1440)
    value = objective_value(variant, evaluation)
    # many steps, no multiple of the reference's, so that both can be wrong in their own way
    truth = objective_value(problem, evaluate(finer(problem, 14401)))
    return abs(value - truth) / value if value else 0.0, Reference(variant, best).error_of(evaluation)


@pytest.mark.parametrize(("first", "count"), first_fast(SHARES, 1, 1))
def test_estimate_is_not_below_the_error(first: int, count: int) -> None:
    """Check that half of the estimates are below ten times the error, and none below it."""
    pairs = {seed: _errors(100_000 + seed) for seed in range(first, first + count)}
    assert [seed for seed, (true, stated) in pairs.items() if true > stated] == []
    assert np.median([stated / true for true, stated in pairs.values() if true > ROUNDING]) < 10.0


def _scene(make, seed: int) -> Problem:
    """Return a random problem with gas: rigid or elastic mounts, even or uneven throws, rows and vees."""
    return make(random.Random(40_000 + seed), gas=True)


@pytest.mark.parametrize("make", [random_problem, random_elastic_problem])
@pytest.mark.parametrize("seed", first_fast(range(30), 6, 7))
def test_estimate_with_few_orders_of_gas_is_not_below_the_error(make, seed: int) -> None:
    rng, problem = random.Random(seed), _scene(make, seed)
    fidelity = Fidelity(samples=rng.choice([96, 360, 720]), gas_orders=rng.choice([1, 2, 4, 8, 12, 24]))
    variant = replace(problem, fidelity=replace(fidelity, orders=rng.choice([None, None, 16]), gas_samples=1440))
    try:
        evaluation, best = evaluate(variant), reference(variant)
    except UncarriedLoadError:
        return
    value, truth = objective_value(variant, evaluation), objective_value(problem, evaluate(finer(problem, 7001)))
    assert abs(value - truth) <= Reference(variant, best).error_of(evaluation) * max(value, 1e-300)


def test_stars_keep_the_choice() -> None:
    """A star of an open crank is evaluated with it, within the bound."""
    problem = load(PROBLEMS / "inline-five-uneven-gas.toml").at(Fidelity(samples=720, gas_orders=4))
    assert problem.phasing is not None
    throws = tuple(math.tau * k / 5.0 for k in (0, 3, 2, 1, 4))
    star = problem.phasing.problem_of(Candidate(throws, (1, 2, 4, 5, 3)))
    assert star.fidelity.gas_orders == 4
    evaluation, best = evaluate(star), reference(star)
    value, truth = objective_value(star, evaluation), objective_value(star, best)
    assert 0.0 < abs(value - truth) <= Reference(star, best).error_of(evaluation) * value


def test_a_trade_tries_it_where_there_is_gas() -> None:
    rungs = dict(ladder(Reference(_scene(random_problem, 3))))
    assert rungs["exact, gas to order 12, 720 steps"].fidelity.gas_orders == 12
    assert not any("gas to order" in name for name, _ in ladder(Reference(random_problem(random.Random(1), gas=False))))
