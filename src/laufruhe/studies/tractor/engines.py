"""The engines of Hasselgruber's study (1964), built in memory.

Printed: bore 100, stroke 120, mounts 504 mm apart across (Fig. 2); reciprocating mass
1.25 kg, 10 m/s at 2500 rpm (Fig. 5); rod inertia deficit -4.2 kg cm2 (Fig. 7);
cylinders 125 mm apart, mounts (z + 1) a or (z + 7) a apart along the engine (Fig. 12).
Not printed, and assumed here: rod ratio, height of the mounts, compression ratio and
exponents of the gas cycle. Rotating masses are balanced on the throws, as the study has
them, and left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from laufruhe.machine import (
    CRANKSHAFT,
    Cycle,
    Engine,
    GasModel,
    Mount,
    OperatingPoint,
    Role,
    Rotor,
    Seiliger,
    Shaft,
    SliderCrank,
)
from laufruhe.machine.layouts import Mechanism, build, inline
from laufruhe.physics.modes import GRAVITY

KILOPOND = GRAVITY
PRESSURE = 1e4 * KILOPOND
"""One kp/cm2 [Pa]."""

BORE, STROKE, SPACING, WIDTH = 0.100, 0.120, 0.125, 0.504
RADIUS = 0.5 * STROKE
RECIPROCATING_MASS = 1.25
ROD_INERTIA_DEFICIT = -4.2e-4
ROD_RATIO = 0.26
PISTON_SPEED = 10.0
PEAK_PRESSURE = 80.0 * PRESSURE
FULL_LOAD, PART_LOAD, TWO_STROKE_LOAD = 9.0 * PRESSURE, 5.5 * PRESSURE, 6.5 * PRESSURE

ASSUMPTIONS = (
    "Rod ratio 0.26, mounts level with the crank axis: the study prints neither.",
    "Compression ratio 17 and exponents 1.35 and 1.30 of the gas cycle: the study prints no pressure trace.",
    "Rotating masses balanced on the throws, as the study has them, so they are left out.",
)

# throws of the cranks that the study draws (Figs. 12, 26, 27), cylinder 1 at the front
THROWS: dict[int, tuple[float, ...]] = {
    1: (0.0,),
    2: (0.0, 180.0),
    3: (0.0, 240.0, 120.0),
    4: (0.0, 180.0, 180.0, 0.0),
    6: (0.0, 240.0, 120.0, 120.0, 240.0, 0.0),
}
FIRING_ORDERS: dict[int, tuple[int, ...]] = {
    1: (1,),
    2: (1, 2),
    3: (1, 3, 2),
    4: (1, 3, 4, 2),
    6: (1, 5, 3, 6, 2, 4),
}
STAR_OF_FIG_26 = (0.0, 180.0, 90.0, -90.0)
STAR_OF_FIG_27 = (0.0, 90.0, -90.0, 180.0)


@dataclass(frozen=True)
class Build:
    """What of an engine the study does not print, or varies.

    Attributes
    ----------
    rod_ratio
        lambda = r / l.
    length, mass
        Factors on every length and every mass (eqs. 18, 23).
    extra
        Spacings by which the rear mounts stand further back: k / a (Fig. 11).
    """

    rod_ratio: float = ROD_RATIO
    length: float = 1.0
    mass: float = 1.0
    extra: float = 6.0


DEFAULT = Build()


def speed_of(piston_speed: float, stroke: float = STROKE) -> float:
    """Crank speed [rad/s] of a mean piston speed [m/s]: c_m = s n / 30 (eq. 15)."""
    return math.pi * piston_speed / stroke


def gas(imep: float, peak_pressure: float = PEAK_PRESSURE) -> Seiliger:
    """The mixed cycle assumed in place of the trace that is not printed."""
    return Seiliger(peak_pressure=peak_pressure, imep=imep)


def running(working_gas: GasModel | None, piston_speed: float = PISTON_SPEED, length: float = 1.0) -> OperatingPoint:
    """An operating point by its mean piston speed [m/s]."""
    return OperatingPoint(f"{piston_speed:g} m/s", speed_of(piston_speed, STROKE * length), working_gas)


def mechanism(how: Build = DEFAULT) -> Mechanism:
    """One cylinder of the study."""
    return Mechanism(
        crank_radius=RADIUS * how.length,
        rod_length=RADIUS / how.rod_ratio * how.length,
        reciprocating_mass=RECIPROCATING_MASS * how.mass,
        rod_inertia_deficit=ROD_INERTIA_DEFICIT * how.mass * how.length**2,
        bore=BORE * how.length,
    )


def cylinder(rod_ratio: float = ROD_RATIO) -> SliderCrank:
    """The mechanism of the single alone."""
    parts, _ = build(Cycle.FOUR_STROKE, inline(1, SPACING), mechanism(Build(rod_ratio)), (0.0,))
    return parts[0]


def two_mounts() -> tuple[Mount, ...]:
    """The single stands in its own plane (Fig. 1)."""
    return Mount("left", (0.0, 0.5 * WIDTH, 0.0)), Mount("right", (0.0, -0.5 * WIDTH, 0.0))


def four_mounts(cylinders: int, how: Build = DEFAULT) -> tuple[Mount, ...]:
    """Mounts 1, 2 in front and 3, 4 behind (Fig. 11), the front ones half the length of the engine ahead."""
    front = 0.5 * (cylinders + 1) * SPACING
    rear = -front - how.extra * SPACING
    return tuple(
        Mount(name, (x * how.length, side * 0.5 * WIDTH * how.length, 0.0))
        for name, x, side in (
            ("front left", front, 1.0),
            ("front right", front, -1.0),
            ("rear left", rear, 1.0),
            ("rear right", rear, -1.0),
        )
    )


def single(rotors: Sequence[Rotor] = (), how: Build = DEFAULT) -> Engine:
    """The single of Figs. 1 to 10 on two mounts."""
    parts, _ = build(Cycle.FOUR_STROKE, inline(1, SPACING), mechanism(how), (0.0,), (1,))
    return Engine("single", Cycle.FOUR_STROKE, parts, tuple(rotors), two_mounts())


def inline_engine(cylinders: int, rotors: Sequence[Rotor] = (), how: Build = DEFAULT) -> Engine:
    """An inline four-stroke engine of the study on four mounts (Figs. 11, 12)."""
    throws = [math.radians(angle) for angle in THROWS[cylinders]]
    layout = inline(cylinders, SPACING * how.length)
    parts, _ = build(Cycle.FOUR_STROKE, layout, mechanism(how), throws, FIRING_ORDERS[cylinders])
    return Engine(f"{cylinders} cylinders", Cycle.FOUR_STROKE, parts, tuple(rotors), four_mounts(cylinders, how))


def two_stroke_four(star: Sequence[float], rotors: Sequence[Rotor] = (), how: Build = DEFAULT) -> Engine:
    """The two-stroke four-cylinder on a cross-shaped crank [deg] (Figs. 26, 27)."""
    throws = [math.radians(angle) for angle in star]
    parts, _ = build(Cycle.TWO_STROKE, inline(4, SPACING), mechanism(how), throws)
    return Engine("two-stroke four", Cycle.TWO_STROKE, parts, tuple(rotors), four_mounts(4, how))


def counterweight(fraction: float) -> Rotor:
    """Opposite the single's throw, for a share of its reciprocating mass (eq. 13)."""
    return Rotor("web", 0.0, -fraction * RECIPROCATING_MASS * RADIUS, CRANKSHAFT, Role.COUNTERWEIGHT, 0.080)


def balancer(name: str, ratio: float, place: tuple[float, float, float], unbalance: complex) -> Rotor:
    """One unbalance on a shaft of its own at (x, y, z) [m]."""
    return Rotor(name, place[0], unbalance, Shaft(name, ratio, place[1], place[2]), Role.BALANCER, 0.020)
