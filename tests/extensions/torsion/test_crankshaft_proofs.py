"""Open numbers of a crankshaft: boxes exclude designs by limits of heat, and are halved by the strongest orders."""

from pathlib import Path

import numpy as np
import pytest

import laufruhe
from claims.test_broken_bounders import first_times, scaled
from laufruhe.errors import BoundError
from laufruhe.extensions.torsion.boxes import TwistBoxes
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.branch_and_bound import bisect_box
from laufruhe.prove.certificate import Proof
from problem_files import PROBLEMS

INPUTS = Path(__file__).parent / "inputs"


@pytest.fixture(scope="module")
def heated() -> Problem:
    return laufruhe.load(INPUTS / "absorber-under-a-limit-of-heat.toml")


@pytest.mark.slow
def test_boxes_whose_absorber_gives_off_too_much_hold_no_design(heated: Problem) -> None:
    boxes, (limit,) = TwistBoxes(heated, evaluate(heated)), heated.limits
    edges = np.linspace(boxes.coordinates.lower[0], boxes.coordinates.upper[0], 33)
    bounds = boxes.bounds(edges[:-1, None], edges[1:, None])[0]
    found = [evaluate(heated, heated.design([float(x)])) for x in edges]
    heat = np.array([each.value(limit.measure) for each in found])
    values = np.array([objective_value(heated, each) for each in found])
    minimum = np.minimum(values[:-1], values[1:])
    # heat and twist go one way each, so that the ends of a box tell its least
    assert np.all(np.diff(heat) > 0.0)
    feasible = heat[:-1] <= limit.maximum
    assert np.all(bounds[feasible] <= minimum[feasible] * (1.0 + 1e-9))
    assert np.all(np.isinf(bounds[heat[:-1] > 1.05 * limit.maximum]))


@pytest.mark.slow
def test_one_absorber_under_a_limit_of_heat_is_proven(heated: Problem) -> None:
    result, (decision,) = laufruhe.solve(heated), heated.decisions
    designs = [evaluate(heated, heated.design([float(x)])) for x in np.linspace(decision.lower, decision.upper, 100)]
    minimum = min(objective_value(heated, each) for each in designs if each.violation(heated.limits) <= 0.0)
    assert result.certificate is not None
    assert result.objective is not None
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.lower_bound <= result.objective.value <= minimum * (1.0 + 1e-6)


@pytest.mark.slow
def test_orders_that_answer_most_choose_the_sides_of_three_numbers() -> None:
    problem = laufruhe.load(INPUTS / "pulley-shaft-and-pendulum.toml")
    boxes, generator = TwistBoxes(problem, evaluate(problem)), np.random.default_rng(83)
    low, high = boxes.coordinates.lower, boxes.coordinates.upper
    draws = [low + (high - low) * generator.random(3) for _ in range(200)]
    minimum = min(objective_value(problem, evaluate(problem, problem.design(list(map(float, x))))) for x in draws)
    bound = bisect_box(boxes, low, high, minimum, problem.tolerance * minimum, 600).bound
    # by the gain of any order the same boxes left four fifths
    assert 0.7 * minimum <= bound <= minimum


@pytest.mark.slow
def test_a_broken_bounder_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    scaled(TwistBoxes, "_bound", first_times(1.01))(monkeypatch)
    with pytest.raises(BoundError, match="contradicts a known design"):
        laufruhe.solve(PROBLEMS / "inline-five-damper.toml")
