"""Rotary engine, compared with polygon areas, pressures along a flank, and masses moved step by step."""

from __future__ import annotations

import cmath
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.bearing_loads.machine import bearings_of
from laufruhe.extensions.bearing_loads.physics import main_bearing_forces, pin_forces
from laufruhe.extensions.flywheel.torque import swing_of
from laufruhe.extensions.recorded_pressure.gas import PressureTrace
from laufruhe.extensions.rotary.unit import RotaryUnit
from laufruhe.files.reader import load_tables
from laufruhe.machine import Engine, OperatingPoint, Seiliger, Wiebe
from laufruhe.machine.gas.charge import chamber_volume
from laufruhe.numerics.exact_angles import cis
from laufruhe.physics.fidelity import EXACT
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.torque import crank_torque
from laufruhe.physics.uneven_speed import crank_motion
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from problem_files import PROBLEMS, changed

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

E, R, B, MASS, INERTIA = 0.015, 0.105, 0.08, 4.4, 0.018
SPEED = 600.0
GAS = Wiebe(compression_ratio=9.4, imep=9e5, start=-0.3, duration=1.6)
TEXT = (PROBLEMS / "rotary-two.toml").read_text(encoding="utf-8")
UNIT = RotaryUnit(
    "rotor 1", 0.0, E, math.inf, 0.0, rotating_mass=MASS, rotor_radius=R, rotor_width=B, rotor_inertia=INERTIA
)


def read(text: str) -> Problem:
    """Return the problem of a text."""
    return load_tables(tomllib.loads(text), PROBLEMS / "rotary-two.toml")


def _of(unit: RotaryUnit) -> Engine:
    return replace(read(TEXT).engine, slider_cranks=(unit,), rotors=())


def _area(line: ComplexArray) -> float:
    """Return the area of a polygon by the shoelace formula [m^2]."""
    return float(0.5 * np.sum((np.conj(line) * np.roll(line, -1)).imag))


def _housing(turn: Array) -> ComplexArray:
    """Return the place of an apex when the rotor has turned about its centre (textbook eq. 7) [m]."""
    return np.asarray(E * np.exp(3j * (turn - math.pi / 3.0)) + R * np.exp(1j * turn))


def _over_chord(since: float) -> float:
    """Return the area between the housing and the chord of the flank that fired `since` ago [m2]."""
    middle = since / 3.0
    arc = _housing(np.linspace(middle - math.pi / 3.0, middle + math.pi / 3.0, 20001))
    return _area(arc)


def test_chambers_are_what_is_between_housing_and_rotor() -> None:
    """Compare Y3 with the area of a polygon of 20,000 corners; the flank adds a constant."""
    angles = np.linspace(0.0, 6.0 * math.pi, 25)
    result = chamber_volume(UNIT, angles)
    drawn = B * np.array([_over_chord(angle) for angle in angles])
    np.testing.assert_allclose(result, drawn - drawn[0], atol=1e-8 * UNIT.displacement)
    assert result.max() == pytest.approx(UNIT.displacement, rel=1e-12)


@pytest.mark.parametrize("radius", [0.06, 0.105, 0.15])
def test_the_smallest_chamber_is_that_of_the_inner_envelope(radius: float) -> None:
    """Compare Y2 with the inner envelope of the housing, found ray by ray."""
    unit = replace(UNIT, rotor_radius=radius)
    turn = np.linspace(-math.pi / 2.0, math.pi / 2.0, 2001)
    rays = np.linspace(-math.pi / 3.0, math.pi / 3.0, 1001)
    reach = np.full(len(rays), np.inf)
    for alpha in np.linspace(-1.5 * math.pi, 1.5 * math.pi, 1201):
        line = E * np.exp(3j * (turn + alpha / 3.0 - math.pi / 3.0)) + radius * np.exp(1j * (turn + alpha / 3.0))
        seen = (line - E * np.exp(1j * alpha)) * np.exp(-1j * alpha / 3.0)
        order = np.argsort(np.angle(seen))
        reach = np.minimum(reach, np.interp(rays, np.angle(seen)[order], np.abs(seen)[order]))
    flank = _area(np.append(reach * np.exp(1j * rays), 0.0)) - 0.25 * math.sqrt(3.0) * radius**2
    arc = E * np.exp(3j * (rays - math.pi / 3.0)) + radius * np.exp(1j * rays)
    assert unit.smallest_volume == pytest.approx(B * (_area(arc) - flank), abs=1e-4 * unit.displacement)
    assert unit.largest_ratio == pytest.approx(1.0 + unit.displacement / unit.smallest_volume, rel=1e-12)


