"""Chambers on both sides of pistons, compared with an independent model, work and symmetry."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import quad

import laufruhe
from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.bearing_loads.physics import piston_pin_forces
from laufruhe.extensions.chambers.gas import Chamber, Chambers, Compressor, Steam
from laufruhe.extensions.recorded_pressure.gas import PressureTrace
from laufruhe.machine import Cycle, Engine, OperatingPoint, SliderCrank
from laufruhe.physics.gas_facts import cylinder_facts
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.physics.shaking_loads import shaking_loads
from one_cylinder import gas_torque, mean_pressure_of

AIR = 1.0e5
STEAM = Steam(9e5, 1.5e5, 0.3, 0.9, 0.2, 0.02, 0.06)
PART = SliderCrank("cylinder 1", 0.0, 0.4, 2.0, 800.0)
HEAD, CRANK = (Chamber(end, ("cylinder 1",), end, 0.45, rod, STEAM) for end, rod in (("head", 0.075), ("crank", 0.1)))
DOUBLE = Chambers((HEAD, CRANK), AIR)


def engine(*parts: SliderCrank) -> Engine:
    return Engine("steam", Cycle.TWO_STROKE, parts)


def plain_pressure(diagram: Steam, x: float, is_out: bool) -> float:
    """Return the pressure of the diagram point by point, in scalars."""
    c, n = diagram.clearance, diagram.exponent
    if is_out and x < diagram.cut_off:
        return diagram.admission
    if is_out:
        p = diagram.admission * ((diagram.cut_off + c) / (min(x, diagram.release) + c)) ** n
        return (
            p
            if x < diagram.release
            else p + (diagram.back_pressure - p) * (x - diagram.release) / (1 - diagram.release)
        )
    if x > diagram.compression:
        return diagram.back_pressure
    p = diagram.back_pressure * ((diagram.compression + c) / (max(x, diagram.lead) + c)) ** n
    return p if x > diagram.lead else diagram.admission + (p - diagram.admission) * x / diagram.lead


def plain_travel(degrees: float) -> float:
    """Return the travel of eq. 285 over the stroke."""
    phi, r, l = math.radians(degrees), 0.4, 2.0
    return (r * (1 - math.cos(phi)) + l - math.sqrt(l * l - (r * math.sin(phi)) ** 2)) / (2 * r)


@pytest.mark.parametrize(
    "degrees", [0.5, 4.0, 30.0, 70.0, 120.0, 150.0, 179.0, 181.0, 200.0, 290.0, 330.0, 345.0, 358.0]
)
def test_pressures_on_both_sides(degrees: float) -> None:
    x, is_out = plain_travel(degrees), degrees < 180.0
    angle = np.radians([degrees])
    assert HEAD.pressure(PART, angle)[0] == pytest.approx(plain_pressure(STEAM, x, is_out), rel=1e-7)
    assert CRANK.pressure(PART, angle)[0] == pytest.approx(plain_pressure(STEAM, 1 - x, not is_out), rel=1e-7)


@pytest.mark.parametrize("exponent", [1.0, 1.2])
def test_area_of_the_diagram_in_closed_form(exponent: float) -> None:
    diagram = replace(STEAM, exponent=exponent)
    bends = [diagram.lead, diagram.compression, diagram.cut_off, diagram.release]
    area = sum(
        quad(lambda x: plain_pressure(diagram, x, True) - plain_pressure(diagram, x, False), a, b, epsabs=1e-6)[0]
        for a, b in zip([0.0, *bends], [*bends, 1.0], strict=True)
    )
    assert mean_pressure_of(diagram) == pytest.approx(area, rel=1e-10)


def test_work_of_a_turn_is_that_of_the_diagrams() -> None:
    torque = gas_loads(engine(PART), DOUBLE).coefficients[0, 3].real
    work = sum(chamber.area * 0.8 * mean_pressure_of(STEAM) for chamber in (HEAD, CRANK))
    assert torque * math.tau == pytest.approx(work, rel=1e-10)


def test_orders_follow_the_torque_point_by_point() -> None:
    """Check that the sum of orders, with corners treated apart, meets the diagram everywhere."""
    load = gas_loads(engine(PART), DOUBLE)
    for degrees in (3.0, 57.0, 120.0, 185.0, 297.0):
        phi, x = math.radians(degrees), plain_travel(degrees)
        out = degrees < 180.0
        force = HEAD.area * (plain_pressure(STEAM, x, out) - AIR) - CRANK.area * (
            plain_pressure(STEAM, 1 - x, not out) - AIR
        )
        sine = 0.2 * math.sin(phi)
        arm = 0.4 * (math.sin(phi) + math.cos(phi) * sine / math.sqrt(1 - sine * sine))
        # eq. 303
        assert load.values(np.array([phi]))[0, 3] == pytest.approx(force * arm, rel=1e-5, abs=1.0)


def test_a_trace_of_the_diagram_is_the_diagram() -> None:
    angles = np.linspace(0.0, math.tau, 20001)[:-1]
    trace = PressureTrace(tuple(angles), tuple(HEAD.pressure(PART, angles)))
    traced = replace(HEAD, diagram=trace)
    at = np.radians([1.0, 20.0, 77.0, 140.0, 250.0, 340.0])
    assert traced.pressure(PART, at) == pytest.approx(HEAD.pressure(PART, at), rel=1e-5)


def test_ends_of_a_scotch_yoke_are_images() -> None:
    """Check that the two ends differ by half a turn and a sign without a rod."""
    yoke = replace(PART, rod_length=math.inf)
    sides = [Chambers((replace(chamber, rod=0.0),), AIR) for chamber in (HEAD, CRANK)]
    head, crank = (gas_torque(side, yoke, Cycle.TWO_STROKE, 720) for side in sides)
    assert crank == pytest.approx(np.roll(head, 360), abs=1e-6 * np.abs(head).max())


@given(st.floats(0.05, 0.6), st.floats(0.0, 1.0), st.floats(0.0, 0.5), st.floats(0.01, 0.3))
@example(0.5, 0.0, 2.2e-313, 0.25)
def test_pressure_stays_between_its_ends(cut_off: float, release: float, compression: float, clearance: float) -> None:
    diagram = Steam(8e5, 1e5, cut_off, cut_off + (1 - cut_off) * release, compression, 0.5 * compression, clearance)
    chamber = replace(HEAD, diagram=diagram)
    pressures = chamber.pressure(PART, np.linspace(0.0, math.tau, 500))
    squeezed = 1e5 * (compression + clearance) / (0.5 * compression + clearance)
    expanded = 8e5 * (cut_off + clearance) / (diagram.release + clearance)
    assert pressures.min() >= 0.999 * min(1e5, expanded)
    assert pressures.max() <= 1.001 * max(8e5, squeezed)


def test_a_reversed_crank_drives_alike() -> None:
    """Check that a crank geared to run backwards gives the same torque."""
    back = replace(PART, shaft=laufruhe.machine.Shaft("back", -1.0))
    forward, backward = (gas_torque(DOUBLE, part, Cycle.TWO_STROKE, 360) for part in (PART, back))
    assert backward == pytest.approx(forward, abs=1e-9 * np.abs(forward).max())


def test_chambers_act_on_their_cylinders_alone() -> None:
    second = replace(PART, name="cylinder 2", x=1.0, throw=math.pi / 2, firing_angle=3 * math.pi / 2)
    point = OperatingPoint("run", 10.0, DOUBLE)
    forces = piston_pin_forces(engine(PART, second), point).values(np.radians([40.0]))[0, :, 0]
    inertia = piston_pin_forces(engine(PART, second), replace(point, gas=None)).values(np.radians([40.0]))[0, :, 0]
    thrust = DOUBLE.thrust(PART, Cycle.TWO_STROKE, np.radians([40.0]))[0]
    assert forces - inertia == pytest.approx([thrust, 0.0], rel=1e-6, abs=1e-6)


def test_relabelled_cylinders_load_alike() -> None:
    both = Chambers(tuple(replace(c, cylinders=("a", "b")) for c in DOUBLE.chambers), AIR)
    a, b = replace(PART, name="a"), replace(PART, name="b", x=1.0, throw=math.pi / 2, firing_angle=3 * math.pi / 2)
    swapped = replace(a, name="b"), replace(b, name="a")
    one, other = (gas_loads(engine(*parts), both) for parts in ((a, b), swapped))
    assert one.coefficients == pytest.approx(other.coefficients, abs=1e-9)
    assert one.base == Fraction(1)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"cut_off": 0.95}, "out of order"),
        ({"lead": 0.3}, "out of order"),
        ({"release": 1.2}, "out of order"),
        ({"clearance": 0.0, "lead": 0.0}, "vanishes"),
        ({"clearance": -0.1}, "negative"),
        ({"admission": 0.0}, "positive"),
        ({"exponent": 0.0}, "over 0"),
    ],
)
def test_diagrams_that_cannot_be(change: dict[str, float], said: str) -> None:
    with pytest.raises(ModelError, match=said):
        replace(STEAM, **change)


FILE = """
title = "steam"
[engine]
layout = "inline"
cycle = "two-stroke"
cylinders = 1
stroke = "800 mm"
rod_length = "2 m"
reciprocating_mass = "830 kg"
[[operating_points]]
speed = "50 rpm"
[gas]
model = "chambers"
[[gas.chambers]]
end = "head"
bore = "45 cm"
rod = "7.5 cm"
steam = { admission = "9 bar", cut_off = 0.3, back_pressure = "1.2 bar" }
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("cut_off = 0.3", "cut_off = 0.3, release = 0.2", "gas.chambers[1].steam"),
        ('rod = "7.5 cm"', 'rod = "45 cm"', "the chamber vanishes"),
        ('end = "head"', 'end = "head"\ncylinders = [2]', "is not among 1 cylinder"),
        ('end = "head"', 'end = "top"', "gas.chambers[1].end"),
        (
            "steam =",
            'pump = { suction = "1 bar", delivery = "5 bar" }\nsteam =',
            "give the chamber one of the keys steam, pump, compressor and trace",
        ),
        ('cycle = "two-stroke"', 'cycle = "four-stroke"', "chambers, which work once a turn"),
        ('speed = "50 rpm"', 'speed = "50 rpm"\nimep = "4 bar"', "needs [gas] with model seiliger or wiebe"),
        ('layout = "inline"', 'layout = "opposed-piston"\ncrank_distance = "6 m"', "share a chamber"),
    ],
)
def test_files_that_contradict_themselves(old: str, new: str, said: str) -> None:
    """Check one line that names the key."""
    with pytest.raises(InputError) as caught:
        laufruhe.load(FILE.replace(old, new, 1))
    assert said in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


