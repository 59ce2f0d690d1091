"""Many designs at once give what each gives alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from laufruhe.errors import ModelError
from laufruhe.files.reader import load
from laufruhe.load_models import batch
from laufruhe.load_models.batch import prepare
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.solvers.many import evaluate_many
from problem_files import PROBLEMS, READY
from random_decisions import random_decisions

COUNT = 12


@pytest.mark.parametrize("path", READY, ids=lambda path: path.stem)
def test_designs_agree_with_evaluations(path: Path) -> None:
    problem = replace(load(path).balance, fidelity=Fidelity(samples=720), phasing=None)
    values = random_decisions(problem, COUNT)
    single = [objective_value(problem, evaluate(problem, problem.design(list(v)))) for v in values]
    assert prepare(problem).objective(values) == pytest.approx(single, rel=1e-11)


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


@pytest.mark.parametrize("name", ["tractor-four-lanchester", "vee-two-90"])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_automatic_holds_over_the_bounds(name: str, tolerance: float) -> None:
    """Check that thousands of designs are within the tolerance at few samples, and that few designs are exact."""
    problem = load(PROBLEMS / f"{name}.toml")
    values = random_decisions(problem, batch.FEW_DESIGNS)
    designs = prepare(problem.at(replace(problem.fidelity, tolerance=tolerance)))
    exact = prepare(problem).objective(values)
    cheap = designs.objective(values)
    assert np.all(np.abs(cheap - exact) <= tolerance * exact)
    assert np.abs(cheap / exact - 1.0).max() > 1e-7
    norm = designs.norms[problem.objective[0].measure]
    assert norm.coarser[0].rows.shape[2] < norm.rows.shape[2] // 8
    # few designs are each exact, because a decision takes longer
    assert designs.objective(values[:-1]) == pytest.approx(exact[:-1], rel=1e-13)


def test_a_table_of_many_designs_is_automatic_too() -> None:
    """Its objective is within the tolerance, and its limits are exact."""
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    assert problem.limits
    rng, sizes = np.random.default_rng(5), {d.name: d.set.upper for d in problem.decisions}
    designs = {name: size * rng.random(batch.FEW_DESIGNS) for name, size in sizes.items()}
    tables = [
        evaluate_many(problem.at(replace(problem.fidelity, tolerance=tolerance)), dict(designs))
        for tolerance in (None, 1e-3)
    ]
    exact, cheap = (table["objective"].to_numpy() for table in tables)
    assert 1e-7 < np.abs(cheap / exact - 1.0).max() <= 1e-3
    name = problem.limits[0].name
    assert tables[1][name].to_numpy() == pytest.approx(tables[0][name].to_numpy(), rel=1e-13)


def test_a_design_that_needs_more_samples_is_seen() -> None:
    """The smallest of all is off by more than the tolerance at few samples, and no checked one is."""
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    designs = prepare(problem.at(replace(problem.fidelity, tolerance=1e-3)))
    norm = designs.norms[problem.objective[0].measure]
    features = np.ones((batch.FEW_DESIGNS, 1 + sum(domain.width for domain in designs.model.domains)))
    features[7] = 0.0
    features[7, 1] = 1.0
    assert norm.values_within(1e-3, features)[7] == pytest.approx(norm.values(features)[7], rel=1e-3)


@pytest.mark.parametrize(
    ("name", "said"),
    [("vee-six-open", "throws or firing order"), ("tractor-four-shaft-heights", "fix shaft")],
)
def test_designs_that_differ_in_more_than_unbalances_are_refused(name: str, said: str) -> None:
    with pytest.raises(ModelError, match="differ in unbalances alone") as refused:
        prepare(load(PROBLEMS / f"{name}.toml"))
    assert said.removeprefix("fix shaft") in str(refused.value)
