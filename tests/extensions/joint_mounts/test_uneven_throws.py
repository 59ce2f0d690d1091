"""Throws between bounds are bounded together with mounts and balance, and no design is under the bound (E72)."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from attack.own_judge import vector
from attack.own_problem import OwnModel
from lanes import first_fast
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.result import Result

PATH = Path(__file__).parents[2] / "claims" / "inputs" / "uneven-throws-beside-a-stiffness.toml"


def table_of_norm(norm: str = "rms") -> dict[str, Any]:
    return {**tomllib.loads(PATH.read_text(encoding="utf-8")), "objective": {"minimise": f"{norm} mount force"}}


def own_at(throw: float, norm: str = "rms") -> OwnModel:
    """Return the model of the second throw at an angle [deg]."""
    table = table_of_norm(norm)
    table["engine"]["throws"] = [0, throw]
    return OwnModel(table, 256)


def decided(found: Result) -> tuple[float, np.ndarray]:
    """Return the second throw [deg], and the other open numbers as the own model has them."""
    values = {decision.name: decision.value for decision in found.decisions}
    throw = float(np.degrees(values["throw 2"]))
    return throw, vector(own_at(throw), values)


def under(found: Result, bound: float, norm: str = "rms") -> int:
    """Return how many designs, all over and ever nearer to the best, are under a bound by the own model."""
    throw, best = decided(found)
    generator, count = np.random.default_rng(20261127), 0
    low, high = own_at(throw).box.T
    for share in (1.0, 1e-1, 1e-2, 1e-3, 1e-4):
        for _ in range(8):
            angle = float(np.clip(throw + share * generator.uniform(-25.0, 25.0), 150.0, 200.0))
            x = np.clip(best + share * (high - low) * generator.uniform(-1.0, 1.0, (5, len(low))), low, high)
            count += int(np.sum(own_at(angle, norm).designs(x).objective < bound))
    return count


@pytest.mark.slow
def test_throws_beside_a_stiffness_and_a_balancer_are_proven() -> None:
    result = laufruhe.solve(PATH)
    assert result.certificate is not None
    assert result.objective is not None
    bound = result.certificate.lower_bound
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value == pytest.approx(11.82163, rel=1e-5)
    assert bound >= (1.0 - 1e-3) * result.objective.value
    throw, best = decided(result)
    assert own_at(throw).designs(best[None]).objective[0] == pytest.approx(result.objective.value, rel=1e-6)
    assert under(result, bound) == 0
    assert under(result, 1.001 * result.objective.value) > 0


@pytest.mark.parametrize("norm", first_fast(["maximum", "mean", "peak to peak"], 0, 1))
def test_means_and_peaks_have_a_bound_of_about_half_their_value(norm: str) -> None:
    result = laufruhe.solve(table_of_norm(norm))
    assert result.certificate is not None
    assert result.objective is not None
    assert result.certificate.lower_bound >= 0.45 * result.objective.value
    assert under(result, result.certificate.lower_bound, norm) == 0
    assert under(result, 1.01 * result.objective.value, norm) > 0
