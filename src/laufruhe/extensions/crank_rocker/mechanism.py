"""Crank, coupler, rocker and piston rod: a four-bar linkage that drives a piston (K22, K23; Roetscher, Fig. 1043)."""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine.bodies import Motion, Outline, bar
from laufruhe.machine.pin_driven import PinDriven
from laufruhe.machine.slider_crank import SliderCrank

LINKS = "coupler", "rocker", "piston_rod"
_STEPS = 360


@dataclass(frozen=True, kw_only=True)
class CrankRocker(PinDriven):
    """Crank that swings a rocker by a coupler; a rod joins the other end of the rocker and the piston.

    Positions are in the plane turned to the cylinder axis (C5), with the crank axis at zero.

    Attributes
    ----------
    pivot, end
        Position of the rocker's pivot [m]; position of the rod's pin on the rocker from the pivot, with the coupler's
        pin on the real axis [m].
    coupler_length, arm, piston_rod_length, piston_offset
        Lengths of the coupler, of the rocker from the pivot to the coupler's pin, and of the piston rod; height of the
        piston's path across the axis [m].
    side
        1 if the coupler's pin lies to the left of the line from crank pin to pivot; else -1.
    coupler_mass, coupler_share, coupler_inertia
        Mass of the coupler [kg], its centre of gravity from the crank pin over the length, and inertia about it
        [kg m2]; so those of the rocker, from the pivot to `end`, and of the piston rod, from the rocker.
    """

    pivot: complex
    coupler_length: float
    arm: float
    end: complex
    side: int
    piston_rod_length: float
    piston_offset: float = 0.0
    coupler_mass: float = 0.0
    coupler_share: float = 0.0
    coupler_inertia: float = 0.0
    rocker_mass: float = 0.0
    rocker_share: float = 0.0
    rocker_inertia: float = 0.0
    piston_rod_mass: float = 0.0
    piston_rod_share: float = 0.0
    piston_rod_inertia: float = 0.0
    has_pin_loads: ClassVar[bool] = False
    is_balanced_by_share: ClassVar[bool] = False
    powers: ClassVar = {
        **SliderCrank.powers, **{f"{link}_mass": (1, 0) for link in LINKS},
        **{f"{link}_inertia": (1, 2) for link in LINKS},
        **dict.fromkeys(("pivot", "coupler_length", "arm", "end", "piston_rod_length", "piston_offset"), (0, 1)),
    }  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        with np.errstate(invalid="ignore"):
            velocity = self.velocity(np, math.tau / _STEPS * (0.5 + np.arange(_STEPS)) + self.dead_centres[0])
        if np.count_nonzero(np.diff(np.sign(velocity))) != 1:
            rule = "the crank does not turn, or the piston does not follow the rocker in two strokes"
            raise ModelError(f"{self.name}: {rule}; lengthen the piston rod, or move the rocker's pivot")

    @property
    def path(self) -> Hashable:
        """Key of the sizes that the path of the piston depends on."""
        linkage = self.pivot, self.coupler_length, self.arm, self.end, self.side
        return "crank-rocker", self.crank_radius, *linkage, self.piston_rod_length, self.piston_offset

    @property
    def piston_rod(self) -> tuple[float, float]:
        """Length of the piston rod, and height of the piston's path across the axis [m]."""
        return self.piston_rod_length, self.piston_offset

    @cached_property
    def dead_centres(self) -> tuple[float, float]:
        """Crank angles of the highest and lowest piston position, with crank and coupler in one line [rad] (K23)."""
        distance, angles = abs(self.pivot), list[float]()
        for reach in (self.coupler_length + self.crank_radius, self.coupler_length - self.crank_radius):
            cosine = (self.arm**2 + distance**2 - reach**2) / (2.0 * self.arm * distance)
            turned = complex(cosine, -self.side * math.sqrt(max(1.0 - cosine * cosine, 0.0)))
            pin = self.pivot * (1.0 - self.arm / distance * turned)
            angles.append(math.atan2(pin.imag, pin.real))
        outer, inner = angles[0], angles[1] + math.pi
        is_outer = self.travel(np, np.float64(outer)) < self.travel(np, np.float64(inner))
        top, bottom = (outer, inner) if is_outer else (inner, outer)
        top = math.remainder(top, math.tau)
        return top, top + (bottom - top) % math.tau

    def links(self, lib: Any, alpha: Any) -> tuple[tuple[Any, Any, Any], tuple[Any, Any]]:
        """Return rocker and coupler over the crank angle (K22).

        They are the direction of the rocker from its pivot to the coupler's pin, with rate and acceleration of its
        angle, and rate and acceleration of the coupler's angle.
        """
        r, a, c = (0.0 * alpha + size for size in (self.crank_radius, self.arm, self.coupler_length))
        crank = lib.cos(alpha) + 1j * lib.sin(alpha)
        line = r * crank - self.pivot
        square = line.real * line.real + line.imag * line.imag
        along, reach = 0.5 + 0.5 * (a - c) * (a + c) / square, a / lib.sqrt(square)
        rocker = line * (along - 1j * self.side * lib.sqrt((reach - along) * (reach + along))) / a
        coupler = (self.pivot + a * rocker - r * crank) / c
        # directions of crank and rocker from the coupler, and of the crank from the rocker
        ahead, lean, gap = crank * coupler.conjugate(), rocker * coupler.conjugate(), crank * rocker.conjugate()
        rate, turn = r * ahead.imag / (a * lean.imag), r * gap.imag / (c * lean.imag)
        swing = (r * ahead.real * (1.0 - turn) / a - rate * lean.real * (rate - turn)) / lean.imag
        twist = (r * gap.real * (1.0 - rate) / c - turn * lean.real * (rate - turn)) / lean.imag
        return (rocker, rate, swing), (turn, twist)

    def _on_rocker(self, rocker: tuple[Any, Any, Any], place: complex) -> tuple[Any, Any, Any]:
        direction, rate, swing = rocker
        arm = place * direction
        return self.pivot + arm, 1j * rate * arm, (1j * swing - rate * rate) * arm

    def driving_pin(self, lib: Any, alpha: Any) -> tuple[Any, Any, Any]:
        """Return the motion of the rod's pin on the rocker."""
        return self._on_rocker(self.links(lib, alpha)[0], self.end)

    def motion(self, lib: Any, alpha: Any) -> Motion:
        """Return the motion of piston, coupler, rocker and piston rod, with derivatives by the crank angle alpha."""
        rocker, coupler = self.links(lib, alpha)
        (place, velocity, acceleration), rod = self.piston(lib, alpha)
        piston = place + 1j * self.piston_offset, velocity, acceleration
        crank = (0.0 * alpha + self.crank_radius) * (lib.cos(alpha) + 1j * lib.sin(alpha))
        pin, end = self._on_rocker(rocker, complex(self.arm)), self._on_rocker(rocker, self.end)
        return Motion(
            (
                (self.reciprocating_mass, piston),
                (self.coupler_mass, _between((crank, 1j * crank, -crank), pin, self.coupler_share)),
                (self.rocker_mass, self._on_rocker(rocker, self.rocker_share * self.end)),
                (self.piston_rod_mass, _between(end, piston, self.piston_rod_share)),
            ),
            ((self.coupler_inertia, coupler), (self.rocker_inertia, rocker[1:]), (self.piston_rod_inertia, rod)),
        )  # fmt: skip

    def outlines(self, alpha: float) -> tuple[Outline, ...]:
        """Return the outlines of piston, coupler, both arms of the rocker, and piston rod."""
        angle, width = np.float64(alpha), 0.08 * self.stroke
        rocker = complex(self.links(np, angle)[0][0])
        pin, end = self.pivot + self.arm * rocker, self.pivot + self.end * rocker
        piston = complex(self.motion(np, angle).points[0][1][0])
        wide, crank = self.bore or self.stroke, self.crank_radius * complex(np.exp(1j * angle))
        head = bar(piston - 0.25 * self.stroke, piston + 0.25 * self.stroke, wide)
        pairs = (crank, pin), (self.pivot, pin), (self.pivot, end), (end, piston)
        return Outline(head, wide, True), *(Outline(bar(*ends, width), width, True) for ends in pairs)


def _between(first: tuple[Any, Any, Any], last: tuple[Any, Any, Any], share: float) -> tuple[Any, Any, Any]:
    a, b, c = ((1.0 - share) * one + share * other for one, other in zip(first, last, strict=True))
    return a, b, c
