"""A piston on a rod that is hinged to the master rod of another cylinder."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import kinematics
from laufruhe.machine.bodies import Motion
from laufruhe.machine.pin_driven import PinDriven
from laufruhe.machine.slider_crank import SliderCrank
from laufruhe.numerics.roots import rising_root

_STEPS = 720
"""Number of crank angles at which the lean of the rod is checked."""


@dataclass(frozen=True)
class Knuckle:
    """Knuckle pin: hinge of an articulated rod on a master rod.

    Attributes
    ----------
    master
        Slider-crank of the master rod.
    radius
        Distance of the knuckle pin from the crank pin [m].
    angle
        Angle of the knuckle pin from the line of the master rod's pins, positive as the crank turns [rad].
    """

    master: SliderCrank
    radius: float
    angle: float
    powers: ClassVar = {"radius": (0, 1)}

    def motion(self, lib: Any, alpha: Any, bank: float) -> tuple[Any, Any, Any]:
        """Return the position of the pin and its first two derivatives by alpha [m], for a cylinder at `bank` (K11)."""
        arm, rate, swing = self._arm(lib, alpha, bank)
        pin = (0.0 * alpha + self.master.crank_radius) * (lib.cos(alpha) + 1j * lib.sin(alpha))
        return pin + arm, 1j * (pin + rate * arm), (1j * swing - rate * rate) * arm - pin

    def _shape(self, lib: Any, alpha: Any, bank: float) -> tuple[Any, Any, Any, Any]:
        zero, length = 0.0 * alpha, 0.0 * alpha + self.master.rod_length
        lead = bank - self.master.bank
        return lib, alpha + lead, (zero + self.master.crank_radius) / length, self.master.offset / length

    def _arm(self, lib: Any, alpha: Any, bank: float) -> tuple[Any, Any, Any]:
        shape = self._shape(lib, alpha, bank)
        rod = kinematics.cos_psi(*shape) - 1j * kinematics.sin_psi(*shape)
        turn = 0.0 * alpha + (self.angle - (bank - self.master.bank))
        arm = self.radius * rod * (lib.cos(turn) + 1j * lib.sin(turn))
        return arm, -kinematics.rod_rate(*shape), -kinematics.rod_acceleration(*shape)

    def push(self, lib: Any, alpha: Any, bank: float, force: Any) -> Any:
        """Return the wall force on the master's piston that holds its rod against `force` on the knuckle pin (B11)."""
        arm, _, _ = self._arm(lib, alpha, bank)
        reach = (0.0 * alpha + self.master.rod_length) * kinematics.cos_psi(*self._shape(lib, alpha, bank))
        return -(arm.conjugate() * force).imag / reach

    def length_to(self, reach: complex, bank: float) -> float:
        """Return the length of a rod whose piston pin comes to the point `reach` at its highest [m] (K13)."""

        def slope(alpha: float) -> float:
            place, velocity, _ = self.motion(np, alpha, bank)
            return float(((place - reach).conjugate() * velocity).real)

        place, _, _ = self.motion(np, _root(slope, 0.0), bank)
        return float(abs(reach - place))


@dataclass(frozen=True, kw_only=True)
class ArticulatedCrank(PinDriven):
    """A cylinder whose rod works on a knuckle pin; `rotating_mass` is the rod's share at that pin."""

    knuckle: Knuckle

    def __post_init__(self) -> None:
        super().__post_init__()
        place, _, _ = self.knuckle.motion(np, np.arange(_STEPS) * (math.tau / _STEPS), self.bank)
        leaning = float(np.abs(place.imag - self.offset).max()) / self.rod_length
        if leaning >= 1.0:
            raise ModelError(
                f"{self.name}: its knuckle pin leaves the axis by {leaning:.4g} rod lengths; lengthen the rod"
            )

    @property
    def path(self) -> Hashable:
        """Numbers that determine the path of the piston over the angle of the crank."""
        master = self.knuckle.master
        hinge = (self.knuckle.radius, self.knuckle.angle, self.bank - master.bank)
        return (*super().path, *hinge, master.path)  # type: ignore[misc]

    @cached_property
    def dead_centres(self) -> tuple[float, float]:
        """Local crank angles of the highest and lowest piston position [rad] (K13)."""
        first, last = (_root(lambda alpha: float(self.velocity(np, alpha)), start) for start in (0.0, math.pi))
        return first, last

    def driving_pin(self, lib: Any, alpha: Any) -> tuple[Any, Any, Any]:
        """Return the motion of the knuckle pin (K11)."""
        return self.knuckle.motion(lib, alpha, self.bank)

    @property
    def master_bank(self) -> float:
        """Bank angle of the master's cylinder [rad]."""
        return self.knuckle.master.bank

    def on_pin(self, lib: Any, alpha: Any, force: Any, with_masses: bool) -> Any:
        """Return the force on the knuckle pin, with the inertia of the mass there (B11)."""
        if not with_masses:
            return force
        _, _, acceleration = self.knuckle.motion(lib, alpha, self.bank)
        return force - self.rotating_mass * acceleration

    def on_wall_of_master(self, lib: Any, alpha: Any, force: Any) -> Any:
        """Return the wall force that balances the moment of a knuckle-pin force about the crank pin (B11)."""
        return self.knuckle.push(lib, alpha, self.bank, force)

    @property
    def big_end_area(self) -> float:
        """Projected area of the pin, which is unknown for a knuckle pin."""
        raise ModelError(
            f"{self.name} works on a knuckle pin of unknown area, so its pressure is not known; use the crank-pin force"
        )

    def motion(self, lib: Any, alpha: Any) -> Motion:
        """Return the motion of piston, rod and knuckle pin, less the mass that is counted at the crank pin."""
        (place, velocity, acceleration), rod = self.piston(lib, alpha)
        radius = 0.0 * alpha + self.crank_radius
        pin = radius * (lib.cos(alpha) + 1j * lib.sin(alpha))
        return Motion(
            (
                (self.reciprocating_mass, (place + 1j * self.offset, velocity, acceleration)),
                (self.rotating_mass, self.knuckle.motion(lib, alpha, self.bank)),
                (-self.rotating_mass, (pin, 1j * pin, -pin)),
            ),
            ((self.rod_inertia_deficit, rod),),
        )


def _root(function: Callable[[float], float], start: float) -> float:
    # zero of a function within a radian of `start`
    sign = math.copysign(1.0, function(start + 1.0))
    if sign * function(start - 1.0) >= 0.0:
        raise ModelError(f"the piston has no dead centre near {math.degrees(start):g} deg; lengthen the rods")
    return rising_root(lambda angle: sign * function(angle), start - 1.0, start + 1.0)
