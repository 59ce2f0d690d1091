"""F. Roetscher, "Die Maschinenelemente", section 14: the waterworks engine of plate I, steam and pumps on one rod."""

from __future__ import annotations

import math

import numpy as np
import pytest

import laufruhe
from laufruhe.extensions.chambers.gas import Chamber, Chambers, Pump, Steam
from laufruhe.extensions.flywheel.torque import torque_facts
from laufruhe.machine import CRANKSHAFT, Cycle, SliderCrank
from laufruhe.physics.shaking_loads import reciprocating_loads
from laufruhe.problem.problem import Problem
from one_cylinder import mean_pressure_of
from problem_files import PROBLEMS

READY = PROBLEMS / "waterworks-steam-pump.toml"
CM2, KILOPOND = 1e-4, 9.80665
AT = KILOPOND / CM2
WEIGHT = 9.81
"""g of the example, on p. 609."""


@pytest.fixture(scope="module")
def engine() -> Problem:
    return laufruhe.load(READY)


def _chambers(problem: Problem) -> dict[str, Chamber]:
    gas = problem.points[0].gas
    assert isinstance(gas, Chambers)
    return {chamber.name: chamber for chamber in gas.chambers}


@pytest.mark.parametrize(("end", "printed"), [("head", 1546.3), ("crank", 1511.9)])
def test_piston_areas(engine: Problem, end: str, printed: float) -> None:
    """Below eq. 296: F' = pi/4 (45^2 - 7.5^2) = 1546.3 cm2, F'' = pi/4 (45^2 - 10^2) = 1511.9 cm2."""
    assert _chambers(engine)[f"high pressure, {end} end"].area / CM2 == pytest.approx(printed, abs=0.05)


@pytest.mark.parametrize(("degrees", "printed"), [(90.0, 3490.0), (270.0, 3710.0)])
def test_pump_forces(engine: Problem, degrees: float, printed: float) -> None:
    """P_p1 = pi/4 28.5^2 (0.45 + 5.4) - pi/4 7.5^2 5.4 = 3490 kg on the way forward, P_p2 = 3710 kg back, to 10 kg.

    The way forward is away from the pump's head: suction there, delivery at the end of the rod; both resist.
    """
    pumps = tuple(chamber for name, chamber in _chambers(engine).items() if name.startswith("pumps"))
    part = engine.engine.slider_cranks[0]
    thrust = Chambers(pumps, AT).thrust(part, Cycle.TWO_STROKE, np.radians([degrees]))[0]
    away_from_crank = 1.0 if degrees < 180.0 else -1.0
    assert away_from_crank * thrust / KILOPOND == pytest.approx(printed, abs=6.0)


@pytest.mark.parametrize(("cylinder", "printed", "digits"), [(0, 1115.0, 2.5), (1, 1330.0, 5.0)])
def test_inertia_forces(engine: Problem, cylinder: int, printed: float, digits: float) -> None:
    """Below eq. 299: 1115 kg on the high-pressure side and 1330 kg on the low, at 50 rpm, R 0.4 m, L 2.0 m."""
    part = engine.engine.slider_cranks[cylinder]
    assert (part.crank_radius, part.rod_length) == (0.4, 2.0)
    alone = laufruhe.machine.Engine("one", engine.engine.cycle, (part,))
    loads = reciprocating_loads(alone, engine.points[0].speed)
    force = np.linalg.norm(loads.values(np.array([part.bank - part.throw]))[0, :3])
    # the book's 2.095 m/s for 2.0944 m/s is within its digits
    assert force / WEIGHT == pytest.approx(printed * (2.0944 / 2.095) ** 2, abs=digits)


def test_mean_area_for_both_sides() -> None:
    """Eq. 297: one mean area F for F' and F'' misses eq. 296 by (F' - F'')/2 times the sum of both overpressures."""
    steam, exhaust = Pump(8.0 * AT, 8.0 * AT), Pump(1.4 * AT, 1.4 * AT)
    part = SliderCrank("one", 0.0, 0.4, 2.0, 0.0, shaft=CRANKSHAFT)

    def force(rods: tuple[float, float]) -> float:
        head = Chamber("1", ("one",), "head", 0.45, rods[0], steam)
        crank = Chamber("2", ("one",), "crank", 0.45, rods[1], exhaust)
        return -float(Chambers((head, crank), AT).thrust(part, Cycle.TWO_STROKE, np.array([1.0]))[0]) / KILOPOND

    exact = force((0.075, 0.10))
    assert exact == pytest.approx(7.0 * 1546.3 - 0.4 * 1511.9, abs=0.5)
    rod = math.sqrt(0.5 * (0.075**2 + 0.10**2))
    assert force((rod, rod)) - exact == pytest.approx(-0.5 * (1546.3 - 1511.9) * 7.4, abs=0.5)


def test_the_cranks_drive_what_steam_leaves_of_the_pumps(engine: Problem) -> None:
    """Figs. 1065, 1067: the mean torque is the work of all diagrams over a turn; masses give none."""
    gas = engine.points[0].gas
    assert isinstance(gas, Chambers)
    stroke = 0.8
    work = sum(len(c.cylinders) * c.area * stroke * mean_pressure_of(c.diagram) for c in gas.chambers
               if isinstance(c.diagram, Steam))  # fmt: skip
    facts = torque_facts(engine.engine, engine.points[0])
    assert facts.mean * math.tau == pytest.approx(work, rel=1e-9)
    pumps = 2.0 * stroke * (3490.0 + 3710.0) * KILOPOND
    steam = sum(len(c.cylinders) * c.area * stroke * mean_pressure_of(c.diagram) for c in gas.chambers
                if type(c.diagram) is Steam)  # fmt: skip
    assert steam - work == pytest.approx(pumps, rel=2e-3)


def test_the_low_pressure_crank_leads_by_a_quarter(engine: Problem) -> None:
    """Fig. 1064: 90 degrees; no dead centre is common, so the engine starts from anywhere."""
    first, second = engine.engine.slider_cranks
    assert math.degrees(second.throw - first.throw) == pytest.approx(90.0)
