"""Where a smooth program starts its modes: each in the column of the motion that is most its own."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from laufruhe.files.reader import load
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.problem import Problem
from laufruhe.solvers.smooth.gathered import Gathered
from laufruhe.solvers.smooth.modes import ModeVariables
from problem_files import PROBLEMS


@pytest.fixture(scope="module")
def problem() -> Problem:
    return load(PROBLEMS / "powertrain-decoupling.toml")


@pytest.mark.parametrize("seed", range(5))
def test_motions_and_modes_are_paired_as_an_assignment_pairs_them(problem: Problem, seed: int) -> None:
    """Of six by six, also where a mode has most of the energy of two motions."""
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    x = low + (high - low) * np.random.default_rng(seed).random(len(low))
    mounting = mounting_in(problem.design(x.tolist(), problem.mount_decisions))
    modes = ModeVariables(problem, Gathered())
    modes.hold(np.eye(6), np.eye(6), mounting)
    _, squares = modes.start(mounting)
    _, columns = linear_sum_assignment(-mounting.modes.energy)
    assert squares * modes._unit == pytest.approx(mounting.modes.squares[columns], rel=1e-12)
