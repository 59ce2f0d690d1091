"""Branching scores of the relaxation of spring forces, and a half of the motions without open springs (E57, E62)."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from laufruhe.extensions.mount_relaxation.box import WORTH, joint_scores
from laufruhe.files.reader import load
from laufruhe.problem.evaluation import evaluate, objective_value, with_mounts
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve


@pytest.mark.parametrize("lacking", [0.0, -1e-9, 5e-324, 1e-310])
@pytest.mark.parametrize("size", [5e-324, 1e-305, 1.0, 1e9, 1e300])
def test_scores_are_finite_without_a_lack(lacking: float, size: float) -> None:
    """Check zero and the least floats: no share overflows or is lost."""
    hidden = size * np.array([0.0, 0.5, 1.0])
    for pull in (np.zeros(3), np.array([5e-324, 0.0, 0.0])):
        result = joint_scores(pull, hidden, lacking)
        assert np.isfinite(result).all()
        assert result[2] == result.max() > 0.0


def test_hidden_scores_are_weighted_by_the_lack() -> None:
    pull, hidden = np.array([4.0, 1.0]), np.array([0.0, 3.0])
    assert joint_scores(pull, hidden, 6.0) == pytest.approx([1.0, 3.0 / (6.0 * WORTH)])


SIDEWAYS = """
title = "Mirrored mounts, of which what gives way sideways is open"
[engine]
layout = "inline"
cycle = "four-stroke"
stroke = "90 mm"
rod_ratio = 0.28
reciprocating_mass = "0.8 kg"
throws = [0]
[[operating_points]]
speed = "1500 rpm"
[block]
mass = "180 kg"
centre_of_gravity = ["-60 mm", "0 mm", "25 mm"]
inertia = ["8 kg m^2", "12 kg m^2", "13 kg m^2"]
[mounts]
kind = "elastic"
loss_factor = 0.1
[[mounts.places]]
name = "front"
position = ["320 mm", "200 mm", "0 mm"]
stiffness = ["190 kN/m", { between = ["47 kN/m", "940 kN/m"], start = "180 kN/m" }, "99 kN/m"]
[[mounts.places]]
name = "front other"
mirror_of = "front"
[[mounts.places]]
name = "rear"
position = ["-350 mm", "160 mm", "-25 mm"]
stiffness = ["125 kN/m", "330 kN/m", "225 kN/m"]
[[mounts.places]]
name = "rear other"
mirror_of = "rear"
[objective]
minimise = "rms mount force"
orders = [2]
[[constraints]]
limit = "natural frequencies"
min = "1.5 Hz"
"""


def test_one_half_of_the_motions_may_have_no_open_springs() -> None:
    """Check a half of upright motions with given stiffness alone."""
    problem = load(tomllib.loads(SIDEWAYS))
    result, initial = solve(problem), evaluate(problem)
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    others = [with_mounts(initial, problem.design([x])) for x in np.geomspace(47e3, 940e3, 30)]
    minimum = min(objective_value(problem, each) for each in others if each.violation(problem.limits) <= 0.0)
    assert result.certificate.lower_bound <= minimum
    assert result.objective is not None
    assert result.objective.value <= minimum * (1.0 + 1e-6)