class TestGas:
    """Gas loads (Y4), compared with pressures summed along flanks and housing."""

    point = OperatingPoint("", SPEED, GAS)

    def _pressures(self, phi: float) -> list[tuple[float, float]]:
        """Return for each chamber the angle since it fired, and its pressure above the crankcase [Pa]."""
        whole = 6.0 * math.pi
        since = [(phi + math.tau * k) % whole for k in range(3)]
        pressures = [float(GAS.pressure(UNIT, _of(UNIT).cycle, np.array([at]))[0]) for at in since]
        return [(at, pressure - GAS.crankcase_pressure) for at, pressure in zip(since, pressures, strict=True)]

    @pytest.mark.parametrize("phi", [0.1, 1.3, 2.9, 4.4, 6.0])
    def test_torque_is_pressure_times_growth_of_the_chamber(self, phi: float) -> None:
        step = 1e-3
        drawn = sum(
            pressure * B * (_over_chord(at + step) - _over_chord(at - step)) / (2.0 * step)
            for at, pressure in self._pressures(phi)
        )
        torque = crank_torque(_of(UNIT), self.point).values(np.array([phi]))[0]
        assert torque == pytest.approx(drawn, rel=1e-4)
        wrench = shaking_loads(_of(UNIT), self.point).values(np.array([phi]))[0]
        assert wrench[3] == pytest.approx(drawn, rel=1e-4)

    @pytest.mark.parametrize("phi", [0.1, 1.3, 2.9, 4.4, 6.0])
    def test_the_eccentric_carries_what_presses_on_the_flanks(self, phi: float) -> None:
        """Compare the pin force with pressure on the flanks and inertia of a rotor on the eccentric."""
        total = MASS * E * SPEED**2 * cmath.exp(1j * phi)
        for at, pressure in self._pressures(phi):
            line = (UNIT.outlines(0.0)[1].points[:31] - E) * cmath.exp(1j * at / 3.0)
            outward = -1j * np.diff(line)
            total -= pressure * B * complex(outward.sum())
            about_the_centre = (np.conj(0.5 * (line[1:] + line[:-1])) * outward).imag.sum()
            # the teeth carry nothing
            assert abs(about_the_centre) < 1e-12 * R**2
        result = pin_forces(_of(UNIT), self.point).values(np.array([phi]))[0, 0]
        assert complex(result[2], result[1]) == pytest.approx(total, rel=1e-4)

    def test_all_that_presses_on_block_and_shaft_leaves_the_wrench(self) -> None:
        """Check that housing and bearings leave the force of eq. 13 and the moment of the torque."""
        engine = read(TEXT).engine
        point = OperatingPoint("", SPEED, GAS)
        phi = np.linspace(0.0, math.tau, 37)
        bearings = main_bearing_forces(engine, point).values(phi)
        housing = np.zeros((len(phi), 2, 3))
        for k, part in enumerate(engine.slider_cranks):
            pins = pin_forces(engine, point).values(phi)[:, k]
            turning = part.rotating_mass * part.crank_radius * SPEED**2 * np.exp(1j * (phi + part.throw))
            housing[:, k] = np.stack([0.0 * phi, turning.imag, turning.real], axis=1) - pins
        force = bearings.sum(axis=1) + housing.sum(axis=1)
        arms = np.array([bearing.x for bearing in bearings_of(engine)])
        couple = -(bearings[:, :, 2] @ arms) - housing[:, :, 2] @ np.array([p.x for p in engine.slider_cranks])
        wrench = shaking_loads(engine, point).values(phi)
        size = float(np.abs(wrench[:, 4]).max())
        np.testing.assert_allclose(force, wrench[:, :3], atol=1e-9 * size)
        np.testing.assert_allclose(couple, wrench[:, 4], atol=1e-9 * size)

    @pytest.mark.parametrize("gas", [GAS, Seiliger(compression_ratio=9.4, imep=9e5, peak_pressure=6e6)])
    def test_work_of_a_turn_is_mean_pressure_times_chamber(self, gas: Wiebe | Seiliger) -> None:
        torque = crank_torque(_of(UNIT), replace(self.point, gas=gas)).coefficients[0].real
        assert math.tau * torque == pytest.approx(gas.imep * UNIT.displacement, rel=1e-6)

    @pytest.mark.slow
    def test_a_trace_over_three_turns_of_the_shaft_gives_the_same(self) -> None:
        angles = np.linspace(0.0, 6.0 * math.pi, 4321)[:-1]
        pressures = GAS.pressure(UNIT, _of(UNIT).cycle, angles)
        trace = PressureTrace(tuple(angles), tuple(pressures), GAS.crankcase_pressure)
        found, expected = (crank_torque(_of(UNIT), replace(self.point, gas=own)).sample(90) for own in (trace, GAS))
        np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


