"""Rotor with three flanks on an eccentric, in a two-lobed housing (Y1-Y8)."""

from __future__ import annotations

import cmath
import math
from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from laufruhe import units
from laufruhe.errors import ModelError
from laufruhe.machine.bodies import Motion, Outline
from laufruhe.machine.slider_crank import SliderCrank, Swept

FLANKS = 3
_PACE = 2.0 / 3.0


@dataclass(frozen=True, kw_only=True)
class RotaryUnit(SliderCrank):
    """Rotor; the crank is the eccentric, the reciprocating mass is zero, and the bank is its firing direction.

    Attributes
    ----------
    rotor_radius
        Distance from the rotor's centre to its apexes [m]; `crank_radius` is the eccentricity.
    rotor_width
        Width of the rotor along the shaft [m].
    rotor_inertia
        Moment of inertia about the rotor's centre [kg m2].
    """

    rotor_radius: float
    rotor_width: float
    rotor_inertia: float = 0.0
    noun: ClassVar[str] = "rotor"
    has_rod: ClassVar[bool] = False
    powers: ClassVar = {
        **SliderCrank.powers, "rotor_radius": (0, 1), "rotor_width": (0, 1), "rotor_inertia": (1, 2),
    }  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rotor_width <= 0.0 or self.rotor_inertia < 0.0:
            raise ModelError(f"{self.name}: the rotor's width must be positive and its inertia not negative")
        if self.rotor_radius <= FLANKS * self.crank_radius:
            radius, lower = (
                units.quantity_text(self.rotor_radius, "m"),
                units.quantity_text(FLANKS * self.crank_radius, "m"),
            )
            raise ModelError(
                f"{self.name}: the rotor cannot turn, its radius of {radius} must be over three eccentricities, {lower}"
            )

    @property
    def path(self) -> Hashable:
        """Key of the sizes that its chambers depend on."""
        return self.crank_radius, self.rotor_radius, self.rotor_width

    @cached_property
    def swept(self) -> Swept:
        """Three chambers, each swept as by a Scotch yoke at two thirds of the speed (Y3; textbook eqs. 102, 103)."""
        bore = math.sqrt(4.0 * self.piston_area / math.pi)
        yoke = SliderCrank("chamber", 0.0, 0.5 * self.stroke, math.inf, 0.0, bore=bore)
        return Swept(yoke, _PACE, tuple(math.tau * k for k in range(FLANKS)), four_strokes=True)

    @property
    def piston_area(self) -> float:
        """Area of a flank that the chamber gas acts on: chord times width [m2] (Y4)."""
        return math.sqrt(3.0) * self.rotor_radius * self.rotor_width

    @property
    def stroke(self) -> float:
        """Stroke of a piston with that area and the displacement of a chamber [m] (Y3)."""
        return 3.0 * self.crank_radius

    @property
    def displacement(self) -> float:
        """Largest minus smallest volume of a chamber [m3] (Y2; textbook eqs. 102, 103)."""
        return self.piston_area * self.stroke

    @property
    def smallest_volume(self) -> float:
        """Volume of a chamber whose flank is the inner envelope of the housing, without a recess [m3] (Y2)."""
        e, radius = self.crank_radius, self.rotor_radius
        lean = math.asin(FLANKS * e / radius)
        sector = math.pi * e**2 / 3.0 + 2.0 * e * radius * math.cos(lean)
        sector += (2.0 * radius**2 / 9.0 + 4.0 * e**2) * lean
        return self.rotor_width * sector - 0.5 * self.displacement

    @property
    def largest_ratio(self) -> float:
        """Compression ratio of a flank without a recess, the largest possible (Y2)."""
        return 1.0 + self.displacement / self.smallest_volume

    @property
    def apex_speed(self) -> float:
        """Largest speed of an apex along the housing at unit speed of the shaft [m] (Y5; textbook eq. 8)."""
        return self.crank_radius + self.rotor_radius / 3.0

    @property
    def apex_acceleration(self) -> float:
        """Largest acceleration of an apex at unit speed of the shaft [m] (Y5; textbook eq. 9)."""
        return self.crank_radius + self.rotor_radius / 9.0

    def lean(self, lib: Any, angles: Any) -> Any:
        """Return the direction of the gas force on a flank (Y4; textbook eqs. 21, 22)."""
        third = angles / 3.0
        return lib.cos(third) + 1j * lib.sin(third)

    def motion(self, lib: Any, alpha: Any) -> Motion:
        """Return the motion of a rotor, which turns at a third of the shaft's speed (Y6).

        Its mass counts at the eccentric, where it is.
        """
        points = super().motion(lib, alpha).points
        return Motion(points, ((self.rotor_inertia, (0.0 * alpha + 1.0 / 3.0, 0.0 * alpha)),))

    def outlines(self, alpha: float) -> tuple[Outline, ...]:
        """Return the outlines of housing and rotor at an eccentric angle, for drawings (Y1)."""
        half, rise = math.sqrt(0.75) * self.rotor_radius, 0.5 * self.rotor_radius - 2.0 * self.crank_radius
        height = np.linspace(-half, half, 31)
        flank = 0.5 * self.rotor_radius + 1j * height
        if rise > 0.0:
            arc = 0.5 * (half**2 + rise**2) / rise
            flank += rise - arc + np.sqrt(arc**2 - height**2)
        flanks = np.outer(np.exp(1j * math.tau * np.arange(FLANKS) / FLANKS), flank).reshape(-1)
        rotor = self.crank_radius * cmath.exp(1j * alpha) + flanks * cmath.exp(1j * alpha / 3.0)
        housing = self.housing(np.linspace(0.0, math.tau, 181))
        return Outline(housing, self.rotor_width, False), Outline(rotor, self.rotor_width, True)

    def housing(self, turn: Any) -> Any:
        """Return the peritrochoid of the apexes, at angles of an apex about the rotor's centre (Y1; textbook eq. 7)."""
        # at alpha = 0 the middle of a flank points in the firing direction
        return self.crank_radius * np.exp(3j * (turn - math.pi / 3.0)) + self.rotor_radius * np.exp(1j * turn)
