"""What of the physics is kept: choices with names, each free of the others (F1)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from laufruhe.errors import ModelError

Kinematics = Literal["exact", "two-order"]
RodModel = Literal["rigid", "mass-only"]
MountModel = Literal["frequency", "rigid", "time"]
MODES = 6


@dataclass(frozen=True)
class Fidelity:
    """What of the physics is kept.

    Attributes
    ----------
    kinematics
        "exact", or "two-order": cos alpha + lambda cos 2 alpha of the textbooks.
    samples
        Steps over the working cycle at which measures are taken.
    orders
        Last order of crank speed kept of the loads of pistons, rods and gas; every
        order when None. Rotors keep theirs: they have one each.
    rod
        "rigid", or "mass-only": two masses without the inertia that they get wrong.
    gas
        Whether the working gas loads the engine.
    gas_samples
        Steps over the cycle at which gas torque is taken; those of `samples` when None.
    crank_inertia
        Of everything that turns with the crank [kg m2], at crank speed. Infinite for a
        crank that turns evenly; a finite one speeds up and slows down within the cycle.
    mounts
        How a block on elastic mounts answers: order by order ("frequency"), as if no
        mount gave way ("rigid"), or by integration in time ("time"), bump stops
        included. Mounts of an engine without a block are rigid at every choice.
    modes
        Natural modes that answer, 1 the lowest; all that are excited when None.
    tolerance
        Relative error of the objective that was asked of an automatic choice; None for
        one made by hand.

    Raises
    ------
    ModelError
        If a choice means nothing, or two contradict each other.
    """

    kinematics: Kinematics = "exact"
    samples: int = 1440
    orders: int | None = None
    rod: RodModel = "rigid"
    gas: bool = True
    gas_samples: int | None = None
    crank_inertia: float = math.inf
    mounts: MountModel = "frequency"
    modes: tuple[int, ...] | None = None
    tolerance: float | None = None

    def __post_init__(self) -> None:
        if self.orders is not None and self.orders < 1:
            raise ModelError(f"orders {self.orders} must be at least 1; leave it out to keep all")
        if not self.crank_inertia > 0.0:
            raise ModelError(f"crank inertia {self.crank_inertia:g} kg m2 must be positive")
        if self.is_uneven and self.kinematics != "exact":
            raise ModelError("an uneven crank speed goes with exact kinematics only; leave kinematics out")
        if self.modes is None:
            return
        if len(set(self.modes)) != len(self.modes) or not all(1 <= mode <= MODES for mode in self.modes):
            raise ModelError(f"modes {list(self.modes)} must be different numbers from 1 to {MODES}, 1 the lowest")
        if self.mounts != "frequency":
            raise ModelError(f"modes go with mounts in the frequency domain, not with '{self.mounts}'; leave modes out")

    @property
    def is_uneven(self) -> bool:
        """Whether the crank speed varies within the cycle."""
        return math.isfinite(self.crank_inertia)

    @property
    def gas_steps(self) -> int:
        """Steps over the cycle at which gas torque is taken."""
        return self.samples if self.gas_samples is None else self.gas_samples

    @property
    def summary(self) -> str:
        """The choices in words, those that are usual left out."""
        words = [f"{self.kinematics} kinematics"]
        if self.orders is not None:
            words.append(f"orders to {self.orders}")
        if self.rod == "mass-only":
            words.append("rod of two masses")
        if not self.gas:
            words.append("no gas")
        if self.is_uneven:
            words.append(f"uneven crank speed ({self.crank_inertia:g} kg m2)")
        if self.mounts == "rigid":
            words.append("mounts that do not give way")
        if self.mounts == "time":
            words.append("mounts in the time domain")
        if self.modes is not None:
            words.append("modes " + ", ".join(map(str, self.modes)) if self.modes else "no mode")
        return ", ".join(words)

    def local_orders(self, ratio: float) -> int | None:
        """Last order kept in the angle of a crank of this ratio to the crankshaft."""
        return None if self.orders is None else max(1, math.ceil(self.orders / abs(ratio)))


EXACT = Fidelity()
