"""Newton's method from the optimum of some angles to that of the whole cycle (P10)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from laufruhe.files.reader import load
from laufruhe.load_models.affine import AffineModel
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from laufruhe.solvers.cones.newton_polish import TARGET_GAP, derivatives
from problem_files import PROBLEMS

NAMES = ["tractor-four-lanchester", "tractor-single", "tractor-six", "vee-six-60"]


@pytest.mark.parametrize("name", NAMES)
def test_the_gap_is_a_millionth_and_the_design_no_worse(name: str) -> None:
    problem = load(PROBLEMS / f"{name}.toml")
    rough, sharp = solve(problem), solve(replace(problem, sharply=True))
    assert sharp.certificate.kind is Proof.GLOBAL
    assert sharp.certificate.gap <= TARGET_GAP < rough.certificate.gap
    # bounds of both hold for the value at any number of steps
    finest = 5 * sharp.final.samples
    best, before = (objective_value(problem, evaluate(problem, r.final.engine, finest)) for r in (sharp, rough))
    assert max(rough.certificate.lower_bound, sharp.certificate.lower_bound) <= best <= before * (1.0 + 1e-12)
    assert sharp.objective.value == pytest.approx(best, rel=1e-7)
    for own, other in zip(sharp.limits, rough.limits, strict=True):
        assert own.value <= own.limit * (1.0 + 1e-9)
        assert own.shadow_price == pytest.approx(other.shadow_price, rel=1e-2, abs=1e-9)


def test_derivatives_are_those_of_differences() -> None:
    affine = AffineModel(load(PROBLEMS / "tractor-four-lanchester.toml")).at(360)
    rng = np.random.default_rng(1)
    x = 0.1 * affine.scales * rng.uniform(-1.0, 1.0, affine.size)
    gradient, curvature = derivatives(affine, x)
    for k, size in enumerate(affine.scales):
        step = np.zeros(affine.size)
        step[k] = 1e-5 * size
        values = [affine.objective(x + sign * step) for sign in (1.0, -1.0)]
        assert (values[0] - values[1]) / (2.0 * step[k]) == pytest.approx(gradient[k], rel=1e-5, abs=1e-3)
        ahead, behind = (derivatives(affine, x + sign * step)[0] for sign in (1.0, -1.0))
        assert (ahead - behind) / (2.0 * step[k]) == pytest.approx(curvature[:, k], rel=1e-3, abs=1e-2 / size)


@pytest.mark.parametrize("name", ["tractor-three-shafts", "tractor-four-bearings"])
@pytest.mark.slow
def test_where_rows_vanish_or_peaks_are_asked_for_the_cones_have_the_word(name: str) -> None:
    problem = load(PROBLEMS / f"{name}.toml")
    result = solve(replace(problem, sharply=True))
    assert "Newton" not in result.certificate.method
    assert result.certificate.kind is Proof.GLOBAL
