"""Mechanisms whose piston follows a moving pin by a rod."""

from __future__ import annotations

from typing import Any

import numpy as np

from laufruhe.machine.slider_crank import SliderCrank


class PinDriven(SliderCrank):
    """Mechanism whose piston follows a moving pin by a rod; subclasses give this pin and the dead centres."""

    @property
    def piston_rod(self) -> tuple[float, float]:
        """Length of the piston rod, and height of the piston's path above the cylinder axis of C5 [m]."""
        return self.rod_length, self.offset

    def driving_pin(self, lib: Any, alpha: Any) -> tuple[Any, Any, Any]:
        """Return the position of the pin that drives the rod, and its first two derivatives by alpha [m]."""
        raise NotImplementedError(type(self).__name__)

    @property
    def fires_at(self) -> float:
        """Local crank angle of the true dead centre [rad]."""
        return self.dead_centres[0]

    @property
    def stroke(self) -> float:
        """Distance between the dead centres [m]; that of a hinged rod differs a little from the master's."""
        top, bottom = self.dead_centres
        return float(self.travel(np, np.float64(bottom)) - self.travel(np, np.float64(top)))

    def travel(self, lib: Any, alpha: Any) -> Any:
        """Return the piston travel towards the crank from alpha = 0 [m]."""
        return self.piston(lib, 0.0 * alpha)[0][0] - self.piston(lib, alpha)[0][0]

    def velocity(self, lib: Any, alpha: Any) -> Any:
        """Return the velocity of the piston away from the crank, by the angle of its crank [m]."""
        return self.piston(lib, alpha)[0][1]

    def piston(self, lib: Any, alpha: Any) -> tuple[tuple[Any, Any, Any], tuple[Any, Any]]:
        """Return piston position with two derivatives along its axis, and rate and acceleration of its rod (K12)."""
        (place, velocity, acceleration), (length, offset) = self.driving_pin(lib, alpha), self.piston_rod
        rod = 0.0 * alpha + length
        sine = (place.imag - offset) / rod
        cosine = lib.sqrt((1.0 - sine) * (1.0 + sine))
        rate = velocity.imag / (rod * cosine)
        swing = (acceleration.imag / rod + rate * rate * sine) / cosine
        return (
            place.real + rod * cosine,
            velocity.real - rod * rate * sine,
            acceleration.real - rod * (swing * sine + rate * rate * cosine),
        ), (-rate, -swing)

    def rod_lean(self, lib: Any, alpha: Any) -> tuple[Any, Any]:
        """Return sine and cosine of the angle chi between rod and cylinder axis (K12)."""
        length, offset = self.piston_rod
        sine = (self.driving_pin(lib, alpha)[0].imag - offset) / (0.0 * alpha + length)
        return sine, lib.sqrt((1.0 - sine) * (1.0 + sine))
