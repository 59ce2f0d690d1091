"""Open cranks of built engines: each star by itself, and as good as each given."""

from __future__ import annotations

import pytest

import laufruhe
from laufruhe.extensions.robust.result import RobustResult
from laufruhe.solvers.result import Result
from problem_files import changed

FOUR = """
title = "Four in line"
[engine]
layout = "inline"
cycle = "four-stroke"
stroke = "80 mm"
rod_ratio = 0.28
reciprocating_mass = "0.5 kg"
rotating_mass = "0.3 kg"
cylinder_spacing = "100 mm"
cylinders = 4
throws = "open"
[[operating_points]]
name = "rated"
speed = "3000 rpm"
[mounts]
positions = [["100 mm", "200 mm", "0 mm"], ["100 mm", "-200 mm", "0 mm"], ["-450 mm", "200 mm", "0 mm"],
             ["-450 mm", "-200 mm", "0 mm"]]
[[counterweights]]
name = "web"
opposite_throw = 1
mass = { between = ["0 kg", "1 kg"] }
angle = { between = [0, 360] }
radius = "60 mm"
[objective]
minimise = "mean mount force"
"""
CRANKS = ("[0, 180, 180, 0]", "[0, 180, 0, 180]", "[0, 0, 180, 180]")


def _each(text: str) -> list[Result]:
    return [laufruhe.solve(changed(text, 'throws = "open"', f"throws = {crank}")) for crank in CRANKS]


@pytest.mark.slow
def test_the_worst_case_of_every_crank_is_that_of_the_best() -> None:
    """Tolerances of the crank pins stand where the throws of each star are, not at those of the first."""
    text = changed(FOUR, '"0.5 kg"', '"0.5 kg ± 5 %"')
    text = changed(text, '"0.3 kg"', '"0.3 kg ± 3 %"') + "[robust]\nengines = 200\n[fidelity]\nsamples = 180\n"
    found, each = laufruhe.solve(text), _each(text)
    best = min(each, key=lambda one: one.objective.value)
    assert found.objective.value == pytest.approx(best.objective.value, rel=2e-4)
    assert found.certificate.lower_bound <= min(one.objective.value for one in each)
    assert isinstance(found.details, RobustResult)
