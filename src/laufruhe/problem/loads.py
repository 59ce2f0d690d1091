"""Loads of a design, and the keys by which measures narrow them."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
        Wrench on the block, shape (n, 6) (C7).
    mount_forces
        Forces of the engine on its mounts, shape (n, mounts, 3); None without mounts.
    mount_travel
        Displacement of the engine at its mounts, shape (n, mounts, 3) [m]; None for rigid mounts.
    moving_parts
        Engine whose slider-cranks and rotors make these loads, for loads inside the crankcase; None if the wrench alone
        is known.
    """

    point: OperatingPoint
    wrench: Spectrum
    mount_forces: Spectrum | None
    mount_travel: Spectrum | None = None
    moving_parts: Engine | None = None
    fidelity: Fidelity = EXACT


@dataclass(frozen=True, eq=False)
class EvaluatedDesign:
    """A design with its loads at every operating point."""

    engine: Engine
    fidelity: Fidelity
    loads: tuple[PointLoads, ...]


@dataclass(frozen=True, kw_only=True)
class MeasureQuery:
    """Keys of a file that narrow a channel to parts of it.

    Attributes
    ----------
    at, points, rotors, cases
        Names of the places, operating points, rotors and load cases that count; all when None. Places are mounts,
        bearings, cylinders or sections of the crankshaft, depending on the channel.
    orders
        Orders of crank speed that count; all when None.
    direction_weights
        Factors on the components of a force before its length is computed; None for 1, 1, 1.
    motions
        Motions that natural modes should decouple; all when None.
    frequency
        Lower and upper bound of the desired natural frequency about the torque-roll axis [Hz].
    wanted
        Energy share of a motion in one mode at which it counts as decoupled, 0 to 1.
    alternating
        True if the mean of a load over the cycle is left out (M7).
    """

    at: tuple[str, ...] | None = None
    points: tuple[str, ...] | None = None
    rotors: tuple[str, ...] | None = None
    cases: tuple[str, ...] | None = None
    orders: tuple[float, ...] | None = None
    direction_weights: tuple[float, float, float] | None = None
    motions: tuple[str, ...] | None = None
    frequency: tuple[float, float] = (0.0, math.inf)
    wanted: float = 1.0
    alternating: bool = False

    def includes_point(self, point: OperatingPoint) -> bool:
        """Return True if an operating point counts."""
        return self.points is None or point.name in self.points

    def places(self, names: Sequence[str]) -> list[int]:
        """Return the indices of the place names that count; all if no places are selected."""
        return [k for k, name in enumerate(names) if self.at is None or name in self.at]
