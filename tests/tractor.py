"""Small problems that solver tests share."""

from __future__ import annotations

import math
from collections.abc import Sequence

from laufruhe.machine import CRANKSHAFT, Cycle, Engine, Mount, OperatingPoint, Role, Rotor, Seiliger, Shaft
from laufruhe.machine.layouts import build, inline
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.decision import Decision, RotorDrive
from laufruhe.problem.measure import MEAN_MOUNT_FORCE, Limit, Term
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Sector
from mechanisms import mechanism_of

RADIUS, LAMBDA, MASS, SPACING = 0.06, 0.26, 1.25, 0.125
SPEED = 2500 * math.pi / 30
TWO_ORDER = Fidelity("two-order", 720)
GAS = Seiliger(peak_pressure=78.5e5, imep=5.4e5)


def mounts(cylinders: int) -> tuple[Mount, ...]:
    """Return the study's long mounting: (z + 7) a apart, 504 mm across."""
    front = 0.5 * (cylinders + 1) * SPACING
    rear = front - (cylinders + 7) * SPACING
    return tuple(
        Mount(f"{end} {side}", (x, y, 0.0))
        for end, x in (("front", front), ("rear", rear))
        for side, y in (("left", 0.252), ("right", -0.252))
    )


def engine(
    throws_deg: Sequence[float],
    rotors: Sequence[Rotor] = (),
    cycle: Cycle = Cycle.FOUR_STROKE,
    firing_order: Sequence[int] | None = None,
) -> Engine:
    """Return the tractor engine with these throws."""
    mechanism = mechanism_of(RADIUS, RADIUS / LAMBDA, MASS, bore=0.1)
    layout = inline(len(throws_deg), SPACING)
    cylinders, _ = build(cycle, layout, mechanism, [math.radians(t) for t in throws_deg], firing_order)
    return Engine("tractor", cycle, cylinders, tuple(rotors), mounts(len(throws_deg)))


def free_unbalance(rotor: str, upper: float = 0.3) -> Decision:
    """Return the size and angle of one rotor open."""
    return Decision(f"{rotor}.unbalance", "kg m", Sector(upper), 0j, (RotorDrive(rotor, 1.0),))


def shaft_rotor(name: str, ratio: float, x: float, y: float = 0.0, z: float = 0.0) -> Rotor:
    """Return a balancer without unbalance yet."""
    return Rotor(name, x, 0j, Shaft(name.split(".")[0], ratio, y, z), Role.BALANCER, 0.02)


def web(name: str, x: float) -> Rotor:
    """Return a counterweight without unbalance yet."""
    return Rotor(name, x, 0j, CRANKSHAFT, Role.COUNTERWEIGHT, 0.08)


def problem(
    machine: Engine,
    open_rotors: Sequence[str],
    gas: Seiliger | None = None,
    objective: Sequence[Term] = (Term(MEAN_MOUNT_FORCE),),
    limits: Sequence[Limit] = (),
    fidelity: Fidelity = TWO_ORDER,
    tolerance: float = 1e-4,
    upper: float = 0.3,
) -> Problem:
    """Return a problem with one operating point and the named rotors free."""
    return Problem(
        "test",
        "test",
        machine,
        (OperatingPoint("rated", SPEED, gas),),
        tuple(free_unbalance(name, upper) for name in open_rotors),
        tuple(objective),
        tuple(limits),
        fidelity=fidelity,
        tolerance=tolerance,
    )
