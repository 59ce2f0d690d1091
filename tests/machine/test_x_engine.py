"""Four banks on one throw, and loads that are known of them in closed form."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import InputError
from laufruhe.problem.evaluation import evaluate, objective_value
from problem_files import PROBLEMS, loaded
from studies.parts import part_of

X_FOUR = """
title = "X engine of four cylinders on one throw"
[engine]
layout = "x-engine"
cycle = "four-stroke"
cylinders = 4
throws = [0]
fires_together = true
stroke = "90 mm"
rod_length = "150 mm"
cylinder_spacing = "120 mm"
reciprocating_mass = "0.8 kg"
rotating_mass = "0.6 kg"
[[operating_points]]
speed = "3000 rpm"
gas = false
[[counterweights]]
name = "web"
x = "0 mm"
angle = 180
unbalance = { between = ["0 kg m", "0.3 kg m"] }
[mounts]
positions = [["300 mm", "200 mm", "0 mm"], ["300 mm", "-200 mm", "0 mm"], ["-300 mm", "0 mm", "0 mm"]]
[objective]
minimise = "rmq resultant mount force"
"""
UNBALANCE = (2.0 * 0.8 + 0.6) * 0.045
"""Unbalance of half the reciprocating mass of four pistons and the rotating mass of the throw [kg m]."""
SHAKING = UNBALANCE * (3000.0 * math.pi / 30.0) ** 2
"""Rotating force, constant over the cycle [N]."""


def test_one_weight_balances_an_x(tmp_path: Path) -> None:
    result = laufruhe.solve(loaded(tmp_path, X_FOUR))
    assert result.objective.initial == pytest.approx(SHAKING, rel=1e-9)
    assert result.objective.value < 1e-6 * SHAKING
    (weight,) = result.decisions
    assert weight.value == pytest.approx(UNBALANCE, rel=1e-9)
    assert result.certificate.kind.value == "global"


def test_an_x_of_six_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cylinders"):
        loaded(tmp_path, X_FOUR.replace("cylinders = 4", "cylinders = 6"))


@pytest.mark.parametrize("norm", ["mean", "maximum", "rms", "rmq"])
def test_mounts_on_rigid_ground_carry_the_shaking_force(norm: str, tmp_path: Path) -> None:
    """Check that the resultant of any mounts is the shaking force (Newton's second law)."""
    text = (PROBLEMS / "tractor-two.toml").read_text(encoding="utf-8")
    loads = (f"{norm} resultant mount force", f"{norm} shaking force")
    problems = [loaded(tmp_path, text.replace("mean mount force", load)) for load in loads]
    assert [problem.objective[0].measure.name for problem in problems] == list(loads)
    values = [objective_value(problem, evaluate(problem)) for problem in problems]
    assert values[0] == pytest.approx(values[1], rel=1e-12)
    assert values[0] > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["vee-eight-open", "inline-five-open"])
def test_a_root_mean_quad_of_few_samples_proves_no_false_bound(name: str, tmp_path: Path) -> None:
    """Samples can overestimate a mean of fourth powers: no bound may lie over the design at fine sampling."""
    text = (PROBLEMS / f"{name}.toml").read_text(encoding="utf-8")
    text = re.sub(r'"(mean|maximum|rms) (?=[a-z])', '"rmq ', text)
    result = laufruhe.solve(loaded(tmp_path, text + "\n[fidelity]\nsamples = 48\n"))
    value = 0.0
    for term in result.problem.objective:
        rows = result.final.rows(term.measure, 5760)
        value += term.weight * term.measure.norm.value(rows.grid, rows.vectors)
    assert result.certificate.lower_bound <= value * (1.0 + 1e-9)


def test_a_percentile_of_a_sine(tmp_path: Path) -> None:
    """A sine is under sin(0.95 pi / 2) of its amplitude for 95 % of the cycle."""
    (tmp_path / "x.toml").write_text(X_FOUR.replace("rmq resultant mount", "rms surging"), encoding="utf-8")
    text = """
title = "Percentiles"
[study]
[[study.parts]]
kind = "percentile"
name = "percentiles"
title = "Load that 95 % of the cycle keeps below"
[[study.parts.cases]]
name = "as given"
problem = "x.toml"
"""
    data = part_of(tmp_path, text)
    expected = SHAKING * math.sin(0.95 * math.pi / 2.0)
    assert float(np.asarray(data["percentile"])[0]) == pytest.approx(expected, rel=1e-4)
