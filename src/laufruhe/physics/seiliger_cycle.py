"""Mixed cycle whose cut-off is solved for the requested indicated mean pressure."""

from __future__ import annotations

import math
from dataclasses import fields
from functools import lru_cache

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Charge, Cycle, PressureTrace, Seiliger, SliderCrank, TrappedCharge, Wiebe
from laufruhe.machine.chambers import CommonGas
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.roots import rising_root
from laufruhe.physics.cylinder_volume import ChargedCylinder, dead_centres, gas_exchange_pressure, in_bar

_ROUNDING = 1e-12


def seiliger_pressure(gas: Seiliger, part: SliderCrank, cycle: Cycle, angles: Array) -> Array:
    """Return the pressure [Pa] of the mixed cycle at crank angles gamma [rad], shape of `angles` (G4, G5)."""
    cylinder = ChargedCylinder(gas, part, cycle)
    top, _ = dead_centres(part)
    cut_off = cylinder.smallest * seiliger_cut_off(gas, cycle)

    def closed(local: Array) -> Array:
        volume, rises = cylinder.volume(local), local < top
        pressure = np.empty_like(volume)
        pressure[rises] = gas.intake_pressure * (cylinder.largest / volume[rises]) ** gas.compression_exponent
        pressure[~rises] = gas.peak_pressure * np.minimum(1.0, cut_off / volume[~rises]) ** gas.expansion_exponent
        return pressure

    return cylinder.pressure(closed, angles)


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


def motored_cycle(gas: Seiliger | Wiebe, cycle: Cycle) -> Seiliger:
    """Return the same charge without heat: expansion retraces compression (G4, G5 with peak p_c and n_2 = n_1).

    Its indicated mean pressure is that of the gas exchange alone.
    """
    exponent = _exponent(gas)
    peak, imep = gas.intake_pressure * gas.compression_ratio**exponent, gas_exchange_pressure(gas, cycle)
    return Seiliger(peak, imep, compression_exponent=exponent, expansion_exponent=exponent, **_charge(gas))


def motored_gas(gas: CommonGas, cycle: Cycle) -> Seiliger | PressureTrace | None:
    """Return the gas of a cylinder without combustion, computed or recorded (G21); None if it is not known."""
    if isinstance(gas, Seiliger | Wiebe):
        return motored_cycle(gas, cycle)
    return gas.motored if isinstance(gas, PressureTrace) else None


def trapped_charge(gas: Seiliger | Wiebe, has_open_valves: bool) -> TrappedCharge:
    """Return the same charge in a cylinder whose valves stay closed, or open to the intake (G21)."""
    return TrappedCharge(exponent=0.0 if has_open_valves else _exponent(gas), **_charge(gas))


def _exponent(gas: Seiliger | Wiebe) -> float:
    return gas.compression_exponent if isinstance(gas, Seiliger) else gas.heat_ratio


def _charge(gas: Charge) -> dict[str, float]:
    return {number.name: getattr(gas, number.name) for number in fields(Charge)}


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