COMPRESSOR = {"suction": 1.2e5, "delivery": 7e5, "clearance": 0.07, "exponent": 1.25}


@pytest.mark.parametrize("end", ["head", "crank"])
@pytest.mark.parametrize("pressures", [(1e5, 3e5), (1.2e5, 7e5), (30e5, 31e5)])
@pytest.mark.parametrize("exponent", [1.1, 1.4])
def test_work_of_a_compressor_in_closed_form(end: str, pressures: tuple[float, float], exponent: float) -> None:
    """Check G17b, n / (n - 1) p_s eta V (r^((n - 1) / n) - 1) a turn, for any rod."""
    (suction, delivery), c = pressures, 0.07
    diagram = Compressor(suction, delivery, c, exponent)
    ratio = delivery / suction
    efficiency = 1.0 + c - c * ratio ** (1.0 / exponent)
    assert 1.0 - diagram.release == pytest.approx(efficiency, rel=1e-12)
    chamber = Chamber("stage", ("cylinder 1",), end, 0.12, 0.03, diagram)
    gain = exponent / (exponent - 1.0) * (ratio ** ((exponent - 1.0) / exponent) - 1.0)
    work = gain * suction * efficiency * chamber.area * PART.stroke
    torque = gas_loads(engine(PART), Chambers((chamber,), AIR)).coefficients[0, 3].real
    assert -torque * math.tau == pytest.approx(work, rel=1e-9)


