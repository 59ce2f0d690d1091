"""Limits that no closing method knows are left out for the bound, and the bound holds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from attack.crossings import transmissibility_and_weights
from attack.families import few_stiffnesses
from laufruhe.numerics.norms import NORMS
from laufruhe.problem.channels import CHANNELS
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Limit, Measure, Term
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.report.wording import explained, headline
from laufruhe.solvers.conclusion import FEASIBILITY_TOL

INPUTS = Path(__file__).parent / "inputs"


@pytest.fixture(scope="module")
def problem() -> Problem:
    return laufruhe.load(INPUTS / "transmissibility-beside-weights.toml")


def _minimum(problem: Problem, count: int = 400) -> float:
    """Return the objective of the best of evenly spaced weights that keep the limits, by the exact model."""
    (decision,) = problem.decisions
    values = []
    for value in np.linspace(decision.lower, decision.upper, count):
        evaluation = evaluate(problem, problem.design([float(value)]))
        if evaluation.violation(problem.limits) <= 0.0:
            values.append(objective_value(problem, evaluation))
    return min(values)


@pytest.mark.slow
def test_a_limit_with_room_takes_nothing_from_the_proof(problem: Problem) -> None:
    result = laufruhe.solve(problem)
    assert result.certificate is not None
    assert result.objective is not None
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.gap < 1e-4
    assert result.objective.value == pytest.approx(38.3224, rel=1e-5)
    assert result.certificate.lower_bound <= _minimum(problem) * (1.0 + 1e-9)
    assert [limit.name for limit in result.limits] == [limit.name for limit in problem.limits]


def test_the_optimum_without_a_limit_that_it_keeps_is_the_optimum() -> None:
    """Compare a weight under a limit on transmissibility, unknown to cone programs, with random designs."""
    problem = laufruhe.load({"title": "ratio", **transmissibility_and_weights(np.random.default_rng(1))})
    result, random = laufruhe.solve(problem), np.random.default_rng(2)
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    assert "dual bound" in result.certificate.method
    assert result.final.violation(problem.limits) <= 1e-6
    (decision,) = problem.decisions
    for _ in range(20):
        design = evaluate(
            problem, problem.design([decision.set.directions[0] * random.uniform(decision.lower, decision.upper)])
        )
        if design.violation(problem.limits) <= 0.0:
            assert result.certificate.lower_bound <= objective_value(problem, design)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "kind"), [(1.01, Proof.GLOBAL), (0.99, Proof.WITHIN_GAP)])
def test_stiffness_has_a_bound_under_a_limit_without_formulas(share: float, kind: Proof) -> None:
    """Check the bound of stiffness under a limit on motion frequencies just above or below the optimum's."""
    variant = laufruhe.load({"title": "stiffness", **few_stiffnesses(1, 2)(np.random.default_rng(1))})
    free, measure = laufruhe.solve(variant), Measure(CHANNELS["motion frequencies"])
    limit = Limit("roll", measure, maximum=share * max(free.final.values(measure)))
    result = laufruhe.solve(variant.changed(limits=(*variant.limits, limit)))
    assert free.certificate is not None
    assert result.certificate is not None
    assert result.objective is not None
    assert result.certificate.kind is kind
    assert result.certificate.lower_bound == free.certificate.lower_bound
    assert result.final.violation(result.problem.limits) <= FEASIBILITY_TOL


@pytest.mark.slow
@pytest.mark.skipif("worst mean" not in NORMS, reason="the extension worst_mean is removed")
def test_boxes_bound_a_norm_that_no_method_of_mounts_accepts() -> None:
    """Compare worst means of forces on open stiffness with random designs."""
    problem = laufruhe.load({"title": "stiffness", **few_stiffnesses(1, 2)(np.random.default_rng(1))})
    worst = problem.changed(objective=(Term(Measure(CHANNELS["mount force"], NORMS["worst mean"])),), limits=())
    result, random = laufruhe.solve(worst), np.random.default_rng(3)
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    for _ in range(20):
        values = [random.uniform(decision.lower, decision.upper) for decision in worst.decisions]
        assert result.certificate.lower_bound <= objective_value(worst, evaluate(worst, worst.design(values)))


@pytest.mark.slow
def test_a_limit_that_holds_leaves_at_least_the_bound_without_it(problem: Problem) -> None:
    free = laufruhe.solve(problem.changed(limits=()))
    (limit,) = problem.limits
    reached = evaluate(problem, free.final.engine).value(limit.measure)
    low = min(
        evaluate(problem, problem.design([float(value)])).value(limit.measure)
        for value in np.linspace(problem.decisions[0].lower, problem.decisions[0].upper, 200)
    )
    tight = problem.changed(limits=(replace(limit, maximum=0.5 * (reached + low)),))
    result = laufruhe.solve(tight)
    assert low < reached
    assert result.certificate is not None
    assert result.objective is not None
    assert free.objective is not None
    # boxes of the weight may show more than that
    assert free.objective.value * (1.0 - 1e-4) <= result.certificate.lower_bound <= _minimum(tight)
    assert result.final.violation(tight.limits) <= 1e-5


@pytest.mark.slow
def test_a_term_without_a_closing_method_has_its_own_share(problem: Problem) -> None:
    (limit,), (term,) = problem.limits, problem.objective
    both = problem.changed(objective=(term, Term(Measure(limit.measure.channel, orders=(1.0,)), 3.0)), limits=())
    result, alone = laufruhe.solve(both), laufruhe.solve(problem.changed(limits=()))
    assert result.certificate is not None
    assert alone.objective is not None
    assert result.objective is not None
    assert alone.objective.value * (1.0 - 1e-4) <= result.certificate.lower_bound <= _minimum(both)
    assert result.objective.value <= _minimum(both) * (1.0 + 1e-6)


@pytest.mark.slow
def test_a_useless_bound_is_reported_as_none(problem: Problem) -> None:
    result = laufruhe.solve(problem)
    assert result.certificate is not None
    empty = replace(result, certificate=replace(result.certificate, kind=Proof.WITHIN_GAP, lower_bound=0.0, gap=1.0))
    local = replace(result, certificate=replace(result.certificate, kind=Proof.LOCAL, lower_bound=0.0, gap=1.0))
    for each in (empty, local):
        text = f"{headline(each)} {explained(each)}"
        assert "no useful lower bound was found" in headline(each)
        assert "No useful lower bound was found." in explained(each)
        assert "100 %" not in text
        assert "less than 0" not in text
        assert "below 0" not in text
