"""Swinging yoke: loads from places of its masses, orders in closed form, and mechanisms that cannot turn."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import laufruhe
from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.chambers.gas import Chamber, Chambers, Pump
from laufruhe.extensions.flywheel.torque import torque_facts
from laufruhe.extensions.swinging_yoke.mechanism import SwingingYoke
from laufruhe.machine import Cycle, Engine, OperatingPoint, Shaft
from laufruhe.machine.rotor import CRANKSHAFT
from laufruhe.machine.scaling import scale_part
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.torque import crank_torque

STEPS = 512
SPEED = 9.0


def yoke(share: float = 0.37, bank: float = 0.0, throw: float = 0.0, shaft: Shaft = CRANKSHAFT) -> SwingingYoke:
    """Return a ram of 400 mm stroke."""
    pivot = 0.36
    return SwingingYoke(
        name="cylinder 1", x=0.2, crank_radius=share * pivot, rod_length=math.inf, reciprocating_mass=95.0, throw=throw,
        bank=bank, shaft=shaft, pivot=pivot, lever_length=0.2 / share, ram_height=0.03, lever_mass=38.0,
        lever_centre=0.34, lever_inertia=2.4, lever_weight=70.0, lever_weight_radius=0.25, rotating_mass=6.0,
        firing_angle=((bank - throw) / shaft.ratio) % math.tau,
    )  # fmt: skip


def places(part: SwingingYoke, phi: np.ndarray) -> tuple[list[tuple[float, np.ndarray]], np.ndarray]:
    """Return the masses with their places z + i y about the origin, and the angle of the lever, from geometry alone."""
    axis, alpha = np.exp(1j * part.bank), part.shaft.ratio * phi + part.throw - part.bank
    pin = part.crank_radius * np.exp(1j * alpha)
    angle = np.unwrap(np.angle(pin + 1j * part.pivot))
    lever = np.exp(1j * angle)
    ram = part.lever_length * np.cos(angle) + 1j * (part.lever_length - part.pivot + part.ram_height)
    pivot, centre = -1j * part.pivot, part.shaft.z + 1j * part.shaft.y
    found = [
        (part.reciprocating_mass, ram),
        (part.lever_mass, pivot + part.lever_centre * lever),
        (part.lever_weight, pivot - part.lever_weight_radius * lever),
        (part.rotating_mass, pin),
    ]
    return [(mass, centre + axis * place) for mass, place in found], angle


def derivative(values: np.ndarray) -> np.ndarray:
    orders = np.fft.fftfreq(STEPS, 1.0 / STEPS)
    return np.fft.ifft(1j * orders * np.fft.fft(values))


def wrench_of_places(part: SwingingYoke) -> np.ndarray:
    """Return force and roll moment from loss of momentum, of angular momentum, and reaction to the drive."""
    phi = math.tau * np.arange(STEPS) / STEPS
    masses, angle = places(part, phi)
    momentum, spin, energy = np.zeros(STEPS, dtype=complex), np.zeros(STEPS), np.zeros(STEPS)
    for mass, place in masses:
        velocity = derivative(place)
        momentum += mass * velocity
        spin += mass * (place.conjugate() * velocity).imag
        energy += 0.5 * mass * np.abs(velocity) ** 2
    rate = derivative(angle).real
    spin, energy = spin + part.lever_inertia * rate, energy + 0.5 * part.lever_inertia * rate**2
    force = -derivative(momentum)
    # positive roll is about x, against the sense of the plane (C3, C4)
    roll = derivative(spin).real - derivative(energy).real
    return SPEED**2 * np.stack([force.imag, force.real, roll])


@pytest.mark.parametrize(
    "part",
    [
        yoke(),
        yoke(0.7, bank=-0.5 * math.pi, throw=1.0),
        yoke(0.2, bank=0.3, throw=-2.0, shaft=Shaft("back", -1.0, 0.1, -0.2)),
    ],
    ids=["upright", "shaper", "geared"],
)
def test_loads_are_those_of_its_masses(part: SwingingYoke) -> None:
    engine = Engine("one", Cycle.TWO_STROKE, (part,))
    loads = shaking_loads(engine, OperatingPoint("run", SPEED)).sample(STEPS)
    expected = wrench_of_places(part)
    size = np.abs(expected).max()
    assert pytest.approx(expected, abs=1e-9 * size) == loads[:, [1, 2, 3]].T
    assert pytest.approx(part.x * np.array([-expected[1], expected[0]]), abs=1e-9 * size) == loads[:, 4:].T


def test_torque_is_what_the_energy_loses() -> None:
    part = yoke()
    torque = crank_torque(Engine("one", Cycle.TWO_STROKE, (part,)), OperatingPoint("run", SPEED)).sample(STEPS)
    masses, angle = places(part, math.tau * np.arange(STEPS) / STEPS)
    energy = sum(0.5 * mass * np.abs(derivative(place)) ** 2 for mass, place in masses)
    energy = energy + 0.5 * part.lever_inertia * derivative(angle).real ** 2
    assert torque == pytest.approx(-(SPEED**2) * derivative(energy).real, abs=1e-9 * np.abs(torque).max())


@pytest.mark.parametrize("share", [0.1, 0.37, 0.8])
def test_orders_in_closed_form(share: float) -> None:
    """Compare orders of the lever's direction, i sqrt((1 - i q E) / (1 + i q / E)), with two series (K17)."""
    part, highest, terms = yoke(share), 12, 400
    up, down = np.ones(terms, dtype=complex), np.ones(terms, dtype=complex)
    for j in range(terms - 1):
        up[j + 1] = up[j] * (0.5 - j) / (j + 1) * -1j * share
        down[j + 1] = down[j] * (-0.5 - j) / (j + 1) * 1j * share
    orders = range(-highest, highest + 1)
    found = [1j * sum(up[m + h] * down[m] for m in range(max(-h, 0), terms - max(h, 0))) for h in orders]
    direction, _ = part.lever(np, math.tau * np.arange(4096) / 4096)
    transform = np.fft.fft(direction) / 4096
    assert found == pytest.approx([transform[h] for h in orders], abs=1e-13)


