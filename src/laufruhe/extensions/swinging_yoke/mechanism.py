"""Crank pin in a slotted lever that swings about a pivot and drives a ram (K14-K16; Roetscher, Fig. 1071)."""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine.bodies import Motion, Outline, bar
from laufruhe.machine.slider_crank import SliderCrank

_THICKNESS = 0.15
_WEIGHT = 7850.0 * _THICKNESS
"""Mass of the drawn steel block per area [kg/m2]."""


@dataclass(frozen=True, kw_only=True)
class SwingingYoke(SliderCrank):
    """Crank with a swinging lever; the ram takes the place of the piston.

    The pivot is at -i e from the crank axis, in the plane turned to the ram's axis (C5). alpha = 0 where the
    crank pin lies along that axis; the slow stroke, towards the crank, has the pin on the far side of the pivot.

    Attributes
    ----------
    pivot
        Distance e of the pivot from the crank axis [m].
    lever_length
        Length from the pivot to the end that drives the ram, R [m].
    ram_height
        Height of the ram's path above where the lever's end touches at mid-stroke [m].
    lever_mass, lever_centre, lever_inertia
        Mass of the lever [kg], its centre of gravity from the pivot towards the end [m], and inertia about it [kg m2].
    lever_weight, lever_weight_radius
        Weight behind the pivot [kg] and its distance from the pivot [m].
    """

    pivot: float
    lever_length: float
    ram_height: float = 0.0
    lever_mass: float = 0.0
    lever_centre: float = 0.0
    lever_inertia: float = 0.0
    lever_weight: float = 0.0
    lever_weight_radius: float = 0.0
    has_pin_loads: ClassVar[bool] = False
    is_balanced_by_share: ClassVar[bool] = False
    powers: ClassVar = {
        **SliderCrank.powers, "lever_mass": (1, 0), "lever_inertia": (1, 2), "lever_weight": (1, 0),
        **dict.fromkeys(("pivot", "lever_length", "ram_height", "lever_centre", "lever_weight_radius"), (0, 1)),
    }  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.crank_radius < self.pivot:
            raise ModelError(
                f"{self.name}: the lever cannot swing, its pivot at {1e3 * self.pivot:g} mm lies within the crank "
                f"circle of {1e3 * self.crank_radius:g} mm; move the pivot out of the circle"
            )
        if not self.lever_length > 0.0:
            raise ModelError(f"{self.name}: the lever needs a length above zero")
        if min(self.lever_mass, self.lever_inertia, self.lever_weight, self.lever_weight_radius) < 0.0:
            raise ModelError(f"{self.name}: masses, inertia and radius of the lever must not be negative")

    @property
    def path(self) -> Hashable:
        """Key of the sizes that the path of the ram depends on."""
        return "swinging yoke", self.crank_radius, self.pivot, self.lever_length

    @cached_property
    def dead_centres(self) -> tuple[float, float]:
        """Crank angles at which crank and lever are at right angles [rad] (K15)."""
        lean = math.asin(self.crank_radius / self.pivot)
        return -lean, math.pi + lean

    @property
    def stroke(self) -> float:
        """Stroke of the ram, 2 R r / e [m]."""
        return 2.0 * self.lever_length * self.crank_radius / self.pivot

    @property
    def counterweight_mass(self) -> float | None:
        """Mass of the weight behind the pivot [kg]; None without one."""
        return self.lever_weight if self.lever_weight_radius > 0.0 else None

    def lever(self, lib: Any, alpha: Any) -> tuple[Any, tuple[Any, Any]]:
        """Return the lever's direction as a complex unit number, and first and second derivative of its angle (K14)."""
        r, e = 0.0 * alpha + self.crank_radius, 0.0 * alpha + self.pivot
        cosine, sine = lib.cos(alpha), lib.sin(alpha)
        # (r^2 + e^2 + 2 e r sin alpha), which is small where the pin comes near the pivot
        square = (e - r) * (e - r) + 2.0 * e * r * (1.0 + sine)
        direction = (r * cosine + 1j * (e + r * sine)) / lib.sqrt(square)
        rate = r * (r + e * sine) / square
        return direction, (rate, r * e * cosine * (e - r) * (e + r) / (square * square))

    def travel(self, lib: Any, alpha: Any) -> Any:
        """Return the travel of the ram towards the crank from alpha = 0 [m]."""
        start, _ = self.lever(lib, 0.0 * alpha)
        return self.lever_length * (start.real - self.lever(lib, alpha)[0].real)

    def velocity(self, lib: Any, alpha: Any) -> Any:
        """Return the velocity of the ram away from the crank, per crank angle [m/rad] (K16)."""
        direction, (rate, _) = self.lever(lib, alpha)
        return -self.lever_length * rate * direction.imag

    def motion(self, lib: Any, alpha: Any) -> Motion:
        """Return the motion of ram, lever and lever weight, with derivatives by the crank angle alpha."""
        direction, (rate, swing) = self.lever(lib, alpha)
        first, second = 1j * rate * direction, (1j * swing - rate * rate) * direction

        # first and second are the derivatives of the direction
        def on_lever(distance: float) -> tuple[Any, Any, Any]:
            arm = 0.0 * alpha + distance
            return arm * direction - 1j * self.pivot, arm * first, arm * second

        length = 0.0 * alpha + self.lever_length
        height = self.lever_length - self.pivot + self.ram_height
        ram = length * direction.real + 1j * height, length * first.real, length * second.real
        return Motion(
            (
                (self.reciprocating_mass, ram),
                (self.lever_mass, on_lever(self.lever_centre)),
                (self.lever_weight, on_lever(-self.lever_weight_radius)),
            ),
            ((self.lever_inertia, (rate, swing)),),
        )

    def outlines(self, alpha: float) -> tuple[Outline, ...]:
        """Return the outlines of ram, lever, and a steel block of 150 mm for the lever weight."""
        direction, pivot = complex(self.lever(np, np.float64(alpha))[0]), -1j * self.pivot
        ram = complex(self.motion(np, np.float64(alpha)).points[0][1][0])
        wide, side = 0.06 * self.stroke, math.sqrt(self.lever_weight / _WEIGHT)
        behind = self.lever_weight_radius if self.lever_weight > 0.0 else wide
        bodies = [
            Outline(bar(ram - 0.4 * self.stroke, ram + 0.4 * self.stroke, 2.0 * wide), 4.0 * wide, True),
            Outline(bar(pivot - behind * direction, pivot + self.lever_length * direction, wide), wide, True),
            Outline(pivot + wide * np.exp(1j * np.linspace(0.0, math.tau, 25)), wide, False),
        ]
        if self.lever_weight > 0.0:
            first, last = (pivot - (behind - half) * direction for half in (0.5 * side, -0.5 * side))
            bodies.append(Outline(bar(first, last, side), _THICKNESS, True))
        return tuple(bodies)
