"""Torque of the crankshaft, what a flywheel stores, and how large it has to be."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import laufruhe
from laufruhe.errors import ModelError
from laufruhe.machine import Engine
from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.torque import crank_torque, least_inertia, torque_facts, work_stored
from laufruhe.physics.uneven_speed import crank_motion
from problem_files import PROBLEMS


def case(name: str) -> tuple[Engine, laufruhe.problem.problem.OperatingPoint]:
    problem = laufruhe.load(PROBLEMS / f"{name}.toml")
    return replace(problem.engine, rotors=()), problem.points[0]


@pytest.mark.parametrize("name", ["tractor-single", "tractor-three", "tractor-four-lanchester", "vee-six-90"])
def test_the_block_feels_the_torque_of_plain_cylinders(name: str) -> None:
    """T is the roll moment (C7), by energy here and by momentum there."""
    engine, point = case(name)
    torque, wrench = crank_torque(engine, point), shaking_loads(engine, point)
    roll = wrench.each(lambda values: values[:, 3])
    size = np.abs(torque.sample(720)).max()
    assert size > 100.0
    assert np.abs(torque.sample(720) - roll.rebased(torque.base).sample(720)).max() < 1e-12 * size


def test_its_mean_is_the_work_of_the_gas() -> None:
    """Indicated work is mean pressure times swept volume, whatever the masses do (textbook eq. 25)."""
    problem = laufruhe.load(PROBLEMS / "tractor-four-lanchester.toml")
    engine, (point,) = problem.engine, problem.points
    swept = sum(part.piston_area * part.stroke for part in engine.slider_cranks)
    facts = torque_facts(engine, point)
    assert facts.mean * engine.cycle.angle == pytest.approx(point.gas.imep * swept, rel=1e-4)
    assert facts.power == pytest.approx(facts.mean * point.speed)
    without = torque_facts(engine, replace(point, gas=None))
    assert abs(without.mean) < 1e-9 * facts.largest
    assert without.irregularity is None


def test_masses_give_back_what_they_store() -> None:
    """The work of the inertia torque is the loss of kinetic energy of pistons and rods, of articulated ones as well."""
    engine, point = case("radial-seven")
    point = replace(point, gas=None)
    phi = engine.cycle.angle * np.arange(720) / 720
    energy = np.zeros(720)
    for part in engine.slider_cranks:
        motion = part.motion(np, part.shaft.ratio * phi + part.throw - part.bank)
        for mass, (_, velocity, _) in motion.points:
            energy += 0.5 * mass * np.abs(velocity) ** 2 * point.speed**2
        for inertia, (rate, _) in motion.swings:
            energy += 0.5 * inertia * rate**2 * point.speed**2
    work = crank_torque(engine, point).integral.sample(720)
    assert work - work[0] == pytest.approx(-(energy - energy[0]), abs=1e-9 * energy.max())


def test_stored_work_of_the_textbook() -> None:
    """Example 4: areas 8, -2, 0.5, -1.5 cm2 on 8 cm, their mean 0.625 cm.

    Drawn as a diagram of steps, every stroke 2 cm long, 6.75 cm2 lie above the mean. The printed 43 200 N cm
    are these at 6400 N cm a cm2; the scale itself is lost in the text.
    """
    areas, stroke = np.array([8.0, -2.0, 0.5, -1.5]), 2.0
    mean = areas.sum() / (4 * stroke)
    assert mean == pytest.approx(0.625)
    steps = 4096
    heights = np.repeat(areas / stroke, steps // 4)
    diagram = spectrum_of(heights, Fraction(1, 2))
    stored = work_stored(diagram, steps) / (4.0 * math.pi / (4 * stroke))
    assert stored == pytest.approx(8.0 - stroke * mean, rel=2e-3)
    assert 6400.0 * stored == pytest.approx(43_200.0, rel=2e-3)


@pytest.mark.parametrize("degree", [0.02, 1.0 / 200.0])
def test_least_flywheel_keeps_the_degree_and_no_smaller_one_does(degree: float) -> None:
    engine, point = case("tractor-three")
    inertia = least_inertia(engine, point, degree)
    motion = crank_motion(engine, point, Fidelity(crank_inertia=inertia))
    assert motion.unevenness == pytest.approx(degree, rel=1e-6)
    assert crank_motion(engine, point, Fidelity(crank_inertia=0.99 * inertia)).unevenness > degree
    # stored work over degree and speed squared, less what the parts store themselves, as textbooks have it
    stored = torque_facts(engine, point).excursion
    assert inertia == pytest.approx(stored / (degree * point.speed**2), rel=0.1)


def test_irregularity_is_that_of_the_motion_in_time() -> None:
    """Integrated in time with the torque and the inertia at the present angle, from one cycle into the next."""
    engine, point = case("tractor-single")
    inertia = least_inertia(engine, point, 0.03)
    fidelity = replace(EXACT, crank_inertia=inertia)
    torque = crank_torque(engine, replace(point, speed=1.0), replace(EXACT, gas=True))
    gas_only = crank_torque(engine, point), crank_torque(engine, replace(point, gas=None))
    gas = Spectrum(torque.base, (gas_only[0] + Spectrum(gas_only[1].base, -gas_only[1].coefficients)).coefficients)
    masses = crank_torque(engine, replace(point, speed=1.0, gas=None))
    mean = float(gas.coefficients[0].real)

    def reduced(angle: float) -> float:
        # work of the masses at unit speed is the loss of their J / 2
        part = engine.slider_cranks[0]
        motion = part.motion(np, np.array([angle + part.throw - part.bank]))
        mass, (_, velocity, _) = motion.points[0]
        swing, (rate, _) = motion.swings[0]
        return inertia + float(mass * np.abs(velocity[0]) ** 2 + swing * rate[0] ** 2)

    def rates(_: float, state: np.ndarray) -> list[float]:
        angle, speed = state
        here = np.array([angle])
        pull = float(gas.values(here)[0]) - mean + float(masses.values(here)[0]) * speed**2
        return [speed, pull / reduced(angle)]

    motion = crank_motion(engine, point, fidelity)
    begin = [float(motion.angle[0]), float(motion.speed[0])]
    period = engine.cycle.angle / point.speed
    found = solve_ivp(rates, (0.0, period), begin, rtol=1e-9, atol=1e-9, t_eval=np.linspace(0.0, period, 400))
    assert found.y[0, -1] - found.y[0, 0] == pytest.approx(engine.cycle.angle, rel=1e-5)
    uneven = float(np.ptp(found.y[1])) / point.speed
    assert torque_facts(engine, point, fidelity).irregularity == pytest.approx(uneven, rel=2e-3)


def test_a_flywheel_for_no_change_of_speed_is_refused() -> None:
    engine, point = case("tractor-single")
    with pytest.raises(ModelError, match="positive"):
        least_inertia(engine, point, 0.0)
