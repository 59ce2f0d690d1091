"""Working chambers on both sides of a piston, and of further pistons on its rod: steam, pumps, traces."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from laufruhe.errors import ModelError
from laufruhe.machine.gas import (
    AMBIENT_PRESSURE,
    PressureTrace,
    Seiliger,
    TrappedCharge,
    Wiebe,
    check_pressures,
)
from laufruhe.machine.slider_crank import SliderCrank

ENDS: Mapping[str, int] = {"head": 1, "crank": -1}
"""Ends of a cylinder, and direction in which the pressure there drives the piston: 1 towards the crank."""


@dataclass(frozen=True)
class Steam:
    """An indicator diagram of straight lines and hyperbolas (G15; Roetscher, Fig. 1051).

    Points are parts of the stroke from the dead centre at which this chamber is smallest.

    Attributes
    ----------
    admission, back_pressure
        Absolute pressures while steam enters and while it leaves [Pa].
    cut_off
        Point where admission ends.
    release
        Point where the outlet opens; from there the pressure falls evenly to the dead centre.
    compression
        Point where the outlet closes on the way back.
    lead
        Point where fresh steam enters on the way back; from there the pressure rises evenly to the dead centre.
    clearance
        Volume that is left at the dead centre, over that of the stroke.
    exponent
        Exponent of expansion and compression; 1 is a hyperbola.
    """

    admission: float
    back_pressure: float
    cut_off: float
    release: float = 1.0
    compression: float = 0.0
    lead: float = 0.0
    clearance: float = 0.05
    exponent: float = 1.0

    def __post_init__(self) -> None:
        check_pressures(self, "admission", "back_pressure")
        if not 0.0 <= self.cut_off <= self.release <= 1.0:
            raise ModelError(
                f"cut_off {self.cut_off:g} and release {self.release:g} are out of order; on the way out steam is cut "
                "off, expands, and is released, each a part of the stroke from 0 to 1"
            )
        if not 0.0 <= self.lead <= self.compression <= 1.0:
            raise ModelError(
                f"compression {self.compression:g} and lead {self.lead:g} are out of order; on the way back the outlet "
                "closes before fresh steam enters, each a part of the stroke from 1 to 0"
            )
        if not 0.0 <= self.clearance < math.inf:
            raise ModelError(f"clearance {self.clearance:g} must not be negative; give a part of the stroke volume")
        if not 0.0 < self.exponent <= 5.0:
            raise ModelError(f"exponent {self.exponent:g} must be over 0 and at most 5; 1 is a hyperbola")
        for name, begin, end in (("cut_off", self.cut_off, self.release), ("lead", self.lead, self.compression)):
            if begin + self.clearance == 0.0 and begin < end:
                raise ModelError(f"the chamber vanishes at the dead centre; give a clearance, or {name} more than 0")


class Pump(Steam):
    """A piston pump: one pressure while its chamber grows, another while it shrinks (G17; Roetscher, Fig. 1053)."""

    def __init__(self, suction: float, delivery: float) -> None:
        super().__init__(suction, delivery, cut_off=1.0)


def suction_point(pressure_ratio: float, clearance: float, exponent: float) -> float:
    """Return the part of the stroke where gas in the clearance has expanded to a ratio of its pressure (G17a)."""
    return float(clearance / pressure_ratio ** (1.0 / exponent)) - clearance


class Compressor(Steam):
    """A piston compressor of gas with ideal valves (G17a).

    What stays in the clearance expands from the delivery pressure before fresh gas enters; compression ends where the
    pressure opens the delivery valve.
    """

    def __init__(self, suction: float, delivery: float, clearance: float = 0.05, exponent: float = 1.3) -> None:
        if not 0.0 < suction < delivery < math.inf:
            raise ModelError(
                f"delivery {delivery * 1e-5:g} bar must be above suction {suction * 1e-5:g} bar, which must be "
                "positive; give absolute pressures"
            )
        if not 0.0 < clearance < math.inf:
            raise ModelError(f"clearance {clearance:g} must be positive; 0.03 to 0.15 is usual")
        shrinking = (suction / delivery) ** (1.0 / exponent) if exponent > 0.0 else 1.0
        suction_begin = suction_point(suction / delivery, clearance, exponent) if exponent > 0.0 else 0.0
        if suction_begin >= 1.0:
            raise ModelError(
                f"clearance {clearance:g} takes no gas in, because what it holds at {delivery * 1e-5:g} bar fills the "
                f"cylinder at {suction * 1e-5:g} bar; reduce the clearance, or divide the pressures among stages"
            )
        delivery_begin = (1.0 + clearance) * shrinking - clearance
        super().__init__(delivery, suction, 0.0, suction_begin, 1.0, delivery_begin, clearance, exponent)


@dataclass(frozen=True)
class Chamber:
    """Space that a piston enlarges and reduces once a turn.

    Attributes
    ----------
    cylinders
        Names of the slider-cranks whose rods carry such a piston.
    end
        End of the cylinder: "head" presses the piston towards the crank, "crank" away from it.
    bore, rod
        Diameters of the piston, and of the piston rod where it passes through this end [m].
    """

    name: str
    cylinders: tuple[str, ...]
    end: str
    bore: float
    rod: float
    diagram: Steam | PressureTrace

    def __post_init__(self) -> None:
        if self.end not in ENDS:
            raise ModelError(f"{self.name}: end '{self.end}' must be {' or '.join(ENDS)}")
        if not 0.0 <= self.rod < self.bore:
            raise ModelError(
                f"{self.name}: the chamber vanishes, its rod of {1e3 * self.rod:g} mm fills the bore of "
                f"{1e3 * self.bore:g} mm; give a thinner rod"
            )

    @property
    def area(self) -> float:
        """Area under pressure [m2], F' or F'' of eq. 296."""
        return math.pi / 4.0 * (self.bore - self.rod) * (self.bore + self.rod)

    def swept_volume(self, slider_cranks: Iterable[SliderCrank]) -> float:
        """Return the volume of the stroke [m3], summed over the slider-cranks with this chamber."""
        return self.area * sum(part.stroke for part in slider_cranks if part.name in self.cylinders)

    @property
    def side(self) -> int:
        """Sign of the force: 1 towards the crank, else -1."""
        return ENDS[self.end]


