"""Cylinder pressure over the working cycle from any gas model (G1-G12).

Every model meets the indicated mean pressure wanted of the whole cycle: that of a
four-stroke cycle includes its gas exchange.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import (
    Chambers,
    Charge,
    Cycle,
    GasModel,
    PressureTrace,
    Seiliger,
    SliderCrank,
    TrappedCharge,
    Wiebe,
)
from laufruhe.machine.chambers import cylinder_gas
from laufruhe.numerics.arrays import Array
from laufruhe.physics.cylinder_volume import dead_centres, trapped_pressure
from laufruhe.physics.pressure_trace import trace_pressure
from laufruhe.physics.seiliger_cycle import cut_off_angle, seiliger_pressure
from laufruhe.physics.wiebe_cycle import wiebe_pressure
from laufruhe.physics.working_chambers import chambers_breaks, chambers_thrust

OneChamber: TypeAlias = Seiliger | Wiebe | PressureTrace | TrappedCharge


def pressure_at(gas: GasModel, part: SliderCrank, cycle: Cycle, angles: Array) -> Array:
    """Return the absolute cylinder pressure [Pa] at crank angles after firing [rad], shape of `angles`.

    Raises
    ------
    ModelError
        If the model cannot meet its indicated mean pressure, or a trace does not cover the cycle.
    """
    model = cylinder_gas(gas, part)
    if isinstance(model, Chambers):
        raise ModelError(f"{part.name} has chambers, which have a pressure each")
    gas, piston, cycle, pace = _worked(model, part, cycle)
    angles = angles - part.swept.firing_delay
    if isinstance(gas, PressureTrace):
        return trace_pressure(gas, cycle, angles, pace)
    if isinstance(gas, Seiliger):
        return seiliger_pressure(gas, piston, cycle, pace * angles)
    if isinstance(gas, TrappedCharge):
        return trapped_pressure(gas, piston, cycle, pace * angles)
    return wiebe_pressure(gas, piston, cycle, pace * angles)


def _worked(gas: OneChamber, part: SliderCrank, cycle: Cycle) -> tuple[OneChamber, SliderCrank, Cycle, float]:
    # Y3: gas, piston and cycle of one chamber, and its pace; a burn is stated in crank angles of the engine
    check_chamber(gas, part)
    swept = part.swept
    if isinstance(gas, Wiebe) and swept.pace != 1.0:
        gas = replace(gas, start=swept.pace * gas.start, duration=swept.pace * gas.duration)
    return gas, swept.chamber, *chamber_cycle_of(part, cycle)


def chamber_cycle_of(part: SliderCrank, cycle: Cycle) -> tuple[Cycle, float]:
    """Return the cycle of a chamber in an engine with a cycle, and its crank angle over that of the engine (Y3)."""
    return Cycle.FOUR_STROKE if part.swept.four_strokes else cycle, part.swept.pace


def check_chamber(gas: GasModel, part: SliderCrank) -> None:
    """Refuse a compression ratio that the shape of a chamber does not allow (Y2)."""
    gas = cylinder_gas(gas, part)
    if isinstance(gas, Charge) and gas.compression_ratio > part.largest_ratio:
        raise ModelError(
            f"{gas.compression_ratio:g} leaves {part.name} no chamber, whose shape allows "
            f"{part.largest_ratio:.4g} at most; reduce the compression ratio, or the eccentricity"
        )


def thrust_at(gas: GasModel, part: SliderCrank, cycle: Cycle, angles: Array) -> Array:
    """Return the gas force on a piston rod along the axis, away from the crank [N], as `pressure_at` (B1, G14)."""
    gas = cylinder_gas(gas, part)
    if isinstance(gas, Chambers):
        return chambers_thrust(gas, part, angles)
    return np.asarray(-part.swept.piston.piston_area * (pressure_at(gas, part, cycle, angles) - gas.crankcase_pressure))


def alike_under(gas: GasModel, part: SliderCrank) -> Hashable:
    """Return a key that is equal for cylinders with equal gas forces over their own angle."""
    model = cylinder_gas(gas, part)
    if isinstance(model, Chambers):
        return part.path, part.facing, tuple((c.end, c.bore, c.rod, c.diagram) for c in model.of(part))
    return part.path, part.facing, part.bore, model if model is not gas else None


def pressure_breaks(gas: GasModel, part: SliderCrank, cycle: Cycle) -> Array:
    """Return the angles after firing at which a derivative of the pressure jumps [rad] (G13).

    Ends of strokes, where valves open and heat comes at once; cut-off; begin and end of a burn; points of a trace.
    A trapped charge has none.
    """
    gas = cylinder_gas(gas, part)
    if isinstance(gas, Chambers):
        turns = math.tau * np.arange(cycle.turns)
        return np.ravel(chambers_breaks(gas, part)[:, None] + turns)
    gas, piston, cycle, pace = _worked(gas, part, cycle)
    if isinstance(gas, TrappedCharge):
        return np.zeros(0)
    if isinstance(gas, PressureTrace):
        breaks = np.array(gas.angles)
    else:
        heat = (
            [cut_off_angle(gas, piston, cycle)] if isinstance(gas, Seiliger) else [gas.start, gas.start + gas.duration]
        )
        top, bottom = dead_centres(piston)
        breaks = np.array([bottom - math.tau, top, bottom, top + math.tau, *heat]) / pace
    return np.ravel(breaks[:, None] + part.swept.firing_delay - np.array(part.swept.lags))
