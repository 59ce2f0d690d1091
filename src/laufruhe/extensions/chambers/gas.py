"""Working chambers on both sides of a piston, and of further pistons on its rod: steam, pumps, traces (G14-G17).

A diagram is over the piston's travel x from the dead centre at which its chamber is smallest, once on
the way out and once on the way back; what its pressure is over that of the air around drives the rod.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from laufruhe.errors import ModelError, counted
from laufruhe.machine import Cycle, Engine, SliderCrank
from laufruhe.machine.gas.base import AMBIENT_PRESSURE, GasModel, OneChamber, check_pressures
from laufruhe.machine.gas.charge import JUMP_WIDTH, dead_centres, swept_volume
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.numerics.roots import rising_root

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
    diagram: Steam | OneChamber

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

    def travel(self, part: SliderCrank, angles: Array) -> Array:
        """Return the travel from where the chamber is smallest, as part of the stroke."""
        swept = np.clip(swept_volume(part, angles), 0.0, 1.0)
        return swept if self.side > 0 else 1.0 - swept

    def pressure(self, part: SliderCrank, angles: Array) -> Array:
        """Return the absolute pressure [Pa], at a jump the mean of both sides, shape of `angles`."""

        def at(angles: Array) -> Array:
            smallest, largest = self.ends(part)
            local = np.mod(angles - smallest, math.tau)
            if not isinstance(self.diagram, Steam):
                return self.diagram.cycle_pressure(part, Cycle.TWO_STROKE, local, 1.0)
            return _steam(self.diagram, self.travel(part, angles), local < largest - smallest)

        return 0.5 * (at(angles - JUMP_WIDTH) + at(angles + JUMP_WIDTH))

    def ends(self, part: SliderCrank) -> tuple[float, float]:
        """Return the angles at which the chamber is smallest, and largest after that [rad]."""
        top, bottom = dead_centres(part)
        return (top, bottom) if self.side > 0 else (bottom, top + math.tau)

    def breaks(self, part: SliderCrank) -> set[float]:
        """Return the angles at which a derivative of the pressure jumps [rad]."""
        smallest, largest = self.ends(part)
        diagram = self.diagram
        if not isinstance(diagram, Steam):
            return {smallest + angle for angle in diagram.cycle_breaks(part, Cycle.TWO_STROKE, 1.0).tolist()}

        def at(place: float, begin: float) -> float:
            # the travel rises from where the chamber is smallest, forwards or backwards
            way = largest - begin
            return begin + way * rising_root(
                lambda share: float(self.travel(part, np.asarray(begin + share * way))) - place, 0.0, 1.0
            )

        kinks = [(place, smallest) for place in (diagram.cut_off, diagram.release)]
        kinks += [(place, smallest + math.tau) for place in (diagram.compression, diagram.lead)]
        return {smallest, largest, *(at(place, begin) for place, begin in kinks if 0.0 < place < 1.0)}


@dataclass(frozen=True)
class Chambers(GasModel):
    """Working chambers of a machine, and the pressure of the air around, on the ends of the piston rods [Pa]."""

    chambers: tuple[Chamber, ...]
    crankcase_pressure: float = AMBIENT_PRESSURE

    fires: ClassVar = False

    def __post_init__(self) -> None:
        check_pressures(self, "crankcase_pressure")
        if not self.chambers:
            raise ModelError("the gas model has no chamber; list at least one")

    def of(self, part: SliderCrank) -> tuple[Chamber, ...]:
        """Return the chambers on the rod of a slider-crank."""
        return tuple(chamber for chamber in self.chambers if part.name in chamber.cylinders)

    def only(self, name: str, /) -> Chambers | None:
        """Return the chambers of this cylinder alone."""
        chambers = [replace(chamber, cylinders=(name,)) for chamber in self.chambers if name in chamber.cylinders]
        return replace(self, chambers=tuple(chambers)) if chambers else None

    def shares(self, engine: Engine) -> list[tuple[str, GasModel, Sequence[SliderCrank]]]:
        """Return every chamber with its slider-cranks."""
        parts = engine.slider_cranks
        return [(c.name, replace(self, chambers=(c,)), [p for p in parts if p.name in c.cylinders])
                for c in self.chambers]  # fmt: skip

    def pressure(self, part: SliderCrank, _cycle: Cycle, angles: Array, /) -> Array:
        """Return the pressure of the only chamber of a rod [Pa]."""
        if len(chambers := self.of(part)) != 1:
            raise ModelError(f"{part.name} has {counted(len(chambers), 'chamber')}; one pressure needs one chamber")
        return chambers[0].pressure(part, angles)

    def thrust(self, part: SliderCrank, _cycle: Cycle, angles: Array, /) -> Array:
        """Return P = -sum of +-F (p - p_0) along the axis of a cylinder, away from the crank [N] (G14; eq. 296)."""
        total = np.zeros(np.shape(angles))
        for chamber in self.of(part):
            total -= chamber.side * chamber.area * (chamber.pressure(part, angles) - self.crankcase_pressure)
        return total

    def breaks(self, part: SliderCrank, cycle: Cycle) -> Array:
        """Return the angles at which a derivative of a pressure jumps [rad]."""
        breaks = sorted(set[float]().union(*(chamber.breaks(part) for chamber in self.of(part))))
        return np.ravel(np.array(breaks)[:, None] + math.tau * np.arange(cycle.turns))

    def alike(self, part: SliderCrank) -> Hashable:
        """Return a key that is equal for rods with equal paths and chambers."""
        return part.path, part.facing, tuple((c.end, c.bore, c.rod, c.diagram) for c in self.of(part))

    def swept_volume(self, part: SliderCrank) -> float:
        """Return the volume that the chambers of a rod sweep [m3]."""
        return sum(chamber.area * part.stroke for chamber in self.of(part))


def _steam(diagram: Steam, travel: Array, out: Mask) -> Array:
    """Return the pressure of admission, expansion and release, then of exhaust, compression and lead (G15)."""
    released = _expanded(diagram, diagram.admission, diagram.cut_off, np.asarray(diagram.release))
    squeezed = _expanded(diagram, diagram.back_pressure, diagram.compression, np.asarray(diagram.lead))
    way = (travel - diagram.release) / (1.0 - diagram.release if diagram.release < 1.0 else 1.0)
    falling = released + np.maximum(way, 0.0) * (diagram.back_pressure - released)
    opening = np.maximum(diagram.lead - travel, 0.0) / (diagram.lead if diagram.lead > 0.0 else 1.0)
    rising = squeezed + opening * (diagram.admission - squeezed)
    behind_cut_off = np.clip(travel, diagram.cut_off, diagram.release)
    expanding = _expanded(diagram, diagram.admission, diagram.cut_off, behind_cut_off)
    closed = np.clip(travel, diagram.lead, diagram.compression)
    squeezing = _expanded(diagram, diagram.back_pressure, diagram.compression, closed)
    on_way_out = np.where(travel <= diagram.release, expanding, falling)
    return np.where(out, on_way_out, np.where(travel >= diagram.lead, squeezing, rising))


def _expanded(diagram: Steam, pressure: float, begin: float, end: Array) -> Array:
    volume = end + diagram.clearance
    shrinking = np.where(volume > 0.0, (begin + diagram.clearance) / np.where(volume > 0.0, volume, 1.0), 1.0)
    return np.asarray(pressure * shrinking**diagram.exponent)
