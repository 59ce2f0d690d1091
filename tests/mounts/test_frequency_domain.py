"""Modes, response and mount forces of a block on its mounts (E1-E12)."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from laufruhe.errors import ModelError, UncarriedLoadError
from laufruhe.machine import Block, Mount, Seiliger
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import ElasticMounting, ResonanceError, elastic_mounting, single_transmissibility
from laufruhe.physics.modes import (
    free_motion,
    sag_for_critical_speed,
    sag_frequency,
    static_motion,
    torque_roll_axis,
    weight_wrench,
)
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.physics.mount_numbers import torque_roll_coupling
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.speed_map import speed_map, split_loads
from laufruhe.problem.channels import mounting_in
from mounts.files import BLOCK as BLOCK_TABLE
from mounts.files import ENGINE, MOUNTS, SAG, problem_of
from mounts.powertrain import BLOCK, powertrain, random_mounting, wrench

FREQUENCIES = (7.50256052, 8.63234374, 10.05518987, 11.68909221, 20.44918424, 26.45129889)
ENERGY = np.array(
    [
        [99.402, 0.045, 0.060, 0.140, 0.342, 0.011],
        [0.032, 98.213, 0.439, 1.259, 0.014, 0.041],
        [0.006, 1.112, 29.855, 49.360, 3.881, 15.786],
        [0.001, 0.549, 10.878, 7.609, 2.126, 78.837],
        [0.066, 0.000, 21.636, 7.921, 65.536, 4.841],
        [0.492, 0.081, 37.131, 33.711, 28.100, 0.485],
    ]
)
RPM = np.pi / 30.0
CUBE = Block(100.0, ((4.0, 0.0, 0.0), (0.0, 5.0, 0.0), (0.0, 0.0, 6.0)))


def motion(mounting: ElasticMounting, wrench: Spectrum, speed: float) -> Spectrum:
    """Return the motion (u, theta) of the centre of gravity, shape (n, 6) [m, rad]."""
    amplitudes = mounting.responses(wrench.orders * speed, wrench.coefficients)
    return Spectrum(wrench.base, amplitudes @ mounting.modes.shapes.T)


def four(loss: float = 0.1, stiffness=(1e5, 1e5, 4e5), block: Block = CUBE, **more):
    """Return the four mounts in a plane through the centre of gravity, symmetric both ways."""
    places = [(x, y, 0.0) for x in (0.3, -0.3) for y in (0.2, -0.2)]
    return elastic_mounting(
        block, [Mount(f"m{k}", p, stiffness, loss_factor=loss, **more) for k, p in enumerate(places)]
    )


def lift(orders=(2,), size: float = 100.0) -> Spectrum:
    values = np.zeros((max(orders) + 1, 6), dtype=complex)
    values[list(orders), 2] = size
    return Spectrum(Fraction(1), values)


# published values


def test_published_frequencies_to_all_digits():
    assert powertrain().modes.frequencies == pytest.approx(FREQUENCIES, abs=5e-9)


def test_published_energy_shares_to_all_digits():
    assert 100.0 * powertrain().modes.energy == pytest.approx(ENERGY, abs=5.001e-4)


def test_sag_of_the_study():
    # eq. 41, Fig. 32: critical speed 400 rpm
    assert sag_for_critical_speed(400.0 * RPM, 1) == pytest.approx(5.6e-3, abs=0.05e-3)
    assert sag_for_critical_speed(400.0 * RPM, 2) == pytest.approx(1.4e-3, abs=0.05e-3)
    assert sag_frequency(sag_for_critical_speed(400.0 * RPM, 2)) == pytest.approx(40.0 / 3.0)
    mounting = four()
    sag = -static_motion(mounting.modes, weight_wrench(CUBE))[2]
    bounce = mounting.modes.frequencies[mounting.modes.names.index("bounce")]
    assert sag_frequency(sag) == pytest.approx(bounce, rel=1e-12)


@pytest.mark.parametrize("loss", [0.0, 0.05, 0.3, 1.0])
@pytest.mark.parametrize("damping", [0.0, 0.1, 0.5])
def test_isolation_begins_at_root_two_for_any_damping(loss, damping):
    if loss == damping == 0.0:
        loss = 1e-3
    root = np.sqrt(2.0)
    assert single_transmissibility(root, loss, damping) == pytest.approx(1.0, abs=1e-12)
    assert (
        single_transmissibility(root * 1.01, loss, damping) < 1.0 < single_transmissibility(root / 1.01, loss, damping)
    )


@pytest.mark.parametrize("ratio", [0.3, 1.0, 1.4, 3.0, 8.0])
def test_pure_bounce_is_the_single_mass_of_figure_31(ratio):
    mounting = four(loss=0.2)
    critical = 2 * np.pi * mounting.modes.frequencies[mounting.modes.names.index("bounce")] / 2
    forces = mounting.forces(lift(), ratio * critical).at(2)[:, 2]
    assert abs(forces.sum()) / 100.0 == pytest.approx(float(single_transmissibility(ratio, 0.2)), rel=1e-10)


# limits and identities


def test_stiff_mounts_become_rigid_ones():
    load, errors = wrench(1), []
    for stiffer in (1e5, 1e7, 1e9):
        elastic = powertrain(stiffer=stiffer)
        rigid = rigid_mounting(tuple(replace(m, position=m.position) for m in elastic.mounts)).forces(load).coefficients
        result = elastic.forces(load, 1500 * RPM).coefficients
        errors.append(np.abs(result - rigid).max() / np.abs(rigid).max())
    assert errors[2] < 1e-6
    # the distance is that of (W / w)^2
    assert errors[0] / errors[1] == pytest.approx(100.0, rel=0.1)


@given(st.integers(0, 10_000), st.floats(20.0, 4000.0), st.integers(1, 8))
def test_reciprocity(seed, rpm, count):
    """A force here moves a point there as much as the same force there moves the point here."""
    mounting = random_mounting(seed, count)
    generator = np.random.default_rng(seed)
    a, b = (np.array([np.zeros(6), generator.normal(size=6)], dtype=complex) for _ in range(2))
    centre = np.array(mounting.block.centre_of_gravity)

    def displacement(load):
        q = motion(mounting, Spectrum(Fraction(1), load), rpm * RPM).coefficients[1]
        # about the origin, as the wrench is
        return np.concatenate([q[:3] + np.cross(q[3:], -centre), q[3:]])

    there, here = displacement(a) @ b[1], displacement(b) @ a[1]
    size = np.abs(displacement(a)).max() * np.abs(b[1]).max()
    assert abs(there - here) <= 1e-9 * max(size, abs(there))


@given(st.integers(0, 10_000), st.floats(20.0, 4000.0))
def test_work_done_is_lost_in_the_mounts(seed, rpm):
    mounting, load = random_mounting(seed), wrench(seed, orders=3)
    speed = rpm * RPM
    q, travel = motion(mounting, load, speed).coefficients, mounting.travel(load, speed).coefficients
    centre = np.array(mounting.block.centre_of_gravity)
    for h in range(1, 4):
        w, omega = load.coefficients[h], h * speed
        at_origin = np.concatenate([q[h, :3] + np.cross(q[h, 3:], -centre), q[h, 3:]])
        put_in = 0.5 * omega * np.imag(np.vdot(at_origin, w))
        lost = 0.0
        for u, loss, damper in zip(travel[h], mounting.losses, mounting.dampers, strict=True):
            lost += 0.5 * omega * np.real(np.vdot(u, (loss + omega * damper) @ u))
        assert put_in == pytest.approx(lost, rel=1e-8)


@given(st.integers(0, 10_000), st.floats(20.0, 4000.0))
def test_forces_and_inertia_balance_the_load(seed, rpm):
    mounting, load, speed = random_mounting(seed), wrench(seed), rpm * RPM
    forces = mounting.forces(load, speed).coefficients
    omega = load.orders * speed
    inertia = -(omega[:, None] ** 2) * (motion(mounting, load, speed).coefficients @ mounting.block.mass_matrix)
    pulled = np.einsum("mai,nma->ni", mounting.motions, forces)
    centre = np.array(mounting.block.centre_of_gravity)
    about = load.coefficients.copy()
    about[:, 3:] -= np.cross(centre, about[:, :3])
    assert np.abs(pulled + inertia - about).max() <= 1e-9 * np.abs(about).max()


def test_response_is_linear_in_the_load():
    mounting = random_mounting(3)
    a, b = wrench(1), wrench(2)
    both = mounting.forces(a + b, 90.0).coefficients
    assert both == pytest.approx((mounting.forces(a, 90.0) + mounting.forces(b, 90.0)).coefficients, rel=1e-10)


def test_modal_route_agrees_with_the_plain_system():
    mounting, load, speed = random_mounting(8), wrench(8), 130.0
    centre = np.array(mounting.block.centre_of_gravity)
    for h in range(1, 5):
        omega, w = h * speed, load.coefficients[h].copy()
        w[3:] -= np.cross(centre, w[:3])
        loss, damping = mounting.total(mounting.losses), mounting.total(mounting.dampers)
        system = mounting.stiffness + 1j * loss + 1j * omega * damping - omega**2 * mounting.block.mass_matrix
        assert motion(mounting, load, speed).coefficients[h] == pytest.approx(np.linalg.solve(system, w), rel=1e-9)


def test_free_modes_that_damping_couples_follow_the_plain_system():
    """The mounts hold upwards alone, so the block may slide and turn; no steady load asks it to."""
    places = [(x, y, 0.05) for x in (0.3, -0.3) for y in (0.2, -0.2)]
    loss = (0.3, 0.0, 0.0, 0.0)
    mounts = [Mount(f"m{k}", p, (0.0, 0.0, 2e5), loss_factor=loss[k]) for k, p in enumerate(places)]
    mounting, speed = elastic_mounting(CUBE, mounts), 60.0
    assert mounting.modes.free.sum() == 3
    values = wrench(5).coefficients
    values[0] = [0.0, 0.0, 400.0, 0.0, 0.0, 0.0]
    result = motion(mounting, Spectrum(Fraction(1), values), speed).coefficients
    assert np.linalg.lstsq(mounting.stiffness, values[0].real)[0] == pytest.approx(result[0], abs=1e-15)
    for h in range(1, 5):
        system = mounting.stiffness + 1j * mounting.total(mounting.losses) - (h * speed) ** 2 * CUBE.mass_matrix
        assert result[h] == pytest.approx(np.linalg.solve(system, values[h]), rel=1e-9)


def test_ever_smaller_loads_move_in_proportion():
    mounting, speeds = random_mounting(4), np.array([60.0, 150.0])
    whole = speed_map(mounting, wrench(4), wrench(5), speeds)
    loads = [replace(load, coefficients=1e-20 * load.coefficients) for load in (wrench(4), wrench(5))]
    little = speed_map(mounting, *loads, speeds)
    assert 1e20 * little.forces == pytest.approx(whole.forces, rel=1e-9)


# orders that a scene excites


def test_symmetric_scene_excites_bounce_alone_and_computes_no_more():
    mounting = four()
    excited = mounting.excited(lift())
    assert [mounting.modes.names[j] for j in excited] == ["bounce"]
    shifted = four(block=replace(CUBE, centre_of_gravity=(0.02, 0.0, 0.0)))
    assert sorted(shifted.modes.names[j] for j in shifted.excited(lift())) == ["bounce", "pitch"]


def test_damping_that_couples_modes_excites_more():
    base = four(loss=0.0)
    uneven = elastic_mounting(CUBE, [replace(m, loss_factor=0.3 * (k == 0)) for k, m in enumerate(base.mounts)])
    assert len(base.excited(lift())) == 1
    assert len(uneven.excited(lift())) > 1


def test_omitted_orders_have_no_response():
    mounting, load = four(), lift((1, 2, 4))
    amplitudes = mounting.responses(load.orders * 80.0, load.coefficients)
    excited = mounting.excited(load)
    assert not np.any(np.delete(amplitudes, excited, axis=1))
    assert np.all(mounting.forces(load, 80.0).coefficients[3] == 0.0)


# torque-roll axis


def test_torque_roll_axis_is_where_a_free_block_turns():
    axis = torque_roll_axis(BLOCK)
    start = np.linalg.solve(BLOCK.tensor, [1.0, 0.0, 0.0])
    assert abs(axis[0]) < 0.999
    assert axis == pytest.approx(start / np.linalg.norm(start))


def test_coupling_is_zero_where_the_axis_is_a_mode_and_not_elsewhere():
    assert torque_roll_coupling(four()) == pytest.approx(0.0, abs=1e-12)
    assert torque_roll_coupling(powertrain()) > 0.3


# extremes


def test_driven_at_an_undamped_resonance_is_refused_and_next_to_it_finite():
    mounting = four(loss=0.0)
    speed = 2 * np.pi * mounting.modes.frequencies[mounting.modes.names.index("bounce")] / 2
    with pytest.raises(ResonanceError, match=r"bounce mode at .* Hz is driven at its own frequency"):
        mounting.forces(lift(), speed)
    for off in (1e-6, 1e-4):
        force = abs(mounting.forces(lift(), speed * (1 + off)).at(2)[:, 2].sum())
        assert force == pytest.approx(100.0 / abs(1 - (1 + off) ** 2), rel=1e-5)
    # not driven there, nothing is wrong
    assert np.all(np.isfinite(mounting.forces(lift((1, 3)), speed).coefficients))


def test_any_damping_makes_the_resonance_finite():
    for more in ({"loss": 1e-4}, {"loss": 0.0, "damping": (1.0, 1.0, 1.0)}):
        mounting = four(**more)
        speed = 2 * np.pi * mounting.modes.frequencies[mounting.modes.names.index("bounce")] / 2
        force = abs(mounting.forces(lift(), speed).at(2)[:, 2].sum())
        assert 1e4 < force < 2e6


def test_stiffness_ratios_of_a_thousand_million():
    """Check the pitch frequency of a block that turns about a very stiff mount as about a hinge."""
    hinge = Mount("hinge", (0.3, 0.0, 0.0), (1e14, 1e14, 1e14))
    soft = Mount("soft", (-0.3, 0.0, 0.0), (0.0, 0.0, 1e5))
    sides = [Mount(f"side{k}", (0.3, y, 0.0), (0.0, 0.0, 1e5)) for k, y in enumerate((0.2, -0.2))]
    keep = Mount("keep", (-0.3, 0.0, 0.0), (0.0, 1e5, 0.0))
    mounting = elastic_mounting(CUBE, [hinge, soft, *sides, keep])
    about = CUBE.inertia[1][1] + CUBE.mass * 0.3**2
    expected = np.sqrt(1e5 * 0.6**2 / about) / (2 * np.pi)
    pitch = min(mounting.modes.frequencies, key=lambda f: abs(f - expected))
    assert pitch == pytest.approx(expected, rel=1e-5)
    assert np.all(np.isfinite(mounting.forces(wrench(), 100.0).coefficients))


def test_one_mount_leaves_three_motions_free_and_says_which():
    mounting = elastic_mounting(CUBE, [Mount("only", (0.0, 0.0, 0.0), (1e5, 1e5, 1e5), loss_factor=0.1)])
    assert mounting.modes.free.sum() == 3
    assert free_motion(mounting.modes) == "roll and pitch and yaw"
    assert np.all(np.isfinite(mounting.forces(wrench(), 100.0).coefficients))
    steady = Spectrum(Fraction(1), np.array([[0, 0, 0, 50.0, 0, 0]], dtype=complex))
    with pytest.raises(UncarriedLoadError, match="steady load drives the block in roll"):
        mounting.forces(steady, 100.0)


@pytest.mark.parametrize("count", [2, 40])
def test_two_and_forty_mounts(count):
    mounting = random_mounting(1, count)
    assert np.all(np.isfinite(mounting.forces(wrench(), 50.0).coefficients))
    assert np.all(np.diff(mounting.modes.frequencies) >= 0)


def test_coincident_mounts_add_up_and_collinear_ones_leave_turning_free():
    one, half = (
        elastic_mounting(CUBE, [Mount(f"m{k}", (x, 0.1, 0.0), (s, s, s)) for k, x in enumerate(places)])
        for s, places in ((2e5, (0.3, -0.3)), (1e5, (0.3, 0.3, -0.3, -0.3)))
    )
    assert one.modes.frequencies == pytest.approx(half.modes.frequencies, rel=1e-9, abs=1e-6)
    assert one.modes.free.sum() == 1
    assert free_motion(one.modes) == "roll"


@pytest.mark.parametrize("mass", [1e-3, 1e6])
def test_a_gram_and_a_thousand_tonnes(mass):
    scale = mass / CUBE.mass
    block = Block(mass, tuple(tuple(scale * v for v in row) for row in CUBE.inertia))
    mounting = four(block=block, stiffness=tuple(scale * k for k in (1e5, 1e5, 4e5)))
    assert mounting.modes.frequencies == pytest.approx(four().modes.frequencies, rel=1e-12)
    load = lift()
    assert mounting.forces(load, 70.0).coefficients == pytest.approx(four().forces(load, 70.0).coefficients, rel=1e-10)


def test_hardly_any_inertia_about_one_axis_costs_no_digits_of_the_others():
    thin = Block(100.0, ((5e-9, 0.0, 0.0), (0.0, 5.0, 0.0), (0.0, 0.0, 5.0)))
    mounting = four(block=thin)
    expected = np.sqrt(4e5 * 4 / 100.0) / (2 * np.pi)
    assert np.min(np.abs(mounting.modes.frequencies - expected)) <= 1e-6 * expected
    assert abs(mounting.forces(lift(), 100.0).at(2)[:, 2].sum()) == pytest.approx(
        abs(four().forces(lift(), 100.0).at(2)[:, 2].sum()), rel=1e-6
    )


def test_speed_towards_zero_is_the_static_answer():
    mounting, load = powertrain(loss=0.0), wrench()
    rigid = rigid_mounting(mounting.mounts).forces(load).coefficients
    assert mounting.forces(load, 1e-9).coefficients == pytest.approx(rigid, rel=1e-9, abs=1e-9)
    assert mounting.forces(load, 0.0).coefficients == pytest.approx(rigid, rel=1e-9, abs=1e-9)


# bad input


def test_blocks_and_mounts_that_cannot_be_are_refused():
    with pytest.raises(ModelError, match="mass"):
        Block(0.0, CUBE.inertia)
    with pytest.raises(ModelError, match="principal moment"):
        Block(1.0, ((1.0, 2.0, 0.0), (2.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    with pytest.raises(ModelError, match="belong to no body"):
        Block(1.0, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 3.0)))
    with pytest.raises(ModelError, match="not symmetric"):
        Block(1.0, ((1.0, 0.1, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    with pytest.raises(ModelError, match="negative stiffness"):
        Mount("bad", (0.0, 0.0, 0.0), (-1.0, 1.0, 1.0))
    with pytest.raises(ModelError, match="negative loss factor"):
        Mount("bad", (0.0, 0.0, 0.0), loss_factor=-0.1)
    with pytest.raises(ModelError, match="no mount has a stiffness"):
        elastic_mounting(CUBE, [Mount("none", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))])


# many speeds at once


def test_a_map_of_speeds_is_the_single_calls_side_by_side(tmp_path):
    problem = problem_of(tmp_path, ENGINE, BLOCK_TABLE, MOUNTS, SAG)
    engine, point = problem.engine, problem.points[0]
    gas = Seiliger(80e5, 5.5e5)
    engine = replace(engine, slider_cranks=tuple(replace(c, bore=0.1) for c in engine.slider_cranks))
    loaded = replace(point, gas=gas)
    mounting = mounting_in(engine)
    speeds = np.array([40.0, 111.0, 260.0])
    field = speed_map(mounting, *split_loads(engine, loaded), speeds)
    for k, speed in enumerate(speeds):
        load = shaking_loads(engine, replace(loaded, speed=speed))
        forces, firm = mounting.forces(load, speed), rigid_mounting(engine.mounts).forces(load)
        size = np.abs(forces.coefficients).max()
        for j, order in enumerate(field.orders):
            assert np.abs(field.forces[k, j] - forces.at(order)).max() <= 1e-10 * size
            assert np.abs(field.firm[k, j] - firm.at(order)).max() <= 1e-10 * np.abs(firm.coefficients).max()
        left = [j for j, order in enumerate(forces.orders) if not np.any(np.isclose(field.orders, order))]
        assert np.abs(forces.coefficients[left]).max(initial=0.0) <= 1e-6 * size
        whole = np.linalg.norm(forces.coefficients[1:]) / np.linalg.norm(firm.coefficients[1:])
        dynamic = field.orders > 0.0
        over, under = (np.linalg.norm(values[k, dynamic]) for values in (field.forces, field.firm))
        assert over / under == pytest.approx(whole, rel=1e-6)
