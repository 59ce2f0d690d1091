"""Sections of the running gear, compared with textbook numbers, a worked diesel, and independent statics."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.bearing_loads.machine import Bearing, MainBearings, bearings_of
from laufruhe.extensions.bearing_loads.physics import pin_forces, piston_pin_forces
from laufruhe.extensions.sizes import strength
from laufruhe.extensions.sizes.machine import Bolts, PistonPin, RunningGear, Shank, Webs, moving_gear, resized
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.physics.fidelity import EXACT
from laufruhe.physics.torque import crank_torque
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import MEASURES, Limit, Measure
from laufruhe.problem.problem import Problem
from problem_files import loaded

POINT = OperatingPoint("", 300.0)
TEXT = """
title = "Two throws, three bearings"
[engine]
layout = "inline"
cycle = "four-stroke"
bore = "90 mm"
stroke = "84 mm"
rod_length = "150 mm"
reciprocating_mass = "0.8 kg"
rotating_mass = "0.4 kg"
cylinder_spacing = "110 mm"
throws = [0, 360]
firing_order = [1, 2]
big_end = { diameter = "50 mm", width = "28 mm" }
[[operating_points]]
speed = "3000 rpm"
[gas]
model = "seiliger"
peak_pressure = "70 bar"
imep = "8 bar"
[[main_bearings]]
x = "105 mm"
diameter = "60 mm"
width = "30 mm"
[[main_bearings]]
x = "2 mm"
diameter = "62 mm"
width = "30 mm"
[[main_bearings]]
x = "-110 mm"
diameter = "60 mm"
width = "32 mm"
[[counterweights]]
name = "web"
x = "72 mm"
opposite_throw = 1
radius = "60 mm"
mass = "1.5 kg"
[running_gear]
webs = { width = "80 mm", thickness = "20 mm" }
rod = { diameter = "22 mm" }
piston_pin = { diameter = "28 mm", bore = "16 mm", length = "70 mm" }
bolts = { count = 2, diameter = "8 mm" }
[fidelity]
samples = 360
"""
# textbook, 10.1.2: D 70 mm, 65 bar
FORCE, PIN = 25000.0, PistonPin(0.022, 0.015, 0.063, given_span=0.045)


def sized(engine: Engine, **parts: object) -> Engine:
    return engine.with_extra(RunningGear(212e9, **parts))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def engine() -> Engine:
    return laufruhe.load(TEXT).engine


class TestTextbook:
    """Example of the piston pin (10.1.2), eqs. 92 to 94; eqs. 98 to 100."""

    def test_outer_diameter_by_pressure(self, engine: Engine) -> None:
        assert pytest.approx(6.5e6 * math.pi / 4.0 * 0.07**2, rel=1e-3) == FORCE
        needed = FORCE / (40e6 * 0.030)
        pin = PistonPin(needed, 0.0, 0.060)
        (factor, _) = strength.boss_factors(sized(engine, piston_pin=pin), POINT)
        assert needed == pytest.approx(0.0208, abs=5e-5)
        assert FORCE * factor == pytest.approx(40e6)

    def test_deflection(self, engine: Engine) -> None:
        (factor, _) = strength.deflection_factors(sized(engine, piston_pin=PIN), POINT)
        assert FORCE * factor == pytest.approx(0.017e-3, abs=0.0005e-3)
        assert PistonPin(0.022, 0.015, 0.060).span == pytest.approx(0.045)

    @pytest.mark.parametrize(("bore", "printed"), [(0.015, 0.035e-3), (0.014, 0.021e-3)])
    def test_ovality(self, bore: float, printed: float, engine: Engine) -> None:
        (factor, _) = strength.ovality_factors(sized(engine, piston_pin=replace(PIN, bore=bore)), POINT)
        assert FORCE * factor == pytest.approx(printed, abs=0.0005e-3)

    def test_pin_in_the_middle_is_eq_99_and_web_eq_100(self, engine: Engine) -> None:
        """Check L between the bearings; the factor 1.5 of eq. 100 is for half the force on each side."""
        length, width, b, h, d, force = 0.16, 0.04, 0.09, 0.03, 0.055, 1e4
        part = replace(engine.slider_cranks[0], x=0.0, big_end=(d, length - 2.0 * h - width))
        bearings = tuple(Bearing(str(x), x, 0.06, width) for x in (0.5 * length, -0.5 * length))
        one = replace(sized(engine, webs=Webs(b, h)), slider_cranks=(part,), rotors=())
        one = one.with_extra(MainBearings(bearings))
        moment = strength.pin_moments(one, POINT, EXACT).sample(1)[0, 0, 2]
        side = strength.side_forces(one, POINT, EXACT).sample(1)[0, :, 2]
        load = pin_forces(one, POINT).sample(1)[0, 0, 2]
        stress = force * moment / load * strength.big_end_factors(one, POINT)[0]
        assert stress == pytest.approx(force * length * 8.0 / (math.pi * d**3))
        webs = force * side / load * strength.web_factors(one, POINT)
        assert webs == pytest.approx(1.5 * force * (width + h) / (b * h**2) + force / (2.0 * b * h))

    def test_journal_of_a_mean_torque_is_eq_98(self, engine: Engine) -> None:
        torque = 1234.0
        diameter = (16.0 * torque / (30e6 * math.pi)) ** (1.0 / 3.0)
        one = engine.with_extra(MainBearings((Bearing("", 0.0, diameter, 0.03),)))
        assert torque * strength.journal_factors(one, POINT)[0] == pytest.approx(30e6)


class TestWorkedDiesel:
    """Part H a; the crankshaft's stresses are statements of problems/replication-worked-diesel.toml."""

    def test_rod_buckles(self, engine: Engine) -> None:
        """Check 55422 kg against the printed 55050 kg, with 10 for pi^2 and 870 cm4 for the section."""
        rod = replace(engine.slider_cranks[0], rod_length=1.5, crank_radius=0.3)
        gear = RunningGear(2150000 * 98066.5, rod=Shank(0.115))
        (factor,) = strength.buckling_factors(replace(engine, slider_cranks=(rod,), extras=(gear,)), POINT)
        rounded = 10.0 / math.pi**2 * 870e-8 / Shank(0.115).inertia
        assert rounded / (44000.0 * 9.80665 * factor) == pytest.approx(19.0, abs=0.5)
        carried = rounded / (15.0 * 9.80665 * factor)
        assert carried == pytest.approx(55422.0, rel=1e-4)
        assert carried == pytest.approx(55050.0, rel=0.01)