def _bodies(unit: RotaryUnit, phi: Array) -> tuple[Array, ComplexArray]:
    """Return twelve masses with mass and inertia of a rotor, and their places, shape (12, n)."""
    corners, gyration = np.exp(2j * np.pi * np.arange(12) / 12), math.sqrt(unit.rotor_inertia / unit.rotating_mass)
    centre = unit.crank_radius * np.exp(1j * (phi + unit.throw))
    about = gyration * corners[:, None] * np.exp(1j * phi / 3.0)
    return np.full(12, unit.rotating_mass / 12), centre + about


@pytest.mark.parametrize("throw", [0.0, 2.0])
def test_masses_that_are_moved_step_by_step_load_the_block_as_a_rotor(throw: float) -> None:
    """Compare with Newton's law by differences of positions."""
    unit = replace(UNIT, throw=throw, firing_angle=-throw % math.tau, x=0.2)
    phi, step = np.linspace(0.0, math.tau, 25), 1e-3
    masses, here = _bodies(unit, phi)
    ahead, behind = _bodies(unit, phi + step)[1], _bodies(unit, phi - step)[1]
    twice = _bodies(unit, phi + 2 * step)[1], _bodies(unit, phi - 2 * step)[1]
    pull = -masses[:, None] * SPEED**2 * (16 * (ahead + behind) - sum(twice) - 30 * here) / (12 * step**2)
    wrench = shaking_loads(_of(unit), OperatingPoint("", SPEED)).values(phi)
    force, size = pull.sum(axis=0), MASS * E * SPEED**2
    np.testing.assert_allclose(wrench[:, 2] + 1j * wrench[:, 1], force, atol=1e-6 * size)
    np.testing.assert_allclose(wrench[:, 4], -0.2 * force.real, atol=1e-6 * size)
    np.testing.assert_allclose(wrench[:, 3], (np.conj(here) * pull).imag.sum(axis=0), atol=1e-6 * size * R)


def test_a_rotor_adds_a_ninth_of_its_inertia_to_the_shaft() -> None:
    """Check Y6: the rotor turns at a third of the speed, and its mass counts at the crank pin."""
    swing = swing_of(_of(UNIT), OperatingPoint("", SPEED, GAS), EXACT)
    np.testing.assert_allclose(swing.inertia, INERTIA / 9.0, rtol=1e-12)


