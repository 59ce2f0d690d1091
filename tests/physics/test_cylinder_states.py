"""Misfire and cut cylinders, compared with independent volumes, work and torque."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import InputError
from laufruhe.extensions.bearing_loads.physics import pin_forces
from laufruhe.extensions.flywheel.torque import torque_facts, turning_torque
from laufruhe.machine import Cycle, Seiliger, SliderCrank
from laufruhe.machine.gas.base import CylinderGases
from laufruhe.physics.gas_loads import gas_coefficients
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.torque import crank_torque, cylinder_torque

RADIUS, ROD, BORE, RATIO, N1, INTAKE, EXHAUST = 0.0425, 0.14, 0.08, 10.0, 1.35, 0.6e5, 1.1e5
AIR, IMEP, PEAK = 101_325.0, 4e5, 30e5
STEPS = 2**15


def engine_tables(*points: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Return the tables of an in-line four."""
    return {
        "title": "four",
        "engine": {
            "layout": "inline", "cycle": "four-stroke", "bore": f"{BORE} m", "stroke": f"{2 * RADIUS} m",
            "rod_length": f"{ROD} m", "reciprocating_mass": "0.5 kg", "cylinder_spacing": "90 mm",
            "throws": [0, 180, 180, 0], "firing_order": [1, 3, 4, 2],
        },
        "gas": {
            "model": "seiliger", "peak_pressure": f"{PEAK} Pa", "imep": f"{IMEP} Pa", "compression_ratio": RATIO,
            "compression_exponent": N1, "intake_pressure": f"{INTAKE} Pa", "exhaust_pressure": f"{EXHAUST} Pa",
        },
        "operating_points": list(points) or [{"name": "all", "speed": "900 rpm"}],
        **more,
    }  # fmt: skip


def piston(angle: np.ndarray) -> np.ndarray:
    """Return the place of the piston from the crank [m]."""
    return RADIUS * np.cos(angle) + np.sqrt(ROD**2 - (RADIUS * np.sin(angle)) ** 2)


def unfired_torque(valves: str) -> np.ndarray:
    """Return the torque by virtual work, p dV, at equal crank angles after the firing dead centre [N m]."""
    angle = 4.0 * math.pi * (np.arange(STEPS) + 0.5) / STEPS
    area, top = 0.25 * math.pi * BORE**2, RADIUS + ROD
    swept = 2.0 * RADIUS * area
    volume = swept / (RATIO - 1.0) + area * (top - piston(angle))
    squeezed = INTAKE * (swept * RATIO / (RATIO - 1.0) / volume) ** N1
    stroke = np.floor(angle / math.pi)
    pressure = {
        "closed": squeezed,
        "open": np.full(STEPS, INTAKE),
        "moving": np.select([stroke == 1, stroke == 2], [EXHAUST, INTAKE], squeezed),
    }[valves]
    half = 2.0 * math.pi / STEPS
    slope = area * (piston(angle - half) - piston(angle + half)) / (2.0 * half)
    return np.asarray((pressure - AIR) * slope)


@pytest.mark.parametrize(
    ("state", "valves"),
    [({"misfire": [3]}, "moving"), ({"cut": [3]}, "closed"), ({"cut": [3], "cut_valves": "open"}, "open")],
    ids=["misfire", "closed", "open"],
)
def test_torque_lacks_combustion_of_one_cylinder_alone(state: dict[str, Any], valves: str) -> None:
    """Compare the torque with that of all cylinders, with cylinder 3 unfired instead of fired."""
    point = {"name": "all", "speed": "900 rpm"}
    problem = laufruhe.load(engine_tables(point, {**point, "name": "one out", **state}))
    every, out = problem.points
    lost = crank_torque(problem.engine, every) + crank_torque(problem.engine, out).mapped(np.negative)
    part = problem.engine.slider_cranks[2]
    fired = gas_coefficients(every.gas, part, Cycle.FOUR_STROKE).coefficients
    transform = np.fft.rfft(unfired_torque(valves)) / STEPS
    k = np.arange(30)
    # samples stand at the middles of steps
    unfired = np.where(k == 0, 1.0, 2.0) * transform[k] * np.exp(-1j * math.pi * k / STEPS)
    expected = (fired[k] - unfired) * np.exp(-0.5j * k * part.firing_angle)
    np.testing.assert_allclose(lost.coefficients[k], expected, atol=2e-5 * abs(fired[:30]).max())
    # 0.5, 1 and 1.5 are orders of the cycle that even firing cancels
    assert np.abs(crank_torque(problem.engine, every).coefficients[1:4]).max() < 1e-9
    assert np.abs(lost.coefficients[1]) > 1.0


