"""Friction from a Willans line or from motoring, and the loads that it leaves open."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import optimize

import laufruhe
import ready
from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.flywheel.torque import torque_facts, torque_parts, turning_torque
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.willans import mean_pressure, mean_torque, motoring_friction, willans_friction
from laufruhe.plots.results import willans
from laufruhe.problem.evaluation import evaluate
from laufruhe.prove.certificate import Proof
from picture_faults import faults_of
from problem_files import PROBLEMS, changed, loaded

LOADS = np.array([1.0, 3.0, 5.0, 8.0, 11.0]) * 1e5
FUEL = 0.4 * (LOADS * 1e-5 + 2.0) + np.array([0.02, -0.01, -0.03, 0.015, 0.01])
BRAKE = """
title = "Four at its brake"
[engine]
layout = "inline"
cycle = "four-stroke"
bore = "85 mm"
stroke = "88 mm"
rod_ratio = 0.3
reciprocating_mass = "0.95 kg"
cylinder_spacing = "97 mm"
firing_order = [1, 3, 4, 2]
[[operating_points]]
name = "pulling"
speed = "1750 rpm"
brake_torque = "250 N m"
[gas]
model = "wiebe"
imep = "10 bar"
start = -4
duration = 55
[friction]
file = "fuel.csv"
[objective]
minimise = "worst mean roll moment"
"""
ROWS = "speed, torque, fuel\n1750, 20, 2.0\n1750, 60, 3.3\n1750, 120, 5.5\n1750, 180, 7.4\n3000, 20, 5\n"


@pytest.fixture(scope="module")
def solved() -> laufruhe.solvers.Result:
    return ready.solved("car-four-willans")


def test_mean_pressure_of_the_bench_manual() -> None:
    """Check that 250 N m of the DW10 with 1997 cm3 are 15.7 bar."""
    assert mean_pressure(250.0, 1997e-6, 2) == pytest.approx(15.7e5, rel=3e-3)
    # and of the indicated work: torque times the angle of a cycle over the displacement
    assert mean_pressure(250.0, 1997e-6, 1) == pytest.approx(0.5 * mean_pressure(250.0, 1997e-6, 2))


def test_line_and_deviation_are_those_of_regression() -> None:
    """Compare with SciPy's curve_fit, which fits friction and its variance."""
    found = willans_friction(LOADS, FUEL)
    (_, friction), covariance = optimize.curve_fit(lambda x, b, f: b * (x + f), LOADS, FUEL, (4e-6, 2e5))
    assert found.mean == pytest.approx(friction, rel=1e-6)
    assert found.deviation == pytest.approx(math.sqrt(covariance[1, 1]), rel=1e-4)


def test_deviation_is_that_of_many_scattered_tables() -> None:
    rng = np.random.default_rng(1)
    truth, scatter = 0.4 * (LOADS * 1e-5 + 2.0), 0.02
    many = [willans_friction(LOADS, truth + rng.normal(0.0, scatter, len(LOADS))) for _ in range(3000)]
    spread = float(np.std([each.mean for each in many]))
    mean_deviation = math.sqrt(float(np.mean([each.deviation**2 for each in many])))
    assert mean_deviation == pytest.approx(spread, rel=0.05)
    assert np.mean([each.mean for each in many]) == pytest.approx(2e5, rel=0.01)


@given(st.floats(0.01, 100.0), st.floats(0.1, 10.0))
def test_units_of_fuel_and_load(fuel: float, load: float) -> None:
    """Check that friction has the unit of the load, and does not depend on the unit of fuel."""
    one, other = willans_friction(LOADS, FUEL), willans_friction(load * LOADS, fuel * FUEL)
    assert other.mean == pytest.approx(load * one.mean, rel=1e-9)
    assert other.deviation == pytest.approx(load * one.deviation, rel=1e-6)


def test_motoring_line() -> None:
    speeds, drag = np.array([100.0, 200.0, 300.0, 400.0]), np.array([1.0, 1.31, 1.58, 1.92]) * 1e5
    found = motoring_friction(speeds, drag, 250.0)
    (slope, level), covariance = np.polyfit(speeds - 250.0, drag, 1, cov=True)
    assert found.mean == pytest.approx(level)
    assert found.deviation == pytest.approx(math.sqrt(covariance[1, 1]))
    assert slope > 0.0


