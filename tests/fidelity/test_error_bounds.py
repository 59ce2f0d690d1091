"""The error estimate is an upper bound: of choices by hand, and of the automatic one."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest

from fidelity.scenes import finer, random_problem
from lanes import first_fast
from laufruhe.fidelity.automatic import choose
from laufruhe.fidelity.error_bounds import ErrorReference, reference
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.evaluation import evaluate, objective_value

QUICK, AUTOMATIC = 150, 25
# ten thousand engines, a thousand at a time
SHARES = [(0, 150), *((first, 1000) for first in range(0, 10_000, 1000))]


def _fidelity(rng: random.Random) -> Fidelity:
    return Fidelity(
        rng.choice(["exact", "exact", "two-order"]), rng.choice([48, 60, 96, 130, 360, 720]),
        orders=rng.choice([None, 1, 2, 4, 7, 16]), rod=rng.choice(["rigid", "mass-only"]), gas=rng.random() < 0.8,
        gas_samples=rng.choice([None, 720]),
    )  # fmt: skip


def _errors(seed: int, gas: bool | None = None, truth_samples: int = 5760) -> tuple[float, float, Fidelity]:
    """True error, stated error."""
    rng = random.Random(seed)
    problem = random_problem(rng, gas)
    own = replace(problem, fidelity=_fidelity(rng))
    found = evaluate(own)
    value = objective_value(own, found)
    truth = objective_value(problem, evaluate(finer(problem, truth_samples)))
    return abs(value - truth) / value if value else 0.0, ErrorReference.of(own).error_of(found), own.fidelity


@pytest.mark.parametrize("seed", first_fast(range(QUICK), 30, 34))
def test_estimate_is_not_below_the_error(seed: int) -> None:
    # steps that are no multiple of the reference's, so that both can be wrong in their own way
    true, stated, fidelity = _errors(seed, truth_samples=7001)
    assert true <= stated, fidelity


@pytest.mark.slow
def test_estimate_is_not_idle() -> None:
    """A bound far above the truth would pass every test and help nobody."""
    ratios = [stated / true for true, stated, _ in map(_errors, range(60)) if true > 1e-6]
    assert sorted(ratios)[len(ratios) // 2] < 12.0


@pytest.mark.validation
@pytest.mark.parametrize(("first", "count"), first_fast(SHARES, 0, 1))
def test_estimate_on_ten_thousand_engines(first: int, count: int) -> None:
    """Nothing is below without gas; with it one in a thousand: where its bends fall between steps is chance."""
    found = {seed: _violation(seed) for seed in range(first, first + count)}
    assert [seed for seed, (violation, has_gas) in found.items() if violation > 0.0 and not has_gas] == []
    assert sum(violation > 0.0 for violation, _ in found.values()) <= 1


def _violation(seed: int) -> tuple[float, bool]:
    """By how much the error is above the estimate, of a reference of fewer steps: ten thousand take a minute."""
    rng = random.Random(100_000 + seed)
    problem = random_problem(rng)
    own = replace(problem, fidelity=_fidelity(rng))
    found, best = evaluate(own), reference(own, samples=720)
    value = objective_value(own, found)
    truth = objective_value(problem, evaluate(finer(problem, 1009)))
    has_gas = any(point.gas is not None for point in problem.points)
    return (abs(value - truth) / value if value else 0.0) - ErrorReference(own, best).error_of(found), has_gas


@pytest.mark.parametrize("seed", first_fast(range(AUTOMATIC), 6, 8))
def test_automatic_choice_keeps_its_word(seed: int) -> None:
    problem = random_problem(random.Random(5000 + seed))
    choice = choose(problem, 1e-2)
    own = replace(problem, fidelity=choice.fidelity)
    value = objective_value(own, evaluate(own))
    truth = objective_value(problem, evaluate(finer(problem, 7001)))
    assert abs(value - truth) <= choice.error_estimate * max(value, 1e-300)
    assert choice.error_estimate <= 1.05e-2 or choice.fidelity.samples >= 5760


@pytest.mark.parametrize("seed", range(12))
def test_parts_put_back_change_less_than_said(seed: int) -> None:
    problem = random_problem(random.Random(9000 + seed), gas=True)
    choice = choose(problem, 1e-2)
    value = objective_value(problem, evaluate(replace(problem, fidelity=choice.fidelity)))
    restored = [part for part in choice.left_out if part.restored is not None]
    assert restored
    for part in restored:
        assert part.restored is not None
        changed = objective_value(problem, evaluate(replace(problem, fidelity=part.restored)))
        # a share is of the reference, the two values are sampled alike
        assert abs(changed - value) <= part.share * max(value, changed) * 1.02 + 1e-12 * value, part.what
