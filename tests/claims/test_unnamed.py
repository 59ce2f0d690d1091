"""Channel or norm unknown to all methods and bounds: no claims about designs that were not evaluated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from laufruhe.numerics.norms import NORMS, Grid, Norm
from laufruhe.numerics.norms.norm import lengths, norm_instance
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem import dependence, measure
from laufruhe.problem.channels import _KNOWN, CHANNELS, MOUNT_FORCE, ON_BLOCK, LoadChannel, Needs
from laufruhe.problem.decision import KINDS, Kind
from laufruhe.problem.dependence import Dependence, depends
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Limit, Measure
from laufruhe.prove.certificate import Proof
from laufruhe.prove.mounts.named import named_part
from laufruhe.solvers import METHODS

SPRINGS = Path(__file__).parent / "inputs" / "resultant-of-joined-springs.toml"
KNOWN = (134976.827, 41921.457, 103493.121, 320608.48)
"""Stiffnesses [N/m] that keep all limits, and at which the resultant is 37.21 N."""


def _resultant(loads: PointLoads) -> Spectrum:
    assert loads.mount_forces is not None
    return loads.mount_forces.mapped(lambda values: values.sum(axis=1, keepdims=True))


RESULTANT = LoadChannel("transmitted force", "N", ON_BLOCK, Needs.MOUNTS, signal=_resultant)


class WorstTwentieth(Norm):
    """The mean of the largest twentieth of the lengths; it claims nothing."""

    name = "worst twentieth"

    def value(self, grid: Grid, rows: np.ndarray) -> float:
        size = np.sort(lengths(rows))
        return float(size[-max(len(size) // 20, 1) :].mean())

    def upper_bound(self, signals: Sequence[Spectrum], shares: np.ndarray) -> float:
        return NORMS["maximum"].upper_bound(signals, shares)

    def sampling_bound(self, signals: Sequence[Spectrum], shares: np.ndarray, steps: int, finest: int) -> float:
        return NORMS["maximum"].sampling_bound(signals, shares, steps, finest)


@pytest.fixture
def resultant(monkeypatch: pytest.MonkeyPatch) -> LoadChannel:
    monkeypatch.setitem(CHANNELS._fill(), RESULTANT.name, RESULTANT)  # type: ignore[attr-defined]
    for norm in NORMS.values():
        monkeypatch.setitem(measure.MEASURES, f"{norm.name} {RESULTANT}", (RESULTANT, norm))  # type: ignore[arg-type]
    return RESULTANT


@pytest.fixture
def worst_twentieth(monkeypatch: pytest.MonkeyPatch) -> Norm:
    norm = norm_instance(WorstTwentieth)
    monkeypatch.setitem(measure.MEASURES, f"{norm.name} {MOUNT_FORCE}", (MOUNT_FORCE, norm))  # type: ignore[arg-type]
    return norm


def declared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give the resultant a line of the table, that of the force on each mount."""
    monkeypatch.setitem(dependence.TABLE, RESULTANT.name, dependence.TABLE[MOUNT_FORCE.name])  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("is_declared", [False, True])
def test_a_channel_that_no_bound_names_is_decided_locally(
    is_declared: bool, resultant: LoadChannel, monkeypatch: pytest.MonkeyPatch
) -> None:
    if is_declared:
        declared(monkeypatch)
    problem = laufruhe.load(SPRINGS)
    known = evaluate(problem, problem.design(KNOWN))
    assert known.violation(problem.limits) <= 0.0
    exists = objective_value(problem, known)
    assert exists == pytest.approx(37.2144, rel=1e-4)
    result = laufruhe.solve(problem.changed(search=replace(problem.search, starts=1)))
    assert result.certificate.kind is Proof.LOCAL
    assert result.certificate.lower_bound <= exists
    assert result.objective.value <= exists


@pytest.mark.slow
def test_a_norm_without_claims_is_decided_locally(worst_twentieth: Norm) -> None:
    text = SPRINGS.read_text().replace("rms transmitted force", f"{worst_twentieth.name} mount force")
    problem = laufruhe.load(text)
    result = laufruhe.solve(problem.changed(search=replace(problem.search, starts=1)))
    given = objective_value(problem, evaluate(problem, problem.design(KNOWN)))
    assert result.certificate.kind is Proof.LOCAL
    assert result.certificate.lower_bound <= min(given, result.objective.value)


def test_no_bound_counts_what_it_does_not_name(resultant: LoadChannel, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = laufruhe.load(SPRINGS)
    assert named_part(problem).objective == ()
    limited = replace(problem, limits=(*problem.limits, Limit("resultant", Measure(resultant), maximum=1.0)))
    assert named_part(limited).limits == problem.limits
    declared(monkeypatch)
    assert named_part(limited).limits == problem.limits


def test_unknown_is_neither_constant_nor_affine(resultant: LoadChannel, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = laufruhe.load(SPRINGS)
    for kind in KINDS.values():
        assert dependence.dependence(resultant, kind, problem) is Dependence.UNKNOWN
        assert depends(resultant, {kind}, problem)
    # channel of the same name that is not the one of the table
    monkeypatch.setitem(_KNOWN, MOUNT_FORCE.name, MOUNT_FORCE)
    other = replace(MOUNT_FORCE, signal=_resultant)
    assert dependence.dependence(other, Kind.PLACE, problem) is Dependence.UNKNOWN
    assert [method.name for method in METHODS if method.suits(problem)] == [METHODS[-1].name]


def test_every_channel_has_its_line() -> None:
    assert set(dependence.TABLE) == set(CHANNELS)


def test_a_norm_claims_nothing_by_default() -> None:
    facts = {name: value for name, value in vars(Norm).items() if isinstance(value, bool)}
    assert len(facts) > 5
    assert not any(facts.values())