@pytest.mark.parametrize(
    ("loads", "fuel", "rule"),
    [
        ([1.0, 2.0], [1.0, 2.0], "take 3 points"),
        ([1.0, 2.0, 2.0, 3.0], [1.0, 2.0, 2.1, 3.0], "is given twice"),
        ([1.0, 2.0, 3.0], [3.0, 2.0, 1.0], "does not rise"),
        ([1.0, 2.0, 3.0], [0.5, 2.0, 3.5], "no friction"),
    ],
)
def test_tables_that_make_no_line(loads: list[float], fuel: list[float], rule: str) -> None:
    with pytest.raises(ModelError, match=rule):
        willans_friction(loads, fuel)


@pytest.mark.slow
def test_scenarios_of_the_ready_problem(solved: laufruhe.solvers.Result) -> None:
    """Check loads at the middle and two deviations to either side, and that their worst is proven least."""
    problem = solved.problem
    assert len(problem.points) == 6
    loads = [point.gas.imep for point in problem.points[:3]]
    brake = mean_pressure(250.0, sum(p.piston_area * p.stroke for p in problem.engine.slider_cranks), 2)
    # the table was made up about 2.2 bar
    assert loads[1] - brake == pytest.approx(2.2e5, abs=loads[2] - loads[1])
    assert loads[2] - loads[1] == pytest.approx(loads[1] - loads[0])
    assert solved.certificate.kind is Proof.GLOBAL
    means = [
        float(np.mean([mount.mean for mount in laufruhe.problem.evaluation.place_measures(solved.final, k)]))
        for k in range(6)
    ]
    assert solved.objective.value == pytest.approx(max(means), rel=1e-6)
    # two operating points hold the design: it is not the best for either alone
    assert max(means[:3]) == pytest.approx(max(means[3:]), rel=1e-3)
    for chosen in (problem.points[2:3], problem.points[5:6]):
        alone = laufruhe.solve(replace(problem, points=chosen))
        assert alone.objective.value < solved.objective.value * (1.0 - 1e-3)
    assert "bar of friction" in problem.assumptions[-1]


@pytest.mark.slow
def test_no_load_between_is_worse_than_the_ends(solved: laufruhe.solvers.Result) -> None:
    """Check that the ends are worst: pressure is affine in imep, and a mean of lengths convex."""
    problem = solved.problem
    point = problem.points[0]
    low, high = problem.points[0].gas.imep, problem.points[2].gas.imep
    torques = [
        gas_loads(problem.engine, replace(point.gas, imep=p), EXACT).coefficients[:, 3]
        for p in (low, 0.3 * high + 0.7 * low, high)
    ]
    assert np.abs(torques[1] - 0.7 * torques[0] - 0.3 * torques[2]).max() < 1e-10 * np.abs(torques[1]).max()
    between = tuple(replace(point, gas=replace(point.gas, imep=p)) for p in np.linspace(low, high, 9))
    named = tuple(replace(p, name=f"{k}") for k, p in enumerate(between))
    worst = evaluate(replace(problem, points=named), solved.final.engine).value(problem.objective[0].measure)
    ends = evaluate(replace(problem, points=(named[0], named[-1])), solved.final.engine)
    assert worst == pytest.approx(ends.value(problem.objective[0].measure), rel=1e-9)


def test_loads_at_the_brake_from_a_file_and_by_fmep(tmp_path: Path) -> None:
    (tmp_path / "fuel.csv").write_text(ROWS, encoding="utf-8")
    problem = loaded(tmp_path, BRAKE)
    assert [point.name for point in problem.points] == [f"pulling, {which} load" for which in ("least", "mean", "most")]
    middle = problem.points[1].gas.imep
    text = changed(BRAKE, 'file = "fuel.csv"', 'fmep = "2 bar"')
    (only,) = loaded(tmp_path, text).points
    volume = math.pi / 4 * 0.085**2 * 0.088 * 4
    assert only.gas.imep == pytest.approx(mean_pressure(250.0, volume, 2) + 2e5)
    apart = loaded(tmp_path, changed(text, '"2 bar"', '"2 bar"\ndeviation = "0.3 bar"\ndeviations = 1')).points
    assert apart[2].gas.imep - apart[0].gas.imep == pytest.approx(0.6e5)
    (tmp_path / "fuel.csv").write_text("1000;0,9\n2000;1,5\n3000;2,0\n", encoding="utf-8")
    drag = changed(BRAKE, 'file = "fuel.csv"', 'file = "fuel.csv"\nkind = "motoring"\nload_unit = "bar"')
    assert loaded(tmp_path, drag).points[1].gas.imep < middle


