"""Free forces from tolerances: known sums, bounds, and order of magnitude of the study."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from laufruhe import load
from laufruhe.extensions.robust.study import (
    GRAVITY,
    StudyTolerancesTable,
    ToleranceStudy,
    _density,
    _marks,
    built,
    mean_mount_forces,
    random_forces,
    rise_of,
    spread,
    worst_parts,
)
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.present.picture import Words
from laufruhe.studies.scenes import Point
from problem_files import PROBLEMS

KILOPOND = 9.80665


def test_long_words_over_neighbouring_lines_keep_apart() -> None:
    """Check that long names of two neighbouring lines stand at different heights."""
    attributes = {
        "mark_names": ["worst sum, a source", "free force, a source"],
        "mark_forces": [GRAVITY, 10.0 * GRAVITY],
    }
    first, second = (mark for mark in _marks(xr.Dataset(attrs=attributes), 3) if isinstance(mark, Words))
    assert abs(first.y - second.y) >= 0.3
    (alone,) = (
        m for m in _marks(xr.Dataset(attrs={"mark_names": "a", "mark_forces": GRAVITY}), 3) if isinstance(m, Words)
    )
    assert alone.y == first.y


def tolerances_of(
    mass: float = 0.0, unbalance: float = 0.0, planes: int = 2, alignment: float = 0.0, aligned: tuple[float, ...] = ()
) -> StudyTolerancesTable:
    return StudyTolerancesTable.model_construct(
        reciprocating_mass=mass, unbalance=unbalance, planes=planes, alignment=alignment, aligned_masses=list(aligned)
    )


def test_one_unbalance_is_u_omega_squared() -> None:
    problem = load(PROBLEMS / "tractor-six.toml")
    tolerances = tolerances_of(unbalance=1e-3, planes=1)
    assert sum(worst_parts(problem.engine, 200.0, tolerances).values()) == pytest.approx(1e-3 * 200.0**2)
    drawn = random_forces(problem.engine, 200.0, tolerances, 2000, 1)
    # even over a disc: the mean size is two thirds of the largest
    assert drawn.mean() == pytest.approx(2.0 / 3.0 * 40.0, rel=0.03)


def test_pistons_alone_at_the_dead_centre() -> None:
    """Compare the worst sum of a four-cylinder engine with 2 |s''_top| + 2 |s''_bottom|."""
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    part = problem.engine.slider_cranks[0]
    result = sum(worst_parts(problem.engine, 1.0, tolerances_of(0.01)).values())
    top, bottom = 1.0 + part.rod_ratio, 1.0 - part.rod_ratio
    assert result == pytest.approx(0.01 * part.crank_radius * 2.0 * (top + bottom), rel=1e-6)


def test_random_engines_stay_under_the_worst() -> None:
    problem = load(PROBLEMS / "vee-six-60.toml")
    tolerances = tolerances_of(0.01, 2e-4, 2, 5e-5, (20.0,))
    worst = sum(worst_parts(problem.engine, 250.0, tolerances).values())
    drawn = random_forces(problem.engine, 250.0, tolerances, 1000, 7)
    assert drawn.max() <= worst * (1.0 + 2e-5)
    assert np.array_equal(drawn, random_forces(problem.engine, 250.0, tolerances, 1000, 7))


def test_second_order_outweighs_the_worst_sum() -> None:
    """Check the paper's 1000 against 100 kp in order of magnitude; it prints no tolerances.

    Assumed: 10 g on a piston of 1.25 kg, 50 g cm on each plane, a flywheel of 30 kg centred to 0.05 mm.
    """
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    tolerances = tolerances_of(0.010, 5e-4, 2, 5e-5, (30.0,))
    six = load(PROBLEMS / "tractor-six.toml")
    cases = [{"name": name, "problem": "x.toml"} for name in ("four", "six")]
    tables = {"kind": "tolerance", "name": "t", "title": "t", "tolerances": {"reciprocating_mass": "10 g"}}
    part = ToleranceStudy.model_validate({**tables, "cases": cases})
    data = part.dataset([Point(case) for case in part.cases], [spread(one, tolerances, 700) for one in (problem, six)])
    four = data.sel(case="four")
    worst, nominal = float(four["worst"]) / KILOPOND, float(four["nominal"]) / KILOPOND
    assert 10.0 < worst < 100.0
    assert nominal > 10.0 * worst
    causes = [float(four[f"worst_{cause}"]) for cause in ("reciprocating_masses", "unbalance", "alignment")]
    assert sum(causes) == pytest.approx(float(four["worst"]))
    assert min(causes) > 0.0
    assert float(four["random"].sel(share=0.95)) < 0.9 * float(four["worst"])
    assert float(four["random"].sel(share=1.0)) <= float(four["worst"])
    # the six has only what orders 6, 12, ... leave: there tolerances are all
    assert float(data["nominal"].sel(case="six")) < float(data["worst"].sel(case="six"))
    # and yet they move its mounts by a percent: gas torque is all that these feel
    assert 0.0 < rise_of(data.sel(case="six")) < 0.02


def test_quantiles_are_those_of_the_draws() -> None:
    problem = load(PROBLEMS / "tractor-six.toml")
    tolerances = tolerances_of(0.01, 5e-4, 2, 5e-5, (30.0,))
    result = spread(problem, tolerances, 400, seed=3)
    drawn = random_forces(problem.engine, problem.points[0].speed, tolerances, 400, 3)
    assert result["mean"] == pytest.approx(drawn.mean())
    assert result["random"][100] == pytest.approx(np.median(drawn))
    assert result["random"][-1] == drawn.max()


def test_built_engines_stay_within_the_worst_sum() -> None:
    """Check that 20 built engines add less shaking force to their drawing than the worst sum."""
    problem = load(PROBLEMS / "vee-six-60.toml")
    engine, point = problem.engine, problem.points[0]
    tolerances = tolerances_of(0.01, 5e-4, 3, 5e-5, (30.0,))
    worst = sum(worst_parts(engine, point.speed, tolerances).values())
    random = np.random.default_rng(5)
    drawn = shaking_loads(engine, point).sample(360)
    for _ in range(20):
        built_engine = built(engine, tolerances, random)
        added = (shaking_loads(built_engine, point).sample(360) - drawn)[:, 1:3]
        assert 0.0 < float(np.hypot(*added.T).max()) < worst
        assert [rotor.x for rotor in built_engine.rotors[len(engine.rotors) :]] == pytest.approx(
            [0.125, 0.0, -0.125, -0.125]
        )


def test_no_tolerances_build_the_drawing() -> None:
    problem = load(PROBLEMS / "tractor-three.toml")
    drawn, forces = mean_mount_forces(problem, tolerances_of(), 3, 1)
    assert forces == pytest.approx(np.full(3, drawn), rel=1e-12)
    wide, narrow = (mean_mount_forces(problem, tolerances_of(m), 20, 1)[1] for m in (0.1, 0.01))
    assert np.ptp(wide) == pytest.approx(10.0 * np.ptp(narrow), rel=0.2)


def test_engines_without_mounts_have_no_mount_forces() -> None:
    problem = load(PROBLEMS / "tractor-six.toml")
    bare = replace(problem, engine=replace(problem.engine, mounts=()))
    result = spread(bare, tolerances_of(0.01), 100)
    assert np.isnan(result["mount"])
    assert result["mean"] > 0.0


def test_the_largest_density_is_one() -> None:
    shares = np.linspace(0.0, 1.0, 401)
    for unit in (1e-3, 1.0, 1e3):
        _, density = _density(unit * (1.0 + shares**2), shares)
        assert density.max() == pytest.approx(1.0)
        assert density.min() == 0.0
