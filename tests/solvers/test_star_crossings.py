"""Open cranks and shafts beside what no method of stars knows: each star by itself, and as good as each given."""

from __future__ import annotations

import pytest

import laufruhe
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.result import Result
from problem_files import PROBLEMS, changed
from ready import solved

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
def test_a_stroke_beside_an_open_crank_is_searched_for_each() -> None:
    text = changed(FOUR, 'stroke = "80 mm"', 'stroke = { between = ["70 mm", "90 mm"] }')
    found = laufruhe.solve(text)
    assert found.certificate.kind is Proof.LOCAL
    assert found.objective.value == pytest.approx(min(one.objective.value for one in _each(text)), rel=1e-6)


@pytest.mark.slow
def test_optional_shafts_with_open_places_are_decided_set_by_set() -> None:
    text = (PROBLEMS / "tractor-four-shaft-heights.toml").read_text(encoding="utf-8")
    for name in ("left", "right"):
        text = changed(text, f'name = "{name}"', f'name = "{name}"\noptional = true')
    found = laufruhe.solve(text)
    built = solved("tractor-four-shaft-heights")
    assert found.objective.value == pytest.approx(built.objective.value, rel=2e-4)
    limited = laufruhe.solve(text + "\n[phasing]\nmost_shafts = 1\n")
    assert limited.objective.value > found.objective.value


@pytest.mark.slow
def test_throws_that_leave_the_even_steps_move_with_a_stroke() -> None:
    """A short stroke is best, and at it the crank is that of the method of uneven throws, which proves it."""
    text = changed(changed(FOUR, "cylinders = 4", "cylinders = 3"), 'rotating_mass = "0.3 kg"\n', "")
    text += '[phasing]\nintervals = { largest_deviation = "40 deg" }\n'
    found = laufruhe.solve(changed(text, '"80 mm"', '{ between = ["70 mm", "90 mm"], start = "80 mm" }'))
    given = laufruhe.solve(changed(text, '"80 mm"', '"70 mm"'))
    assert found.certificate.kind is Proof.LOCAL
    assert found.objective.value == pytest.approx(given.objective.value, rel=1e-4)
    assert found.objective.value >= given.certificate.lower_bound * (1.0 - 1e-6)
