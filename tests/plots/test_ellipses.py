"""Mass ellipses of a single cylinder (L9), and loads that have none."""

from __future__ import annotations

import numpy as np
import pytest

from laufruhe.files.reader import load
from laufruhe.plots import figure, names
from laufruhe.solvers import evaluate_only
from problem_files import PROBLEMS

OPEN = "balance_factor = { between = [0, 1] }"


@pytest.mark.parametrize("factor", [0.0, 0.3, 0.6, 1.0])
def test_half_axes_are_what_the_weight_leaves_and_adds(factor: float) -> None:
    text = (PROBLEMS / "tractor-single.toml").read_text(encoding="utf-8")
    assert OPEN in text
    result = evaluate_only(load(text.replace(OPEN, f"balance_factor = {factor}")))
    part = result.final.engine.slider_cranks[0]
    force = part.reciprocating_mass * part.crank_radius * result.problem.points[0].speed ** 2
    if factor in (0.0, 1.0):
        # a line along the cylinder or across it, which the forces on the mounts show
        assert "ellipses" not in names(result)
        return
    first = figure(result, "ellipses").axes[0]
    across, up = np.asarray(first.lines[0].get_data())
    assert (across.max(), up.max()) == pytest.approx((factor * force, (1.0 - factor) * force), abs=2e-3 * force)


def test_the_picture_names_the_objective() -> None:
    result = evaluate_only(load(PROBLEMS / "vee-six-90.toml"))
    words = " ".join(text.get_text() for text in figure(result, "ellipses").texts)
    assert "Objective: mean mount force" in " ".join(words.split())
