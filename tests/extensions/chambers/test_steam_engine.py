"""The waterworks engine, steam and pumps on one rod, as rigid bodies and joints in exudyn.

Its diagrams are evaluated here point by point, from the positions of the crank alone.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

import laufruhe
from laufruhe.extensions.chambers.gas import Chamber, Chambers, Pump, Steam
from laufruhe.physics.shaking_loads import shaking_loads
from problem_files import PROBLEMS
from validation import multibody
from validation.multibody import ConnectingRod, Cylinder, Machine, Turning

pytestmark = [pytest.mark.validation, pytest.mark.slow]

READY = PROBLEMS / "waterworks-steam-pump.toml"
COARSE, FINE = 360, 720
RADIUS, LENGTH = 0.4, 2.0
ROD = ConnectingRod(LENGTH, mass=220.0, centre=0.8, inertia=0.7 * 220.0 * 0.8 * 1.2)


def towards_crank(chambers: tuple[Chamber, ...], air: float, alpha: float) -> float:
    """Return P = p1 F' - p2 F'' (eq. 296) of one rod at a crank angle from its inner dead centre [N]."""
    sine = math.sin(alpha)
    x = (RADIUS * (1.0 - math.cos(alpha)) + LENGTH - math.sqrt(LENGTH**2 - (RADIUS * sine) ** 2)) / (2.0 * RADIUS)
    force = 0.0
    for chamber in chambers:
        is_head = chamber.end == "head"
        area = math.pi / 4.0 * (chamber.bore**2 - chamber.rod**2) * (1.0 if is_head else -1.0)
        force += area * (_pressure(chamber.diagram, x if is_head else 1.0 - x, (sine > 0.0) == is_head) - air)
    return force


def _pressure(diagram: object, x: float, grows: bool) -> float:
    if isinstance(diagram, Pump):
        return diagram.admission if grows else diagram.back_pressure
    assert isinstance(diagram, Steam)
    c = diagram.clearance
    if grows:
        p = diagram.admission * min(1.0, (diagram.cut_off + c) / (min(x, diagram.release) + c))
        return p + (diagram.back_pressure - p) * max(x - diagram.release, 0.0) / (1.0 - diagram.release)
    p = diagram.back_pressure * max(1.0, (diagram.compression + c) / (max(x, diagram.lead) + c))
    return p + (diagram.admission - p) * max(diagram.lead - x, 0.0) / diagram.lead


def test_wrench_of_bodies_and_joints() -> None:
    """Compare with rigid rods to 1e-4 of the largest loads, with steam."""
    problem = laufruhe.load(READY)
    gas, point = problem.points[0].gas, problem.points[0]
    assert isinstance(gas, Chambers)
    parts, bodies, cylinders = [], [], []
    for k, part in enumerate(problem.engine.slider_cranks):
        piston = part.reciprocating_mass - ROD.mass * ROD.centre / LENGTH
        parts.append(replace(
            part, rotating_mass=ROD.mass * (1.0 - ROD.centre / LENGTH),
            rod_inertia_deficit=ROD.inertia - ROD.mass * ROD.centre * (LENGTH - ROD.centre),
        ))  # fmt: skip
        lead, own = part.throw - part.bank, gas.of(part)
        bodies.append(Turning(part.x, mass=50.0))
        cylinders.append(Cylinder(
            k, RADIUS * cmath.exp(1j * part.throw), ROD, piston, bank=part.bank,
            gas=lambda phi, own=own, lead=lead: towards_crank(own, gas.crankcase_pressure, phi + lead),
        ))  # fmt: skip
    machine = Machine(tuple(bodies), tuple(cylinders), point.speed)
    coarse, fine = (multibody.simulate(machine, steps).reactions for steps in (COARSE, FINE))
    extrapolated = (4.0 * fine[::2] - coarse) / 3.0
    # on a jump of a pump at a dead centre either side is right, and no torque tells them apart
    angles = math.tau * np.arange(COARSE) / COARSE
    engine = replace(problem.engine, slider_cranks=tuple(parts), rotors=())
    ours = shaking_loads(engine, point).values(angles)
    sizes = np.abs(fine).max(axis=0)
    assert np.abs(ours - extrapolated)[:, sizes > 1.0].max(axis=0) / sizes[sizes > 1.0] == pytest.approx(0.0, abs=1e-4)
    assert sizes[3] > 1e4
    # without steam the roll moment would be another one
    still = shaking_loads(engine, replace(point, gas=None)).values(angles)
    assert np.abs(ours - still)[:, 3].max() > 0.5 * sizes[3]
