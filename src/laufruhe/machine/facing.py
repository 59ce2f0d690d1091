"""Shared chamber of two pistons that face each other, on cranks that need not be in step (G18).

Both pistons sweep it: V = A (x_1(gamma) + x_2(gamma + ahead)), each from its own crank. The volume V is smallest
between the dead centres of the two pistons, and the angle of the gas cycle counts from there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

from laufruhe.errors import ModelError
from laufruhe.machine import kinematics
from laufruhe.machine.slider_crank import SliderCrank, Swept, as_kind
from laufruhe.numerics.roots import rising_root

MAX_AHEAD = 0.5 * math.pi
"""Crank angle by which one piston may lead the other to its dead centre: beyond it they hardly compress."""
STEPS = 720
"""Number of crank angles at which the distance of two pistons is computed."""


@dataclass(frozen=True)
class Facing:
    """The other piston of a cylinder, and the crank angle by which it comes to its dead centre first [rad]."""

    crank_radius: float
    rod_length: float
    ahead: float
    powers: ClassVar = {"crank_radius": (0, 1), "rod_length": (0, 1)}

    def swept(self, part: SliderCrank) -> Swept:
        """Return the chamber between the piston `part` and this opposed piston."""
        if self.ahead == 0.0 and part.path == (self.crank_radius, self.rod_length, 0.0):
            # pistons in step have half of the chamber each
            return Swept(part)
        chamber = _chamber(part)
        return Swept(part, charge=chamber, firing_delay=chamber.fires_at * part.shaft.ratio)


@dataclass(frozen=True)
class SharedChamber(SliderCrank):
    """Slider-crank whose travel is that of two pistons together, so that it sweeps their shared chamber."""

    @property
    def _other(self) -> Facing:
        assert isinstance(self.facing, Facing)
        return self.facing

    def travel(self, lib: Any, alpha: Any) -> Any:
        """Return the travel of both pistons, from the highest position of this one [m]; `lib` is NumPy or CasADi."""
        other = self._other
        angle = self.shaft.ratio * alpha + other.ahead
        far = other.crank_radius * kinematics.travel(lib, angle, other.crank_radius / other.rod_length)
        return super().travel(lib, alpha) + far

    def velocity(self, lib: Any, alpha: Any) -> Any:
        """Return the derivative of the travel of both pistons by the angle of this one's crank [m].

        `lib` is NumPy or CasADi.
        """
        other = self._other
        angle = self.shaft.ratio * alpha + other.ahead
        far = other.crank_radius * kinematics.piston_velocity(lib, angle, other.crank_radius / other.rod_length)
        return super().velocity(lib, alpha) + self.shaft.ratio * far

    @cached_property
    def dead_centres(self) -> tuple[float, float]:
        """Crank angles at which the chamber is smallest and largest [rad], between the dead centres of both (G18)."""
        ratio, first = self.shaft.ratio, -self._other.ahead
        low, high = min(first, 0.0), max(first, 0.0)

        def rate(angle: float) -> float:
            return -ratio * float(self.velocity(math, ratio * angle))

        top = rising_root(rate, low, high) if high > low else 0.0
        bottom = rising_root(lambda angle: -rate(angle), math.pi + low, math.pi + high) if high > low else math.pi
        return ratio * top, ratio * bottom

    @property
    def fires_at(self) -> float:
        """Crank angle at which the chamber is smallest [rad]."""
        return self.dead_centres[0]

    @cached_property
    def stroke(self) -> float:
        """Largest less smallest travel of both together [m]."""
        top, bottom = self.dead_centres
        return float(self.travel(math, bottom) - self.travel(math, top))


@lru_cache(maxsize=256)
def _chamber(part: SliderCrank) -> SharedChamber:
    return as_kind(SharedChamber, part)


def with_shared_chambers(parts: Sequence[SliderCrank], cycle_angle: float) -> tuple[SliderCrank, ...]:
    """Return the slider-cranks with chambers of opposed pistons: both pistons of a pair get their shared chamber."""
    pistons = list(parts)
    for k, part in enumerate(parts):
        for other in parts:
            if other is not part and part.faces(other):
                both = f"{part.name} and {other.name} share a chamber"
                ahead = math.remainder(part.firing_angle - other.firing_angle, cycle_angle)
                ahead = 0.0 if abs(ahead) < 1e-12 else ahead
                if abs(ahead) >= MAX_AHEAD:
                    raise ModelError(
                        f"{both} and come to their dead centres {math.degrees(abs(ahead)):.6g} deg apart; bring them "
                        f"within {math.degrees(MAX_AHEAD):g} deg"
                    )
                if any(type(p) is not SliderCrank or abs(p.shaft.ratio) != 1.0 or p.offset for p in (part, other)):
                    raise ModelError(
                        f"{both}, which is known of plain slider-cranks without offset on cranks of a ratio of 1 or "
                        "-1; leave [gas] out"
                    )
                if part.bore != other.bore:
                    raise ModelError(f"{both} and have different bores; give both the same bore")
                pistons[k] = replace(part, facing=Facing(other.crank_radius, other.rod_length, ahead))
    return tuple(pistons)


def minimum_room(part: SliderCrank, other: SliderCrank) -> float:
    """Return the smallest distance between the piston pins of two facing pistons [m]; infinite for Scotch yokes."""
    distance = math.hypot(other.shaft.y - part.shaft.y, other.shaft.z - part.shaft.z)
    reach = part.crank_radius + part.rod_length + other.crank_radius + other.rod_length
    if math.isinf(reach):
        return math.inf
    ahead = math.remainder(part.firing_angle - other.firing_angle, math.tau)
    sizes = (part.crank_radius, part.rod_ratio, part.offset_ratio, other.crank_radius, other.rod_ratio)
    return distance - reach + _least_travel(*sizes, other.offset_ratio, round(ahead, 9))


@lru_cache(maxsize=256)
def _least_travel(
    radius: float, ratio: float, offset: float, far_radius: float, far_ratio: float, far_offset: float, ahead: float
) -> float:
    # least way of two pistons towards their cranks, together [m]
    return float(
        min(
            radius * kinematics.travel(math, at, ratio, offset)
            + far_radius * kinematics.travel(math, at + ahead, far_ratio, far_offset)
            for at in (math.tau * k / STEPS for k in range(STEPS))
        )
    )
