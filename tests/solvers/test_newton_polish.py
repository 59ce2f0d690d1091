"""Newton's method from the optimum of some angles to that of the whole cycle (P10)."""

from __future__ import annotations

from dataclasses import replace

import pytest

from laufruhe.files.reader import load
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from laufruhe.solvers.cones.newton_polish import TARGET_GAP
from problem_files import PROBLEMS

NAMES = ["tractor-four-lanchester", "tractor-single", "tractor-six", "vee-six-60"]


@pytest.mark.parametrize("name", NAMES)
def test_the_gap_is_a_millionth_and_the_design_no_worse(name: str) -> None:
    problem = load(PROBLEMS / f"{name}.toml")
    rough, sharp = solve(problem), solve(replace(problem, sharply=True))
    assert sharp.certificate.kind is Proof.GLOBAL
    assert sharp.certificate.gap <= TARGET_GAP < rough.certificate.gap
    # bounds of both hold for the value at any number of steps
    finest = 5 * sharp.final.samples
    best, before = (objective_value(problem, evaluate(problem, r.final.engine, finest)) for r in (sharp, rough))
    assert max(rough.certificate.lower_bound, sharp.certificate.lower_bound) <= best <= before * (1.0 + 1e-12)
    assert sharp.objective.value == pytest.approx(best, rel=1e-7)
    for own, other in zip(sharp.limits, rough.limits, strict=True):
        assert own.value <= own.limit * (1.0 + 1e-9)
        assert own.shadow_price == pytest.approx(other.shadow_price, rel=1e-2, abs=1e-9)


@pytest.mark.parametrize("name", ["tractor-three-shafts", "tractor-four-bearings"])
@pytest.mark.slow
def test_optima_with_rows_of_zero_or_many_rows_are_not_refined(name: str) -> None:
    problem = load(PROBLEMS / f"{name}.toml")
    result = solve(replace(problem, sharply=True))
    assert "and Newton's method" not in result.certificate.method
    assert result.certificate.kind is Proof.GLOBAL
