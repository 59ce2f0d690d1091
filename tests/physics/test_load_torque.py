"""Torque of the driven machine over the crank angle: irregularity, stored work, motion, and all models of loads."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from laufruhe.extensions.flywheel.torque import swing_of, torque_facts, torque_parts
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.load_models.affine import AffineModel
from laufruhe.machine import LoadTorque
from laufruhe.numerics.norms import NORMS
from laufruhe.physics.fidelity import EXACT
from laufruhe.physics.geared_inertia import geared_factor
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.speed_map import split_loads
from laufruhe.physics.torque import crank_torque, excess_torque
from laufruhe.physics.uneven_speed import crank_motion, moving_inertia
from laufruhe.problem.channels import STORED_WORK
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from problem_files import PROBLEMS

DEGREES = np.arange(0.0, 720.0, 1.0)
WAVES = ((0.5, 25.0, 1.1), (1.0, -40.0, 0.3), (2.0, 60.0, 2.0), (6.0, 8.0, 0.7))
WORK = Measure(STORED_WORK, NORMS["peak to peak"])


def torque_at(angles: np.ndarray) -> np.ndarray:
    return 130.0 + sum(size * np.cos(order * angles - phase) for order, size, phase in WAVES)


def load(times: float = 1.0) -> LoadTorque:
    angles = np.radians(DEGREES)
    return LoadTorque(tuple(angles.tolist()), tuple((times * torque_at(angles)).tolist()))


def problem_of(name: str, times: float = 1.0, **changes: Any) -> Problem:
    problem = load_tables({**tables_of(PROBLEMS / f"{name}.toml"), **changes}, PROBLEMS / f"{name}.toml")
    period = problem.engine.cycle.angle
    turned = load(times)
    if period < 12.0:
        turned = replace(turned, angles=turned.angles[:360], torques=turned.torques[:360])
    return replace(problem, engine=replace(problem.engine, load_torque=turned))


@pytest.mark.parametrize("states", [{}, {"misfire": [1]}])
def test_a_time_integration_has_the_same_irregularity(states: dict[str, Any]) -> None:
    """J w' = T_gas - T_load - w^2 dJ/dphi / 2, integrated over the angle without any spectrum (T12)."""
    point = {"speed": "900 rpm", **states}
    problem = problem_of("tractor-three", operating_points=[{"name": "p", **point}], flywheel={"inertia": "1.2 kg m^2"})
    engine, (at,) = problem.engine, problem.points
    torque = crank_torque(replace(engine, load_torque=None), at)
    still = crank_torque(engine, replace(at, gas=None))
    mean = float(torque.coefficients[0].real)

    def slope(angle: float, square: np.ndarray) -> list[float]:
        here = np.array([angle])
        inertia, steep = moving_inertia(engine, EXACT, here)
        pull = float((torque.values(here) - still.values(here))[0]) - mean
        pull -= float(torque_at(here)[0]) - 130.0
        return [2.0 * (pull - 0.5 * steep[0] * square[0]) / (1.2 + inertia[0])]

    swing = swing_of(engine, at, EXACT)
    speeds = swing.speeds(1.2)
    result = solve_ivp(
        slope, (0.0, engine.cycle.angle), [speeds[0] ** 2], rtol=1e-8, atol=1e-6, max_step=0.05,
        t_eval=np.linspace(0.0, engine.cycle.angle, 720, endpoint=False),
    )  # fmt: skip
    integrated = np.sqrt(result.y[0])
    assert 1.0 / np.mean(1.0 / integrated) == pytest.approx(at.speed, rel=1e-4)
    degree = np.ptp(integrated) / at.speed
    assert swing.irregularity(1.2) == pytest.approx(degree, rel=1e-3)
    plain = swing_of(replace(engine, load_torque=None), at, EXACT).irregularity(1.2)
    assert abs(degree - plain) > 0.02 * plain


