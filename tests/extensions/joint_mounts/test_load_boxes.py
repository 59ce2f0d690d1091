"""Boxes of mounts and unbalances: no design is under the bound of its box, and small boxes come near (E71)."""

from __future__ import annotations

import itertools
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from attack.families import problem as random_problem
from attack.own_problem import OwnModel
from lanes import first_fast
from laufruhe.extensions.joint_mounts.load_boxes import LoadBoxes, is_boxed, load_bounds
from laufruhe.extensions.joint_mounts.mounted_loads import MountedLoads
from laufruhe.extensions.joint_mounts.prover import EARLY
from laufruhe.problem.evaluation import evaluate, objective_value, with_default_sampling
from laufruhe.problem.problem import Problem
from mounts.files import BLOCK, ENGINE, MOUNTS, problem_of

INPUTS = Path(__file__).parents[2] / "claims" / "inputs"
# rms, mean and largest force and travel on stiff, moved and turned mounts, under limits of loads and modes
SEEDS = (780003, 780004, 780005, 780000, 780014, 780017, 780012, 780002, 780031, 780032, 780033, 780034)


def columns(problem: Problem, x: np.ndarray, numbers: int) -> list[complex]:
    """Return the values of all decisions, those of unbalances from their columns."""
    mounts, unbalances, values = iter(x[:numbers]), iter(x[numbers:]), []
    for decision in problem.decisions:
        if not decision.is_affine:
            values.append(float(next(mounts)))
        elif decision.set.width == 2:
            values.append(complex(next(unbalances), next(unbalances)))
        else:
            values.append(float(next(unbalances)) * decision.set.directions[0])
    return values


def is_inside(problem: Problem, values: list[complex]) -> bool:
    pairs = zip(problem.decisions, values, strict=True)
    return all(abs(value) <= d.upper for d, value in pairs if d.set.width == 2)


@pytest.mark.parametrize("seed", first_fast(SEEDS, 3, 6))
def test_no_design_of_a_box_is_under_its_bound_and_small_boxes_come_near(seed: int) -> None:
    problem = with_default_sampling(laufruhe.load(random_problem("joint", seed)[0]))
    if not is_boxed(problem):
        pytest.skip("more is open than boxes take")
    boxes, generator = LoadBoxes(problem, 1e-9), np.random.default_rng(seed)
    low, high, numbers = boxes.lower, boxes.upper, len(problem.mount_decisions)
    near = []
    for widest in (1.0, 0.3, 0.1, 0.02, 1e-4):
        middle, half = generator.uniform(low, high), 0.5 * (high - low) * widest * generator.random(len(low))
        lower, upper = np.maximum(middle - half, low), np.minimum(middle + half, high)
        bound = float(boxes.bounds(lower[None], upper[None])[0][0])
        for share in generator.random((6, len(low))):
            values = columns(problem, lower + share * (upper - lower), numbers)
            evaluation = evaluate(problem, problem.design(values))
            if is_inside(problem, values) and evaluation.violation(problem.limits) <= 0.0:
                assert bound <= objective_value(problem, evaluation) * (1.0 + 1e-9)
            if widest == 1e-4 and bound < np.inf:
                near.append(bound / objective_value(problem, evaluation))
    assert not near or max(near) > 0.98


ONE_NUMBER = ["one-damper-over-41-speeds", "one-stiffness-under-transmissibility"]


@pytest.mark.parametrize("name", first_fast(ONE_NUMBER, 0, 1))
def test_one_open_number_is_bounded_by_few_boxes(name: str) -> None:
    path = INPUTS / f"{name}.toml"
    problem, text = laufruhe.load(path), OwnModel(tomllib.loads(path.read_text(encoding="utf-8")), 256)
    ((low, high),) = text.box
    designs = text.designs(np.linspace(low, high, 61)[:, None])
    objective = np.where(designs.excesses.max(axis=1) <= 0.0, designs.objective, np.inf)
    minimum = float(objective.min())
    (found,) = load_bounds(problem, minimum, 1e-3 * minimum, (1.0,))
    assert found.boxes <= 60
    assert minimum * (1.0 - 1e-3) <= found.bound <= minimum * (1.0 + 1e-6)
    # a better value than any is not shown
    (found,) = load_bounds(problem, 1.2 * minimum, 1e-3 * minimum, (1.0,))
    assert found.bound <= minimum * (1.0 + 1e-6)


@pytest.mark.slow
def test_a_transmissibility_limit_takes_the_boxes_where_it_is_broken() -> None:
    path = INPUTS / "one-stiffness-under-transmissibility.toml"
    problem, text = laufruhe.load(path), OwnModel(tomllib.loads(path.read_text(encoding="utf-8")), 256)
    (limit,) = problem.limits
    ((low, high),) = text.box
    x = np.linspace(low, high, 201)
    ratio = text.designs(x[:, None]).measure({"quantity": "transmissibility", "orders": [2]})
    boxes = LoadBoxes(
        problem.changed(limits=(limit.__class__(limit.name, limit.measure, float(np.median(ratio))),)), 0.0
    )
    edges = np.linspace(low, high, 21)
    bounds = boxes.bounds(edges[:-1, None], edges[1:, None])[0]
    broken = [ratio[(x >= a) & (x <= b)].min() > np.median(ratio) for a, b in itertools.pairwise(edges)]
    assert not np.any(np.isinf(bounds) & ~np.array(broken))
    assert np.isinf(bounds).sum() >= 5


@pytest.mark.slow
def test_a_share_of_the_boxes_is_divided_first() -> None:
    path = INPUTS / "one-stiffness-under-transmissibility.toml"
    problem = laufruhe.load(path)
    problem = replace(problem, search=replace(problem.search, boxes=40))
    text = OwnModel(tomllib.loads(path.read_text(encoding="utf-8")), 256)
    ((low, high),) = text.box
    designs = text.designs(np.linspace(low, high, 61)[:, None])
    minimum = float(np.where(designs.excesses.max(axis=1) <= 0.0, designs.objective, np.inf).min())
    few, many = load_bounds(problem, minimum, 1e-4 * minimum, (EARLY, 1.0))
    assert few.boxes <= 10
    assert few.bound < minimum * (1.0 - 1e-4)
    assert many.boxes > few.boxes
    assert many.bound > few.bound


def test_a_ratio_beside_a_force_keeps_all_orders(tmp_path: Path) -> None:
    """Check that transmissibility keeps orders that a limited force drops."""
    limit = '[[constraints]]\nlimit = "rms mount force"\nmax = "1e9 N"\n'
    left_out = []
    for minimised in ("transmissibility", "rms mount force"):
        objective = f'[objective]\nminimise = "{minimised}"\n'
        problem = with_default_sampling(problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, objective, limit))
        boxes = LoadBoxes(problem, 1e9)
        left_out.append(len(MountedLoads(problem).orders.orders) - len(boxes._orders.orders))
        near = np.array([d.start for d in problem.mount_decisions])
        bound = float(boxes.bounds(near[None] * (1.0 - 1e-4), near[None] * (1.0 + 1e-4))[0][0])
        assert bound <= objective_value(problem, evaluate(problem)) * (1.0 + 1e-9)
    assert left_out[0] == 0 < left_out[1]
