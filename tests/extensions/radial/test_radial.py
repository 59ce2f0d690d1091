"""Master and articulated rods against Newton and Euler's equations of rigid bodies, and limiting cases (L7, K11-K13).

The bodies here are whole rods with mass, centre of gravity and inertia; places come from the intersection of a
circle with a cylinder's axis, accelerations from differences in 40 digits, and what reaches the block is the sum
of side forces and the crank pin's force. Nothing of that is used by the model: it knows momentum, closed
derivatives and rods of two masses with a deficit.
"""

from __future__ import annotations

import cmath
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from laufruhe.errors import InputError
from laufruhe.extensions.bearing_loads.machine import Bearing, MainBearings
from laufruhe.extensions.bearing_loads.physics import crank_forces, main_bearing_forces, pin_forces, piston_pin_forces
from laufruhe.extensions.radial.mechanism import ArticulatedCrank, Knuckle
from laufruhe.files.reader import load
from laufruhe.machine import Engine, OperatingPoint, Seiliger, SliderCrank
from laufruhe.machine.scaling import scale_part
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import (
    reciprocating_loads,
    shaking_loads,
)
from laufruhe.physics.torque import crank_torque
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from one_cylinder import inertia_coefficients, rod_inertia_loads, rotating_loads
from problem_files import PROBLEMS, changed, loaded
from ready import solved

READY = PROBLEMS / "radial-seven.toml"
TEXT = """
title = "Radial"
[engine]
layout = "radial"
cycle = "four-stroke"
cylinders = 5
bore = "100 mm"
stroke = "120 mm"
rod_length = "210 mm"
reciprocating_mass = "0.9 kg"
knuckle_radius = "50 mm"
[engine.rod]
mass = "2 kg"
centre_of_gravity = "45 mm"
inertia = "0.011 kg m^2"
[engine.articulated_rod]
mass = "0.5 kg"
centre_of_gravity = "70 mm"
inertia = "0.0021 kg m^2"
[[operating_points]]
speed = "2400 rpm"
[objective]
minimise = "mean shaking force"
"""
PISTON, MASTER, LINK = 0.9, (2.0, 0.045, 0.011), (0.5, 0.07, 0.0021)
RADIUS, LENGTH, KNUCKLE = 0.06, 0.21, 0.05
SPEED = 2400 * math.pi / 30


@dataclass
class Star:
    """A row of cylinders, their knuckle pins and rods, the first cylinder with the master rod."""

    banks: list[float]
    knuckles: list[float]
    lengths: list[float]

    def places(self, phi: Any) -> tuple[Any, list[Any], list[Any]]:
        """Return the crank pin, lower ends of the rods and piston pins."""
        pin = RADIUS * mp.expj(phi + self.banks[0])
        lower, upper = [pin], [_on_axis(pin, LENGTH, self.banks[0])]
        line = (upper[0] - pin) / LENGTH
        for bank, angle, length in zip(self.banks[1:], self.knuckles[1:], self.lengths[1:], strict=True):
            lower.append(pin + KNUCKLE * line * mp.expj(angle))
            upper.append(_on_axis(lower[-1], length, bank))
        return pin, lower, upper

    def on_the_block(self, phi: float, gas: dict[int, float] | None = None, massless: bool = False) -> tuple[Any, Any]:
        """Return the force and roll moment by Newton and Euler at every body, the crank turning evenly."""
        return self.solved(phi, gas, massless)[:2]

    def solved(
        self, phi: float, gas: dict[int, float] | None = None, massless: bool = False
    ) -> tuple[Any, Any, list[complex], list[float]]:
        """Return force, roll moment, forces of every rod on its lower pin, and of every piston on its wall."""
        weight = 0.0 if massless else 1.0
        _, lower, upper = self.places(mp.mpf(phi))
        force, roll = 0j, 0.0
        count = len(self.banks)
        to_master: list[tuple[complex, complex]] = []
        on_pins, on_walls = [0j] * count, [0.0] * count
        for k in reversed(range(count)):
            mass, _, inertia = (weight * v for v in (LINK if k else MASTER))
            share = (LINK if k else MASTER)[1] / self.lengths[k]
            piston = weight * PISTON * self._second(phi, lambda p, k=k: self.places(p)[2][k])
            centre = self._second(phi, lambda p, k=k, s=share: _between(self.places(p), k, s))
            turning = self._second(
                phi, lambda p, k=k: mp.arg((self.places(p)[2][k] - self.places(p)[1][k]) / mp.expj(self.banks[k]))
            )
            axis = cmath.exp(1j * self.banks[k])
            push = -axis * (gas or {}).get(k, 0.0)
            # unknown: side force, force of the rod on the piston, of what is below on the rod
            low, high = complex(lower[k]), complex(upper[k])
            middle = low + share * (high - low)
            matrix, right = np.zeros((5, 5)), np.zeros(5)
            side = 1j * axis
            matrix[0], matrix[1] = (side.real, 1, 0, 0, 0), (side.imag, 0, 1, 0, 0)
            right[:2] = (piston - push).real, (piston - push).imag
            matrix[2], matrix[3] = (0, -1, 0, 1, 0), (0, 0, -1, 0, 1)
            other = sum((pull for _, pull in to_master), 0j) if k == 0 else 0j
            right[2:4] = (mass * centre - other).real, (mass * centre - other).imag
            arm, below = high - middle, low - middle
            # moments in the sense in which angles count
            matrix[4] = (0, arm.imag, -arm.real, -below.imag, below.real)
            torque = sum(((place - middle).conjugate() * pull).imag for place, pull in to_master) if k == 0 else 0.0
            right[4] = inertia * float(np.real(turning)) - torque
            result = np.linalg.solve(matrix, right)
            against = -side * result[0]
            on_pins[k], on_walls[k] = -complex(result[3], result[4]), -float(result[0])
            force += against - push
            # Mx = y Fz - z Fy counts against the sense of angles
            roll -= (high.conjugate() * against).imag
            if k:
                to_master.append((low, -complex(result[3], result[4])))
            else:
                force -= complex(result[3], result[4])
        return force, roll, on_pins, on_walls

    @staticmethod
    def _second(phi: float, of: Any) -> complex:
        return complex(mp.diff(of, mp.mpf(phi), 2)) * SPEED**2


