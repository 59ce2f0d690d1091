"""Finite heat release, the heat solved for the requested indicated mean pressure."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine.engine import Cycle
from laufruhe.machine.gas.charge import ChargedCylinder, dead_centres, gas_exchange_pressure, in_bar, stroke_ends
from laufruhe.machine.gas.seiliger import FiredCharge
from laufruhe.machine.slider_crank import SliderCrank
from laufruhe.numerics.arrays import Array

MAX_CHARGE_HEAT = 50.0
"""Most heat taken for possible, over p V of the charge. Fuel and air without excess hold
some 3.4 MJ/m3 at 1 bar and 300 K, which is 34; 50 leaves room for cold charges."""

_ROUNDING = 1e-12
MAX_HEAT_RATIO, MAX_SHAPE = 1.7, 20.0
"""Largest ratio of specific heats and exponent of the burnt fraction that the cycle accepts."""


@dataclass(frozen=True)
class Wiebe(FiredCharge):
    """Finite heat release: burnt fraction 1 - exp(-a x^(m+1)) over the burn.

    Attributes
    ----------
    imep
        Indicated mean effective pressure, as in `Seiliger` [Pa]; the heat released follows from it.
    start, duration
        Start and duration of combustion, as crank angles; the start counts from the firing dead centre [rad].
    shape
        Exponent m of the burnt fraction.
    completeness
        Fraction burnt at the end; a = -ln(1 - completeness).
    heat_ratio
        Ratio of specific heats of the charge, from the start of compression to the end of expansion.
    """

    imep: float
    start: float
    duration: float
    shape: float = 2.0
    completeness: float = 0.999
    heat_ratio: float = 1.35

    def __post_init__(self) -> None:
        super().__post_init__()
        if not math.isfinite(self.start):
            raise ModelError(f"start {self.start} must be finite; give a crank angle from the firing dead centre")
        if not self.duration > 0.0:
            raise ModelError(f"duration {math.degrees(self.duration):g} deg must be positive; 30 to 70 deg is usual")
        first, last = math.degrees(self.start), math.degrees(self.start + self.duration)
        if first < -180.0 or last > 180.0:
            raise ModelError(
                f"the burn from {first:g} to {last:g} deg must lie between -180 and 180 deg about the firing dead "
                "centre; move start or shorten duration"
            )
        if not 0.0 <= self.shape <= MAX_SHAPE:
            raise ModelError(f"shape {self.shape:g} must be between 0 and {MAX_SHAPE:g}; 0.5 to 3 is usual")
        if not 0.0 < self.completeness < 1.0:
            raise ModelError(f"completeness {self.completeness:g} must be between 0 and 1; 0.999 is usual")
        if not 1.0 < self.heat_ratio <= MAX_HEAT_RATIO:
            raise ModelError(
                f"heat_ratio {self.heat_ratio:g} must be over 1 and at most {MAX_HEAT_RATIO:g}; 1.3 to 1.4 is usual"
            )

    @property
    def charge_exponent(self) -> float:
        """Ratio of specific heats."""
        return self.heat_ratio

    def cycle_breaks(self, piston: SliderCrank, _cycle: Cycle, pace: float, /) -> Array:
        """Return the ends of strokes, and those of the burn, in crank angles of the engine [rad] (G13)."""
        return np.array([*(end / pace for end in stroke_ends(piston)), self.start, self.start + self.duration])

    def cycle_pressure(self, piston: SliderCrank, cycle: Cycle, angles: Array, pace: float) -> Array:
        """Return the pressure with finite heat release [Pa] (G7-G9)."""
        gas = self if pace == 1.0 else replace(self, start=pace * self.start, duration=pace * self.duration)
        cylinder, heat = ChargedCylinder(gas, piston, cycle), wiebe_heat(gas, piston, cycle)

        def closed(local: Array) -> Array:
            volume = cylinder.volume(local)
            motored = gas.intake_pressure * (cylinder.largest / volume) ** gas.heat_ratio
            burnt = np.clip((local - gas.start) / gas.duration, 0.0, 1.0)
            added = heat * (gas.heat_ratio - 1.0) * _stored_heat(gas, cylinder, burnt)
            return np.asarray(motored + added / volume**gas.heat_ratio)

        return cylinder.pressure(closed, pace * angles)


def wiebe_heat(gas: Wiebe, part: SliderCrank, cycle: Cycle) -> float:
    """Return the heat that gives the indicated mean pressure, over the displacement [Pa] (G10, G11).

    Heat released at a volume V works with the efficiency 1 - (V / V_largest)^(kappa-1)
    whatever the rest does, so the mean pressure is linear in the heat.
    """
    cylinder = ChargedCylinder(gas, part, cycle)
    _, bottom = dead_centres(part)
    first, last = gas.start, gas.start + gas.duration
    if first < bottom - math.tau - _ROUNDING or last > bottom + _ROUNDING:
        raise ModelError(
            f"{part.name}: the burn from {math.degrees(first):.6g} to {math.degrees(last):.6g} deg must lie between "
            f"the dead centres at {math.degrees(bottom) - 360.0:.6g} and {math.degrees(bottom):.6g} deg; move start or "
            "shorten duration"
        )
    places, weights = _unit_quadrature()

    def worked(x: Array) -> Array:
        volume = cylinder.volume(gas.start + gas.duration * x)
        return np.asarray(-np.expm1((gas.heat_ratio - 1.0) * np.log(volume / cylinder.largest)))

    efficiency = float(np.sum(weights * _burn_rate(gas, places) * worked(places)))
    minimum = gas_exchange_pressure(gas, cycle)
    charge = gas.intake_pressure * cylinder.largest
    maximum = minimum + MAX_CHARGE_HEAT * charge * efficiency / gas.completeness
    slack = _ROUNDING * max(gas.intake_pressure, gas.exhaust_pressure)
    if not minimum - slack <= gas.imep <= maximum:
        remedy = (
            "raise intake_pressure or burn earlier" if gas.imep > maximum else "raise imep or lower exhaust_pressure"
        )
        raise ModelError(
            f"imep {in_bar(gas.imep)} is out of reach with intake_pressure {in_bar(gas.intake_pressure)}: from no "
            f"heat to the most that fuel and air can hold it is between {in_bar(minimum)} and {in_bar(maximum)}; "
            f"{remedy}"
        )
    return max(gas.imep - minimum, 0.0) / efficiency


def _burn_rate(gas: Wiebe, x: Array) -> Array:
    # G7: derivative of 1 - exp(-a x^(m+1)) by x, the elapsed part of the burn
    order = gas.shape + 1.0
    efficiency = -math.log1p(-gas.completeness)
    return np.asarray(efficiency * order * x**gas.shape * np.exp(-efficiency * x**order))


def _stored_heat(gas: Wiebe, cylinder: ChargedCylinder, elapsed: Array) -> Array:
    # G9: integral of v^(kappa-1) over the burnt fraction up to each elapsed part of the burn
    places, weights = _unit_quadrature()
    # every sample after the burn has the same integral
    ends, inverse = np.unique(elapsed, return_inverse=True)
    x = np.outer(ends, places)
    volume = cylinder.volume(gas.start + gas.duration * x)
    integrals = ends * ((_burn_rate(gas, x) * volume ** (gas.heat_ratio - 1.0)) @ weights)
    return np.asarray(integrals[inverse])


@lru_cache(maxsize=1)
def _unit_quadrature() -> tuple[Array, Array]:
    step = 1.0 / 24.0
    t = step * np.arange(-84, 85)
    lean = 0.5 * math.pi * np.sinh(t)
    places = 1.0 / (1.0 + np.exp(-2.0 * lean))
    weights = step * math.pi * np.cosh(t) * places / (1.0 + np.exp(2.0 * lean))
    for table in (places, weights):
        table.setflags(write=False)
    return places, weights