def test_a_recorded_cylinder_without_combustion_is_that_of_misfire(tmp_path: Path) -> None:
    """Compare traces of both pressures in one file with the cycles behind them."""
    points = ({"name": "all", "speed": "900 rpm"}, {"name": "out", "speed": "900 rpm", "misfire": [3]},
              {"name": "motored", "speed": "900 rpm", "motored": True})  # fmt: skip
    computed = laufruhe.load(engine_tables(*points))
    degrees, part = np.arange(-360.0, 360.0, 1.0), computed.engine.slider_cranks[0]
    columns = [computed.points[k].gas.pressure(part, Cycle.FOUR_STROKE, np.radians(degrees)) for k in (0, 2)]
    rows = (f"{a},{p / 1e5:.9f},{q / 1e5:.9f}" for a, p, q in zip(degrees, *columns, strict=True))
    (tmp_path / "both.csv").write_text("angle,fired,motored\n" + "\n".join(rows) + "\n")
    gas = {"model": "trace", "file": str(tmp_path / "both.csv"), "pressure_column": "fired", "smooth": False}
    recorded = laufruhe.load(engine_tables(*points) | {"gas": {**gas, "motored_column": "motored"}})
    for one, other in zip(recorded.points, computed.points, strict=True):
        found, expected = (crank_torque(computed.engine, point).sample(360) for point in (one, other))
        assert np.abs(found - expected).max() < 5e-3 * np.abs(expected).max()
    turning = [turning_torque(computed.engine, problem.points[0]) for problem in (recorded, computed)]
    assert turning[0].torque == pytest.approx(turning[1].torque, rel=5e-3)
    with pytest.raises(InputError, match="record it too and name its motored_column"):
        laufruhe.load(engine_tables(points[1]) | {"gas": gas})


def test_closed_valves_do_no_work_and_repeat_every_turn() -> None:
    part = SliderCrank("cylinder 1", 0.0, RADIUS, ROD, 0.5, bore=BORE)
    gas = Seiliger(peak_pressure=PEAK, imep=IMEP, compression_ratio=RATIO, intake_pressure=INTAKE).cut(False)
    angle = np.linspace(0.0, math.tau, 101)
    pressure = gas.pressure(part, Cycle.FOUR_STROKE, angle)
    np.testing.assert_allclose(pressure, gas.pressure(part, Cycle.FOUR_STROKE, angle + math.tau), rtol=1e-12)
    np.testing.assert_allclose([pressure.max(), pressure.min()], [INTAKE * RATIO**N1, INTAKE], rtol=1e-12)
    problem = laufruhe.load(engine_tables({"name": "p", "speed": "900 rpm", "cut": [1, 2, 3, 4]}))
    assert abs(crank_torque(problem.engine, problem.points[0]).coefficients[0]) < 1e-9


def test_work_of_a_cycle_is_that_of_the_cylinders_that_fire() -> None:
    problem = laufruhe.load(engine_tables({"name": "p", "speed": "900 rpm", "misfire": [2], "cut": [3]}))
    swept = 0.25 * math.pi * BORE**2 * 2.0 * RADIUS
    work = 2.0 * IMEP * swept + (INTAKE - EXHAUST) * swept
    torque = crank_torque(problem.engine, problem.points[0]).coefficients[0].real
    assert torque == pytest.approx(work / (4.0 * math.pi), rel=1e-6)


def test_states_take_the_gas_of_their_own_cylinder() -> None:
    """Check that a misfiring cylinder keeps its compression ratio, and the others their imep."""
    tables = engine_tables({"name": "p", "speed": "900 rpm", "misfire": [2]})
    tables["gas"]["single_cylinders"] = [
        {"cylinders": [2], "compression_ratio": 8.0}, {"cylinders": [4], "imep": "5 bar"},
    ]  # fmt: skip
    gas = laufruhe.load(tables).points[0].gas
    assert isinstance(gas, CylinderGases)
    second, fourth = (gas.of_cylinder(f"cylinder {k}") for k in (2, 4))
    assert isinstance(second, Seiliger)
    assert second.peak_pressure == pytest.approx(INTAKE * 8.0**N1)
    assert isinstance(fourth, Seiliger)
    assert fourth.imep == 5e5


def test_torsion_takes_the_gas_of_each_cylinder() -> None:
    """Check that the torques of single cylinders add up to that of the engine."""
    problem = laufruhe.load(engine_tables({"name": "p", "speed": "900 rpm", "misfire": [2], "cut": [4]}))
    engine, point = problem.engine, problem.points[0]
    total = crank_torque(engine, point).coefficients[:40]
    k = np.arange(40)
    each = [
        cylinder_torque(engine.cycle, part, point)[:40] * np.exp(-0.5j * k * part.firing_angle)
        for part in engine.slider_cranks
    ]
    np.testing.assert_allclose(np.sum(each, axis=0), total, atol=1e-9 * abs(total).max())