def _on_axis(place: Any, length: float, bank: float) -> Any:
    turned = place / mp.expj(bank)
    return mp.expj(bank) * (turned.real + mp.sqrt(mp.mpf(length) ** 2 - turned.imag**2))


def _between(found: Any, k: int, share: float) -> Any:
    return found[1][k] + share * (found[2][k] - found[1][k])


@pytest.fixture(scope="module")
def five(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    return loaded(tmp_path_factory.mktemp("radial"), TEXT)


def star_of(engine: Engine) -> Star:
    parts = engine.slider_cranks
    knuckles = [p.knuckle.angle if isinstance(p, ArticulatedCrank) else 0.0 for p in parts]
    return Star([p.bank for p in parts], knuckles, [p.rod_length for p in parts])


def loads_of(engine: Engine, phi: float) -> tuple[complex, float]:
    loads = reciprocating_loads(engine, SPEED) + rod_inertia_loads(engine, SPEED) + rotating_loads(engine, SPEED)
    wrench = loads.values(np.array([phi]))[0]
    assert wrench[0] == pytest.approx(0.0, abs=1e-9)
    return complex(wrench[2], wrench[1]), float(wrench[3])


def test_loads_are_those_of_rigid_bodies(five: Problem) -> None:
    star = star_of(five.engine)
    with mp.workdps(40):
        for phi in (0.1, 0.9, 2.0, 3.3, 4.4, 5.9):
            force, roll = star.on_the_block(phi)
            ours, our_roll = loads_of(five.engine, phi)
            assert abs(ours - force) <= 1e-9 * abs(force)
            assert our_roll == pytest.approx(roll, rel=1e-9, abs=1e-9 * abs(force) * RADIUS)


def test_forces_on_pins_and_walls_are_those_of_rigid_bodies(five: Problem) -> None:
    """Check knuckle pins, the crank pin under the master rod, and walls, for masses and gas (B11)."""
    star, engine = star_of(five.engine), five.engine
    point, turning = replace(five.points[0], gas=None), 1j * RADIUS * SPEED
    torque = crank_torque(engine, point)
    with mp.workdps(40):
        for phi in (0.1, 0.9, 2.0, 3.3, 4.4, 5.9):
            _, _, on_pins, on_walls = star.solved(phi)
            at = np.array([phi])
            pins, walls = pin_forces(engine, point).values(at)[0], piston_pin_forces(engine, point).values(at)[0]
            size = max(abs(pin) for pin in on_pins)
            assert pins[:, 2] + 1j * pins[:, 1] == pytest.approx(on_pins, abs=1e-9 * size)
            assert -walls[:, 1] == pytest.approx(on_walls, abs=1e-9 * size)
            # all of it reaches the crankshaft through the one pin, and drives it
            crank = crank_forces(engine, point).values(at)[0].sum(axis=0)
            assert complex(crank[2], crank[1]) == pytest.approx(on_pins[0], abs=1e-9 * size)
            velocity = turning * cmath.exp(1j * (phi + star.banks[0]))
            power = velocity.real * crank[2] + velocity.imag * crank[1]
            assert power == pytest.approx(SPEED * torque.values(at)[0], abs=1e-9 * size * abs(velocity))
            bearings = main_bearing_forces(carried(engine), point).values(at)[0]
            assert bearings.sum(axis=0) == pytest.approx(crank, abs=1e-9 * size)
            assert bearings[0] == pytest.approx(0.25 * crank, abs=1e-9 * size)


def test_gas_reaches_pins_and_walls_through_the_master_rod(five: Problem) -> None:
    star, engine = star_of(five.engine), five.engine
    gas = Seiliger(peak_pressure=60e5, imep=8e5)
    point = replace(five.points[0], gas=gas)
    light = replace(engine, slider_cranks=tuple(
        part.only({}) for part in engine.slider_cranks))  # fmt: skip
    pins, walls = pin_forces(light, point), piston_pin_forces(light, point)
    with mp.workdps(40):
        for phi in (0.4, 2.9, 7.7):
            pressed = {}
            for k, part in enumerate(engine.slider_cranks):
                since = (phi - part.firing_angle) % (4.0 * math.pi)
                pressed[k] = float(-gas.thrust(part, engine.cycle, np.array([since]))[0])
            _, _, on_pins, on_walls = star.solved(phi, pressed, massless=True)
            size, at = max(abs(pin) for pin in on_pins), np.array([phi])
            result = pins.values(at)[0]
            assert result[:, 2] + 1j * result[:, 1] == pytest.approx(on_pins, abs=1e-4 * size)
            assert -walls.values(at)[0][:, 1] == pytest.approx(on_walls, abs=1e-4 * size)


def carried(engine: Engine) -> Engine:
    return engine.with_extra(MainBearings((Bearing("front", 0.15), Bearing("rear", -0.05))))


def test_rods_on_one_pin_press_it_as_hinged_ones_close_to_it(tmp_path: Path) -> None:
    """Compare bearing forces of rods on one pin with those of knuckle pins very close to it."""
    found = []
    for radius in ("0 mm", "1e-3 mm"):
        engine = loaded(tmp_path, TEXT.replace('knuckle_radius = "50 mm"', f'knuckle_radius = "{radius}"')).engine
        point = OperatingPoint("run", SPEED)
        found.append(main_bearing_forces(carried(engine), point).sample(64))
    assert found[1] == pytest.approx(found[0], abs=1e-4 * np.abs(found[0]).max())


def test_gas_closes_inside_and_gives_its_torque(five: Problem) -> None:
    star = star_of(five.engine)
    with mp.workdps(40):
        for k, part in enumerate(five.engine.slider_cranks):
            for phi in (0.4, 2.9):
                force, roll = star.on_the_block(phi, {k: 1000.0}, massless=True)
                alpha = phi + star.banks[0] - part.bank
                assert abs(force) <= 1e-9 * 1000.0
                assert roll == pytest.approx(-1000.0 * part.velocity(np, alpha), rel=1e-9, abs=1e-9)


def test_given_knuckles_and_lengths_and_another_master(tmp_path: Path) -> None:
    text = changed(TEXT, "cylinders = 5", 'cylinders = 3\nmaster_cylinder = 2\nknuckle_mass = "0.2 kg"')
    text = changed(
        text,
        'knuckle_radius = "50 mm"',
        'knuckle_radius = "50 mm"\nknuckle_angles = [-118, 121]\narticulated_rod_length = "165 mm"',
    )
    engine = loaded(tmp_path, text).engine
    first, master, last = engine.slider_cranks
    assert isinstance(first, ArticulatedCrank)
    assert type(master) is SliderCrank
    assert isinstance(last, ArticulatedCrank)
    assert (first.rod_length, math.degrees(first.knuckle.angle)) == pytest.approx((0.165, -118.0))
    assert math.degrees(last.knuckle.angle) == pytest.approx(121.0)
    assert first.rotating_mass == pytest.approx(0.2 + 0.5 * (1 - 0.07 / 0.165))
    # cylinder 1 stands at its true dead centre when phi = 0
    assert first.firing_angle == 0.0
    assert first.velocity(np, first.throw - first.bank) == pytest.approx(0.0, abs=1e-12)
    assert first.throw != 0.0


class TestGeometry:
    def test_every_piston_comes_equally_high(self, five: Problem) -> None:
        for part in five.engine.slider_cranks[1:]:
            place = part.motion(np, part.dead_centres[0]).points[0][1][0]
            assert place.real == pytest.approx(RADIUS + LENGTH, rel=1e-14)

    def test_firing_is_that_of_true_dead_centres(self, five: Problem) -> None:
        order = sorted(five.engine.slider_cranks, key=lambda part: part.firing_angle)
        assert [int(part.name.split()[1]) for part in order] == [1, 3, 5, 2, 4]
        intervals = np.degrees(five.engine.firing_intervals)
        assert sum(intervals) == pytest.approx(720.0)
        assert 1.0 < np.abs(intervals - 144.0).max() < 10.0
        # both sides of the master rod mirror each other
        assert intervals == pytest.approx(intervals[::-1])

    def test_dead_centres_are_extremes(self, five: Problem) -> None:
        angles = np.linspace(0.0, math.tau, 3601)
        for part in five.engine.slider_cranks:
            travel = part.travel(np, angles)
            top, bottom = (float(part.travel(np, np.array(a))) for a in part.dead_centres)
            assert top <= travel.min() + 1e-12
            assert bottom >= travel.max() - 1e-12
            assert part.stroke == pytest.approx(travel.max() - travel.min(), rel=1e-6)

    def test_two_strokes_fire_in_their_numbers(self, tmp_path: Path) -> None:
        engine = loaded(tmp_path, changed(TEXT, "four-stroke", "two-stroke")).engine
        angles = [part.firing_angle for part in engine.slider_cranks]
        assert angles == sorted(angles)


class TestLimits:
    def test_rods_on_the_crank_pin_are_plain(self, tmp_path: Path) -> None:
        text = changed(TEXT, 'knuckle_radius = "50 mm"', 'knuckle_radius = "0 mm"')
        plain = loaded(tmp_path, text).engine
        assert {type(part) for part in plain.slider_cranks} == {SliderCrank}
        assert plain.firing_intervals == pytest.approx([math.radians(144.0)] * 5)
        near = loaded(tmp_path, changed(TEXT, 'knuckle_radius = "50 mm"', 'knuckle_radius = "1e-6 mm"')).engine
        for phi in (0.3, 2.2):
            force, roll = loads_of(plain, phi)
            close, close_roll = loads_of(near, phi)
            assert abs(close - force) <= 1e-6 * abs(force)
            assert close_roll == pytest.approx(roll, abs=1e-6 * abs(force) * RADIUS)

    def test_equal_rods_on_one_pin_leave_a_rotating_force_alone(self, tmp_path: Path) -> None:
        """Check n/2 m r w^2 that turns with the crank, and no other order below n - 1."""
        text = changed(TEXT, 'knuckle_radius = "50 mm"', 'knuckle_radius = "0 mm"')
        engine = loaded(tmp_path, text.split("[engine.rod]")[0] + text[text.index("[[operating") :]).engine
        loads = reciprocating_loads(engine, SPEED)
        first = loads.at(1)[1:3]
        assert first[1] == pytest.approx(2.5 * 0.9 * RADIUS * SPEED**2, rel=1e-12)
        assert first[0] == pytest.approx(-1j * first[1], rel=1e-12)
        assert not np.any([loads.at(h)[1:3] for h in (2, 3)])

    def test_a_master_rod_leaves_more(self, five: Problem) -> None:
        """The first order does not turn as one, and a second that turns with twice the speed remains."""
        loads = reciprocating_loads(five.engine, SPEED)
        lateral, vertical = loads.at(1)[1:3]
        against = abs(vertical - 1j * lateral) / 2
        along = abs(vertical + 1j * lateral) / 2
        assert 1e-3 * along < against < 0.1 * along
        lateral, vertical = loads.at(2)[1:3]
        assert 0.02 * along < abs(vertical) < 0.3 * along
        assert abs(vertical + 1j * lateral) > 20.0 * abs(vertical - 1j * lateral)


@settings(max_examples=25, deadline=None)
@given(
    turn=st.floats(-3.0, 3.0),
    lead=st.floats(-2.5, 2.5),
    radius=st.floats(0.0, 0.06),
    angle=st.floats(-0.2, 0.2),
    offset=st.floats(-0.01, 0.01),
)
def test_turning_and_mirroring(turn: float, lead: float, radius: float, angle: float, offset: float) -> None:
    """Loads belong to the mechanism: a frame that is turned or mirrored sees the same."""

    def part(bank: float, other: float, at: float, side: float) -> ArticulatedCrank:
        master = SliderCrank("master", 0.0, 0.06, 0.21, 0.0, bank=bank, offset=side * offset)
        return ArticulatedCrank(
            "part", 0.0, 0.06, 0.18, 0.9, 0.3, bank + other, side * offset, 0.3, 0.001,
            knuckle=Knuckle(master, radius, at),
        )  # fmt: skip

    here = inertia_coefficients(part(0.0, lead, lead + angle, 1.0), 100.0)
    there = inertia_coefficients(part(turn, lead, lead + angle, 1.0), 100.0)
    for one, two in zip(here, there, strict=True):
        count = min(len(one), len(two))
        np.testing.assert_allclose(one[:count], two[:count], atol=1e-11 * np.abs(here[0]).max())
    mirrored = inertia_coefficients(part(0.0, -lead, -lead - angle, -1.0), 100.0)
    for one, two, sign in zip(here, mirrored, (1.0, -1.0, -1.0), strict=True):
        count = min(len(one), len(two))
        np.testing.assert_allclose(one[:count], sign * two[:count].conj(), atol=1e-11 * np.abs(here[0]).max())


def test_size_and_speed(five: Problem) -> None:
    """Twice as large at the same densities: forces 16 times at equal speed."""
    large = replace(five.engine, slider_cranks=tuple(scale_part(part, 2.0, 8.0) for part in five.engine.slider_cranks))
    small = reciprocating_loads(five.engine, SPEED) + rod_inertia_loads(five.engine, SPEED)
    grown = reciprocating_loads(large, SPEED) + rod_inertia_loads(large, SPEED)
    np.testing.assert_allclose(grown.coefficients[:, 1:3], 16.0 * small.coefficients[:, 1:3], rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(grown.coefficients[:, 3], 32.0 * small.coefficients[:, 3], rtol=1e-9, atol=1e-6)


def test_an_even_speed_is_the_limit_of_an_uneven_one() -> None:
    problem = load(READY)
    even = shaking_loads(problem.engine, problem.points[0], Fidelity(samples=720))
    heavy = shaking_loads(problem.engine, problem.points[0], Fidelity(samples=720, crank_inertia=1e7))
    size = np.abs(even.coefficients).max(axis=0)
    for order in (1, 2, 3.5, 7):
        assert np.all(np.abs(even.at(order) - heavy.at(order)) <= 1e-4 * size + 1e-9)


def test_the_ready_problem_is_proven() -> None:
    result = solved("radial-seven")
    certificate = result.certificate
    assert certificate.kind.value.startswith("global")
    assert certificate.lower_bound <= result.objective.value <= certificate.lower_bound * (1.0 + 1e-4)
    # the web leaves a part of the first order that turns against the crank
    lateral, vertical = result.final.loads[0].wrench.at(1)[1:3]
    assert abs(vertical - 1j * lateral) > 5.0 * abs(vertical + 1j * lateral)


def test_an_open_order_is_the_one_that_is_nearest_to_even(tmp_path: Path) -> None:
    problem = loaded(tmp_path, changed(TEXT, "cylinders = 5", 'cylinders = 5\nfiring_order = "open"'))
    assert problem.phasing is not None
    result = solve(problem)
    assert result.phasing is not None
    assert result.phasing.ranking[0].firing_orders[0].order == (1, 3, 5, 2, 4)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('knuckle_radius = "50 mm"', "", "engine.knuckle_radius: is missing; add it, 0 mm puts all rods"),
        ("cylinders = 5", "cylinders = 5\nmaster_cylinder = 6", 'engine.master_cylinder = "6": is not one of the 5'),
        ("cylinders = 5", "cylinders = 5\nknuckle_angles = [72]", "engine.knuckle_angles: has 1 angle"),
        ('rod_length = "210 mm"', "rod_ratio = 0", "engine.rod"),
        ("cylinders = 5", 'cylinders = 5\ncylinder_spacing = "1 m"', "engine.cylinder_spacing: means nothing"),
        ("cylinders = 5", "cylinders = 5\nthrows = [0]", "engine.throws: means nothing in layout 'radial'"),
        ("cylinders = 5", 'cylinders = 5\narticulated_rod_length = "72 mm"', "rod lengths; lengthen the rod"),
        ('centre_of_gravity = "70 mm"', 'centre_of_gravity = "300 mm"', "engine.articulated_rod.centre_of_gravity"),
        ("cylinders = 5", 'cylinders = 5\nthrows = "open"', "use layout inline or vee"),
    ],
)  # fmt: skip
def test_impossible_radial_engines_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        loaded(tmp_path, changed(TEXT, old, new))


def test_a_rod_beside_none_is_refused(tmp_path: Path) -> None:
    a, b = TEXT.index("[engine.articulated_rod]"), TEXT.index("[[operating")
    with pytest.raises(InputError, match=r"articulated_rod: is missing beside \[engine.rod\]"):
        loaded(tmp_path, TEXT[:a] + TEXT[b:])
