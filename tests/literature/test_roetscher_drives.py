"""F. Roetscher, "Die Maschinenelemente", section 14 C: Klein's drive, the Scotch yoke, and the swinging yoke."""

from __future__ import annotations

import math

import numpy as np
import pytest

import laufruhe
from laufruhe.machine import SliderCrank
from laufruhe.physics.shaking_loads import shaking_loads

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
    """Check eqs. 287, 289, 295 below Fig. 1069: x = R (1 - cos phi), c = v sin phi, b = v^2/R cos phi."""
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
    klein, plain = (laufruhe.load(FILE.format(drive=text)) for text in (f'drive = "klein"\n{rod}', rod))
    loads = [shaking_loads(own.engine, own.points[0]).values(ANGLES) for own in (klein, plain)]
    assert np.array_equal(*loads)
    assert np.abs(loads[0][:, 2]).max() == pytest.approx(830.0 * 0.4 * klein.points[0].speed ** 2 * 1.2, rel=1e-12)
