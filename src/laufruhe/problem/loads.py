"""Loads of one design at one operating point: what every channel takes its signal from."""

from __future__ import annotations

from dataclasses import dataclass

from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import EXACT, Fidelity


@dataclass(frozen=True, eq=False)
class PointLoads:
    """Loads at one operating point.

    Attributes
    ----------
    wrench
        On the block, shape (n, 6) (C7).
    mount_forces
        Of the engine on its mounts, shape (n, mounts, 3); None without mounts.
    mount_travel
        Displacement of the engine at them, shape (n, mounts, 3) [m]; None where rigid.
    moving
        The slider-cranks and rotors that make all this, for loads inside the crankcase; None where
        the wrench alone is known.
    fidelity
        What of the physics was kept.
    """

    point: OperatingPoint
    wrench: Spectrum
    mount_forces: Spectrum | None
    mount_travel: Spectrum | None = None
    moving: Engine | None = None
    fidelity: Fidelity = EXACT