@pytest.mark.parametrize("fidelity", [EXACT, Fidelity(crank_inertia=0.5), Fidelity(gas_orders=4)])
def test_the_mean_roll_moment_is_the_brake_torque(fidelity: Fidelity, tmp_path: Path) -> None:
    """Check L5b at a brake torque, at idle and at an imep; orders above zero are those of the gas."""
    text = changed(BRAKE, 'file = "fuel.csv"', 'fmep = "2 bar"')
    idle = '\n[[operating_points]]\nname = "idle"\nspeed = "800 rpm"\nbmep = "0 bar"\n'
    given = '[[operating_points]]\nname = "given"\nspeed = "800 rpm"\nimep = "3 bar"\n[gas]'
    problem = loaded(tmp_path, changed(text, "[gas]", idle + given))
    volume = math.pi / 4 * 0.085**2 * 0.088 * 4
    for point, torque in zip(problem.points, (250.0, 0.0, 1e5 * volume / (4.0 * math.pi)), strict=True):
        loads = shaking_loads(problem.engine, point, fidelity)
        tiny = {"rel": 1e-6, "abs": 1e-6}
        assert loads.coefficients[0, 3].real == pytest.approx(torque, **tiny)
        assert torque_facts(problem.engine, point).mean == pytest.approx(torque, **tiny)
        parts = torque_parts(problem.engine, point)
        assert (parts["gas"] + parts["friction"]).coefficients[0].real == pytest.approx(torque, **tiny)
        rubbed = shaking_loads(problem.engine, replace(point, fmep=0.0), fidelity)
        assert np.abs((loads + rubbed.mapped(np.negative)).coefficients[1:]).max() < 1e-9
        assert (rubbed.coefficients - loads.coefficients)[0, 3].real == pytest.approx(mean_torque(2e5, volume, 2))
        # a motored crank is turned against compression, without friction
        still, moved = (turning_torque(problem.engine, replace(point, fmep=f)) for f in (0.0, 2e5))
        assert still == moved


@pytest.mark.parametrize(
    ("rows", "old", "new", "said"),
    [
        ("1750, 20, 2\n1750, 60, 3\n", "", "", "has 2 rows at 1750 rpm, the speed of pulling, and a fit needs 3"),
        (ROWS.replace("1750, 60", "1750, 20"), "", "", "one load is given twice"),
        ("1750, 20, 9\n1750, 60, 6\n1750, 90, 5\n", "", "", "does not rise with the load"),
        ("1750, 20, 0.5\n1750, 60, 3.0\n1750, 90, 5.7\n", "", "", "no friction"),
        ("1750, 20, 2.2\n1750, 60, 3.0\n1750, 90, 6\n", "", "", "friction"),
        ("1750, 20, inf\n1750, 60, 3\n1750, 90, 5\n", "", "", "not finite"),
        ("1750, 20, nan\n1750, 60, 3\n1750, 90, 5\n", "", "", "line 1 is no row of numbers"),
        ("1750, 20\n1750, 60\n", "", "", "no row of numbers"),
        (ROWS, 'file = "fuel.csv"', "", "is missing"),
        (ROWS, 'file = "fuel.csv"', 'file = "fuel.csv"\nfmep = "2 bar"', "given twice"),
        (ROWS, 'file = "fuel.csv"', 'file = "fuel.csv"\ndeviation = "1 bar"', "follows from the file"),
        (ROWS, 'file = "fuel.csv"', 'file = "fuel.csv"\nload_unit = "kg"', "load_unit"),
        (ROWS, 'brake_torque = "250 N m"', 'brake_torque = "250 N m"\nbmep = "9 bar"', "given beside"),
        (ROWS, 'brake_torque = "250 N m"', "gas = false", "is given, but no operating point has gas"),
        (ROWS, 'speed = "1750 rpm"\nbrake_torque = "250 N m"', 'speed = "900 rpm"', "has 0 rows at 900 rpm"),
        (ROWS, 'brake_torque = "250 N m"', 'brake_torque = "250 N m"\nmotored = true', "needs combustion"),
        (ROWS, '[friction]\nfile = "fuel.csv"', "", "needs [friction]"),
        (ROWS, 'bore = "85 mm"', "", "bore"),
    ],
)  # fmt: skip
def test_bad_friction_data_are_refused_in_one_line(rows: str, old: str, new: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "fuel.csv").write_text(rows, encoding="utf-8")
    with pytest.raises(InputError) as refused:
        loaded(tmp_path, changed(BRAKE, old, new) if old else BRAKE)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.slow
