"""Flywheel: an inertia that turns with the crank, or a rim on arms (T5-T8)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

from laufruhe.errors import ModelError
from laufruhe.machine.extra import Extra
from laufruhe.machine.slider_crank import SliderCrank
from laufruhe.physics.modes import GRAVITY
from laufruhe.problem.decision import Kind

FLYWHEEL = Kind(6, "flywheel", "flywheel", is_alone=True)
LATERAL = 0.3
"""Poisson's ratio of the rim, of steel and of cast iron nearly."""


@dataclass(frozen=True)
class Arms:
    """Arms between hub and rim, each with a full oval section.

    Attributes
    ----------
    at_rim, at_hub
        Width across the plane of rotation, and depth along the direction of motion [m].
    hub_diameter
        Diameter at which the arms begin [m].
    """

    count: int
    at_rim: tuple[float, float]
    at_hub: tuple[float, float]
    hub_diameter: float


@dataclass(frozen=True)
class Rim:
    """A ring of a rectangular section.

    Attributes
    ----------
    mean_diameter, width, height
        Diameter at the middle of the section, width along the shaft, and height along a radius [m].
    density
        Density of the rim [kg/m3].
    mass_ratio
        Mass of the whole flywheel over that of its rim; what is within the rim is not counted as inertia.
    """

    mean_diameter: float
    width: float
    height: float
    density: float
    mass_ratio: float = 1.0
    arms: Arms | None = None

    @property
    def radii(self) -> tuple[float, float]:
        """Inner and outer radius [m]."""
        return 0.5 * (self.mean_diameter - self.height), 0.5 * (self.mean_diameter + self.height)

    @property
    def mass(self) -> float:
        """Mass of the ring alone [kg] (T5)."""
        return math.pi * self.density * self.mean_diameter * self.width * self.height

    @property
    def inertia(self) -> float:
        """Moment of inertia about the shaft [kg m2] (T5)."""
        inside, outside = self.radii
        return 0.5 * self.mass * (inside**2 + outside**2)

    def stress(self, speed: float) -> float:
        """Return the largest hoop stress, at the inside of a free ring [Pa] (T6)."""
        inside, outside = self.radii
        return 0.25 * self.density * speed**2 * ((3.0 + LATERAL) * outside**2 + (1.0 - LATERAL) * inside**2)

    def arm_stress(self, speed: float, torque: float) -> float:
        """Return the largest stress in an arm that hangs down, from pull and torque of the rim [Pa] (T7).

        The rim carries none of its own pull.
        """
        if self.arms is None:
            raise ModelError(
                "the flywheel has no arms, so there is no arm stress; give flywheel.rim arms, or use the rim stress"
            )
        arms, radius = self.arms, 0.5 * self.mean_diameter
        pull = self.mass * (speed**2 * radius / arms.count + 0.5 * GRAVITY)
        (rim_width, rim_depth), (hub_width, hub_depth) = arms.at_rim, arms.at_hub
        bending = 2.0 * abs(torque) / (radius * arms.count) * (radius - 0.5 * arms.hub_diameter)
        at_rim = pull / (0.25 * math.pi * rim_width * rim_depth)
        at_hub = pull / (0.25 * math.pi * hub_width * hub_depth) + bending / (math.pi / 32.0 * hub_width * hub_depth**2)
        return max(at_rim, at_hub)


@dataclass(frozen=True)
class Flywheel(Extra):
    """Parts that turn with the crank at its speed, pistons and rods excluded.

    `rest` is the inertia of all but the rim, or of all where there is none [kg m2]. The keys of its open numbers are
    "inertia", or the names of sizes of the rim.
    """

    rest: float
    rim: Rim | None = None
    name: ClassVar[str] = FLYWHEEL.name

    @property
    def inertia(self) -> float:
        """Total moment of inertia [kg m2]."""
        return self.rest + (self.rim.inertia if self.rim else 0.0)

    @property
    def ring(self) -> Rim:
        """Rim; `ModelError` if the flywheel is given by its inertia alone."""
        if self.rim is None:
            raise ModelError("a flywheel that is given by its inertia has no mass and no stress; give its rim")
        return self.rim

    def weighing(self, mass: float) -> Flywheel:
        """Return the flywheel with the rim width that gives a mass [kg]."""
        return replace(self, rim=replace(self.ring, width=self.ring.width * (mass / self.ring.mass)))

    def moved(self, changes: Mapping[Any, Any], __: Sequence[SliderCrank], ___: Sequence[SliderCrank]) -> Self:
        """Return the flywheel with changes of its open numbers."""
        if not changes:
            return self
        section = {key: getattr(self.rim, key) + change for key, change in changes.items() if key != "inertia"}
        rim = self.rim and replace(self.rim, **section)
        return replace(self, rest=self.rest + changes.get("inertia", 0.0), rim=rim)

    def turning_inertia(self, _: Sequence[SliderCrank], /) -> float:
        """Return the inertia of all rotating parts except pistons and rods [kg m2]."""
        return self.inertia
