"""Open cranks of built engines: each star by itself, and as good as each given."""

from __future__ import annotations

import pytest

import laufruhe
from laufruhe.extensions.robust.result import RobustResult
from open_four import FOUR, solved_each
from problem_files import changed


@pytest.mark.slow
def test_the_worst_case_of_every_crank_is_that_of_the_best() -> None:
    """Tolerances of the crank pins stand where the throws of each star are, not at those of the first."""
    text = changed(FOUR, '"0.5 kg"', '"0.5 kg ± 5 %"')
    text = changed(text, '"0.3 kg"', '"0.3 kg ± 3 %"') + "[robust]\nengines = 200\n[fidelity]\nsamples = 180\n"
    found, each = laufruhe.solve(text), solved_each(text)
    best = min(each, key=lambda one: one.objective.value)
    assert found.objective.value == pytest.approx(best.objective.value, rel=2e-4)
    assert found.certificate.lower_bound <= min(one.objective.value for one in each)
    assert isinstance(found.details, RobustResult)