def test_a_limit_on_the_worst_mean_is_one_on_every_point(tmp_path: Path) -> None:
    """Check equal designs and prices under the worst mean and under a limit at each point."""
    problem = laufruhe.load(PROBLEMS / "car-four-willans.toml")
    text = (PROBLEMS / "car-four-willans.toml").read_text(encoding="utf-8")
    text = text[: text.index("[objective]")].replace("unbalance = {", 'radius = "30 mm"\nunbalance = {')
    (tmp_path / "car-four-fuel.csv").write_text((PROBLEMS / "car-four-fuel.csv").read_text("utf-8"), encoding="utf-8")
    minimum = text + '[fidelity]\nsamples = 120\n[objective]\nminimise = "balancer mass"\n'
    maximum = 'max = "700 N"\n'
    joint = laufruhe.solve(loaded(tmp_path, minimum + f'[[constraints]]\nlimit = "worst mean mount force"\n{maximum}'))
    each = "".join(
        f'[[constraints]]\nname = "{k}"\nlimit = "mean mount force"\n{maximum}operating_points = ["{point.name}"]\n'
        for k, point in enumerate(problem.points)
    )
    separate = laufruhe.solve(loaded(tmp_path, minimum + each))
    assert joint.certificate.kind is separate.certificate.kind is Proof.GLOBAL
    assert joint.objective.value == pytest.approx(separate.objective.value, rel=2e-4)
    prices = sum(limit.shadow_price for limit in separate.limits)
    assert joint.limits[0].shadow_price == pytest.approx(prices, rel=1e-2)


def test_the_line_is_drawn_down_to_no_fuel(tmp_path: Path) -> None:
    """Check the picture of a fuel table and of motoring, and that a given fmep has none."""
    (tmp_path / "fuel.csv").write_text(
        "speed,load,fuel\n" + "\n".join(f"1750,{load},{fuel}" for load, fuel in zip(LOADS * 1e-5, FUEL, strict=True))
    )
    (tmp_path / "drag.csv").write_text("speed,drag\n1000,1.5\n1750,2.1\n2500,2.6\n3000,3.1\n")
    own = '[friction]\nfile = "fuel.csv"\n'
    fuelled = '[friction]\nfile = "fuel.csv"\nload_unit = "bar"\n'
    motored = '[friction]\nfile = "drag.csv"\nkind = "motoring"\nload_unit = "bar"\n'
    for replacement in (fuelled, motored):
        result = laufruhe.evaluate(loaded(tmp_path, changed(BRAKE, own, replacement)))
        (test,) = result.problem.friction
        intercept, slope = test.line
        at = test.target if test.is_motored else -test.friction.mean
        assert intercept + slope * at == pytest.approx(test.friction.mean if test.is_motored else 0.0, abs=1e-9)
        assert willans.applies(result)
        drawn = willans.figure(result)
        assert faults_of(drawn, result.problem.title) == []
    assert not willans.applies(laufruhe.evaluate(loaded(tmp_path, changed(BRAKE, own, '[friction]\nfmep = "2 bar"\n'))))


def test_a_mean_pressure_of_the_engine_is_needed_by_points_without_a_load_alone() -> None:
    tables = tomllib.loads((PROBLEMS / "car-four-willans.toml").read_text(encoding="utf-8"))
    points = [{"speed": "800 rpm", "brake_torque": "10 N m", "name": "idle"}, {"speed": "3000 rpm", "imep": "8 bar"}]
    tables |= {"operating_points": points, "friction": {"fmep": "0.9 bar", "deviation": "0 bar"}}
    tables.pop("objective"), tables.pop("constraints", None)
    whole = laufruhe.evaluate(laufruhe.load(tables))
    del tables["gas"]["imep"]
    without = laufruhe.evaluate(laufruhe.load(tables))
    assert without.objective.value == whole.objective.value
    del points[1]["imep"]
    with pytest.raises(InputError, match=r"gas\.imep: is missing; add it, or give operating_points\[2\] imep"):
        laufruhe.load(tables)
