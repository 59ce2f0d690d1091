"""Integration in time, compared with the frequency domain, and effects that only time shows."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from laufruhe.errors import ModelError
from laufruhe.machine import Block, Mount
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import elastic_mounting
from laufruhe.physics.steady_state import INTEGRATION, periodic_state
from laufruhe.physics.time_model import time_model
from mounts.powertrain import powertrain, random_mounting, wrench

RPM = np.pi / 30.0


@pytest.mark.parametrize("rpm", [120.0, 605.0, 3000.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_viscous_steady_state_is_that_of_the_frequency_domain(rpm, seed):
    mounting = random_mounting(seed, loss=0.0, damping=400.0)
    load = wrench(seed)
    steady = periodic_state(mounting, load, rpm * RPM)
    expected = mounting.forces(load, rpm * RPM).values(steady.angles)
    assert steady.mismatch < 1e-9
    assert np.abs(steady.forces - expected).max() <= 1e-6 * np.abs(expected).max()


def test_light_damping_near_resonance_too():
    mounting = powertrain(damping=20.0)
    speed = 2 * np.pi * mounting.modes.frequencies[1] * 1.001
    load = wrench(3, orders=1)
    steady = periodic_state(mounting, load, speed)
    expected = mounting.forces(load, speed).values(steady.angles)
    assert np.abs(expected).max() > 10 * np.abs(mounting.forces(load, 0.2 * speed).sample(64)).max()
    assert np.abs(steady.forces - expected).max() <= 1e-6 * np.abs(expected).max()


@pytest.mark.parametrize("tolerance", [1e-11, INTEGRATION, 1e-7])
def test_a_mean_torque_on_soft_mounts_settles(tolerance):
    """Check that the period of an idling four-cylinder closes despite rounding of the integration."""
    turned = ((3**0.5 / 2, 0.0, 0.5), (0.0, 1.0, 0.0), (-0.5, 0.0, 3**0.5 / 2))
    mounts = [
        Mount("right", (0.15, -0.3, 0.12), (40e3, 40e3, 60e3), loss_factor=0.12),
        Mount("left", (0.15, 0.3, 0.12), (40e3, 40e3, 60e3), loss_factor=0.12),
        Mount("rear", (-0.45, 0.0, -0.05), (80e3, 60e3, 40e3), turned, loss_factor=0.12),
    ]
    block = Block(180.0, ((9.0, 0.0, 0.0), (0.0, 14.0, 0.0), (0.0, 0.0, 12.0)), (-0.04, 0.0, 0.08))
    coefficients = np.zeros((37, 6), dtype=complex)
    coefficients[0, 3], coefficients[4, 2] = 39.75, 251.5
    coefficients[4::4, 3] = -149j / np.arange(1, 10) ** 2
    mounting, speed = elastic_mounting(block, mounts), 750.0 * RPM
    load = Spectrum(Fraction(1, 2), coefficients)
    steady = periodic_state(mounting, load, speed, tolerance=tolerance)
    means = mounting.forces(load, speed).coefficients[0].real
    assert steady.mismatch < 1e3 * tolerance
    assert steady.forces.mean(axis=0) == pytest.approx(means, rel=max(1e-6, 10.0 * tolerance), abs=1e-5)


def test_equal_loss_keeps_every_modes_loss_factor():
    mounting = powertrain(loss=0.12)
    model = time_model(mounting)
    rates = np.sort(np.linalg.eigvalsh(model.damping))
    assert rates == pytest.approx(np.sort(0.12 * 2 * np.pi * mounting.modes.frequencies), rel=1e-12)


def test_hysteretic_resonance_peak_is_that_of_the_frequency_domain():
    # at a natural frequency the viscous stand-in loses the same work, so one mode agrees there
    mounting = powertrain(loss=0.05)
    omega, shape = 2 * np.pi * mounting.modes.frequencies[3], mounting.modes.shapes[:, 3]
    drive = np.linalg.solve(mounting.modes.shapes.T, np.eye(6)[3]) * 100.0
    load = Spectrum(wrench().base, np.array([np.zeros(6), drive], dtype=complex))
    assert np.abs(mounting.modes.shapes.T @ drive)[3] == pytest.approx(100.0)
    steady = periodic_state(mounting, load, omega)
    expected = mounting.forces(load, omega).values(steady.angles)
    assert np.abs(steady.forces - expected).max() <= 1e-6 * np.abs(expected).max()
    assert shape.shape == (6,)


@pytest.mark.slow
def test_a_stop_that_is_never_met_changes_nothing_and_one_that_is_met_limits_travel():
    load, speed = wrench(2, orders=2), 560.0 * RPM
    free = periodic_state(powertrain(damping=300.0), load, speed)
    reach = np.abs(free.travels).max()
    far = powertrain(damping=300.0, stop_gap=2.0 * reach, stop_stiffness=5e6)
    assert np.abs(periodic_state(far, load, speed).forces - free.forces).max() <= 1e-6 * np.abs(free.forces).max()
    near = periodic_state(powertrain(damping=300.0, stop_gap=0.5 * reach, stop_stiffness=2e6), load, speed)
    assert np.abs(near.travels).max() < 0.9 * reach
    assert near.mismatch < 1e-7


def test_free_vibration_keeps_its_energy_without_damping_and_forces_balance_inertia():
    mounting = random_mounting(5, loss=0.2, damping=100.0)
    model = time_model(mounting)
    generator = np.random.default_rng(0)
    y, rate, load = generator.normal(size=(6, 1)), generator.normal(size=(6, 1)), generator.normal(size=(6, 1))
    forces = model.mount_forces(y, rate)[0]
    root = np.linalg.inv(np.linalg.cholesky(mounting.block.mass_matrix))
    pulled = root @ np.einsum("mai,ma->i", mounting.motions, forces)
    assert model.accelerations(y, rate, load)[:, 0] == pytest.approx(load[:, 0] - pulled, rel=1e-9, abs=1e-9)


def test_standstill_is_refused():
    with pytest.raises(ModelError, match="speed above zero"):
        periodic_state(powertrain(), wrench(), 0.0)
    assert elastic_mounting(powertrain().block, [replace(m, stop_gap=0.01) for m in powertrain().mounts])


def test_roll_of_the_block_follows_from_its_mount_travels():
    """Compare the roll of random motions with the turn about x that the travels of three mounts determine."""
    mounting = powertrain(damping=20.0)
    model, rng = time_model(mounting), np.random.default_rng(5)
    middle = np.array(mounting.block.centre_of_gravity)
    rows = []
    for mount in mounting.mounts:
        x, y, z = np.array(mount.position) - middle
        rows.append(np.hstack([np.eye(3), np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])]))
    for y in rng.standard_normal((4, 6)):
        own = (model.stops.rows @ y).reshape(-1, 3)
        global_axes = np.einsum("mab,ma->mb", np.array([m.orientation for m in mounting.mounts]), own)
        motion, *_ = np.linalg.lstsq(np.vstack(rows), global_axes.reshape(-1), rcond=None)
        assert model.roll @ y == pytest.approx(motion[3], rel=1e-9)
