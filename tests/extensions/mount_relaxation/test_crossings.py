"""Bounds by spring forces of mounts with stars, with sizes, and with further terms of an objective."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from laufruhe.numerics.norms import NORMS
from laufruhe.problem import channels
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Measure, Term
from laufruhe.solvers.mounts.nonlinear import mounts_bound
from mounts.files import problem_of
from mounts.test_mount_nonlinear import joint_problem
from mounts.test_mount_stars import parts


@pytest.mark.slow
def test_stars_have_a_bound(tmp_path: Path) -> None:
    """Check the bound of open stars; tests of the core compare the values with exact models."""
    result = laufruhe.solve(problem_of(tmp_path, *parts()))
    assert result.certificate is not None
    assert result.objective is not None
    assert 0.0 < result.certificate.lower_bound <= result.objective.value


@pytest.mark.slow
def test_forces_beside_other_terms_are_bounded_by_themselves(tmp_path: Path) -> None:
    """Check that the bound of a sum of mount force, block force and stiffness is at least the sum of the bounds."""
    problem = joint_problem(tmp_path, "rms")
    shaken = Measure(channels.SHAKING_FORCE, NORMS["rms"])
    terms = (*problem.objective, Term(shaken, 0.1), Term(Measure(channels.TOTAL_STIFFNESS), 1e-5))
    search = replace(problem.search, boxes=4)
    alone = replace(problem, decisions=problem.mount_decisions, limits=(), search=search)
    mixed = replace(alone, objective=terms)
    near = [d.lower if d.is_stiffness else d.start for d in mixed.decisions]
    bound = mounts_bound(mixed, near)
    assert bound > mounts_bound(mixed) + 0.5 * objective_value(alone, evaluate(alone, alone.design(near)))
    generator = np.random.default_rng(5)
    for _ in range(40):
        values = [d.lower + generator.random() * (d.upper - d.lower) for d in mixed.decisions]
        assert objective_value(mixed, evaluate(mixed, mixed.design(values))) >= bound
