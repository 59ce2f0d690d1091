"""Torsional response against openTorsion, and against the chain integrated in time."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import opentorsion
import pytest
from scipy.integrate import solve_ivp

import laufruhe
from laufruhe.machine import Absorber, Engine, OperatingPoint
from laufruhe.physics.torsion import natural_modes, shaft_torque, throw_torques, twist
from problem_files import PROBLEMS

DAMPER = Absorber("damper", "pulley", 0.006, damping=3.0)


@pytest.fixture(scope="module")
def damped() -> tuple[Engine, OperatingPoint]:
    """The ready five-cylinder with a viscous damper, and what springs lose left to the rings and the cylinders."""
    problem = laufruhe.load(PROBLEMS / "inline-five-torsion.toml")
    own = problem.engine.torsion
    sections = tuple(replace(section, loss_factor=0.0, damping=2.0) for section in own.sections)
    chain = replace(own, sections=sections, absorbers=(DAMPER,))
    return replace(problem.engine, torsion=chain), problem.points[0]


def assembly(engine: Engine) -> opentorsion.Assembly:
    """The same chain in openTorsion: the damper's ring last."""
    own = engine.torsion
    count = len(own.discs)
    discs = [opentorsion.Disk(k, I=d.inertia, c=d.damping) for k, d in enumerate(own.discs)]
    shafts = [opentorsion.Shaft(k, k + 1, k=s.stiffness, c=s.damping) for k, s in enumerate(own.sections)]
    for k, a in enumerate(own.absorbers, count):
        discs.append(opentorsion.Disk(k, I=a.inertia))
        shafts.append(opentorsion.Shaft(own.index(a.on), k, k=a.stiffness, c=a.damping))
    return opentorsion.Assembly(shafts, disk_elements=discs)


def test_natural_frequencies_of_open_torsion(damped: tuple[Engine, OperatingPoint]) -> None:
    engine, _ = damped
    rubber = replace(DAMPER, stiffness=4e4)
    engine = replace(engine, torsion=replace(engine.torsion, absorbers=(rubber,)))
    squares, _ = assembly(engine).undamped_modal_analysis()
    theirs = np.sort(np.sqrt(np.abs(squares)))[1:] / math.tau
    assert natural_modes(engine.torsion).frequencies == pytest.approx(theirs, rel=1e-9)


def test_forced_response_of_open_torsion(damped: tuple[Engine, OperatingPoint]) -> None:
    """Every order at once: angles from its receptance, twists of the chain from ours."""
    engine, point = damped
    torques = throw_torques(engine, point)
    count, orders = len(engine.torsion.discs), torques.orders[1:40]
    excitation = np.zeros((count + 1, len(orders)), dtype=complex)
    excitation[:count] = torques.coefficients[1:40].T
    angles, _ = assembly(engine).ss_response(excitation, orders * point.speed)
    theirs = (angles[: count - 1] - angles[1:count]).T
    assert twist(engine, point).coefficients[1:40] == pytest.approx(theirs, abs=1e-9 * np.abs(theirs).max())


@pytest.mark.slow
def test_chain_integrated_in_time(damped: tuple[Engine, OperatingPoint]) -> None:
    """Runge and Kutta over eight cycles from where the orders put it: it stays there, static twist and all."""
    engine, point = damped
    own, torques = engine.torsion, throw_torques(engine, point)
    count = len(own.discs)
    matrices = assembly(engine)
    inverse = np.linalg.inv(matrices.M)
    # few orders keep the torque smooth; the load takes the mean at the flywheel
    kept = replace(torques, coefficients=torques.coefficients[:25])
    mean = kept.coefficients[0].real.sum()

    def torque(phi: float) -> np.ndarray:
        out = np.zeros(count + 1)
        out[:count] = (kept.coefficients * np.exp(1j * kept.orders * phi)[:, None]).real.sum(axis=0)
        out[count - 1] -= mean
        return out

    def slope(t: float, state: np.ndarray) -> np.ndarray:
        angle, rate = np.split(state, 2)
        return np.concatenate([rate, inverse @ (torque(point.speed * t) - matrices.K @ angle - matrices.C @ rate)])

    period = engine.cycle.angle / point.speed
    times = period * (24.0 + np.arange(180) / 180.0)
    run = solve_ivp(slope, (0.0, 25.0 * period), np.zeros(2 * (count + 1)), "DOP853", times, rtol=1e-8, atol=1e-11)
    theirs = (run.y[: count - 1] - run.y[1:count]).T
    whole = twist(engine, point)
    ours = replace(whole, coefficients=whole.coefficients[:25]).sample(180)
    assert np.abs(ours - theirs).max() < 2e-4 * np.abs(ours).max()
    assert np.abs(shaft_torque(engine, point).coefficients[0].real).max() > 10.0
