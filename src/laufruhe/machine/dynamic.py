"""Springs whose stiffness depends on frequency: fluid tracks and measured stiffness (E50, E51)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import Array, ComplexArray


@dataclass(frozen=True)
class FluidTrack:
    """A hydraulic mount: fluid is pumped through a track, and swells the rubber that pumps it (E50).

    All numbers are referred to the travel of the mount by the area of the piston.

    Attributes
    ----------
    axis
        Index of the mount's own axis along which the fluid acts.
    mass
        Effective mass of the fluid in the track [kg].
    bulge
        Stiffness of the rubber against swelling [N/m].
    stiffness
        Stiffness of the lower chamber [N/m].
    damping
        Damping of the flow through the track [N s/m].
    """

    axis: int
    mass: float
    bulge: float
    stiffness: float = 0.0
    damping: float = 0.0

    def __post_init__(self) -> None:
        if not (self.mass > 0.0 and self.bulge > 0.0):
            raise ModelError("the fluid track of a hydraulic mount needs a mass and a bulge stiffness above zero")
        if not (self.stiffness >= 0.0 and self.damping >= 0.0):
            raise ModelError(
                "the fluid track of a hydraulic mount has a negative stiffness or damping; give zero or more"
            )

    @property
    def static(self) -> float:
        """Stiffness of bulge and lower chamber in series [N/m]."""
        return self.bulge * self.stiffness / (self.bulge + self.stiffness)

    def at(self, omegas: Array) -> ComplexArray:
        """Return the complex stiffness that the fluid adds to a hydraulic mount [N/m], at angular frequencies [rad/s].

        The fluid track and the lower chamber act in series with the bulge, the elastic wall of the upper chamber.
        """
        behind = self.stiffness - self.mass * omegas**2 + 1j * self.damping * omegas
        total = self.bulge + behind
        # without damping the fluid resonates: the force of the mount has no size there
        return np.asarray(self.bulge * behind / np.where(total == 0.0, 1e-300, total), dtype=complex)


@dataclass(frozen=True)
class MeasuredStiffness:
    """Complex stiffness [N/m] over rising frequency [rad/s], linear between these values, constant beyond (E51)."""

    axis: int
    omegas: tuple[float, ...]
    values: tuple[complex, ...]

    def __post_init__(self) -> None:
        rising = all(a < b for a, b in zip(self.omegas, self.omegas[1:], strict=False))
        if not self.omegas or len(self.omegas) != len(self.values) or not rising or self.omegas[0] < 0.0:
            raise ModelError(
                "the frequencies of a measured mount stiffness must rise, from zero or more; sort the rows"
            )
        for omega, value in zip(self.omegas, self.values, strict=True):
            if not (math.isfinite(value.real) and value.imag >= 0.0):
                raise ModelError(
                    f"at {omega / math.tau:.4g} Hz a measured mount stiffness has a negative loss; correct this row"
                )
        if not self.values[0].real >= 0.0:
            raise ModelError("a measured mount stiffness is negative at rest; give its first row zero or more")

    @property
    def static(self) -> float:
        """Stiffness at the lowest frequency, without loss [N/m]."""
        return self.values[0].real

    def at(self, omegas: Array) -> ComplexArray:
        """Return the stiffness at angular frequencies [rad/s], interpolated in real and imaginary part."""
        values = np.array(self.values)
        real, imag = (np.interp(omegas, self.omegas, part) for part in (values.real, values.imag))
        return np.asarray(np.where(omegas == 0.0, self.static, real + 1j * imag), dtype=complex)


Dynamic: TypeAlias = FluidTrack | MeasuredStiffness
"""Spring along one axis of a mount, in parallel with its constant stiffness."""
