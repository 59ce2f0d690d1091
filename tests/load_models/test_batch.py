"""Many designs at once give what each gives alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from laufruhe.errors import ModelError
from laufruhe.fidelity.automatic import automatic
from laufruhe.files.reader import load
from laufruhe.load_models import batch
from laufruhe.load_models.batch import Designs, prepare
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.evaluation import evaluate, objective_value
from problem_files import PROBLEMS, READY
from random_decisions import random_decisions

COUNT = 12


@pytest.mark.parametrize("path", READY, ids=lambda path: path.stem)
def test_designs_agree_with_evaluations(path: Path) -> None:
    problem = replace(load(path).balance, fidelity=Fidelity(samples=720), phasing=None)
    values = random_decisions(problem, COUNT)
    single = [objective_value(problem, evaluate(problem, problem.design(list(v)))) for v in values]
    for prune in (True, False):
        designs = prepare(problem, prune)
        assert designs.objective(values) == pytest.approx(single, rel=1e-11)
        features = np.concatenate([np.ones((COUNT, 1)), _columns(designs, values)], axis=1)
        assert designs.objective_from_features(features) == pytest.approx(single, rel=1e-11)


def _columns(designs: Designs, values: np.ndarray) -> np.ndarray:
    parts = [
        np.array([domain.columns_of(complex(u)) for u in values[:, k]])
        for k, domain in enumerate(designs.model.domains)
    ]
    return np.concatenate(parts, axis=1) if parts else np.zeros((len(values), 0))


def test_threads_change_nothing() -> None:
    problem = load(READY[0])
    designs, values = prepare(problem), random_decisions(problem, 5000)
    one = designs.objective(values)
    for threads in (2, 3):
        assert np.array_equal(designs.objective(values, threads), one)


def test_memory_limit_changes_a_rounding_only(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = load(READY[0])
    designs, values = prepare(problem), random_decisions(problem, 500)
    usual = designs.objective(values)
    monkeypatch.setattr(batch, "CACHE_BYTES", 1)
    assert designs.objective(values) == pytest.approx(usual, rel=1e-14)


def test_automatic_holds_over_the_bounds() -> None:
    """Chosen for the design as given: a thousand others are within the tolerance in 99 of 100."""
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    values = random_decisions(problem, 1000)
    cheap = prepare(automatic(problem, 1e-3)).objective(values)
    exact = prepare(replace(problem, fidelity=Fidelity(samples=2880))).objective(values)
    assert np.mean(np.abs(cheap / exact - 1.0) <= 1e-3) >= 0.99


@pytest.mark.parametrize(
    ("name", "said"),
    [("vee-six-open", "throws or firing order"), ("tractor-four-shaft-heights", "fix shaft")],
)
def test_what_is_no_unbalance_is_refused(name: str, said: str) -> None:
    with pytest.raises(ModelError, match="differ in unbalances alone") as refused:
        prepare(load(PROBLEMS / f"{name}.toml"))
    assert said.removeprefix("fix shaft") in str(refused.value)
