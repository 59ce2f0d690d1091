"""Positions of engine parts at a crank angle, and sizes of drawn weights (C4, C5)."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.machine import Engine, SliderCrank
from laufruhe.machine.bodies import Outline

STEEL = 7850.0
THICKNESS = 0.02
"""Thickness of the half discs that represent weights [m]."""
LONG_ROD = 4.0


@dataclass(frozen=True)
class Pose:
    """Positions of a slider-crank, zeta = z + i y [m] (C4), and outlines of its rotating bodies."""

    part: SliderCrank
    crank: complex
    pin: complex
    foot: complex
    piston: complex
    bodies: tuple[Outline, ...]

    @classmethod
    def at_angle(cls, part: SliderCrank, phi: float) -> Pose:
        """Return the positions of crank, pin and piston of a cylinder at a crank angle [rad] (C5), for drawings."""
        centre, axis = complex(part.shaft.z, part.shaft.y), cmath.exp(1j * part.bank)
        turn = part.throw + part.shaft.ratio * phi
        rod = part.rod_length if math.isfinite(part.rod_length) else LONG_ROD * part.crank_radius
        offset = complex(part.motion(np, np.float64(turn - part.bank)).points[0][1][0])
        # positions count from alpha = 0, where the rod leans by the offset
        distance = part.crank_radius + math.sqrt(rod**2 - part.offset**2) + offset
        bodies = tuple(
            replace(body, points=centre + axis * body.points) for body in part.outlines(float(turn - part.bank))
        )
        pin = part.crank_radius * cmath.exp(1j * turn)
        # the pin of a Scotch yoke slides across its rod, which stays on the axis
        foot = pin if math.isfinite(part.rod_length) else axis * (pin / axis).real
        return cls(part, centre, centre + pin, centre + foot, centre + distance * axis, bodies)


def half_disc(unbalance: float) -> float:
    """Return the radius of a steel half disc with this unbalance [m]: its centroid is 4 R / 3 pi off."""
    return math.cbrt(1.5 * unbalance / (STEEL * THICKNESS))


def bore_of(engine: Engine) -> float:
    """Return the largest bore; the stroke where no bore is given [m]."""
    return max(part.bore or part.stroke for part in engine.slider_cranks)