def test_pieces_of_the_shaft_are_in_balance(engine: Engine) -> None:
    """Compare with supports from moments about each end, and the pin moment from loads before it."""
    webs = [(r.x, r.unbalance * POINT.speed**2) for r in engine.rotors if r.unbalance]
    moments = strength.pin_moments(engine, POINT, EXACT).values(np.array([0.7]))[0]
    sides = strength.side_forces(engine, POINT, EXACT).values(np.array([0.7]))[0]
    pins = pin_forces(engine, POINT).values(np.array([0.7]))[0]
    for k, (front, rear) in enumerate([(0.105, 0.002), (0.002, -0.110)]):
        turned = [(x, u * np.exp(0.7j)) for x, u in webs]
        loads = [(x, np.array([0.0, w.imag, w.real])) for x, w in turned if rear < x < front]
        loads.append((engine.slider_cranks[k].x, pins[k]))
        carried = sum(force * (x - rear) for x, force in loads) / (front - rear)
        assert sides[2 * k] == pytest.approx(carried, rel=1e-9)
        assert sides[2 * k + 1] == pytest.approx(sum(force for _, force in loads) - carried, rel=1e-9)
        place = engine.slider_cranks[k].x
        moment = carried * (front - place) - sum(force * (x - place) for x, force in loads if x > place)
        assert moments[k] == pytest.approx(moment, rel=1e-9)


def test_journals_hand_on_the_torque_of_what_stands_before_them(engine: Engine) -> None:
    angles = np.linspace(0.0, 12.0, 17)
    result = strength.journal_torques(engine, POINT, EXACT).values(angles)
    whole = crank_torque(engine, POINT).values(angles)
    first = crank_torque(replace(engine, slider_cranks=engine.slider_cranks[:1]), POINT).values(angles)
    assert result == pytest.approx(np.stack([0.0 * whole, first, whole], axis=1), abs=1e-9 * np.abs(whole).max())


