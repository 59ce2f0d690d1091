"""Loads of crank pins and main bearings: their sums, and the loads that they follow."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.extensions.bearing_loads.machine import Bearing, MainBearings, bearings_of
from laufruhe.extensions.bearing_loads.physics import (
    beam_shares,
    crank_pin_factors,
    has_bearing_loads,
    lever_shares,
    main_bearing_forces,
    pin_forces,
    piston_pin_forces,
)
from laufruhe.machine import Cycle, Engine, OperatingPoint, Rod, Rotor, Seiliger, Shaft, SliderCrank
from laufruhe.machine.kinematics import piston_acceleration, rod_acceleration
from laufruhe.numerics.exact_angles import cis
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.shaking_loads import rotor_loads, shaking_loads
from laufruhe.physics.torque import crank_torque
from one_cylinder import cylinder_pressure

FloatArray = NDArray[np.float64]
GAS = Seiliger(peak_pressure=80e5, imep=6e5)
POINT = OperatingPoint("run", 230.0, GAS)
ROD = Rod(0.2, 1.9, 0.07, 0.011)


def engine_of(seed: int) -> Engine:
    """Return a random crankshaft of throws, banks, offsets and counterweights in five bearings, with a balancer."""
    random = np.random.default_rng(seed)
    parts = []
    for k in range(4):
        throw, bank = random.uniform(0.0, math.tau), random.uniform(-0.6, 0.6)
        parts.append(
            SliderCrank(
                f"cylinder {k + 1}", 0.15 - 0.1 * k, 0.05, ROD.length, 1.1 + ROD.reciprocating_mass, throw, bank,
                random.uniform(-0.01, 0.01), ROD.rotating_mass, ROD.inertia_deficit, 0.09,
            )
        )  # fmt: skip
        parts[-1] = replace(parts[-1], firing_angle=(bank - throw + parts[-1].fires_at) % math.tau)
    rotors = [Rotor(f"web {k}", random.uniform(-0.25, 0.25), complex(*random.normal(0.0, 0.05, 2))) for k in range(3)]
    rotors.append(Rotor("balancer", 0.04, 0.02 + 0.01j, Shaft("balancer", -2.0, 0.1, -0.08)))
    bearings = tuple(Bearing(str(k), x) for k, x in enumerate((0.2, 0.1, 0.0, -0.1, -0.2)))
    return Engine("random", Cycle.FOUR_STROKE, tuple(parts), tuple(rotors), extras=(MainBearings(bearings),))


def walls_and_heads(engine: Engine, steps: int) -> FloatArray:
    """Return the wrench of pistons on walls and of gas on heads from the pin forces, shape (steps, 6)."""
    phi = engine.cycle.angle * np.arange(steps) / steps
    pins = pin_forces(engine, POINT, replace(EXACT, samples=steps)).sample(steps)
    total = np.zeros((steps, 6))
    for k, part in enumerate(engine.slider_cranks):
        axis = cmath.exp(1j * part.bank)
        arm = part.crank_radius * np.exp(1j * (phi + part.throw))
        on_pin = (pins[:, k, 2] + 1j * pins[:, k, 1] - part.rotating_mass * POINT.speed**2 * arm) / axis
        local = arm / axis - 1j * part.offset
        height = local.real + np.sqrt(part.rod_length**2 - local.imag**2) + 1j * part.offset
        pressure = cylinder_pressure(GAS, part, engine.cycle, steps)
        shift = round(part.firing_angle / engine.cycle.angle * steps)
        assert shift == pytest.approx(part.firing_angle / engine.cycle.angle * steps, abs=1e-9)
        gas = part.piston_area * np.roll(pressure - GAS.crankcase_pressure, shift)
        for place, force in ((height, -1j * on_pin.imag), (height.imag * 1j, gas + 0j)):
            place, force = place * axis, force * axis
            lateral, vertical = force.imag, force.real
            roll = place.imag * vertical - place.real * lateral
            total += np.stack([0 * roll, lateral, vertical, roll, -part.x * vertical, part.x * lateral], axis=1)
    return total


def on_grid(engine: Engine, steps: int) -> Engine:
    """Return the engine with throws and banks on a grid of its angles, at which gas is sampled."""
    grid = engine.cycle.angle / steps
    parts = []
    for part in engine.slider_cranks:
        throw, bank = (round(angle / grid) * grid for angle in (part.throw, part.bank))
        parts.append(replace(part, throw=throw, bank=bank, firing_angle=(bank - throw) % math.tau))
    return replace(engine, slider_cranks=tuple(parts))


@pytest.mark.parametrize("seed", range(3))
def test_bearings_walls_heads_and_balancers_make_the_shaking_loads(seed: int) -> None:
    """Check Newton's third law of the block for forces and moments, by independent formulas."""
    steps = 2880
    engine = on_grid(engine_of(seed), steps)
    fidelity = replace(EXACT, samples=steps)
    bearings = main_bearing_forces(engine, POINT, fidelity).sample(steps)
    _, lateral, vertical = np.moveaxis(bearings, 2, 0)
    x, none = np.array([bearing.x for bearing in bearings_of(engine)]), np.zeros(steps)
    inside = np.stack([none, lateral.sum(1), vertical.sum(1), none, -vertical @ x, lateral @ x], axis=1)
    balancer = rotor_loads(engine.rotors[-1:], POINT.speed, engine.cycle).sample(steps)
    outside = walls_and_heads(engine, steps)
    total = inside + outside + balancer
    expected = shaking_loads(engine, POINT, fidelity).sample(steps)
    # the largest force of those that cancel; a thousand terms leave up to 1e-12 of it, by the order they are added in
    size = max(np.abs(bearings).max(), np.abs(outside).max())
    assert np.abs(total - expected).max() < 3e-12 * size


