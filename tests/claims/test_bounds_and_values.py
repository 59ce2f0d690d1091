"""A bound and a value that were read at different angles."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import laufruhe
from laufruhe.problem.evaluation import objective_value
from laufruhe.prove.certificate import Proof

INPUTS = Path(__file__).parent / "inputs"
TRUE_MEAN = 46.10256
"""Mean at the best places, at 115,200 angles [N m]."""


def test_a_mean_is_read_at_the_angles_of_its_bound() -> None:
    """Check that a mean is read at more than 360 angles if its bound over the cycle is above it there."""
    result = laufruhe.solve(INPUTS / "places-case.toml")
    assert result.objective is not None
    assert result.certificate is not None
    value, bound = result.objective.value, result.certificate.lower_bound
    many = objective_value(result.problem, replace(result.final, samples=115_200))
    assert many == pytest.approx(TRUE_MEAN, abs=1e-5)
    assert bound < value
    assert value == pytest.approx(many, rel=1e-6)
    assert bound <= many
    assert 0.0 < result.certificate.gap < 1e-5
    assert result.certificate.kind is Proof.GLOBAL
