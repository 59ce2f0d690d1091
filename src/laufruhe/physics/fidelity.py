"""Physics options of a model, each independent of the others (F1).

`files.fidelity` reads each from a problem file; `extensions.fidelity.choice` says when it pays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

from laufruhe.errors import ModelError
from laufruhe.machine import GasModel, OperatingPoint
from laufruhe.numerics.spectrum import Spectrum

Kinematics = Literal["exact", "two-order"]
RodModel = Literal["rigid", "mass-only"]
CrankshaftModel = Literal["cut", "beam"]
MountModel = Literal["frequency", "rigid", "time"]
MODES = 6


class ChoiceError(ModelError):
    """Invalid or contradictory fidelity option."""

    def __init__(self, key: str, value: Any, rule: str, remedy: str) -> None:
        self.key, self.rule, self.remedy = key, rule, remedy
        super().__init__(f"{key.replace('_', ' ')} {value} {rule}; {remedy}")


@dataclass(frozen=True)
class Fidelity:
    """Physics options of a model.

    Attributes
    ----------
    kinematics
        "exact", or "two-order": cos alpha + lambda cos 2 alpha of the textbooks.
    samples
        Steps over the working cycle at which measures are taken.
    orders
        Last order of crank speed kept of pistons, rods and gas, all when None. Rotors have one each, and keep it.
    rod
        "rigid", or "mass-only": two masses without the inertia that they get wrong.
    gas, gas_orders, gas_samples
        Whether the working gas counts; the last order kept of it alone, and the steps over
        the cycle at which its torque is taken, those of `orders` and `samples` when None.
    crank_inertia
        Of all that turns with the crank [kg m2], at crank speed; a finite one turns unevenly.
    mounts
        How a block on elastic mounts answers: order by order ("frequency"), as if no mount gave
        way ("rigid"), or by integration in time ("time"), bump stops included.
    modes
        Natural modes that answer, 1 the lowest; all that are excited when None.
    crankshaft
        How bearings share its loads: "cut" in the middle of every journal, or as a "beam" of one stiffness
        along all of them.
    tolerance
        Relative error of the objective that was requested of an automatic choice.
    """

    kinematics: Kinematics = "exact"
    samples: int = 1440
    orders: int | None = None
    rod: RodModel = "rigid"
    gas: bool = True
    gas_orders: int | None = None
    gas_samples: int | None = None
    crank_inertia: float = math.inf
    mounts: MountModel = "frequency"
    modes: tuple[int, ...] | None = None
    crankshaft: CrankshaftModel = "cut"
    tolerance: float | None = None

    def __post_init__(self) -> None:
        if self.orders is not None and self.orders < 1:
            raise ChoiceError("orders", self.orders, "must be at least 1", "leave it out to keep all")
        if self.gas_orders is not None and not (self.gas and self.gas_orders >= 1):
            raise ChoiceError("gas_orders", self.gas_orders, "needs gas, and must be at least 1", "leave it out")
        if not self.crank_inertia > 0.0:
            raise ChoiceError("crank_inertia", self.crank_inertia, "must be positive", "give an inertia in kg m2")
        if self.has_uneven_speed and self.kinematics != "exact":
            rule = "needs exact kinematics"
            raise ChoiceError("crank_inertia", self.crank_inertia, rule, "leave kinematics out")
        if self.modes is None:
            return
        modes = list(self.modes)
        if self.mounts != "frequency":
            raise ChoiceError("modes", modes, "need mounts in the frequency domain", "leave one of the two out")
        if len(set(modes)) != len(modes) or not all(1 <= mode <= MODES for mode in modes):
            raise ChoiceError("modes", modes, f"must be different numbers from 1 to {MODES}", "1 is the lowest mode")

    def exact(self, samples: int) -> Fidelity:
        """Return the fidelity with all physics, for the same crankshaft model and inertia of the crank."""
        return replace(EXACT, samples=samples, crank_inertia=self.crank_inertia, crankshaft=self.crankshaft)

    @property
    def is_exact(self) -> bool:
        """True if no physics is left out."""
        return self == replace(self.exact(self.samples), gas_samples=self.gas_samples, tolerance=self.tolerance)

    @property
    def has_uneven_speed(self) -> bool:
        """True if the crank speed varies within the cycle."""
        return math.isfinite(self.crank_inertia)

    @property
    def gas_steps(self) -> int:
        """Steps over the cycle at which gas torque is taken."""
        return self.samples if self.gas_samples is None else self.gas_samples

    def gas_of(self, point: OperatingPoint) -> GasModel | None:
        """Return the working gas that loads the engine, or None."""
        return point.gas if self.gas else None

    def truncated_gas(self, torque: Spectrum) -> Spectrum:
        """Return the gas torque without truncated orders."""
        return torque if self.gas_orders is None else torque.truncated(self.gas_orders)

    def truncated(self, loads: Spectrum, minimum: float = 1.0) -> Spectrum:
        """Return the loads without truncated orders; those up to `minimum` stay."""
        return loads if self.orders is None else loads.truncated(max(self.orders, minimum))

    def local_orders(self, ratio: float) -> int | None:
        """Return the last order in the angle of a crank of this ratio, or None."""
        return None if self.orders is None else max(1, math.ceil(self.orders / abs(ratio)))

    @property
    def summary(self) -> str:
        """Options that are not the default, in words."""
        modes = "no mode" if not self.modes else "modes " + ", ".join(map(str, self.modes))
        words = (
            (True, f"{self.kinematics} kinematics"),
            (self.orders is not None, f"orders to {self.orders}"),
            (self.rod == "mass-only", "rod of two masses"),
            (not self.gas, "no gas"),
            (self.gas_orders is not None, f"gas to order {self.gas_orders}"),
            (self.has_uneven_speed, f"uneven crank speed ({self.crank_inertia:g} kg m2)"),
            (self.mounts == "rigid", "mounts that do not give way"),
            (self.mounts == "time", "mounts in the time domain"),
            (self.modes is not None, modes),
            (self.crankshaft == "beam", "crankshaft as a continuous beam"),
        )
        return ", ".join(text for is_said, text in words if is_said)


EXACT = Fidelity()