@pytest.mark.parametrize("seed", range(3))
def test_pin_forces_are_those_of_newton_and_euler(seed: int) -> None:
    """Compare with rigid bodies, accelerations by differences of places, and joint forces in balance."""
    engine = engine_of(seed)
    part, speed, step = engine.slider_cranks[seed], POINT.speed, 1e-3
    phi = np.linspace(0.0, math.tau, 25)

    def bodies(angle: FloatArray) -> tuple[NDArray[np.complex128], ...]:
        pin = part.crank_radius * np.exp(1j * (angle + part.throw - part.bank))
        across = pin.imag - part.offset
        piston = pin.real + np.sqrt(part.rod_length**2 - across**2) + 1j * part.offset
        reach = piston - pin
        return pin, piston, pin + reach * ROD.centre_of_gravity / ROD.length, np.unwrap(np.angle(reach)) + 0j

    def second(values: list[NDArray[np.complex128]]) -> NDArray[np.complex128]:
        a, b, c, d, e = values
        return (-a + 16 * b - 30 * c + 16 * d - e) / (12.0 * step**2) * speed**2

    moved = [bodies(phi + k * step) for k in (-2, -1, 0, 1, 2)]
    pin, piston, middle, _ = moved[2]
    of_piston, of_rod, of_angle = (second([m[j] for m in moved]) for j in (1, 2, 3))
    found = pin_forces(engine, replace(POINT, gas=None)).values(phi)[:, seed]
    for k in range(len(phi)):
        # unknown: force of the piston on the rod (2), of the pin on the rod (2), of the wall on the piston (1)
        a, b = piston[k] - middle[k], pin[k] - middle[k]
        balance = np.array([
            [1, 0, 1, 0, 0], [0, 1, 0, 1, 0], [-a.imag, a.real, -b.imag, b.real, 0], [-1, 0, 0, 0, 0], [0, -1, 0, 0, 1],
        ])  # fmt: skip
        mass = 1.1
        right = [ROD.mass * of_rod[k].real, ROD.mass * of_rod[k].imag, ROD.inertia * of_angle[k].real,
                 mass * of_piston[k].real, mass * of_piston[k].imag]  # fmt: skip
        forces = np.linalg.solve(balance, np.array(right))
        expected = -complex(forces[2], forces[3]) * cmath.exp(1j * part.bank)
        assert found[k, 2] + 1j * found[k, 1] == pytest.approx(expected, abs=1e-6 * abs(expected) + 0.02)


def test_bearings_are_linear_in_the_unbalances_of_their_shaft() -> None:
    engine = engine_of(1)

    def forces(gains: tuple[complex, ...]) -> FloatArray:
        rotors = (replace(r, unbalance=g * r.unbalance) for r, g in zip(engine.rotors, gains, strict=True))
        return main_bearing_forces(replace(engine, rotors=tuple(rotors)), POINT).sample(64)

    none, both = forces((0, 0, 0, 0)), forces((2.0, 3.0j, 0, 0))
    assert both == pytest.approx(forces((2.0, 0, 0, 0)) + forces((0, 3.0j, 0, 0)) - none, rel=1e-11, abs=1e-8)
    # a balancer shaft has bearings of its own
    assert np.array_equal(forces((0, 0, 0, 7.0)), none)


