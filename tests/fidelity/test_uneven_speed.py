"""Uneven crank speed: against a differential equation, in the limit of a large flywheel, by balances."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tractor
from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.machine import kinematics as slider_crank
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.uneven_speed import crank_motion
from one_cylinder import gas_torque

POINT = OperatingPoint("rated", tractor.SPEED, tractor.GAS)


def _engine(throws: tuple[float, ...] = (0, 180, 180, 0)) -> Engine:
    engine = tractor.engine(throws, [replace(tractor.shaft_rotor("shaft", 2.0, 0.1, 0.1), unbalance=0.01 + 0.02j)])
    parts = tuple(
        replace(part, rod_inertia_deficit=-0.003, rotating_mass=0.4, offset=0.002) for part in engine.slider_cranks
    )
    return replace(engine, slider_cranks=parts)


def test_infinite_flywheel_is_constant_speed() -> None:
    engine = _engine()
    even = shaking_loads(engine, POINT, Fidelity(samples=720)).sample(720)
    uneven = shaking_loads(engine, POINT, Fidelity(samples=720, crank_inertia=1e12)).sample(720)
    assert np.abs(uneven - even).max() <= 1e-11 * np.abs(even).max()


def test_change_falls_with_the_flywheel() -> None:
    engine = _engine()
    even = shaking_loads(engine, POINT, Fidelity(samples=360)).sample(360)
    changes = [
        np.abs(shaking_loads(engine, POINT, Fidelity(samples=360, crank_inertia=inertia)).sample(360) - even).max()
        for inertia in (10.0, 100.0, 1000.0)
    ]
    # the first correction is of first order in one over the inertia
    assert changes[0] / changes[1] == pytest.approx(10.0, rel=0.05)
    assert changes[1] / changes[2] == pytest.approx(10.0, rel=0.01)


def test_motion_solves_the_differential_equation() -> None:
    """Compare J w' + J' w^2 / 2 = torque less load, integrated from the found state, with that state."""
    engine, fidelity = _engine((0,)), Fidelity(samples=1440, crank_inertia=0.15)
    part = engine.slider_cranks[0]
    motion = crank_motion(engine, POINT, fidelity)
    grid = engine.cycle.angle * np.arange(1441) / 1440
    torque = gas_torque(tractor.GAS, part, engine.cycle, 1440)
    table = np.append(torque - torque.mean(), torque[0] - torque.mean())

    def inertia(phi: float) -> float:
        velocity = slider_crank.piston_velocity(np, phi, part.rod_ratio, part.offset_ratio) * part.crank_radius
        rate = slider_crank.rod_rate(np, phi, part.rod_ratio, part.offset_ratio)
        return 0.15 + part.reciprocating_mass * velocity**2 + part.rod_inertia_deficit * rate**2

    def slope(_: float, state: np.ndarray) -> list[float]:
        phi, speed = state
        step = 1e-5
        bent = (inertia(phi + step) - inertia(phi - step)) / (2.0 * step)
        drive = np.interp(phi % engine.cycle.angle, grid, table)
        return [speed, float((drive - 0.5 * bent * speed**2) / inertia(phi))]

    period = engine.cycle.angle / POINT.speed
    times = period * np.arange(1440) / 1440
    result = solve_ivp(
        slope,
        (0.0, period),
        [motion.angle[0], motion.speed[0]],
        t_eval=times,
        rtol=1e-9,
        atol=1e-10,
        max_step=period / 700,
    )
    assert motion.unevenness > 0.05
    assert np.abs(result.y[1] - motion.speed).max() <= 2e-5 * POINT.speed
    assert motion.angle[0] == pytest.approx(0.0, abs=1e-12)


def test_mean_speed_and_momentum() -> None:
    """Check that the mean over time is the given speed, and that no net force remains over a cycle."""
    engine, fidelity = _engine(), Fidelity(samples=720, crank_inertia=0.3)
    motion = crank_motion(engine, POINT, fidelity)
    assert motion.speed.mean() == pytest.approx(POINT.speed, rel=1e-6)
    loads = shaking_loads(engine, POINT, fidelity)
    # forces are time derivatives of a periodic momentum
    assert np.abs(loads.coefficients[0, :3]).max() <= 1e-4 * np.abs(loads.coefficients[:, :3]).max()


def test_roll_moment_has_the_mean_of_the_gas() -> None:
    engine = _engine()
    even = shaking_loads(engine, POINT, Fidelity(samples=720)).coefficients[0, 3].real
    uneven = shaking_loads(engine, POINT, Fidelity(samples=720, crank_inertia=0.5)).coefficients[0, 3].real
    assert uneven == pytest.approx(even, rel=1e-3)


@pytest.mark.parametrize("inertia", [1e-9, 1e-4])
def test_too_small_a_flywheel_is_refused(inertia: float) -> None:
    slow = replace(POINT, speed=2.0 * math.pi)
    with pytest.raises(ModelError, match="crank inertia"):
        shaking_loads(_engine((0,)), slow, Fidelity(samples=720, crank_inertia=inertia))


def test_uneven_speed_needs_exact_kinematics() -> None:
    with pytest.raises(ModelError, match="exact"):
        Fidelity("two-order", crank_inertia=1.0)
