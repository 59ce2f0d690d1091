"""Fidelities in their common limits, and the automatic choice in files and solves."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tractor
from cli import scenes
from fidelity.scenes import random_elastic_problem, random_problem
from laufruhe.errors import InputError, ModelError
from laufruhe.files.fidelity import FidelityTable
from laufruhe.files.reader import load
from laufruhe.machine import OperatingPoint
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem.error_bounds import REFERENCE_SAMPLES
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from problem_files import written

ROOT = Path(__file__).parents[2]
PROBLEMS = ROOT / "problems"

POINT = OperatingPoint("rated", tractor.SPEED, tractor.GAS)


def _coefficients(fidelity: Fidelity, rod_ratio: float = 0.26) -> np.ndarray:
    engine = tractor.engine((0, 120, 240))
    parts = tuple(replace(part, rod_length=part.crank_radius / rod_ratio) for part in engine.slider_cranks)
    return shaking_loads(replace(engine, slider_cranks=parts), replace(POINT, gas=None), fidelity).coefficients


def test_many_orders_are_every_order() -> None:
    assert np.array_equal(_coefficients(Fidelity(orders=500)), _coefficients(Fidelity()))


@pytest.mark.parametrize("last", [1, 2, 3, 8])
def test_orders_are_cut_and_nothing_else(last: int) -> None:
    cut, whole = _coefficients(Fidelity(orders=last)), _coefficients(Fidelity())
    assert np.allclose(cut[: 2 * last + 1], whole[: 2 * last + 1], rtol=1e-14, atol=1e-12)
    assert len(cut) <= 2 * last + 1


def test_two_orders_are_exact_for_a_long_rod() -> None:
    """The textbook's formulas err by the cube of the rod ratio in the couples of force."""
    errors = []
    for ratio in (0.02, 0.01):
        two, exact = (_coefficients(f, ratio)[:5, 4:] for f in (Fidelity("two-order"), Fidelity(orders=2)))
        errors.append(np.abs(two - exact).max() / np.abs(exact).max())
    assert errors[0] < 1e-5
    assert errors[0] / errors[1] == pytest.approx(8.0, rel=0.2)


def test_rod_of_two_masses_differs_by_its_deficit_only() -> None:
    engine = tractor.engine((0, 180, 180, 0))
    parts = tuple(replace(part, rod_inertia_deficit=-0.004) for part in engine.slider_cranks)
    heavy = replace(engine, slider_cranks=parts)
    without = shaking_loads(heavy, POINT, Fidelity(samples=720, rod="mass-only"))
    assert np.array_equal(without.coefficients, shaking_loads(engine, POINT, Fidelity(samples=720)).coefficients)
    rigid = shaking_loads(heavy, POINT, Fidelity(samples=720))
    assert not np.array_equal(without.coefficients[:, 3], rigid.coefficients[:, 3])


def test_no_gas_is_an_engine_without_a_gas_model() -> None:
    engine = tractor.engine((0, 180, 180, 0))
    bare = shaking_loads(engine, replace(POINT, gas=None))
    assert np.array_equal(shaking_loads(engine, POINT, Fidelity(gas=False)).coefficients, bare.coefficients)


@pytest.mark.parametrize("make", [random_problem, random_elastic_problem])
def test_order_of_parts_does_not_matter(make: Callable[..., Problem]) -> None:
    problem = make(random.Random(11), gas=True)
    other = replace(problem.points[0], name="other", speed=0.7 * problem.points[0].speed)
    problem = replace(problem, points=(*problem.points, other))
    value = objective_value(problem, evaluate(problem))
    for seed in range(5):
        rng, engine = random.Random(seed), problem.engine
        shuffled = replace(
            engine, slider_cranks=_shuffled(rng, engine.slider_cranks), mounts=_shuffled(rng, engine.mounts),
            rotors=_shuffled(rng, engine.rotors),
        )  # fmt: skip
        again = replace(problem, engine=shuffled, points=_shuffled(rng, problem.points))
        assert objective_value(again, evaluate(again)) == pytest.approx(value, rel=1e-12)


def _shuffled(rng: random.Random, parts: tuple[Any, ...]) -> tuple[Any, ...]:
    out = list(parts)
    rng.shuffle(out)
    return tuple(out)


def _with(text: str, table: str) -> str:
    return text + "\n[fidelity]\n" + table


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
def test_solve_within_a_tolerance(tolerance: float, tmp_path: Path) -> None:
    text = _with(scenes.TIGHT, f'kinematics = "auto"\ntolerance = {tolerance}')
    problem = load(written(tmp_path, text))
    result = solve(problem)
    exact = problem.at(problem.fidelity.exact(REFERENCE_SAMPLES))
    truth = objective_value(problem, evaluate(exact, result.final.engine))
    assert result.objective is not None
    assert result.error_estimate <= 1.05 * tolerance
    assert abs(result.objective.value - truth) <= result.error_estimate * truth * 1.01


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ('kinematics = "auto"\nsamples = 720', "fidelity.samples"),
        ('kinematics = "auto"\norders = 4', "fidelity.orders"),
        ("tolerance = 1e-3", "fidelity.tolerance"),
        ('kinematics = "two-order"\ncrank_inertia = "1 kg m^2"', "fidelity.crank_inertia"),
        ('crank_inertia = "0 kg m^2"', "fidelity.crank_inertia"),
        ("orders = 0", "fidelity.orders"),
    ],
)
def test_contradictions_are_refused(table: str, key: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=key):
        load(written(tmp_path, _with(scenes.GIVEN, table)))


def test_uneven_speed_from_a_file(tmp_path: Path) -> None:
    problem = load(written(tmp_path, _with(scenes.TIGHT, 'samples = 360\ncrank_inertia = "0.5 kg m^2"')))
    assert problem.fidelity.has_uneven_speed
    result = solve(problem)
    assert result.certificate is not None
    assert result.certificate.gap <= 1e-3


def test_no_orders_is_refused() -> None:
    with pytest.raises(ModelError, match="orders"):
        Fidelity(orders=0)


def test_every_choice_has_its_option() -> None:
    """Read every option of a fidelity from a file."""
    assert set(FidelityTable.model_fields) == {field.name for field in fields(Fidelity)}
