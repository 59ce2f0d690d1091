"""Open cranks of built engines, compared with each star given by itself."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

import laufruhe
from laufruhe.extensions.robust import solver
from laufruhe.extensions.robust.result import RobustResult
from open_four import FOUR, solved_each
from problem_files import changed


@pytest.mark.slow
def test_the_worst_case_of_every_crank_is_that_of_the_best() -> None:
    """Check that tolerances of crank pins stand at the throws of each star, not of the first."""
    text = changed(FOUR, '"0.5 kg"', '"0.5 kg ± 5 %"')
    text = changed(text, '"0.3 kg"', '"0.3 kg ± 3 %"') + "[robust]\nengines = 200\n[fidelity]\nsamples = 180\n"
    result, each = laufruhe.solve(text), solved_each(text)
    best = min(each, key=lambda one: one.objective.value)
    assert result.objective.value == pytest.approx(best.objective.value, rel=2e-4)
    assert result.certificate.lower_bound <= min(one.objective.value for one in each)
    assert isinstance(result.details, RobustResult)


@pytest.mark.parametrize("found", [None, SimpleNamespace(value=3.0)])
def test_open_cranks_keep_the_initial_values(found: object, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that the result of the stars stays as it is without an objective of its own or of the initial design."""
    problem = laufruhe.load(changed(FOUR, '"0.5 kg"', '"0.5 kg ± 5 %"') + "[robust]\nengines = 20\n")
    result = SimpleNamespace(objective=found)
    monkeypatch.setattr(solver, "solve_star_by_star", lambda *_: result)
    assert solver.solve_built(problem, lambda _: SimpleNamespace(objective=None), lambda _: result) is result
