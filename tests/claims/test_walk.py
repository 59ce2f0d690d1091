"""Walk by exact evaluations, which withdraws claims of a false bound, and no true ones."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from laufruhe.errors import ModelError
from laufruhe.files.reader import load
from laufruhe.machine.firing import lap_orders
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import NORMS, lengths
from laufruhe.numerics.norms.maximum import Maximum
from laufruhe.numerics.norms.norm import Grid
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.channels import CHANNELS, ON_BLOCK, LoadChannel, Needs
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import MEASURES, Measure
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Certificate, Proof
from laufruhe.report.wording import explained
from laufruhe.solvers import solve, walk
from laufruhe.solvers.conclusion import decision_values, evaluate_only
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.ranking import candidates_of, ranked_star, ranking_result
from laufruhe.solvers.stars.star_results import with_star
from problem_files import PROBLEMS
from ready import solved

RESULTANT = Path(__file__).parent / "inputs" / "resultant-of-mount-forces.toml"
BETTER = {
    "engine.stiffness.z": 134976.827, "engine block.stiffness.z": 41921.457, "torque rod.stiffness.y": 103493.121,
    "gearbox.stiffness.z": 320608.48,
}  # fmt: skip
"""A design of the file within its limits, of 37.21 N."""


@pytest.fixture(autouse=True)
def whole_walks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give every walk enough time for all steps, however slow the machine is."""
    monkeypatch.setattr(walk, "SECONDS", 20.0)


def marked_optimal(result: Result) -> Result:
    """Return the result with the initial design marked as proven optimum."""
    value = result.objective.initial if result.objective is not None else math.nan
    claim = Certificate(Proof.GLOBAL, value * (1.0 - 1e-5), 1e-5, 0.0, "a false bound")
    decisions = tuple(e for d in result.problem.decisions for e in decision_values(d, d.start))
    assert result.objective is not None
    return replace(
        result, status=Status.OPTIMAL, objective=replace(result.objective, value=value), certificate=claim,
        decisions=decisions, final=result.initial,
    )  # fmt: skip


def is_withheld(result: Result, best: float) -> bool:
    """Return whether a result claims nothing, after checks of its reason and its design."""
    problem, own, objective = result.problem, result.final, result.objective
    assert objective is not None
    assert result.certificate is not None
    assert own.violation(problem.limits) <= 0.0
    assert objective_value(problem, own) == pytest.approx(objective.value, rel=1e-12)
    assert objective.value >= best * (1.0 - 1e-4)
    assert repr(objective.value) in result.message
    assert "report" in result.message
    assert "no design within" not in explained(result).lower()
    return (result.certificate.kind, result.certificate.lower_bound) == (Proof.NONE, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "car-four-willans",  # unbalances
        "twin-boxer",  # an unbalance and its angle
        "single-counter-shaft",  # several objectives in order
        "geared-inertia",  # a share of inertia
        "geared-three-leads",
        "opposed-pistons-lead",
        "opposed-pistons-masses",
        "tractor-four-shaft-heights",
        "inline-five-damper",  # the crankshaft
        "powertrain-joined-springs",
        "soft-mounts-run-up",
        "klein-steam-pump",
    ],
)
def test_a_suboptimal_design_is_detected(name: str) -> None:
    result = solved(name)
    assert result.objective is not None
    lie = marked_optimal(result)
    actual = walk.check_by_walk(result.problem, lie, 1.0)
    assert is_withheld(actual, result.objective.value)
    assert actual.objective is not None
    assert actual.objective.value < 0.9999 * result.objective.initial
    assert walk.check_by_walk(result.problem, result, 1.0) is result


@pytest.mark.slow
@pytest.mark.parametrize("name", ["study-soft-mounts", "worked-diesel", "locomotive-two-cylinder"])
def test_a_design_denied_by_a_result_is_found(name: str) -> None:
    """Check that a walk finds the design, from an initial one that breaks a limit or near a limit."""
    result = solved(name)
    lie = replace(
        result, status=Status.INFEASIBLE, objective=None, certificate=None, decisions=(), final=result.initial,
        conflict=tuple(limit.name for limit in result.problem.limits), message="no design exists",
    )  # fmt: skip
    actual = walk.check_by_walk(result.problem, lie, 10.0)
    assert result.objective is not None
    assert is_withheld(actual, result.objective.value)
    assert actual.conflict == ()


@pytest.mark.parametrize("rank", [1, 2])
def test_a_wrongly_pruned_star_is_detected(rank: int) -> None:
    result = solved("inline-five-open")
    phasing, ranked = result.problem.phasing, result.phasing
    assert phasing is not None
    assert ranked is not None
    (candidate,) = candidates_of(phasing, ranked.ranking[rank : rank + 1])
    star = solve(replace(phasing.problem_of(candidate), phasing=None))
    assert star.objective is not None
    claim = Certificate(Proof.GLOBAL, star.objective.value, 0.0, 0.0, "a false bound")
    lie = with_star(result.problem, phasing, star, candidate, claim, replace(ranked, ranking=ranked.ranking[rank:]))
    actual = walk.check_by_walk(result.problem, lie, 1.0)
    assert result.objective is not None
    assert is_withheld(actual, result.objective.value)
    assert actual.phasing is not None
    assert actual.phasing.ranking[0].value == pytest.approx(result.objective.value, rel=1e-9)
    assert not any(star.proven for star in actual.phasing.ranking)


