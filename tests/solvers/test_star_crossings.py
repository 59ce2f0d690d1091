"""Open cranks and shafts with parts that no method of stars knows, compared with each star given by itself."""

from __future__ import annotations

import pytest

import laufruhe
from laufruhe.prove.certificate import Proof
from open_four import FOUR, solved_each
from problem_files import PROBLEMS, changed
from ready import solved

FEW = "[search]\nstarts = 1\n[fidelity]\nsamples = 48\n"


@pytest.mark.slow
def test_a_stroke_beside_an_open_crank_is_searched_for_each() -> None:
    text = changed(FOUR, 'stroke = "80 mm"', 'stroke = { between = ["70 mm", "90 mm"] }') + FEW
    result = laufruhe.solve(text)
    assert result.certificate.kind is Proof.LOCAL
    assert result.objective.value == pytest.approx(min(one.objective.value for one in solved_each(text)), rel=1e-6)


@pytest.mark.slow
def test_optional_shafts_with_open_places_are_decided_set_by_set() -> None:
    text = (PROBLEMS / "tractor-four-shaft-heights.toml").read_text(encoding="utf-8")
    for name in ("left", "right"):
        text = changed(text, f'name = "{name}"', f'name = "{name}"\noptional = true')
    result = laufruhe.solve(text)
    built = solved("tractor-four-shaft-heights")
    assert result.objective.value == pytest.approx(built.objective.value, rel=2e-4)
    limited = laufruhe.solve(text + "\n[phasing]\nmost_shafts = 1\n")
    assert limited.objective.value > result.objective.value


@pytest.mark.slow
def test_throws_that_leave_the_even_steps_move_with_a_stroke() -> None:
    """A short stroke is best, and at it the crank is that of the method of uneven throws, which proves it."""
    text = changed(changed(FOUR, "cylinders = 4", "cylinders = 3"), 'rotating_mass = "0.3 kg"\n', "")
    text += '[phasing]\nintervals = { largest_deviation = "40 deg" }\n' + FEW.replace("1", "2").replace("48", "90")
    result = laufruhe.solve(changed(text, '"80 mm"', '{ between = ["70 mm", "90 mm"], start = "80 mm" }'))
    given = laufruhe.solve(changed(text, '"80 mm"', '"70 mm"'))
    assert result.certificate.kind is Proof.LOCAL
    assert result.objective.value == pytest.approx(given.objective.value, rel=2e-4)
    assert result.objective.value >= given.certificate.lower_bound * (1.0 - 1e-6)