def test_stresses_are_measures_of_a_problem() -> None:
    """Compare journals with bending and torsion at one angle by hand, combined by distortion energy."""
    problem = laufruhe.load(TEXT)
    evaluation = evaluate(problem)
    point = problem.points[0]
    channel, norm = MEASURES["maximum journal stress"]
    value = evaluation.value(Measure(channel, norm, at=("cylinder 2 rear",)))
    angles = np.linspace(0.0, 4.0 * math.pi, 4001)
    force = np.linalg.norm(strength.side_forces(problem.engine, point, EXACT).values(angles)[:, 3], axis=1)
    torque = crank_torque(problem.engine, point).values(angles)
    bending = force * 0.016 / (math.pi / 32.0 * 0.060**3)
    shear = torque / (math.pi / 16.0 * 0.060**3)
    assert value == pytest.approx(np.sqrt(bending**2 + 3.0 * shear**2).max(), rel=1e-3)
    rod = evaluation.value(Measure(*MEASURES["maximum rod stress"]))
    pressed = np.linalg.norm(piston_pin_forces(problem.engine, point).values(angles), axis=-1).max()
    assert rod == pytest.approx(pressed / (math.pi / 4.0 * 0.022**2), rel=1e-3)
    speed = evaluation.value(Measure(*MEASURES["maximum main-bearing pressure times speed"]))
    pressures = [
        evaluation.value(Measure(*MEASURES["maximum main-bearing pressure"], at=(b.name,))) * 0.5 * b.diameter
        for b in bearings_of(problem.engine) if b.diameter is not None
    ]  # fmt: skip
    assert speed == pytest.approx(max(pressures) * point.speed, rel=1e-9)
    bolts = evaluation.value(Measure(*MEASURES["maximum bolt stress"]))
    part = problem.engine.slider_cranks[0]
    pull = (part.reciprocating_mass * (1.0 + part.rod_ratio) + part.rotating_mass) * part.crank_radius * point.speed**2
    assert bolts == pytest.approx(pull / Bolts(2, 0.008).area, rel=1e-6)


def test_eyes_of_the_rod_are_limits_on_its_pull(tmp_path: Path) -> None:
    """Check textbook eqs. 95 to 97: F/(2 A), F r/(2 W) of the pull, shared by two bolts."""
    allowed, area, arm, modulus = 40e6, 0.8e-4, 0.012, 0.4e-6
    free = '[[operating_points]]\nname = "exchange"\nspeed = "3000 rpm"\ngas = false\n[gas]'
    limits = "".join(
        f'[[constraints]]\nname = "{eye}"\nlimit = "{name}"\noperating_points = ["exchange"]\nmax = "{maximum} N"\n'
        for eye, name, maximum in (
            ("small eye pulled", "maximum rod force", 2.0 * area * allowed),
            ("small eye bent", "maximum rod force", 2.0 * modulus * allowed / arm),
            ("bolts", "maximum crank-pin force", 2.0 * area * allowed),
        )
    )  # fmt: skip
    problem = loaded(tmp_path, TEXT.replace("[gas]", free) + limits + '[objective]\nminimise = "rms shaking force"\n')
    found = {limit.measure.name: problem_limit(problem, limit) for limit in problem.limits}
    part, speed = problem.engine.slider_cranks[0], problem.points[1].speed
    small = part.reciprocating_mass * (1.0 + part.rod_ratio) * part.crank_radius * speed**2
    large = small + part.rotating_mass * part.crank_radius * speed**2
    assert sorted(found.values()) == pytest.approx(sorted([small, large]), rel=1e-6)
    # Z8 with the section of one bolt in place of A
    bolts = evaluate(problem).value(Measure(*MEASURES["maximum bolt stress"], points=("exchange",)))
    assert bolts == pytest.approx(large / (2.0 * Bolts(1, 0.008).area), rel=1e-6)
    stresses = [small / (2.0 * area), small * arm / (2.0 * modulus), large / (2.0 * area)]
    within = [evaluate(problem).value(limit.measure) <= limit.maximum for limit in problem.limits]
    assert within == [stress <= allowed for stress in stresses]


