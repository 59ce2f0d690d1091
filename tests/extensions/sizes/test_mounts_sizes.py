"""Sizes of the running gear beside elastic mounts: a design that neither alone beats, and a bound that holds."""

from __future__ import annotations

import numpy as np
import pytest

import laufruhe
from extensions.sizes.test_sizes_weights import FEWER
from laufruhe.extensions.sizes.model import SizeModel
from laufruhe.extensions.sizes.mounted import with_masses
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.conclusion import evaluate_design
from laufruhe.solvers.result import Result
from problem_files import changed

SOFT = '{ between = ["100 N/mm", "800 N/mm"], start = "300 N/mm" }'
MOUNTED = changed(
    changed(FEWER, "mean shaking force", "mean mount force"),
    "[objective]",
    f"""
[[counterweights]]
name = "w"
opposite_throw = 1
unbalance = {{ between = ["0 kg m", "0.02 kg m"] }}
[block]
mass = "60 kg"
inertia = ["1.2 kg m^2", "1.5 kg m^2", "1.4 kg m^2"]
centre_of_gravity = ["0 mm", "0 mm", "60 mm"]
[mounts]
kind = "elastic"
[[mounts.places]]
name = "left"
position = ["0 mm", "150 mm", "0 mm"]
stiffness = ["300 N/mm", {SOFT}, {SOFT}]
loss_factor = 0.1
[[mounts.places]]
name = "right"
position = ["0 mm", "-150 mm", "0 mm"]
stiffness = ["300 N/mm", "300 N/mm", "300 N/mm"]
loss_factor = 0.1
[[mounts.places]]
name = "third"
position = ["200 mm", "0 mm", "0 mm"]
stiffness = ["300 N/mm", "300 N/mm", "300 N/mm"]
loss_factor = 0.1
[objective]""",
)
MOUNTED = changed(MOUNTED, "[fidelity]", '[[constraints]]\nlimit = "static sag"\nmax = "1.2 mm"\n[fidelity]')
# a bound of a local optimum need not be the best that boxes give
FEW_BOXES = changed(MOUNTED, "[fidelity]", "[search]\nboxes = 4\n[fidelity]")


@pytest.fixture(scope="module")
def problem() -> Problem:
    return laufruhe.load(FEW_BOXES)


@pytest.fixture(scope="module")
def solved(problem: Problem) -> Result:
    return laufruhe.solve(problem)


def random_design(problem: Problem, rng: np.random.Generator) -> list[float]:
    return [d.lower + rng.random() * (d.upper - d.lower) for d in problem.decisions]


def placed(problem: Problem, values: list[float]) -> list[complex]:
    """A weight along its own direction, the rest as it is."""
    pairs = zip(problem.decisions, values, strict=True)
    return [value * d.set.directions[0] if d.is_affine else value for d, value in pairs]


@pytest.mark.slow
def test_a_local_optimum_keeps_its_limits_and_no_random_design_is_better(solved: Result, problem: Problem) -> None:
    assert solved.certificate.kind is Proof.LOCAL
    assert solved.final.violation(problem.limits) <= 1e-5
    rng = np.random.default_rng(1)
    for _ in range(60):
        evaluation = evaluate(problem, problem.design(placed(problem, random_design(problem, rng))))
        if evaluation.violation(problem.limits) <= 0.0:
            assert objective_value(problem, evaluation) >= solved.objective.value * (1.0 - 1e-6)
        # the bound knows nothing of stresses
        assert objective_value(problem, evaluation) >= solved.certificate.lower_bound


@pytest.mark.slow
def test_masses_in_place_of_sizes_make_the_same_loads(problem: Problem) -> None:
    """What the bound is of has every design in it, worth what the exact model says."""
    held = problem.changed(decisions=tuple(d for d in problem.decisions if d not in problem.mount_decisions))
    rng = np.random.default_rng(2)
    for _ in range(5):
        values = placed(problem, random_design(problem, rng))
        relaxed, near = with_masses(problem, SizeModel(held), values)
        for decision, value in zip(relaxed.decisions, near, strict=True):
            assert decision.lower - 1e-12 <= abs(value) or decision.lower < 0.0
            assert abs(value) <= decision.set.scale * (1.0 + 1e-12)
        assert evaluate_design(relaxed, near).value == pytest.approx(evaluate_design(problem, values).value, rel=1e-9)


@pytest.mark.slow
def test_mounts_beside_sizes_are_never_worse_than_mounts_as_given(solved: Result) -> None:
    text = changed(MOUNTED, f'["300 N/mm", {SOFT}, {SOFT}]', '["300 N/mm", "300 N/mm", "300 N/mm"]')
    given = laufruhe.solve(laufruhe.load(text).changed(tolerance=5e-3))
    assert given.certificate.kind is Proof.GLOBAL
    assert solved.objective.value <= given.objective.value
    assert solved.certificate.lower_bound <= given.objective.value
