"""Claims of the bounds by spring forces: boxes of any width, no bound above a known design."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import clarabel
import numpy as np
import pytest
from scipy.sparse import csc_array

import laufruhe
from claims.test_broken_bounders import INPUTS, first_times, scaled
from claims.test_unnamed import RESULTANT
from laufruhe.errors import BoundError
from laufruhe.extensions.mount_relaxation.cone_program import new_solver
from laufruhe.extensions.mount_relaxation.prover import applies, spring_bound
from laufruhe.extensions.mount_relaxation.search import SdpRelaxation
from laufruhe.numerics.budget import is_time_over, limit_time, minimum_time, seconds_left
from laufruhe.problem.evaluation import evaluate, objective_value, with_default_sampling
from laufruhe.prove.mounts.provers import Question
from problem_files import PROBLEMS

LEAST_STIFF, STIFFEST = 24.108448, 35.101221
"""Forces with the least and the largest stiffness [N]."""


@pytest.mark.parametrize("limit", ["static sag", "kinetic-energy decoupling"], ids=["sag", "modes"])
@pytest.mark.parametrize(("stiffness", "force"), [(250e3, LEAST_STIFF), (350e3, STIFFEST)])
@pytest.mark.parametrize("width", [0.0, 1e-9, 1e-6, 1e-3])
def test_spring_forces_bound_boxes_of_any_width(
    tmp_path: Path, limit: str, stiffness: float, force: float, width: float
) -> None:
    text = (INPUTS / "zero-width.toml").read_text(encoding="utf-8")
    if limit != "static sag":
        text = text.replace('"static sag"\nmax = "5 mm"', f'"{limit}"\nmotions = ["yaw"]\nmin = "0.5"')
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    problem = laufruhe.load(tmp_path / "scene.toml")
    value = objective_value(problem, evaluate(problem, problem.design([stiffness])))
    assert value == pytest.approx(force, rel=1e-7)
    boxes = SdpRelaxation(with_default_sampling(problem), value * (1.0 + 1e-9), 0.0, [stiffness])
    assert len(boxes.modes) == (limit != "static sag")
    lower, upper = boxes.lower.copy(), boxes.upper.copy()
    lower[0], upper[0] = np.clip([stiffness * (1.0 - width), stiffness * (1.0 + width)], lower[0], upper[0])
    assert force * (1.0 - 5e-3) <= boxes.bound(lower, upper)[0] <= value * (1.0 + 1e-9)


@pytest.mark.slow
def test_a_broken_bounder_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    scaled(SdpRelaxation, "bound", first_times(1.01))(monkeypatch)
    with pytest.raises(BoundError, match="contradicts a known design"):
        laufruhe.solve(PROBLEMS / "powertrain-joined-springs.toml")


@pytest.mark.slow
def test_no_bound_counts_what_it_does_not_name() -> None:
    problem = laufruhe.load(PROBLEMS / "powertrain-joined-springs.toml")
    assert applies(problem)
    (term,) = problem.objective
    unknown = problem.changed(objective=(replace(term, measure=replace(term.measure, channel=RESULTANT)),))
    assert not applies(unknown)
    assert spring_bound(Question(unknown, 50.0, 0.01, problem.start)).bound == 0.0


def test_a_relaxation_stops_when_time_is_over_unless_it_is_given_more() -> None:
    cones, settings = [clarabel.NonnegativeConeT(3)], {"verbose": False}
    solver = new_solver(np.ones(3), csc_array(-np.eye(3)), -np.arange(3.0), cones, settings)
    with limit_time(1e-9):
        assert solver.solve().iterations <= 1
        with minimum_time(60.0):
            assert seconds_left() > 50.0
            assert solver.solve().x == pytest.approx([0.0, 1.0, 2.0], abs=1e-6)
        assert is_time_over()
