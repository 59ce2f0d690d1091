"""Bounds of boxes of stiffness over the least design that is seen in each."""

from __future__ import annotations

import numpy as np

from laufruhe.problem.evaluation import evaluate, objective_value, with_mounts
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.subdivision import StiffnessBoxes
from prove.test_subdivision import boxes


def designs(problem: Problem, low, high, seed: int) -> list[float]:
    generator, evaluation = np.random.default_rng(seed), evaluate(problem)
    shares = generator.random((6, len(low)))
    return [
        objective_value(problem, with_mounts(evaluation, problem.design((low + s * (high - low)).tolist())))
        for s in shares
    ]


def bounds_over_designs(problem: Problem) -> list[float]:
    """Return the bound over the least of some designs for each of twelve random boxes."""
    search = StiffnessBoxes(problem, 1e-4 * objective_value(problem, evaluate(problem)))
    low, high = boxes(problem, 12, 5)
    bounds, _ = search.bounds(low, high)
    return [bound / min(designs(problem, *ends, 1)) for *ends, bound in zip(low, high, bounds, strict=True)]