def test_throws_are_walked_from_the_best_star_only() -> None:
    """Check that every throw and angle of the best star moves and its cranks swap; without a star none."""
    problem = load(PROBLEMS / "inline-seven-uneven.toml")
    assert problem.phasing is not None
    phasing, throws = problem.phasing, tuple(math.tau * k / 7 for k in range(7))
    layout = phasing.layout_of(Candidate(throws))
    candidate = Candidate(throws, next(lap_orders(phasing.cycle, layout, throws)))
    star = evaluate_only(replace(phasing.problem_of(candidate), phasing=None))
    assert star.objective is not None
    ranked = ranked_star(phasing, candidate, None, star.objective.value, 0.0, False)
    details = ranking_result(phasing, candidate, [ranked], 1, 1, "one star")
    result = with_star(problem, phasing, star, candidate, star.certificate, details)
    start = walk._start_point(result)
    assert start.candidate is not None
    assert start.candidate.throws == pytest.approx(throws)
    assert start.candidate.firing_order == ranked.firing_orders[0].order
    own = walk._LocalSearch(result, start)
    assert len(own._angle_moves()) == 7 + 2
    # 21 pairs, alone; two of three pairs of ends in two ways, with their mirror images; and other firing orders
    assert len(own._star_moves()) == 21 + 3 * 2 + walk.ORDERS
    unlisted = replace(details, ranking=(replace(ranked, firing_orders=()),))
    for without in (replace(result, phasing=None), replace(result, phasing=unlisted)):
        start = walk._start_point(without)
        assert start.candidate is None
        assert walk._LocalSearch(without, start)._angle_moves() == walk._LocalSearch(without, start)._star_moves() == []


# --- channels and norms that nobody knows


def resultant(loads: PointLoads) -> Spectrum:
    if loads.mount_forces is None:
        raise ModelError("this mounting has no transmitted force")
    return loads.mount_forces.mapped(lambda values: values.sum(axis=1, keepdims=True))


@pytest.fixture
def transmitted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measure the resultant of all mount forces by a channel with the fewest claims."""
    channel = LoadChannel("transmitted force", "N", ON_BLOCK, Needs.MOUNTS, signal=resultant)
    monkeypatch.setitem(CHANNELS._fill(), channel.name, channel)  # type: ignore[attr-defined]
    for norm in NORMS.values():
        monkeypatch.setitem(MEASURES, f"{norm.name} {channel.name}", (channel, norm))  # type: ignore[arg-type]


class WorstTwentieth(Maximum):
    """The mean of the longest twentieth of the rows, with no flag that says so."""

    name = "worst twentieth"
    refinement = 1
    is_largest = False

    def value(self, grid: Grid, rows: Array) -> float:
        size, left, total = lengths(rows), 0.05 * grid.weights.sum(), 0.0
        for k in np.argsort(-size):
            total += size[k] * min(grid.weights[k], left)
            left -= min(grid.weights[k], left)
        return float(total / (0.05 * grid.weights.sum()))

    def dual_norm(self, grid: Grid, z: Array) -> float:
        size, shares = lengths(z), grid.weights / grid.weights.sum()
        maximum = np.divide(0.05 * size, shares, out=np.zeros_like(size), where=shares > 0.0)
        return float(max(maximum.max(initial=0.0), size.sum()))

    def norm_from_lengths(self, lengths: Array, weights: Array) -> Array:
        count = max(lengths.shape[-1] // 20, 1)
        return np.asarray(np.sort(lengths, axis=-1)[..., -count:].mean(axis=-1))


def at(problem: Problem, values: dict[str, float]) -> float:
    """Return the objective of a design of this file, which keeps its limits."""
    design = evaluate(problem, problem.design([values[decision.name] for decision in problem.decisions]))
    assert design.violation(problem.limits) <= 0.0
    return objective_value(problem, design)


def claims_no_more_than(result: Result, value: float) -> bool:
    """Return whether the bound of a result is not above a known value."""
    assert result.certificate is not None
    return result.certificate.lower_bound <= value * (1.0 + 1e-9)


@pytest.mark.slow
@pytest.mark.usefixtures("transmitted")
def test_a_channel_declared_constant_by_mistake_is_detected(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check a channel declared to be off the mounts while their stiffness is open."""
    names = ("mount force", "mount travel")
    monkeypatch.setattr(Measure, "on_mounts", property(lambda self: self.is_load and self.load.name in names))
    problem = load(RESULTANT)
    known = at(problem, BETTER)
    assert known == pytest.approx(37.21, abs=0.01)
    assert claims_no_more_than(solve(problem.changed(search=replace(problem.search, starts=1))), known)


@pytest.mark.slow
@pytest.mark.usefixtures("transmitted")
def test_no_false_claim_about_an_unknown_norm_and_channel(monkeypatch: pytest.MonkeyPatch) -> None:
    norm, channel = WorstTwentieth(), "transmitted force"
    monkeypatch.setitem(NORMS, norm.name, norm)  # type: ignore[arg-type]
    monkeypatch.setitem(MEASURES, f"{norm.name} {channel}", (CHANNELS[channel], norm))  # type: ignore[arg-type]
    problem = load(RESULTANT.read_text().replace("rms transmitted force", f"{norm.name} {channel}"))
    result = solve(problem.changed(search=replace(problem.search, starts=1)))
    assert claims_no_more_than(result, at(problem, BETTER))
