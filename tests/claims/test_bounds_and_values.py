"""What bounds and values that were read at different angles, or at boxes of no width, say of each other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from laufruhe.problem.evaluation import at_many, evaluate, objective_value
from laufruhe.prove.certificate import Proof
from laufruhe.prove.springs.search import SpringBoxes

INPUTS = Path(__file__).parent / "inputs"
TRUE_MEAN = 46.10256
"""Of the best places, at 115,200 angles [N m]."""
LEAST_STIFF, STIFFEST = 24.108448, 35.101221
"""Forces with the least and the largest stiffness [N]."""


def test_a_mean_is_read_at_the_angles_of_its_bound() -> None:
    """The bound of the whole cycle lies over the mean at 360 angles: the value is read at more, and is over it."""
    found = laufruhe.solve(INPUTS / "places-case.toml")
    assert found.objective is not None
    assert found.certificate is not None
    value, bound = found.objective.value, found.certificate.lower_bound
    many = objective_value(found.problem, replace(found.final, samples=115_200))
    assert many == pytest.approx(TRUE_MEAN, abs=1e-5)
    assert bound < value
    assert value == pytest.approx(many, rel=1e-6)
    assert bound <= many
    assert 0.0 < found.certificate.gap < 1e-5
    assert found.certificate.kind is Proof.GLOBAL


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
    boxes = SpringBoxes(at_many(problem), value * (1.0 + 1e-9), 0.0, [stiffness])
    assert len(boxes.modes) == (limit != "static sag")
    lower, upper = boxes.lower.copy(), boxes.upper.copy()
    lower[0], upper[0] = np.clip([stiffness * (1.0 - width), stiffness * (1.0 + width)], lower[0], upper[0])
    for bound, share in ((boxes.relaxed(lower, upper)[0], 5e-3), (boxes.look(lower, upper)[0], 5e-3)):
        assert force * (1.0 - share) <= bound <= value * (1.0 + 1e-9)