def test_bearings_and_flywheel_follow_the_state() -> None:
    """Check that rod forces give the crank torque, and that stored work is that of the torque."""
    tables = engine_tables({"name": "p", "speed": "900 rpm", "misfire": [2], "cut": [4]})
    problem = laufruhe.load({**tables, "flywheel": {"inertia": "0.3 kg m^2"}})
    engine, point = problem.engine, problem.points[0]
    torque, forces = crank_torque(engine, point).sample(STEPS // 8), pin_forces(engine, point).sample(STEPS // 8)
    angle = 4.0 * math.pi * np.arange(STEPS // 8) / (STEPS // 8)
    driven = np.zeros_like(torque)
    for part, force in zip(engine.slider_cranks, forces.swapaxes(0, 1), strict=True):
        driven += RADIUS * (force[:, 1] * np.cos(angle + part.throw) - force[:, 2] * np.sin(angle + part.throw))
    np.testing.assert_allclose(driven, torque, atol=2e-4 * np.abs(torque).max())
    work = np.cumsum(torque - torque.mean()) * 32.0 * math.pi / STEPS
    assert torque_facts(engine, point).excursion == pytest.approx(np.ptp(work), rel=1e-3)


def test_each_makes_a_point_for_each_cylinder_and_shares_the_weight() -> None:
    every = {"speed": "900 rpm"}
    points = laufruhe.load(engine_tables(every, {**every, "misfire": "each", "cut": [4], "weight": 2.0})).points
    assert [point.name for point in points] == [
        "900 rpm", *(f"900 rpm, cylinder {k} misfires, cylinder 4 cut" for k in (1, 2, 3)),
    ]  # fmt: skip
    assert [point.weight for point in points] == pytest.approx([1.0, *[2.0 / 3.0] * 3])


def test_two_pistons_of_a_cylinder_misfire_together() -> None:
    tables = engine_tables({"speed": "900 rpm", "misfire": "each"})
    tables["engine"] |= {"layout": "opposed-piston", "cycle": "two-stroke", "crank_distance": "0.5 m"}
    del tables["engine"]["firing_order"]
    tables["engine"]["throws"] = [0, 180]
    problem = laufruhe.load(tables)
    assert len(problem.points) == 2
    gas = problem.points[0].gas
    assert isinstance(gas, CylinderGases)
    assert len(gas.single) == 2
    wrench = shaking_loads(problem.engine, problem.points[0])
    assert np.isfinite(wrench.coefficients).all()


@pytest.mark.parametrize(
    ("keys", "gas", "message"),
    [
        ({"misfire": [5]}, {}, "is not among 4 cylinders; count them from 1"),
        ({"misfire": []}, {}, "is empty; name a cylinder"),
        ({"misfire": [2], "cut": [2]}, {}, "has cylinders of misfire too"),
        ({"misfire": "each", "cut": [1, 2, 3, 4]}, {}, "leaves no cylinder that fires"),
        ({"misfire": [2], "motored": True}, {}, "has no combustion in any cylinder"),
        ({"cut_valves": "open"}, {}, "is given without cut cylinders"),
        ({"cut": [2], "bmep": "3 bar"}, {}, "beside a load at the brake"),
        ({"misfire": [2]}, None, "needs [gas] with model seiliger or wiebe"),
    ],
)
def test_messages(keys: dict[str, Any], gas: dict[str, Any] | None, message: str) -> None:
    tables = engine_tables({"name": "p", "speed": "900 rpm", **keys})
    if gas is None:
        del tables["gas"]
    with pytest.raises(InputError) as error:
        laufruhe.load(tables)
    assert message in str(error.value)
    assert "\n" not in str(error.value).strip()


@pytest.mark.slow
def test_open_throws_are_the_best_of_all_firing_orders() -> None:
    """Compare star and order for a cut cylinder with each even crank solved by itself."""
    point = {"name": "p", "speed": "1800 rpm", "cut": [2], "cut_valves": "open", "misfire": [1]}
    mounts = {
        "mounts": {
            "kind": "rigid",
            "positions": [[f"{x} m", f"{y} m", "0 m"] for x in (0.2, -0.2) for y in (0.2, -0.3)],
        }
    }
    shaft = {"name": "s", "ratio": 1, "position": ["60 mm", "-100 mm"]}
    shaft["unbalances"] = [
        {"x": "100 mm", "unbalance": {"between": ["0 kg m", "0.01 kg m"]}, "angle": {"between": [0, 360]}}
    ]
    tables = engine_tables(point, {"name": "all", "speed": "1800 rpm"}, **mounts, balancer_shafts=[shaft])
    tables["objective"] = {"minimise": "worst mean mount force"}

    def solved(throws: Any, order: Any) -> Any:
        engine = {**tables["engine"], "throws": throws, "firing_order": order}
        return laufruhe.solve(
            laufruhe.load({**tables, "engine": engine | ({"cylinders": 3} if throws == "open" else {})})
        )

    best = min(
        solved([0, -240 * order.index(2) % 360, -240 * order.index(3) % 360], order).objective.value
        for order in ([1, 2, 3], [1, 3, 2])
    )
    result = solved("open", "open")
    assert result.certificate.kind == "global"
    assert result.certificate.lower_bound <= best * (1.0 + 1e-9)
    assert result.objective.value == pytest.approx(best, rel=1e-4)
