"""Columns of unbalances that turn with throws, or stand still, compared with the engine of the problem."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from laufruhe.load_models.uneven_model import rotor_throws_of
from laufruhe.machine import Engine
from laufruhe.problem.decision import domains_of
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.sets import Interval
from laufruhe.solvers.throws.riding_weights import Riders
from phasing import engines

STILL = """
[[counterweights]]
name = "still"
x = "200 mm"
unbalance = { between = ["0 kg m", "0.2 kg m"] }
angle = { between = [0, 360] }
[[counterweights]]
name = "free"
opposite_throw = 1
unbalance = { between = ["0 kg m", "0.1 kg m"] }
angle = { between = [0, 360] }
[[counterweights]]
name = "sized"
opposite_throw = 2
unbalance = { between = ["0.01 kg m", "0.08 kg m"] }
angle = 20
[[counterweights]]
name = "all"
balance_factor = { between = [0.1, 0.7] }
"""


def unbalances(engine: Engine) -> np.ndarray:
    return np.array([rotor.unbalance for rotor in engine.rotors])


@pytest.mark.parametrize("own", [(0.01, 0.08), (-0.08, -0.01), (-0.05, 0.03), (0.0, 0.06), (-0.06, 0.0), (0.02, 0.02)])
def test_columns_at_given_throws_are_the_unbalances_of_the_engine(own: tuple[float, float], tmp_path: Path) -> None:
    """Check random values of every kind of decision, with intervals on both sides of zero and around it."""
    problem = engines.problem(
        tmp_path, 3, "two-stroke", engines.OPEN, 'intervals = { largest_deviation = "25 deg" }',
        STILL + engines.MOUNTS + engines.MOUNT_FORCE, "inline", 96,
    )  # fmt: skip
    throws, phasing = (0.0, 4.3, 2.0), problem.phasing
    candidate = Candidate(throws, (1, 2, 3), *phasing.minimum_geometry)
    given = replace(phasing.problem_of(candidate), phasing=None)
    given = replace(given, decisions=tuple(
        replace(d, set=Interval(*own, d.set.angle)) if d.set.width == 1 and d.name.startswith("sized") else d
        for d in given.decisions
    ))  # fmt: skip
    riders = Riders(given, rotor_throws_of(phasing, candidate), throws)
    result = riders.columns(np.array(throws), np.array(throws))
    rng = np.random.default_rng(5)
    names = [decision.name for decision in given.unbalances]
    assert len(names) == 4
    still = names[:1]
    assert still[0].startswith("still")
    for _ in range(4):
        values, y, first = [], np.zeros(result.matrix.shape[1]), 0
        for decision in given.unbalances:
            own_set = decision.set
            if own_set.width == 2:
                value = own_set.upper * rng.uniform() * np.exp(1j * rng.uniform(0.0, math.tau))
                parts = [value.real, value.imag]
            else:
                size = rng.uniform(own_set.lower, own_set.upper)
                value = size * own_set.directions[0]
                # counted from the end nearest to nothing, so that none is negative
                parts = [own_set.upper - size if own_set.upper <= 0.0 else size - own_set.lower]
            y[first : first + len(parts)] = parts
            first += len(parts)
            values.append(value)
        for domain in result.domains:
            # inside the set of every column
            assert y[domain.columns] == pytest.approx(domain.project(y), abs=1e-15)
        x = result.matrix @ y
        unbalance_values = [domain.complex_value(x) for domain in domains_of(riders.problem.unbalances)]
        expected = unbalances(given.design(values))
        assert np.abs(expected).max() > 0.0
        assert unbalances(riders.problem.design(unbalance_values)) == pytest.approx(expected, abs=1e-12)
