"""Mixed cycle whose cut-off is solved for the requested indicated mean pressure."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import ClassVar, Self

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine.engine import Cycle
from laufruhe.machine.gas.base import check_pressures
from laufruhe.machine.gas.charge import (
    Charge,
    ChargedCylinder,
    TrappedCharge,
    dead_centres,
    gas_exchange_pressure,
    in_bar,
    stroke_ends,
)  # fmt: skip
from laufruhe.machine.slider_crank import SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.roots import rising_root

_ROUNDING = 1e-12
MAX_EXPONENT = 5.0
"""Largest polytropic exponent that the cycle accepts."""


class FiredCharge(Charge):
    """Charge that burns, so that the whole cycle has an indicated mean pressure."""

    imep: float
    loads: ClassVar[tuple[str, ...]] = ("imep", "intake_pressure")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not math.isfinite(self.imep):
            raise ModelError(f"imep {self.imep} must be finite; give a mean pressure such as 9 bar")

    @property
    @abstractmethod
    def charge_exponent(self) -> float:
        """Polytropic exponent of the charge before it burns."""

    def loaded(self, pressures: Mapping[str, float], /) -> Self:
        """Return the cycle with other pressures [Pa]."""
        return replace(self, **pressures)

    def motored(self, cycle: Cycle, /) -> Seiliger:
        """Return the same charge without heat: expansion retraces compression (G4, G5 with peak p_c and n_2 = n_1).

        Its indicated mean pressure is that of the gas exchange alone.
        """
        exponent = self.charge_exponent
        peak, imep = self.intake_pressure * self.compression_ratio**exponent, gas_exchange_pressure(self, cycle)
        return Seiliger(peak, imep, compression_exponent=exponent, expansion_exponent=exponent, **self._charge)

    def cut(self, has_open_valves: bool, /) -> TrappedCharge:
        """Return the same charge in a cylinder whose valves stay closed, or open to the intake (G21)."""
        return TrappedCharge(exponent=0.0 if has_open_valves else self.charge_exponent, **self._charge)

    @property
    def _charge(self) -> dict[str, float]:
        return {number.name: getattr(self, number.name) for number in fields(Charge)}


@dataclass(frozen=True)
class Seiliger(FiredCharge):
    """Mixed cycle, its heat given at constant volume and then at constant pressure.

    Heat at constant volume raises the pressure to its peak. Heat at constant pressure lasts up to the cut-off that
    gives the indicated mean effective pressure.

    Attributes
    ----------
    peak_pressure
        Absolute peak pressure [Pa].
    imep
        Indicated mean effective pressure of the whole cycle, gas exchange included [Pa].
    compression_exponent, expansion_exponent
        Polytropic exponents.
    """

    peak_pressure: float
    imep: float
    compression_exponent: float = 1.35
    expansion_exponent: float = 1.30

    loads: ClassVar[tuple[str, ...]] = ("imep", "peak_pressure", "intake_pressure")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_pressures(self, "peak_pressure")
        for name in ("compression_exponent", "expansion_exponent"):
            exponent = getattr(self, name)
            if not 0.0 < exponent <= MAX_EXPONENT:
                raise ModelError(
                    f"{name} {exponent:g} must be over 0 and at most {MAX_EXPONENT:g}; "
                    "1.2 to 1.4 is usual, 1 is a constant temperature"
                )

    @property
    def charge_exponent(self) -> float:
        """Exponent of compression."""
        return self.compression_exponent

    def cycle_pressure(self, piston: SliderCrank, cycle: Cycle, angles: Array, pace: float) -> Array:
        """Return the pressure of the mixed cycle [Pa] (G4, G5)."""
        cylinder = ChargedCylinder(self, piston, cycle)
        top, _ = dead_centres(piston)
        cut_off = cylinder.smallest * seiliger_cut_off(self, cycle)

        def closed(local: Array) -> Array:
            volume, rises = cylinder.volume(local), local < top
            pressure = np.empty_like(volume)
            pressure[rises] = self.intake_pressure * (cylinder.largest / volume[rises]) ** self.compression_exponent
            pressure[~rises] = self.peak_pressure * np.minimum(1.0, cut_off / volume[~rises]) ** self.expansion_exponent
            return pressure

        return cylinder.pressure(closed, pace * angles)

    def cycle_breaks(self, piston: SliderCrank, cycle: Cycle, pace: float) -> Array:
        """Return the ends of strokes, where valves open and heat comes at once, and that of heat [rad] (G13)."""
        return np.array([*stroke_ends(piston), cut_off_angle(self, piston, cycle)]) / pace


@lru_cache(maxsize=64)
def seiliger_cut_off(gas: Seiliger, cycle: Cycle) -> float:
    """Return cut-off volume over smallest volume, solved for the indicated mean pressure (G6).

    The mean pressure rises with the cut-off all the way, from heat at constant volume
    alone (1) to constant pressure down the whole stroke (the compression ratio).
    """
    end = compression_end_pressure(gas)
    if gas.peak_pressure < end * (1.0 - _ROUNDING):
        raise ModelError(
            f"peak_pressure {in_bar(gas.peak_pressure)} is below the {in_bar(end)} at the end of compression "
            f"(ratio {gas.compression_ratio:g}, exponent {gas.compression_exponent:g}, "
            f"from {in_bar(gas.intake_pressure)}); lower intake_pressure (at idle that of the manifold) or "
            "compression_ratio, or raise peak_pressure",
            "gas.peak_pressure",
        )
    minimum, maximum = seiliger_imep(gas, cycle, 1.0), seiliger_imep(gas, cycle, gas.compression_ratio)
    slack = _ROUNDING * gas.peak_pressure
    if not minimum - slack <= gas.imep <= maximum + slack:
        remedy = (
            "raise peak_pressure or lower imep"
            if gas.imep > maximum
            else "lower intake_pressure (at idle that of the manifold) and peak_pressure together, or raise imep"
        )
        raise ModelError(
            f"imep {in_bar(gas.imep)} cannot be reached with peak_pressure {in_bar(gas.peak_pressure)}: from no to "
            f"full cut-off it is between {in_bar(minimum)} and {in_bar(maximum)}; {remedy}",
            "gas.imep",
        )
    if gas.imep <= minimum:
        return 1.0
    if gas.imep >= maximum:
        return gas.compression_ratio
    return rising_root(lambda ratio: seiliger_imep(gas, cycle, ratio) - gas.imep, 1.0, gas.compression_ratio)


def cut_off_angle(gas: Seiliger, part: SliderCrank, cycle: Cycle) -> float:
    """Return the crank angle after the firing dead centre at which the heat ends [rad] (G5)."""
    top, bottom = dead_centres(part)
    ratio, smallest = part.shaft.ratio, ChargedCylinder(gas, part, cycle).smallest
    wanted = part.travel(math, part.dead_centres[0]) + part.stroke * smallest * (seiliger_cut_off(gas, cycle) - 1.0)

    def beyond(angle: float) -> float:
        return float(part.travel(math, part.fires_at + ratio * angle) - wanted)

    if beyond(top) >= 0.0:
        return top
    return rising_root(beyond, top, bottom) if beyond(bottom) > 0.0 else bottom


def compression_end_pressure(gas: Seiliger) -> float:
    """Return the pressure at the smallest volume before heat is added [Pa] (G4)."""
    return float(gas.intake_pressure * gas.compression_ratio**gas.compression_exponent)


def seiliger_imep(gas: Seiliger, cycle: Cycle, cut_off_ratio: float) -> float:
    """Return the indicated mean pressure of a ratio of cut-off volume to smallest volume, in closed form [Pa] (G6)."""
    ratio = gas.compression_ratio
    compression = compression_end_pressure(gas) * _polytropic_work(ratio, gas.compression_exponent)
    expansion = cut_off_ratio * _polytropic_work(ratio / cut_off_ratio, gas.expansion_exponent)
    burning = gas.peak_pressure * (cut_off_ratio - 1.0 + expansion)
    return (burning - compression) / (ratio - 1.0) + gas_exchange_pressure(gas, cycle)


def _polytropic_work(ratio: float, exponent: float) -> float:
    power, log = exponent - 1.0, math.log(ratio)
    return -math.expm1(-power * log) / power if power != 0.0 else log
