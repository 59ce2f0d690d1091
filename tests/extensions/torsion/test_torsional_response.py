"""Torsional response, compared with openTorsion and with integration in time."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import opentorsion
import pytest
from scipy.integrate import solve_ivp

import laufruhe
from laufruhe.extensions.torsion.machine import Absorber
from laufruhe.extensions.torsion.physics import chain_of, natural_modes, shaft_torque, throw_torques, twist
from laufruhe.machine import Engine, OperatingPoint
from problem_files import PROBLEMS

DAMPER = Absorber("damper", "pulley", 0.006, damping=3.0)


@pytest.fixture(scope="module")
def damped() -> tuple[Engine, OperatingPoint]:
    """Return the ready five-cylinder engine with a viscous damper, without losses of springs."""
    problem = laufruhe.load(PROBLEMS / "inline-five-torsion.toml")
    own = chain_of(problem.engine)
    sections = tuple(replace(section, loss_factor=0.0, damping=2.0) for section in own.sections)
    chain = replace(own, sections=sections, absorbers=(DAMPER,))
    return problem.engine.with_extra(chain), problem.points[0]


def assembly(engine: Engine) -> opentorsion.Assembly:
    """Return the same chain in openTorsion, with the damper's ring last."""
    own = chain_of(engine)
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
    engine = engine.with_extra(replace(chain_of(engine), absorbers=(rubber,)))
    squares, _ = assembly(engine).undamped_modal_analysis()
    theirs = np.sort(np.sqrt(np.abs(squares)))[1:] / math.tau
    assert natural_modes(chain_of(engine)).frequencies == pytest.approx(theirs, rel=1e-9)


def test_forced_response_of_open_torsion(damped: tuple[Engine, OperatingPoint]) -> None:
    """Compare the twist of orders 1 to 39 with the forced response of OpenTorsion."""
    engine, point = damped
    torques = throw_torques(engine, point)
    count, orders = len(chain_of(engine).discs), torques.orders[1:40]
    excitation = np.zeros((count + 1, len(orders)), dtype=complex)
    excitation[:count] = torques.coefficients[1:40].T
    angles, _ = assembly(engine).ss_response(excitation, orders * point.speed)
    theirs = (angles[: count - 1] - angles[1:count]).T
    assert twist(engine, point).coefficients[1:40] == pytest.approx(theirs, abs=1e-9 * np.abs(theirs).max())


@pytest.mark.slow
def test_chain_integrated_in_time(damped: tuple[Engine, OperatingPoint]) -> None:
    """Compare orders and static twist with Runge-Kutta integration until the start has decayed."""
    engine, point = damped
    own, torques = chain_of(engine), throw_torques(engine, point)
    count = len(own.discs)
    matrices = assembly(engine)
    inverse, none, one = np.linalg.inv(matrices.M), np.zeros((count + 1, count + 1)), np.eye(count + 1)
    free = np.block([[none, one], [-inverse @ matrices.K, -inverse @ matrices.C]])
    # few orders keep the torque smooth; the load takes the mean at the flywheel
    truncated = replace(torques, coefficients=torques.coefficients[:25])
    torque = np.zeros((count + 1, len(truncated.coefficients)), dtype=complex)
    torque[:count] = truncated.coefficients.T
    torque[count - 1, 0] -= truncated.coefficients[0].real.sum()
    driven, rates = np.concatenate([0.0 * torque, inverse @ torque]), 1j * point.speed * truncated.orders

    def slope(t: float, state: np.ndarray) -> np.ndarray:
        return free @ state + (driven @ np.exp(rates * t)).real

    period = engine.cycle.angle / point.speed
    times = period * (24.0 + np.arange(180) / 180.0)
    run = solve_ivp(slope, (0.0, 25.0 * period), np.zeros(2 * (count + 1)), "DOP853", times, rtol=1e-7, atol=1e-10)
    theirs = (run.y[: count - 1] - run.y[1:count]).T
    whole = twist(engine, point)
    ours = replace(whole, coefficients=whole.coefficients[:25]).sample(180)
    assert np.abs(ours - theirs).max() < 2e-4 * np.abs(ours).max()
    assert np.abs(shaft_torque(engine, point).coefficients[0].real).max() > 10.0
