"""Swinging yoke of Roetscher, Figs. 1071 to 1073: its speeds and the times of its strokes."""

from __future__ import annotations

import math

import numpy as np
import pytest

import laufruhe
from laufruhe.extensions.swinging_yoke.mechanism import SwingingYoke
from problem_files import PROBLEMS


def shaper() -> SwingingYoke:
    (part,) = laufruhe.load(PROBLEMS / "shaper.toml").engine.slider_cranks
    assert isinstance(part, SwingingYoke)
    return part


def test_speeds_of_the_swinging_yoke() -> None:
    """Check eqs. 304, 305: c_1 = v R / (e + r) at the top of the crank circle, c_2 = v R / (e - r) below."""
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
    """Check fig. 1071: c = v GD FC / (r CD), F the foot of the perpendicular from M on the lever."""
    yoke, phi = shaper(), math.radians(degrees)
    pin, pivot = yoke.crank_radius * complex(math.cos(phi), math.sin(phi)), -1j * yoke.pivot
    along = (pin - pivot) / abs(pin - pivot)
    foot = pivot + (along.conjugate() * -pivot).real * along
    end = pivot + yoke.lever_length * along
    signed = math.copysign(1.0, (along.conjugate() * (pin - foot)).real)
    printed = (end - pivot).imag * signed * abs(pin - foot) / (yoke.crank_radius * abs(pin - pivot))
    assert -yoke.velocity(np, np.array([phi]))[0] / yoke.crank_radius == pytest.approx(printed, rel=1e-12)


def test_times_of_both_strokes() -> None:
    """Check v_a / v_r = beta / alpha below fig. 1071, angles between perpendiculars from M on both ends."""
    yoke = shaper()
    top, bottom = yoke.dead_centres
    slow = bottom - top
    assert slow / (math.tau - slow) == pytest.approx(1.6, rel=1e-14)
    assert yoke.stroke == pytest.approx(0.4, rel=1e-14)
    assert yoke.velocity(np, np.array([top, bottom])) == pytest.approx(0.0, abs=1e-15)
    ends = yoke.travel(np, np.array([top, bottom]))
    assert ends[1] - ends[0] == pytest.approx(0.4, rel=1e-14)
    # beta, half of what the quick stroke takes, fixes r / e
    assert yoke.crank_radius / yoke.pivot == pytest.approx(math.cos(math.pi / 2.6), rel=1e-14)