def problem_limit(problem: Problem, limit: Limit) -> float:
    return evaluate(problem).value(limit.measure)


def test_masses_follow_the_sizes() -> None:
    """Compare masses with plain bodies: a straight rod, rings, and webs as boxes integrated over their length."""
    plain = laufruhe.load(TEXT).engine
    heavy = laufruhe.load(TEXT.replace("[running_gear]", '[running_gear]\ndensity = "7850 kg/m^3"')).engine
    shank = 7850.0 * math.pi / 4.0 * 0.022**2 * 0.150
    ring = 7850.0 * math.pi / 4.0 * (0.028**2 - 0.016**2) * 0.070
    for a, b in zip(plain.slider_cranks, heavy.slider_cranks, strict=True):
        assert b.reciprocating_mass - a.reciprocating_mass == pytest.approx(0.5 * shank + ring)
        assert b.rotating_mass - a.rotating_mass == pytest.approx(0.5 * shank)
        ends = 2.0 * 0.5 * shank * 0.075**2
        assert b.rod_inertia_deficit == pytest.approx(shank * 0.150**2 / 12.0 - ends)
    s = np.linspace(-0.030, 0.042 + 0.025, 100001)
    webs = 2.0 * 7850.0 * 0.080 * 0.020 * float(np.trapezoid(s, s))
    pin = 7850.0 * math.pi / 4.0 * 0.050**2 * 0.028 * 0.042
    for a, b in zip(plain.rotors, heavy.rotors, strict=True):
        added = webs + pin if a.name.startswith("throw") else 0.0
        assert b.unbalance - a.unbalance == pytest.approx(added, abs=1e-9)


def test_sizes_there_and_back_leave_the_engine_as_it_is() -> None:
    engine = laufruhe.load(TEXT.replace("[running_gear]", '[running_gear]\ndensity = "7850 kg/m^3"')).engine
    sizes = moving_gear(engine).sizes
    larger = resized(engine, {size: 1.1 * value for size, value in sizes.items()})
    assert moving_gear(larger).sizes == pytest.approx({size: 1.1 * value for size, value in sizes.items()})
    back = resized(larger, sizes)
    for a, b in zip(engine.slider_cranks, back.slider_cranks, strict=True):
        assert [b.reciprocating_mass, b.rotating_mass] == pytest.approx([a.reciprocating_mass, a.rotating_mass])
    assert [r.unbalance for r in back.rotors] == pytest.approx([r.unbalance for r in engine.rotors])


@pytest.mark.parametrize(
    ("old", "new", "rule"),
    [
        ('diameter = "22 mm" }', 'diameter = "0 mm" }', "must be more than 0 m"),
        ('bore = "16 mm"', 'bore = "28 mm"', "does not fit into a pin"),
        ('width = "80 mm", thickness = "20 mm"', 'width = "80 mm"', "thickness"),
        ("count = 2", "count = 0", "greater than or equal to 1|at least 1"),
        ('[running_gear]', '[running_gear]\ndensity = "0 kg/m^3"', "must be more than 0"),
    ],
)  # fmt: skip
def test_sizes_that_are_none_are_one_line_each(old: str, new: str, rule: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=rule) as refused:
        loaded(tmp_path, TEXT.replace(old, new))
    assert len(refused.value.complaints) == 1


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (lambda e: replace(e, extras=(MainBearings(bearings_of(e)),)), "add \\[running_gear\\]"),
        (lambda e: e.with_extra(replace(e.extra(RunningGear), webs=None)), "has no webs"),
        (lambda e: e.with_extra(MainBearings(bearings_of(e)[1:])), "no main bearing on one side"),
        (lambda e: e.with_extra(MainBearings(bearings_of(e)[::2])), "no main bearing between them"),
    ],
)  # fmt: skip
def test_a_missing_dimension_is_named(change: object, rule: str, engine: Engine) -> None:
    one = change(engine)  # type: ignore[operator]
    channel, _ = MEASURES["maximum web stress"]
    loads = PointLoads(POINT, crank_torque(engine, POINT), None, moving_parts=one)
    with pytest.raises(ModelError, match=rule):
        channel.signal(loads)  # type: ignore[attr-defined]
