"""The automatic choice: omitted parts, and an estimate that is not below the error."""

from __future__ import annotations

import os
import random
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

import laufruhe
import tractor
from fidelity.scenes import finer, random_problem
from fidelity.test_gas_peaks import ANGLES, FAST, QUICK, problem_of_peak, truth_of_peak
from lanes import first_fast
from laufruhe.extensions.fidelity.choice import choose
from laufruhe.files.reader import load
from laufruhe.machine import SliderCrank
from laufruhe.machine.bodies import Motion
from laufruhe.numerics.norms import NORMS
from laufruhe.problem import channels
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Measure, Term
from problem_files import PROBLEMS

ROOT = Path(__file__).parents[3]


THREADS = """
from laufruhe import load, solve
from laufruhe.extensions.fidelity.choice import choose
found = solve(load("problems/tractor-four-lanchester.toml"))
print(found.objective.value, found.certificate.lower_bound, choose(found.problem, 1e-3).error_estimate)
"""


@pytest.mark.slow
def test_threads_of_the_machine_change_a_rounding() -> None:
    """Check that threads change optimum, bound and estimate by a rounding only."""
    count = "3" if os.environ.get(NAMES[0]) == "1" else "1"
    answer = subprocess.run(
        [sys.executable, "-c", THREADS], capture_output=True, text=True, check=True, cwd=ROOT,
        env={**os.environ, **dict.fromkeys(NAMES, count)},
    ).stdout  # fmt: skip
    result = laufruhe.solve(load(PROBLEMS / "tractor-four-lanchester.toml"))
    here = [result.objective.value, result.certificate.lower_bound, choose(result.problem, 1e-3).error_estimate]
    assert [float(word) for word in answer.split()] == pytest.approx(here, rel=1e-11)


NAMES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS")


def test_automatic_finds_what_is_not_there() -> None:
    text = "\n".join(part.what for part in choose(load(PROBLEMS / "tractor-six.toml"), 1e-2).left_out)
    # an open shaft may drive what nothing drives now
    assert "loads Fx\n" in text
    assert "2, 2.5" in text
    assert "1 of 2 parts of the cycle" in text


def test_gas_that_the_objective_cannot_see_is_dropped() -> None:
    engine = replace(tractor.engine((0, 180, 180, 0)), mounts=())

    force = Term(Measure(channels.SHAKING_FORCE, NORMS["mean"]))
    choice = choose(tractor.problem(engine, [], tractor.GAS, objective=(force,)), 1e-3)
    assert not choice.fidelity.gas
    assert choice.error_estimate <= 1e-3
    # gas loads no force, so that the rod alone gives all orders
    assert choice.fidelity.orders is not None
    assert choice.fidelity.orders <= 8


def test_balanced_objective_of_zero() -> None:
    engine = replace(tractor.engine((0, 120, 240, 240, 120, 0)), mounts=())

    force = Term(Measure(channels.SHAKING_FORCE, NORMS["mean"], orders=(1.0, 2.0)))
    choice = choose(tractor.problem(engine, [], objective=(force,)), 1e-3)
    assert choice.error_estimate < 1e-9


class Swinging(SliderCrank):
    """Something more turns to and fro than the rod that is a number."""

    def motion(self, lib: Any, alpha: Any) -> Motion:
        plain = super().motion(lib, alpha)
        return Motion(plain.points, (*plain.swings, (0.02, (0.3 * lib.cos(alpha), -0.3 * lib.sin(alpha)))))


def test_rods_of_any_mechanism_count() -> None:
    """Find the inertia of rods by their motion, for every mechanism."""
    # no even star, which would cancel the swing
    engine = tractor.engine((0, 90, 200))
    own = [{field.name: getattr(part, field.name) for field in fields(part)} for part in engine.slider_cranks]
    swinging = replace(engine, slider_cranks=tuple(Swinging(**numbers) for numbers in own))
    for one, is_there in ((engine, False), (swinging, True)):
        choice = choose(tractor.problem(one, []), 1e-6)
        assert ("inertia of the rods beyond that of two masses" in choice.description) is is_there


AUTOMATIC = 25


@pytest.mark.parametrize("seed", first_fast(range(AUTOMATIC), 6, 8))
def test_automatic_choice_keeps_its_word(seed: int) -> None:
    problem = random_problem(random.Random(5000 + seed))
    choice = choose(problem, 1e-2)
    variant = replace(problem, fidelity=choice.fidelity)
    value = objective_value(variant, evaluate(variant))
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


@pytest.mark.parametrize("seed", first_fast(range(40), 6, 7))
def test_automatic_fidelity_sees_the_bends(seed: int) -> None:
    """Compare the estimate with the error of a peak, for every choice."""
    problem = problem_of_peak(seed)
    problem = replace(problem, objective=(Term(replace(problem.objective[0].measure, norm=NORMS["maximum"])),))
    choice = choose(problem, 1e-2)
    value = objective_value(problem, evaluate(replace(problem, fidelity=choice.fidelity)))
    assert abs(value - truth_of_peak(problem, QUICK if seed < FAST else ANGLES)) <= choice.error_estimate * value