def test_lever_rule_keeps_forces_and_moments() -> None:
    bearings, places = [0.2, -0.1, 0.05], [0.3, 0.2, 0.1, -0.03, -0.1, -0.4]
    shares = lever_shares(bearings, places)
    assert shares.sum(axis=0) == pytest.approx(1.0)
    assert np.array(bearings) @ shares == pytest.approx(places)
    between = shares[:, 1:5]
    assert between.min() >= 0.0
    assert np.count_nonzero(between, axis=0).max() <= 2


def test_turning_the_engine_turns_its_loads() -> None:
    """Check that a crank and banks rotated by an angle rotate the loads."""
    engine, angle = engine_of(2), 0.7
    parts = (replace(p, throw=p.throw + angle, bank=p.bank + angle) for p in engine.slider_cranks)
    rotors = (replace(r, unbalance=r.unbalance * cis(angle / math.tau)) for r in engine.rotors[:-1])
    one = main_bearing_forces(replace(engine, rotors=engine.rotors[:-1]), POINT).sample(90)
    two = main_bearing_forces(replace(engine, slider_cranks=tuple(parts), rotors=tuple(rotors)), POINT).sample(90)
    planes = [values[..., 2] + 1j * values[..., 1] for values in (one, two)]
    assert planes[1] == pytest.approx(planes[0] * cmath.exp(1j * angle), rel=1e-9, abs=1e-6)


def test_one_bearing_does_not_carry_a_throw() -> None:
    engine = engine_of(0)
    with pytest.raises(ModelError, match="two main bearings"):
        main_bearing_forces(engine.with_extra(MainBearings(bearings_of(engine)[:1])), POINT)


def test_uneven_speed_is_refused() -> None:
    with pytest.raises(ModelError, match="constant crank speed"):
        pin_forces(engine_of(0), POINT, Fidelity(crank_inertia=1.0))


def three_moments(bearings: FloatArray, place: float) -> FloatArray:
    """Return the reactions of a unit load in a beam by Clapeyron's equations of moments over its supports."""
    n, spans = len(bearings), np.diff(bearings)
    k = int(np.searchsorted(bearings, place)) - 1
    a = place - bearings[k]
    b = spans[k] - a
    matrix, right = np.eye(n), np.zeros(n)
    for j in range(1, n - 1):
        matrix[j, j - 1 : j + 2] = spans[j - 1], 2.0 * (spans[j - 1] + spans[j]), spans[j]
        # sagging moments; the load's own terms, of the span to the left and to the right of support j
        right[j] -= a * (spans[k] ** 2 - a**2) / spans[k] if k == j - 1 else 0.0
        right[j] -= b * (spans[k] ** 2 - b**2) / spans[k] if k == j else 0.0
    moments = np.linalg.solve(matrix, right)
    slopes = np.diff(moments) / spans
    reactions = np.concatenate([slopes, [0.0]]) - np.concatenate([[0.0], slopes])
    reactions[k] += b / spans[k]
    reactions[k + 1] += a / spans[k]
    return reactions


@pytest.mark.parametrize("count", [3, 4, 7])
def test_a_beam_shares_as_the_three_moment_equations_say(count: int) -> None:
    random = np.random.default_rng(count)
    bearings = np.cumsum(random.uniform(0.05, 0.2, count))
    places = random.uniform(bearings[0], bearings[-1], 5)
    shares = beam_shares(list(bearings), list(places))
    for k, place in enumerate(places):
        assert shares[:, k] == pytest.approx(three_moments(bearings, place), abs=1e-12)


def test_a_beam_keeps_forces_and_moments() -> None:
    """Check overhanging loads, loads at a bearing, and the lever rule on two bearings."""
    bearings, places = [0.2, -0.1, 0.05, -0.3], [0.3, 0.2, 0.1, -0.03, -0.1, -0.4]
    shares = beam_shares(bearings, places)
    assert shares.sum(axis=0) == pytest.approx(1.0)
    assert np.array(bearings) @ shares == pytest.approx(places)
    assert shares[:, 1] == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-12)
    assert beam_shares([0.0, 1.0], [0.25, 1.5]) == pytest.approx(lever_shares([0.0, 1.0], [0.25, 1.5]))
    # the textbook's beam on three supports, loaded in the middle of one span: 13/32, 11/16, -3/32
    assert beam_shares([0.0, 1.0, 2.0], [0.5])[:, 0] == pytest.approx([13 / 32, 11 / 16, -3 / 32])


