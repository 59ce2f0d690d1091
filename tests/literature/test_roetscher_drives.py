"""F. Roetscher, "Die Maschinenelemente", section 14 C: Klein's drive, the Scotch yoke, and the swinging yoke."""

from __future__ import annotations

import math

import numpy as np
import pytest

import laufruhe
from laufruhe.machine import SliderCrank
from laufruhe.machine.swinging_yoke import SwingingYoke
from laufruhe.physics.shaking_loads import shaking_loads
from problem_files import PROBLEMS

FILE = """
title = "drive"
[engine]
layout = "inline"
{drive}
cycle = "two-stroke"
cylinders = 1
stroke = "800 mm"
reciprocating_mass = "830 kg"
[[operating_points]]
speed = "50 rpm"
"""
ANGLES = np.radians([0.0, 1e-4, 25.0, 90.0, 141.0, 180.0, 233.0, 300.0])


def part_of(drive: str) -> SliderCrank:
    (part,) = laufruhe.load(FILE.format(drive=drive)).engine.slider_cranks
    return part


def test_scotch_yoke() -> None:
    """Below Fig. 1069, eqs. 287, 289, 295: x = R (1 - cos phi), c = v sin phi, b = v^2/R cos phi."""
    yoke, radius, speed = part_of('drive = "scotch-yoke"'), 0.4, 50.0 * math.tau / 60.0
    v = radius * speed
    assert yoke == part_of("rod_ratio = 0")
    assert yoke.travel(np, ANGLES) == pytest.approx(2.0 * radius * np.sin(0.5 * ANGLES) ** 2, rel=1e-14)
    assert -speed * yoke.velocity(np, ANGLES) == pytest.approx(v * np.sin(ANGLES), abs=1e-15)
    _, (_, _, acceleration) = yoke.motion(np, ANGLES).points[0]
    assert -(speed**2) * acceleration.real == pytest.approx(v**2 / radius * np.cos(ANGLES), abs=1e-14)


def test_kleins_drive_loads_its_block_as_a_slider_crank() -> None:
    """Fig. 1068: the rod swings in a frame between two piston rods, which take the side force by bending."""
    rod = 'rod_length = "2 m"'
    klein, plain = (laufruhe.load(FILE.format(drive=told)) for told in (f'drive = "klein"\n{rod}', rod))
    loads = [shaking_loads(own.engine, own.points[0]).values(ANGLES) for own in (klein, plain)]
    assert np.array_equal(*loads)
    assert np.abs(loads[0][:, 2]).max() == pytest.approx(830.0 * 0.4 * klein.points[0].speed ** 2 * 1.2, rel=1e-12)


def shaper() -> SwingingYoke:
    (part,) = laufruhe.load(PROBLEMS / "shaper.toml").engine.slider_cranks
    assert isinstance(part, SwingingYoke)
    return part


def test_speeds_of_the_swinging_yoke() -> None:
    """Eq. 304, c_1 = v R / (e + r) at the top of the crank circle; eq. 305, c_2 = v R / (e - r) at its lowest point."""
    yoke, v = shaper(), 1.0
    r, e, length = yoke.crank_radius, yoke.pivot, yoke.lever_length
    forward, back = (-v / r * yoke.velocity(np, np.array([angle]))[0] for angle in (0.5 * math.pi, 1.5 * math.pi))
    assert forward == pytest.approx(v * length / (e + r), rel=1e-14)
    assert back == pytest.approx(-v * length / (e - r), rel=1e-14)
    fine = np.linspace(0.0, math.tau, 100001)
    speeds = -v / r * yoke.velocity(np, fine)
    assert speeds.max() == pytest.approx(forward, rel=1e-9)
    assert speeds.min() == pytest.approx(back, rel=1e-9)


@pytest.mark.parametrize("degrees", [10.0, 80.0, 130.0, 200.0, 275.0, 340.0])
def test_speed_by_the_construction_of_the_figure(degrees: float) -> None:
    """Fig. 1071: c = v GD FC / (r CD), F the foot of the perpendicular from M on the lever."""
    yoke, phi = shaper(), math.radians(degrees)
    pin, pivot = yoke.crank_radius * complex(math.cos(phi), math.sin(phi)), -1j * yoke.pivot
    along = (pin - pivot) / abs(pin - pivot)
    foot = pivot + (along.conjugate() * -pivot).real * along
    end = pivot + yoke.lever_length * along
    signed = math.copysign(1.0, (along.conjugate() * (pin - foot)).real)
    printed = (end - pivot).imag * signed * abs(pin - foot) / (yoke.crank_radius * abs(pin - pivot))
    assert -yoke.velocity(np, np.array([phi]))[0] / yoke.crank_radius == pytest.approx(printed, rel=1e-12)


def test_times_of_both_strokes() -> None:
    """Text below Fig. 1071: v_a / v_r = beta / alpha, angles between the perpendiculars from M on both ends."""
    yoke = shaper()
    top, bottom = yoke.dead_centres
    slow = bottom - top
    assert slow / (math.tau - slow) == pytest.approx(1.6, rel=1e-14)
    assert yoke.return_ratio == pytest.approx(1.6, rel=1e-14)
    assert yoke.stroke == pytest.approx(0.4, rel=1e-14)
    assert yoke.velocity(np, np.array([top, bottom])) == pytest.approx(0.0, abs=1e-15)
    ends = yoke.travel(np, np.array([top, bottom]))
    assert ends[1] - ends[0] == pytest.approx(0.4, rel=1e-14)
    # beta, half of what the quick stroke takes, fixes r / e
    assert yoke.crank_radius / yoke.pivot == pytest.approx(math.cos(math.pi / 2.6), rel=1e-14)