def test_a_compressor_point_by_point() -> None:
    """Compare with polytropes between the pressures, in scalars."""
    diagram, c, n = Compressor(**COMPRESSOR), 0.07, 1.25
    chamber = replace(HEAD, diagram=diagram)
    for degrees in (0.5, 5.0, 20.0, 60.0, 170.0, 190.0, 250.0, 300.0, 330.0, 359.0):
        x, is_out = plain_travel(degrees), degrees < 180.0
        expanded, squeezed = 7e5 * (c / (x + c)) ** n, 1.2e5 * ((1 + c) / (x + c)) ** n
        expected = max(expanded, 1.2e5) if is_out else min(squeezed, 7e5)
        assert chamber.pressure(PART, np.radians([degrees]))[0] == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"delivery": 1e5}, "must be above suction"),
        ({"suction": 0.0}, "must be positive"),
        ({"clearance": 0.0}, "0.03 to 0.15 is usual"),
        ({"clearance": 0.5}, "takes no gas in"),
        ({"exponent": 6.0}, "at most 5"),
    ],
)
def test_compressors_that_cannot_be(change: dict[str, float], said: str) -> None:
    with pytest.raises(ModelError, match=said):
        Compressor(**COMPRESSOR | change)


def test_equal_pistons_of_the_ready_compressor_leave_no_first_order() -> None:
    """Check that a 90-degree vee with balanced m r has no order 1."""
    problem = laufruhe.load("compressor-two-stage")
    first, second = problem.engine.slider_cranks
    (web,) = problem.engine.rotors
    web = replace(web, unbalance=-1.9 * 0.04 * cmath.exp(1j * first.throw))
    balanced = replace(problem.engine, slider_cranks=(first, replace(second, reciprocating_mass=1.9)), rotors=(web,))
    loads = shaking_loads(balanced, problem.points[0]).coefficients
    unbalanced = shaking_loads(problem.engine, problem.points[0]).coefficients
    assert np.abs(loads[1, :3]).max() < 1e-9 * np.abs(unbalanced[1, :3]).max()
    # two stages of about the same work
    work = -loads[0, 3].real * math.tau
    assert work == pytest.approx(105.98 + 113.06, rel=1e-3)
    # figures of each stage
    stages = dict(cylinder_facts(problem.engine, problem.points[0]))
    assert [stage.split(", ")[1] for stage in stages] == ["first stage", "second stage"]
    assert [-facts.torque * math.tau for facts in stages.values()] == pytest.approx([105.98, 113.06], rel=1e-3)
    for facts, bore, peak in zip(stages.values(), (0.12, 0.07), (3.06e5, 10e5), strict=True):
        assert facts.displacement == pytest.approx(math.pi / 4.0 * bore**2 * 0.08, rel=1e-12)
        assert facts.imep * facts.displacement == pytest.approx(facts.torque * math.tau, rel=1e-12)
        assert (facts.peak_pressure, facts.power) == pytest.approx((peak, facts.torque * problem.points[0].speed))


def test_a_file_needs_no_bore_of_the_engine() -> None:
    gas = laufruhe.load(FILE).points[0].gas
    assert isinstance(gas, Chambers)
    assert gas.chambers[0].name == "chamber 1"
