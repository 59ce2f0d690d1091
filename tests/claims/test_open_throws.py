"""Throws between bounds are bounded together with mounts and balance, and no design is under the bound (E72)."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from attack.own_judge import vector
from attack.own_problem import Own
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.result import Result

PATH = Path(__file__).parent / "inputs" / "uneven-throws-beside-a-stiffness.toml"


def told() -> dict[str, Any]:
    return tomllib.loads(PATH.read_text(encoding="utf-8"))


def own_at(throw: float) -> Own:
    """Return the model of the second throw at an angle [deg]."""
    table = told()
    table["engine"]["throws"] = [0, throw]
    return Own(table, 256)


def decided(found: Result) -> tuple[float, np.ndarray]:
    """Return the second throw [deg], and the other open numbers as the own model has them."""
    values = {decision.name: decision.value for decision in found.decisions}
    throw = float(np.degrees(values["throw 2"]))
    return throw, vector(own_at(throw), values)


@pytest.mark.slow
def test_throws_beside_a_stiffness_and_a_balancer_are_proven() -> None:
    found, generator = laufruhe.solve(PATH), np.random.default_rng(20261127)
    assert found.certificate is not None
    assert found.objective is not None
    bound = found.certificate.lower_bound
    assert found.certificate.kind is Proof.GLOBAL
    assert found.objective.value == pytest.approx(11.82163, rel=1e-5)
    assert bound >= (1.0 - 1e-3) * found.objective.value
    throw, best = decided(found)
    assert own_at(throw).designs(best[None]).objective[0] == pytest.approx(found.objective.value, rel=1e-6)
    low, high = own_at(throw).box.T
    for share in (1.0, 1e-1, 1e-2, 1e-3, 1e-4):
        for _ in range(8):
            angle = float(np.clip(throw + share * generator.uniform(-25.0, 25.0), 150.0, 200.0))
            x = np.clip(best + share * (high - low) * generator.uniform(-1.0, 1.0, (5, len(low))), low, high)
            assert np.all(own_at(angle).designs(x).objective >= bound)
