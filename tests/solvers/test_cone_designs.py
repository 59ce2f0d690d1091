"""Designs of cone programs: limits kept between angles, and of designs alike for all loads the lightest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from laufruhe.files.reader import load_tables
from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.numerics.norms import NORMS, Grid
from laufruhe.problem.decision import Decision, RotorDrive, domains_of
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.sets import Interval
from laufruhe.solvers.conclusion import FEASIBLE
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.tie_break import break_ties, is_moved_along
from laufruhe.solvers.cones.unbalances import allowed_optimum


def test_a_peak_between_angles_keeps_its_limit() -> None:
    """Check that the design keeps its limit between 48 angles, where the program alone breaks it, at little cost."""
    table = {
        "title": "twin", "fidelity": {"samples": 48},
        "engine": {"layout": "inline", "cycle": "two-stroke", "stroke": "100 mm", "rod_ratio": 0.3,
                   "reciprocating_mass": "1 kg", "rotating_mass": "0.5 kg", "throws": [0, 75],
                   "cylinder_spacing": "120 mm"},
        "operating_points": [{"speed": "3000 rpm"}],
        "counterweights": [{"name": "a", "x": "25 mm", "unbalance": {"between": ["0 kg m", "0.2 kg m"]},
                            "angle": {"between": [0, 360]}}],
        "constraints": [{"limit": "maximum shaking force", "max": "9000 N"}],
        "objective": {"minimise": "mean rocking couple"},
    }  # fmt: skip
    problem = load_tables(table, Path("twin.toml"))
    model, zero_level = AffineModel(problem), numerical_zero(problem)
    domains = model.domains

    def peak(x: np.ndarray) -> float:
        design = evaluate(problem, problem.design([domain.complex_value(x) for domain in domains]), 1920)
        return design.value(problem.limits[0].measure)

    plain = solve_cones(model.at(48)).x
    result = allowed_optimum(problem, model, 48, zero_level)
    assert plain is not None
    assert result is not None
    assert peak(plain) > 9000.0 * (1.0 + 1e-4)
    assert 9000.0 * 0.99 < peak(result.x) <= 9000.0 * (1.0 + 3.0 * FEASIBLE)
    fine = model.at(960)
    best = solve_cones(fine).x
    assert best is not None
    assert fine.objective(result.x) == pytest.approx(fine.objective(best), rel=2e-3)


def test_designs_of_equal_loads_end_at_the_lightest() -> None:
    """Check sizes of 1 and 1e11 within wide bounds, and that a weight without effect goes."""
    sets = [Interval(-1e12, 1e12), Interval(-1e13, 1e13), Interval(-1.0, 1.0), Interval(-1.0, 1.0)]
    decisions = [Decision(str(k), "kg m", own, 0.0, (RotorDrive(str(k), 1.0),)) for k, own in enumerate(sets)]
    slope = np.zeros((2, 1, 4))
    slope[0, 0, 0], slope[1, 0, 1], slope[0, 0, 2] = 1.0, 1e-11, 1.0
    norm = AffineNorm(NORMS["rms"], np.array([[-3.0], [-5.0]]), slope, Grid(np.full(2, 0.5), 2))
    affine = AffineProblem(((1.0, norm),), (), domains_of(decisions), 2)
    problem = SimpleNamespace(objective=(), load_limits=())
    x = np.array([0.4, 1e11, 0.6, 0.7])
    result = break_ties(problem, affine, x)
    assert norm.rows(result) == pytest.approx(norm.rows(x), rel=1e-6)
    assert result[3] == pytest.approx(0.0, abs=1e-6)


def test_a_rounding_is_no_move_of_a_limit() -> None:
    slope = np.array([[[1.0, 1.0]], [[0.0, 0.0]]])
    norm = AffineNorm(NORMS["maximum"], np.ones((2, 1)), slope, Grid(np.full(2, 0.5), 2))
    assert not is_moved_along(norm, np.array([[0.1 + 0.2], [-0.3]]))
    assert is_moved_along(norm, np.array([[0.3], [-0.3 + 1e-9]]))
    assert not is_moved_along(replace(norm, slope=0.0 * slope), np.ones((2, 1)))