def test_peaks_stand_where_heat_comes_at_once() -> None:
    """Check that the peak load at a pressure jump does not depend on the steps."""
    engine = engine_of(0)
    found = []
    for steps in (360, 720, 1440):
        pins = pin_forces(engine, POINT, replace(EXACT, samples=steps))
        values = np.concatenate([pins.sample(steps), pins.values(pins.kink_angles)])
        found.append(np.linalg.norm(values, axis=2).max(axis=0))
    # by the formula itself, close to either side of the dead centre
    part = engine.slider_cranks[1]
    top = part.dead_centres[0]
    gas = part.piston_area * (GAS.peak_pressure - GAS.crankcase_pressure)
    acceleration = part.crank_radius * piston_acceleration(np, top, part.rod_ratio, part.offset_ratio)
    along = -part.reciprocating_mass * acceleration * POINT.speed**2 - gas
    sine = part.rod_ratio * math.sin(top) - part.offset_ratio
    across = -along * sine / math.sqrt(1.0 - sine**2)
    turning = rod_acceleration(np, top, part.rod_ratio, part.offset_ratio) * POINT.speed**2
    across -= part.rod_inertia_deficit * turning / (part.rod_length * math.sqrt(1.0 - sine**2))
    pull = part.rotating_mass * part.crank_radius * POINT.speed**2 * cmath.exp(1j * top)
    assert found[1] == pytest.approx(found[2], rel=1e-6)
    assert found[0] == pytest.approx(found[2], rel=1e-4)
    assert found[2][1] >= abs(complex(along, across) + pull) * (1.0 - 1e-9)
    assert found[2][1] == pytest.approx(abs(complex(along, across) + pull), rel=0.02)


def test_piston_pins_carry_what_rods_and_walls_do() -> None:
    """Compare P + i N along the cylinders with the force of the rods on their pins."""
    engine = engine_of(4)
    phi = np.linspace(0.0, 4.0 * math.pi, 41)
    found, pins = (of(engine, POINT).values(phi) for of in (piston_pin_forces, pin_forces))
    for k, part in enumerate(engine.slider_cranks):
        pull = part.rotating_mass * part.crank_radius * POINT.speed**2 * np.exp(1j * (phi + part.throw))
        rod = (pins[:, k, 2] + 1j * pins[:, k, 1] - pull) * cmath.exp(-1j * part.bank)
        assert found[:, k, 0] + 1j * found[:, k, 1] == pytest.approx(rod, rel=1e-9, abs=1e-6)


def test_pressure_on_a_pin_is_that_of_its_rod() -> None:
    engine = engine_of(0)
    parts = tuple(replace(part, big_end=(0.05, 0.02 + 0.001 * k)) for k, part in enumerate(engine.slider_cranks))
    found = crank_pin_factors(replace(engine, slider_cranks=parts), POINT)
    assert found == pytest.approx(1.0 / (0.05 * (0.02 + 0.001 * np.arange(4))))
    with pytest.raises(ModelError, match="cylinder 1 has no big end"):
        crank_pin_factors(engine, POINT)


@pytest.mark.parametrize("seed", range(3))
def test_pins_drive_the_crank_with_its_torque(seed: int) -> None:
    """Compare the work of rod forces on the moving pins with the crank torque."""
    engine = engine_of(seed)
    phi = np.linspace(0.0, 4.0 * math.pi, 61)
    pins, torque = pin_forces(engine, POINT).values(phi), crank_torque(engine, POINT).values(phi)
    power = np.zeros(len(phi))
    for k, part in enumerate(engine.slider_cranks):
        velocity = 1j * POINT.speed * part.crank_radius * np.exp(1j * (phi + part.throw))
        power += velocity.real * pins[:, k, 2] + velocity.imag * pins[:, k, 1]
    assert power == pytest.approx(POINT.speed * torque, rel=1e-8, abs=1e-8 * np.abs(power).max())


def test_a_journal_drags_at_its_radius_and_the_speed_of_its_shaft() -> None:
    assert Bearing("b", 0.0, diameter=0.06, friction=0.004).drag == pytest.approx(0.004 * 0.03)
    half = Shaft("slow", -0.5, 0.0, 0.1)
    assert Bearing("b", 0.0, diameter=0.06, friction=0.004, shaft=half).drag == pytest.approx(0.002 * 0.03)
    with pytest.raises(ModelError, match="no friction"):
        _ = Bearing("b", 0.0, diameter=0.06).drag


@pytest.mark.parametrize("pins", [(True, True), (True, False)])
def test_loads_inside_are_known_of_bearings_and_pins(pins: tuple[bool, ...]) -> None:
    engine = Engine("", Cycle.FOUR_STROKE, (), extras=(MainBearings((Bearing("b", 0.0),)),))
    known = SimpleNamespace(slider_cranks=[SimpleNamespace(has_pin_loads=known) for known in pins], extra=engine.extra)
    assert has_bearing_loads(known) is all(pins)
    assert not has_bearing_loads(replace(engine, extras=()))