@pytest.mark.slow
def test_an_uneven_speed_loads_the_block_through_the_teeth() -> None:
    """Check Y6: torque J a / 3 acts at the pitch circle of radius 3 e against the wheel of radius 2 e."""
    unit, uneven = replace(UNIT, rotating_mass=0.0), replace(EXACT, crank_inertia=0.2)
    point = OperatingPoint("", 200.0, GAS)
    motion = crank_motion(_of(unit), point, uneven)
    tooth = INERTIA * motion.acceleration / 3.0 / (3.0 * E)
    expected = crank_torque(_of(unit), point).values(motion.angle) + tooth * 2.0 * E
    result = shaking_loads(_of(unit), point, uneven).sample(uneven.samples)[:, 3]
    np.testing.assert_allclose(result, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.slow
class TestWeights:
    """End weights of least mass that leave no force and no couple."""

    @pytest.mark.parametrize("count", [1, 2, 3, 4])
    def test_weights_at_the_ends_have_one_size(self, count: int) -> None:
        """Check that force and couple fix two planes, and that the best even star is proven."""
        text = _ends(count)
        result = solve(read(text))
        assert str(result.certificate.kind) == "global"
        unbalance, best = (MASS + 1.6) * E, math.inf
        for throws in _even_stars(count):
            places = 0.13 * (0.5 * (count - 1) - np.arange(count))
            waves = unbalance * np.exp(1j * np.array(throws))
            force, couple = waves.sum(), (places * waves).sum()
            ends = [-(force + sign * couple / 0.3) / 2.0 for sign in (1.0, -1.0)]
            best = min(best, sum(abs(end) for end in ends) / 0.05)
        assert result.objective.value == pytest.approx(best, rel=1e-6)
        wrench = np.abs(result.final.loads[0].wrench.coefficients)
        size = unbalance * result.problem.points[0].speed ** 2
        assert np.abs(wrench[:, [0, 1, 2, 4, 5]]).max() < 1e-6 * size

    def test_the_far_planes_of_three_are_used(self) -> None:
        """Compare the ready problem with a linear program of signed sizes in one plane."""
        from scipy.optimize import linprog

        result = solve(read(TEXT))
        places, radii = np.array([0.15, 0.0, -0.16]), np.array([0.05, 0.05, 0.095])
        rows = np.vstack([radii, radii * places])
        couple = (MASS + 1.6) * E * (0.065 + 0.065)
        actual = linprog(np.ones(6), A_eq=np.hstack([rows, -rows]), b_eq=[0.0, -couple])
        assert result.objective.value == pytest.approx(actual.fun, rel=1e-6)


def _ends(count: int) -> str:
    head, _, rest = TEXT.partition("[[counterweights]]")
    weights = "".join(
        f'[[counterweights]]\nname = "{name}"\nx = "{x} mm"\nradius = "50 mm"\n'
        'mass = { between = ["0 kg", "20 kg"] }\nangle = { between = [0, 360] }\n'
        for name, x in (("front", 300), ("rear", -300))
    )
    limits = rest[rest.index("[objective]") : rest.index('[[constraints]]\nlimit = "maximum crank-pin force"')]
    head = head[: head.index("[[main_bearings]]")].replace("throws = [0, 180]", f'cylinders = {count}\nthrows = "open"')
    return head + weights + limits


def _even_stars(count: int) -> list[tuple[float, ...]]:
    from itertools import permutations

    steps = [math.tau * k / count for k in range(count)]
    return [(0.0, *rest) for rest in permutations(steps[1:])]


class TestApexes:
    """Y5, textbook eqs. 8, 9."""

    def test_limits_are_kept_or_named(self) -> None:
        problem = read(changed(TEXT, 'max = "35 m/s"', 'max = "31 m/s"'))
        result = solve(problem)
        assert str(result.status) == "infeasible"
        assert "apex speed" in result.message

    @pytest.mark.slow
    def test_values_are_the_largest_of_positions_moved_step_by_step(self) -> None:
        values = {limit.name: limit.value for limit in solve(read(TEXT)).limits}
        speed, step = read(TEXT).points[0].speed, 1e-4
        phi = np.linspace(0.0, 3 * math.tau, 100001)
        ahead, here, behind = (_housing((phi + shift) / 3.0) for shift in (step, 0.0, -step))
        assert values["apex speed"] == pytest.approx(speed * np.abs((ahead - behind) / (2 * step)).max(), rel=1e-6)
        maximum = np.abs((ahead + behind - 2 * here) / step**2).max()
        assert values["apex acceleration"] == pytest.approx(speed**2 * maximum, rel=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"105 mm"', '"45 mm"', "engine.rotor_radius = 45 mm: does not let the rotor turn"),
        ('"80 mm"', '"0 mm"', "engine.rotor_width"),
        ("compression_ratio = 9.4", "compression_ratio = 19", "gas.compression_ratio: 19 leaves rotor 1 no chamber"),
        ('"four-stroke"  ', '"two-stroke"  ', 'engine.cycle = "two-stroke": does not fit a rotary engine'),
        ('eccentricity = "15 mm"', 'stroke = "30 mm"', "engine.stroke: means nothing in layout 'rotary'"),
        ('rotor_mass = "4.4 kg"', "", "engine.rotor_mass: is missing"),
        (
            'speed = "6000 rpm"',
            'mean_piston_speed = "10 m/s"',
            "mean_piston_speed: is a mean piston speed, and this engine has no pistons",
        ),
        ("maximum crank-pin force", "maximum side force", "rotor 1 has no rod"),
    ],
)
def test_bad_input_is_one_line(old: str, new: str, said: str) -> None:
    with pytest.raises((InputError, ModelError)) as caught:
        solve(read(changed(TEXT, old, new)))
    lines = [line for line in str(caught.value).splitlines() if line]
    assert len(lines) == 1
    assert said in lines[0]


def test_apexes_are_of_rotors_alone() -> None:
    text = (PROBLEMS / "tractor-four-lanchester.toml").read_text(encoding="utf-8")
    with pytest.raises(InputError, match="needs the rotors of a rotary engine"):
        read(text + '\n[[constraints]]\nlimit = "apex speed"\nmax = "30 m/s"\n')


def test_a_rotor_fires_once_a_turn() -> None:
    problem: Problem = read(TEXT)
    assert problem.engine.firing_intervals == pytest.approx((math.pi, math.pi))
    assert [part.name for part in problem.engine.slider_cranks] == ["rotor 1", "rotor 2"]
    assert evaluate(problem).engine.pins[1].unbalance == pytest.approx(
        MASS * E * cis(problem.engine.slider_cranks[1].star_turn)
    )
