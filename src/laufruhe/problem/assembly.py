"""Parts of measured masses, one of which goes into each cylinder (R12)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.numerics.arrays import Array


@dataclass(frozen=True)
class Lot:
    """Parts of one kind; the drawing stands for their mean.

    Attributes
    ----------
    kind
        "piston" or "rod".
    masses
        Of every part what goes to and fro, and what turns with the crank pin [kg].
    """

    kind: str
    masses: tuple[tuple[float, float], ...]

    @property
    def differences(self) -> Array:
        """From the mean of the lot, shape (parts, 2) [kg]."""
        masses = np.array(self.masses)
        return np.asarray(masses - masses.mean(axis=0))


@dataclass(frozen=True)
class Assembly:
    """Lots of parts, of each of which every cylinder takes one."""

    lots: tuple[Lot, ...]
