"""Finite heat release, the heat solved for the requested indicated mean pressure."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Cycle, SliderCrank, Wiebe
from laufruhe.numerics.arrays import Array
from laufruhe.physics.cylinder_volume import ChargedCylinder, dead_centres, gas_exchange_pressure, in_bar

MAX_CHARGE_HEAT = 50.0
"""Most heat taken for possible, over p V of the charge. Fuel and air without excess hold
some 3.4 MJ/m3 at 1 bar and 300 K, which is 34; 50 leaves room for cold charges."""

_ROUNDING = 1e-12


def wiebe_pressure(gas: Wiebe, part: SliderCrank, cycle: Cycle, angles: Array) -> Array:
    """Return the pressure [Pa] with finite heat release at crank angles gamma [rad], shape of `angles` (G7-G9)."""
    cylinder = ChargedCylinder(gas, part, cycle)
    heat = wiebe_heat(gas, part, cycle)

    def closed(local: Array) -> Array:
        volume = cylinder.volume(local)
        motored = gas.intake_pressure * (cylinder.largest / volume) ** gas.heat_ratio
        burnt = np.clip((local - gas.start) / gas.duration, 0.0, 1.0)
        added = heat * (gas.heat_ratio - 1.0) * _stored_heat(gas, cylinder, burnt)
        return np.asarray(motored + added / volume**gas.heat_ratio)

    return cylinder.pressure(closed, angles)


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