@dataclass(frozen=True)
class Chambers:
    """Working chambers of a machine, and the pressure of the air around, on the ends of the piston rods [Pa]."""

    chambers: tuple[Chamber, ...]
    crankcase_pressure: float = AMBIENT_PRESSURE

    def __post_init__(self) -> None:
        check_pressures(self, "crankcase_pressure")
        if not self.chambers:
            raise ModelError("the gas model has no chamber; list at least one")

    def of(self, part: SliderCrank) -> tuple[Chamber, ...]:
        """Return the chambers on the rod of a slider-crank."""
        return tuple(chamber for chamber in self.chambers if part.name in chamber.cylinders)


CommonGas: TypeAlias = Seiliger | Wiebe | PressureTrace | TrappedCharge | Chambers


@dataclass(frozen=True)
class CylinderGases:
    """Gas of an engine whose cylinders differ: the common model, and models of single cylinders by their names."""

    common: CommonGas
    single: tuple[tuple[str, CommonGas], ...]

    def of_cylinder(self, name: str) -> CommonGas:
        """Return the gas model of a cylinder."""
        return dict(self.single).get(name, self.common)

    def mapped(self, change: Callable[[CommonGas], CommonGas]) -> CylinderGases:
        """Return the gas with every model changed."""
        return CylinderGases(change(self.common), tuple((name, change(gas)) for name, gas in self.single))


GasModel: TypeAlias = CommonGas | CylinderGases


def cylinder_gas(gas: GasModel, part: SliderCrank) -> CommonGas:
    """Return the gas model of a cylinder."""
    return gas.of_cylinder(part.name) if isinstance(gas, CylinderGases) else gas


def models_of(gas: GasModel | None) -> tuple[CommonGas, ...]:
    """Return the gas models of all cylinders, each once."""
    if isinstance(gas, CylinderGases):
        return tuple(dict.fromkeys((gas.common, *(model for _, model in gas.single))))
    return () if gas is None else (gas,)
