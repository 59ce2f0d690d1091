"""Objectives in order: the proof of all of them together, and first ones that cancel."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from lanes import first_fast
from laufruhe.prove.certificate import Proof
from laufruhe.report.tables import number_tables

INPUTS = Path(__file__).parent / "inputs"


@pytest.mark.slow
def test_a_sacrifice_that_is_allowed_is_no_gap() -> None:
    """Check that a first objective that rises by 0.67 % of an allowed tenth has no gap."""
    result = laufruhe.solve(INPUTS / "ranks-with-a-sacrifice.toml")
    first, second = result.ranks
    assert first.final > 1.005 * first.minimum
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.gap == max(first.gap, second.gap) <= result.problem.tolerance
    assert result.status == "optimal"


@pytest.mark.slow
def test_a_first_objective_that_cancels_is_zero() -> None:
    """Check that a shaft cancels the roll of order 1, and that the second objective is least under that."""
    result = laufruhe.solve(INPUTS / "ranks-with-a-zero.toml")
    first, second = result.ranks
    assert first.initial == pytest.approx(5.827, abs=1e-3)
    assert first.minimum < 1e-12
    assert first.final < 1e-12
    assert second.minimum == pytest.approx(979.28, abs=0.02)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.status == "optimal"


@pytest.mark.parametrize("seed", first_fast(range(4), 0, 2))
def test_a_cancelled_order_is_proven_at_any_rank(seed: int) -> None:
    """Check order 1 of a crank against two shafts, as the first of two objectives and alone."""
    rng = np.random.default_rng(seed)
    table = tomllib.loads((INPUTS / "ranks-with-a-zero.toml").read_text())
    table["engine"]["stroke"] = f"{rng.uniform(50.0, 120.0)} mm"
    table["engine"]["reciprocating_mass"] = f"{rng.uniform(0.3, 2.0)} kg"
    ranked = laufruhe.solve(table)
    assert ranked.ranks[0].minimum < 1e-12 * ranked.ranks[0].initial
    assert ranked.ranks[0].proof is Proof.GLOBAL
    alone = laufruhe.solve(table | {"objective": {k: v for k, v in table["objective"][0].items() if k != "within"}})
    assert alone.objective.value < 1e-12 * alone.objective.initial
    assert alone.certificate.kind is Proof.GLOBAL


@pytest.mark.slow
def test_tables_of_objectives_that_needed_other_numbers_of_angles() -> None:
    """Check tables of a bearing's mean force at many angles and a root mean square at few."""
    result = laufruhe.solve(INPUTS / "ranks-of-a-bearing.toml")
    assert result.initial.samples == result.final.samples
    assert result.objective.value == pytest.approx(796.32, abs=0.01)
    paths = number_tables(result)["bearings-on-crank"]
    assert {len(row) for row in paths.rows} == {len(paths.head)}