@given(st.floats(0.05, 0.9), st.floats(0.0, 6.28))
def test_derivatives(share: float, alpha: float) -> None:
    part, h = yoke(share), 1e-5
    near = np.array([alpha - h, alpha, alpha + h])
    angle = np.unwrap(np.angle(part.lever(np, near)[0]))
    _, (rate, swing) = part.lever(np, near[1])
    assert rate == pytest.approx((angle[2] - angle[0]) / (2 * h), abs=1e-6 / (1 - share) ** 3)
    assert swing == pytest.approx((angle[2] - 2 * angle[1] + angle[0]) / h**2, abs=1e-4 / (1 - share) ** 4)


def test_scaled_and_without_mass() -> None:
    part = yoke()
    larger = scale_part(part, 2.0, 3.0)
    point = OperatingPoint("run", SPEED)
    one, other = (shaking_loads(Engine("one", Cycle.TWO_STROKE, (p,)), point).sample(64) for p in (part, larger))
    assert other[:, 1:3] == pytest.approx(6.0 * one[:, 1:3], rel=1e-9, abs=1e-6)
    assert other[:, 3:] == pytest.approx(12.0 * one[:, 3:], rel=1e-9, abs=1e-6)
    bare = shaking_loads(Engine("one", Cycle.TWO_STROKE, (part.only({}),)), point)
    assert not bare.coefficients.any()


def test_a_pump_on_the_ram() -> None:
    """Chambers work on any drive: the mean torque is the work of the diagrams over a turn."""
    part = replace(yoke(), lever_inertia=0.0)
    pumps = tuple(Chamber(end, ("cylinder 1",), end, 0.1, 0.0, Pump(0.5e5, 6e5)) for end in ("head", "crank"))
    facts = torque_facts(Engine("one", Cycle.TWO_STROKE, (part,)), OperatingPoint("run", SPEED, Chambers(pumps)))
    assert facts.mean * math.tau == pytest.approx(-2 * math.pi / 4 * 0.1**2 * 0.4 * 5.5e5, rel=1e-9)


def test_levers_that_cannot_swing() -> None:
    with pytest.raises(ModelError, match="cannot swing"):
        replace(yoke(), pivot=0.1)
    with pytest.raises(ModelError, match="must not be negative"):
        replace(yoke(), lever_weight=-1.0)


FILE = """
title = "shaper"
[engine]
layout = "inline"
drive = "swinging-yoke"
cycle = "two-stroke"
cylinders = 1
stroke = "400 mm"
pivot_distance = "360 mm"
return_ratio = 1.6
reciprocating_mass = "95 kg"
[[operating_points]]
speed = "90 rpm"
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("return_ratio = 1.6", "return_ratio = 0.9", "makes no quick return"),
        ("return_ratio = 1.6", "return_ratio = 1e9", "puts the pivot on the crank circle"),
        ("return_ratio = 1.6", "", "engine.return_ratio: is missing"),
        ("return_ratio = 1.6", 'return_ratio = 1.6\nlever_length = "1 m"', "is given beside lever_length"),
        ("return_ratio = 1.6", 'lever_length = "150 mm"', "is too short"),
        ('pivot_distance = "360 mm"', "", "engine.pivot_distance: is missing"),
        ('drive = "swinging-yoke"', "rod_ratio = 0.2", "means nothing with drive 'slider-crank'"),
        ('stroke = "400 mm"', 'stroke = "400 mm"\nrod_ratio = 0.2', "means nothing with drive 'swinging-yoke'"),
        ('stroke = "400 mm"', 'stroke = "400 mm"\nlever_weight = "5 kg"', "engine.lever_weight_radius"),
        ('layout = "inline"', 'layout = "radial"\nknuckle_radius = "0 mm"', "this layout needs a master rod"),
        ('drive = "swinging-yoke"', 'drive = "scotch yoke"', "engine.drive"),
        ("[[operating", '[[counterweights]]\nname = "web"\nbalance_factor = 0.5\n[[operating', "needs pistons"),
    ],
)  # fmt: skip
def test_files_that_contradict_themselves(old: str, new: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        laufruhe.load(FILE.replace(old, new, 1))
    assert said in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_return_ratio_or_length_of_the_lever() -> None:
    (part,) = laufruhe.load(FILE).engine.slider_cranks
    assert isinstance(part, SwingingYoke)
    by_length = FILE.replace("return_ratio = 1.6", f'lever_length = "{part.lever_length} m"')
    (other,) = laufruhe.load(by_length).engine.slider_cranks
    assert other.crank_radius == pytest.approx(part.crank_radius, rel=1e-12)
