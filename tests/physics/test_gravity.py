"""Weight of moving parts on the crank: against forces, a Lagrangian of the mechanism, and bounds."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import InputError
from laufruhe.extensions.flywheel.channels import IRREGULARITY
from laufruhe.extensions.flywheel.torque import swing_of, torque_facts, torque_parts
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.load_models.affine import AffineModel
from laufruhe.numerics.norms import NORMS
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import EXACT
from laufruhe.physics.gravity import potential_energy, with_gravity
from laufruhe.physics.modes import GRAVITY
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem.channels import STORED_WORK
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import Dependence, dependence
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from problem_files import PROBLEMS

NAMES = [
    "tractor-single", "vee-six-90", "single-bob-weights", "worked-diesel", "klein-steam-pump", "radial-seven",
    "opposed-pistons-masses", "boxer-four",
]  # fmt: skip
WORK = Measure(STORED_WORK, NORMS["peak to peak"])


def weighed(name: str, **changes: Any) -> Problem:
    tables = {**tables_of(PROBLEMS / f"{name}.toml"), **changes}
    tables["engine"] = {**tables["engine"], "gravity": True}
    return load_tables(tables, PROBLEMS / f"{name}.toml")


def torque_of(problem: Problem) -> Spectrum:
    zero = Spectrum(problem.engine.cycle.base_order, np.zeros(1, dtype=complex))
    return with_gravity(zero, problem.engine, EXACT)


@pytest.mark.parametrize("name", NAMES)
def test_the_torque_is_the_slope_of_the_energy_and_follows_from_the_inertia_forces(name: str) -> None:
    """The centre of mass that the weight pulls down is the one whose acceleration shakes the block: F_z = -S_z''."""
    problem = weighed(name)
    engine = problem.engine
    angles, step = np.radians(np.arange(0.0, 720.0, 7.0)), 1e-5
    rotors = (*engine.pins, *engine.rotors)
    ends = [potential_energy(engine.slider_cranks, rotors, angles + side) for side in (step, -step)]
    torque = torque_of(problem).values(angles)
    assert torque == pytest.approx((ends[1] - ends[0]) / (2.0 * step), abs=1e-6 * (1.0 + np.abs(torque).max()))
    wrench = shaking_loads(replace(engine, gravity=False), replace(problem.points[0], speed=1.0, gas=None))
    orders = wrench.orders
    inverse = np.divide(1.0, orders, out=np.zeros_like(orders), where=orders > 0.0)
    by_force = Spectrum(wrench.base, -1j * GRAVITY * wrench.coefficients[:, 2] * inverse)
    assert torque == pytest.approx(by_force.values(angles), abs=1e-7 * (1.0 + np.abs(torque).max()))


def test_a_lagrangian_of_a_leaning_crank_has_the_same_torque() -> None:
    """L = T - V in coordinates of pin, rod ends and web by trigonometry; the term without speed is the torque."""
    problem = weighed(
        "vee-two-90", operating_points=[{"speed": "500 rpm"}], gas=None, constraints=[], objective=None,
        counterweights=[{"name": "web", "x": "0 mm", "unbalance": "0.02 kg m", "angle": "130 deg"}],
    )  # fmt: skip
    engine = problem.engine

    def energy(phi: float) -> float:
        total = 0.02 * math.cos(phi + math.radians(130.0))
        for part in engine.slider_cranks:
            pin_y, pin_z = (part.crank_radius * f(phi + part.throw) for f in (math.sin, math.cos))
            # along and across the axis of the cylinder
            lean = part.bank
            along = pin_z * math.cos(lean) + pin_y * math.sin(lean)
            across = pin_y * math.cos(lean) - pin_z * math.sin(lean)
            piston = along + math.sqrt(part.rod_length**2 - (across - part.offset) ** 2)
            total += part.rotating_mass * pin_z
            total += part.reciprocating_mass * (piston * math.cos(lean) - part.offset * math.sin(lean))
        return GRAVITY * total

    torque = torque_of(problem)
    for phi in np.linspace(0.1, 12.0, 23):
        slope = -(energy(phi + 1e-5) - energy(phi - 1e-5)) / 2e-5
        assert float(torque.values(np.array([phi]))[0]) == pytest.approx(slope, abs=2e-6)
    assert np.abs(torque.sample(90)).max() > 0.5


def test_weights_share_a_static_crank_between_two_sides() -> None:
    """A vertical single with a counterweight for its mean mass has almost no torque of weight of order one."""
    problem = weighed("tractor-single", counterweights=[])
    torque = torque_of(problem)
    part = problem.engine.slider_cranks[0]
    mass = part.reciprocating_mass * part.crank_radius * GRAVITY
    assert abs(torque.at(1.0)) == pytest.approx(mass, rel=1e-9)
    # the rod adds its second order, and the pull is down: at a quarter turn the weight drives the crank
    assert float(torque.values(np.array([0.5 * math.pi]))[0]) == pytest.approx(mass, rel=0.02)


def test_irregularity_and_stored_work_count_the_weights() -> None:
    problem = weighed("worked-diesel", flywheel={"inertia": "8000 kg m^2"}, constraints=[])
    engine, point = problem.engine, problem.points[0]
    heavy, light = torque_facts(engine, point), torque_facts(replace(engine, gravity=False), point)
    assert heavy.excursion / light.excursion == pytest.approx(1.0384, abs=2e-3)
    assert heavy.irregularity / light.irregularity == pytest.approx(heavy.excursion / light.excursion, abs=3e-3)
    assert (heavy.mean, heavy.largest) == (light.mean, light.largest)
    assert shaking_loads(engine, point).coefficients == pytest.approx(
        shaking_loads(replace(engine, gravity=False), point).coefficients, abs=0.0
    )
    parts = torque_parts(engine, point)
    assert abs(parts["weights"].coefficients[0]) < 1e-9


def test_an_energy_balance_over_the_cycle_holds() -> None:
    """Compare kinetic energy with the work of gas and weights (F2)."""
    problem = weighed("tractor-three", operating_points=[{"name": "p", "speed": "300 rpm", "misfire": [2]}])
    engine, point = problem.engine, problem.points[0]
    swing, plain = (swing_of(e, point, EXACT) for e in (engine, replace(engine, gravity=False)))
    angles = engine.cycle.angle * np.arange(len(swing.work)) / len(swing.work)
    energy = potential_energy(engine.slider_cranks, (*engine.pins, *engine.rotors), angles)
    assert swing.work - plain.work == pytest.approx(energy.mean() - energy, abs=1e-9)


def test_stored_work_is_affine_in_unbalances() -> None:
    """Check that with gravity a counterweight changes stored work (affine) and irregularity (P1)."""
    web = {"name": "web", "x": "0 mm", "opposite_throw": 1, "unbalance": {"between": ["0 kg m", "0.3 kg m"]}}
    changes = {
        "counterweights": [web], "objective": {"minimise": "peak to peak stored work"}, "constraints": [],
        "operating_points": [{"speed": "120 rpm"}], "gas": None,
    }  # fmt: skip
    tables = {k: v for k, v in {**tables_of(PROBLEMS / "tractor-single.toml"), **changes}.items() if v is not None}
    tables["engine"] = {**tables["engine"], "gravity": True}
    problem = load_tables(tables, Path("single.toml"))
    assert dependence(STORED_WORK, Kind.UNBALANCE, problem) is Dependence.AFFINE
    assert dependence(IRREGULARITY, Kind.UNBALANCE, problem) is Dependence.UNKNOWN
    model = AffineModel(problem)
    for weight in (0.0, 0.1, 0.3):
        exact = evaluate(problem, problem.design([weight], problem.decisions)).value(WORK)
        assert model.at(1440).terms[0][1].value(np.array([weight])) == pytest.approx(exact, rel=1e-4)
    result = laufruhe.solve(problem)
    grid = [evaluate(problem, problem.design([w], problem.decisions)).value(WORK) for w in np.linspace(0.0, 0.3, 301)]
    assert result.certificate is not None
    assert result.certificate.gap <= 1e-3
    assert result.certificate.lower_bound <= min(grid) * (1.0 + 1e-9)
    assert result.objective is not None
    assert result.objective.value == pytest.approx(min(grid), rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("inertia", ["1 kg m^2", {"between": ["0.5 kg m^2", "2 kg m^2"]}])
def test_irregularity_with_weights_is_no_matter_of_the_flywheel_alone(inertia: object) -> None:
    """A counterweight lowers it; no method that leaves counterweights out may prove it."""
    limit, objective = {"limit": "degree of irregularity", "max": 8e-4}, {"minimise": "flywheel inertia"}
    web = {"name": "web", "balance_factor": {"between": [0, 1]}}
    tables = {
        "title": "m", "flywheel": {"inertia": inertia}, "counterweights": [web],
        "engine": {"layout": "inline", "cycle": "four-stroke", "stroke": "90 mm", "rod_ratio": 0.28, "throws": [0],
                   "reciprocating_mass": "0.6 kg", "gravity": True},
        "operating_points": [{"speed": "300 rpm"}],
        **({"objective": {"minimise": "degree of irregularity"}} if isinstance(inertia, str)
           else {"objective": objective, "constraints": [limit]}),
    }  # fmt: skip
    problem = load_tables(tables, Path("single.toml"))
    result = laufruhe.solve(problem)
    assert result.objective is not None
    assert result.certificate is not None
    fixed = laufruhe.solve(load_tables({**tables, "counterweights": [{**web, "balance_factor": 0.5}]}, Path("f.toml")))
    assert fixed.objective is not None
    assert result.certificate.lower_bound <= result.objective.value < 0.95 * fixed.objective.value


@pytest.mark.parametrize(
    ("ready", "changes", "words"),
    [
        ("inline-five-open", {}, "an open crank"), ("geared-inertia", {}, "geared_inertias"),
        ("tractor-single", {"fidelity": {"crank_inertia": "2 kg m^2"}}, "crank_inertia"),
    ],
)  # fmt: skip
def test_unsupported_combinations_with_gravity_are_refused(ready: str, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        weighed(ready, **changes)
