"""One crank of a rhombic drive, with its halves of power piston and displacer (K24; Meijer 1959)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from laufruhe.machine.bodies import Motion, Outline, bar
from laufruhe.machine.slider_crank import SliderCrank


@dataclass(frozen=True, kw_only=True)
class RhombicHalf(SliderCrank):
    """Slider-crank of half a power piston, with a second equal rod on its pin that drives half a displacer.

    Attributes
    ----------
    displacer_mass
        Half the mass of the displacer with its rod and yoke, and the second rod's share [kg].
    """

    displacer_mass: float = 0.0
    has_pin_loads: ClassVar[bool] = False
    is_balanced_by_share: ClassVar[bool] = False
    powers: ClassVar = {**SliderCrank.powers, "displacer_mass": (1, 0)}

    def motion(self, lib: Any, alpha: Any) -> Motion:
        """Return the motion of both pistons and both rods, with derivatives by the crank angle alpha.

        The height of the crank pin is the mean of both pistons (K24).
        """
        moving = super().motion(lib, alpha)
        ((mass, piston),), ((inertia, (rate, swing)),) = moving.points, moving.swings
        twice, (place, velocity, acceleration) = 0.0 * alpha + 2.0 * self.crank_radius, piston
        cosine, sine = lib.cos(alpha), lib.sin(alpha)
        # positions count from alpha = 0
        displacer = (
            twice * (cosine - 1.0) - place + 2j * self.offset, -twice * sine - velocity, -twice * cosine - acceleration
        )  # fmt: skip
        return Motion(
            ((mass, piston), (self.displacer_mass, displacer)), ((inertia, (rate, swing)), (inertia, (-rate, -swing)))
        )  # fmt: skip

    def outlines(self, alpha: float) -> tuple[Outline, ...]:
        """Return the outlines of both rods and of the yokes' halves."""
        angle, width = np.float64(alpha), 0.08 * self.stroke
        pin = self.crank_radius * complex(np.exp(1j * angle))
        sine, cosine = (float(part) for part in self.rod_lean(np, angle))
        yokes = [pin + self.rod_length * complex(side * cosine, -sine) for side in (1.0, -1.0)]
        bars = [ends for yoke in yokes for ends in ((pin, yoke), (yoke - 2j * width, yoke + 2j * width))]
        return tuple(Outline(bar(*ends, width), width, True) for ends in bars)