def test_a_load_that_takes_the_torque_of_the_engine_leaves_no_irregularity() -> None:
    problem = problem_of("tractor-single", flywheel={"inertia": "0.5 kg m^2"})
    engine, point = problem.engine, problem.points[0]
    fine = np.radians(np.arange(0.0, 720.0, 0.25))
    torque = crank_torque(engine, point).values(fine)
    plain = torque_facts(replace(engine, load_torque=None), point)
    even = torque_facts(replace(engine, load_torque=LoadTorque(tuple(fine.tolist()), tuple(torque.tolist()))), point)
    assert plain.irregularity > 0.02
    assert even.irregularity < 1e-3 * plain.irregularity
    assert even.excursion < 1e-3 * plain.excursion
    assert (even.mean, even.largest) == (plain.mean, plain.largest)


def test_the_mean_of_the_file_does_not_count() -> None:
    problem = problem_of("tractor-three")
    engine, point = problem.engine, problem.points[0]
    raised = LoadTorque(engine.load_torque.angles, tuple(t + 50.0 for t in engine.load_torque.torques))
    torques = [excess_torque(e, point).sample(720) for e in (engine, replace(engine, load_torque=raised))]
    assert torques[0] == pytest.approx(torques[1], abs=1e-9)
    parts = torque_parts(engine, point)
    assert parts["load"].coefficients[0] == parts["all"].coefficients[0]
    angles = np.radians(DEGREES)
    alternating = torque_at(angles) - 130.0 + parts["all"].coefficients[0].real
    assert parts["load"].values(angles) == pytest.approx(alternating, abs=0.01)


def test_an_uneven_crank_follows_the_load() -> None:
    """The kinetic energy changes by the work of the gas less that of the load (F2)."""
    problem = problem_of("tractor-three")
    engine, point = replace(problem.engine, rotors=()), problem.points[0]
    fidelity = replace(EXACT, crank_inertia=1.5)
    motion = crank_motion(engine, point, fidelity)
    energy = 0.5 * (1.5 + moving_inertia(engine, fidelity, motion.angle)[0]) * motion.speed**2
    gas = crank_torque(engine, point) + crank_torque(engine, replace(point, gas=None)).mapped(np.negative)
    waves = sum(s / o * np.sin(o * motion.angle - p) for o, s, p in WAVES)
    work = gas.integral.values(motion.angle) - waves
    assert energy - energy.mean() == pytest.approx(work - work.mean(), abs=2e-3 * np.ptp(energy))


def test_geared_inertia_takes_its_share_of_the_load() -> None:
    """Check L8: the second shaft takes its share of the load; gas and load are independent of speed."""
    problem = problem_of("geared-inertia", geared_inertias=[{"name": "second", "ratio": -1.0, "share": 0.3}])
    engine, point = problem.engine, problem.points[0]
    moved = shaking_loads(engine, point)
    plain = shaking_loads(replace(engine, load_torque=None), point)
    angles = np.radians(DEGREES)
    roll = (moved.values(angles) - plain.values(angles))[:, 3]
    alternating = sum(s * np.cos(o * angles - p) for o, s, p in WAVES if engine.cycle.turns == 2 or o >= 1.0)
    assert geared_factor(engine) != 0.0
    assert roll == pytest.approx(-geared_factor(engine) * alternating, abs=0.05)
    inertia, constant = split_loads(engine, point)
    total = point.speed**2 * inertia.values(angles) + constant.values(angles)
    assert total == pytest.approx(moved.values(angles), abs=1e-9 * np.abs(total).max())


def test_columns_of_pistons_leave_the_load_to_the_rest() -> None:
    """Rows V0 + B x at any mass are those of the evaluated engine (P1)."""
    piston = {"between": ["1 kg", "3 kg"], "start": "2 kg"}
    tables = tables_of(PROBLEMS / "tractor-three.toml")
    engine = {**tables["engine"], "reciprocating_mass": piston}
    objective = {"minimise": "peak to peak stored work"}
    problem = problem_of(
        "tractor-three", engine=engine, objective=objective, constraints=[], counterweights=[], balancer_shafts=[]
    )
    model, x = AffineModel(problem), np.array([2.6])
    value = evaluate(problem, problem.design(x.tolist(), problem.unbalances))
    rows = model.at(1440).terms[0][1].value(x)
    assert rows == pytest.approx(value.value(problem.objective[0].measure), rel=1e-3)
