"""Key figures of the gas in an engine: peak, mean pressure, torque and power."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from laufruhe.machine import Chambers, Cycle, Engine, OperatingPoint, PressureTrace, SliderCrank
from laufruhe.machine.chambers import Chamber, CylinderGases
from laufruhe.numerics.arrays import Array
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gas_cycle import OneChamber, chamber_cycle_of, pressure_at
from laufruhe.physics.gas_loads import gas_coefficients
from laufruhe.physics.pressure_trace import peak_angle
from laufruhe.physics.willans import mean_torque
from laufruhe.physics.working_chambers import chamber_pressure

_STEPS, _ROUNDING = 7200, 1e-9
"""Number of crank angles at which the pressure of a cycle is compared, and relative rounding error of a plateau."""


@dataclass(frozen=True)
class GasFacts:
    """Key figures of the gas at one operating point.

    Attributes
    ----------
    peak_pressure, peak_angle
        Largest absolute pressure [Pa], and its crank angle after firing, within half a cycle of it [rad].
    least_pressure, imep
        Least absolute pressure, and work of one cycle over the displacement (G3) [Pa].
    torque, power
        Mean torque of the gas in all cylinders [N m], and its power [W].
    friction, fmep
        Mean torque that friction takes of it (L5b) [N m], and its mean effective pressure [Pa].
    displacement
        Swept volume of all cylinders [m3].
    recording
        Sentences about how a recorded trace was read from its file; empty for other gas.
    """

    peak_pressure: float
    peak_angle: float
    least_pressure: float
    imep: float
    torque: float
    power: float
    friction: float
    fmep: float
    displacement: float
    recording: tuple[str, ...]


def cylinder_facts(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> list[tuple[str, GasFacts]]:
    """Return the key figures of the gas at an operating point, after its name.

    Cylinders that differ in gas and the working chambers of a rod have figures of their own.
    """
    gas, engines = fidelity.gas_of(point), [(point.name, point, engine)]
    if isinstance(gas, Chambers):
        return [
            (f"{point.name}, {chamber.name}", _chamber_facts(engine, point, gas, chamber, fidelity))
            for chamber in gas.chambers
        ]
    if isinstance(gas, CylinderGases):
        engines = [
            (f"{point.name}, {part.name}", replace(point, gas=gas.of_cylinder(part.name)), alone)
            for part in engine.cylinders
            for alone in [replace(engine, slider_cranks=(part,))]
        ]
    facts = ((name, gas_facts(alone, one_point, fidelity)) for name, one_point, alone in engines)
    return [(name, figures) for name, figures in facts if figures is not None]


def gas_facts(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> GasFacts | None:
    """Return the key figures of the gas at an operating point.

    The result is None without gas, for several chambers on a rod, and for an engine whose cylinders differ in gas.
    """
    gas, parts = fidelity.gas_of(point), engine.slider_cranks
    if gas is None or isinstance(gas, Chambers | CylinderGases) or not parts:
        return None
    torques = [float(gas_coefficients(gas, part, engine.cycle, fidelity).coefficients[0].real) for part in parts]
    swept = [part.swept.piston.piston_area * part.swept.piston.stroke for part in parts]
    first = max(range(len(parts)), key=lambda k: swept[k])
    cycle, pace = chamber_cycle_of(parts[first], engine.cycle)
    period = cycle.angle / pace
    work = torques[first] * period / len(parts[first].swept.lags)
    peak, angle, minimum = _extremes(gas, parts[first], engine.cycle, period)
    recording = gas.recording if isinstance(gas, PressureTrace) else ()
    return GasFacts(
        peak, math.remainder(angle, period), minimum, work / swept[first], sum(torques), sum(torques) * point.speed,
        mean_torque(point.fmep, sum(swept), engine.cycle.turns), point.fmep, sum(swept), recording,
    )  # fmt: skip


def _chamber_facts(
    engine: Engine, point: OperatingPoint, gas: Chambers, chamber: Chamber, fidelity: Fidelity
) -> GasFacts:
    """Return the key figures of one chamber, which works once a turn (G14)."""
    parts = [part for part in engine.slider_cranks if part.name in chamber.cylinders]
    alone = replace(gas, chambers=(chamber,))
    torque = sum(float(gas_coefficients(alone, part, engine.cycle, fidelity).coefficients[0].real) for part in parts)
    peak, angle, minimum = _sampled_extremes(lambda angles: chamber_pressure(chamber, parts[0], angles), math.tau)
    swept = chamber.swept_volume(parts)
    return GasFacts(
        peak, math.remainder(angle, math.tau), minimum,
        torque * math.tau / swept, torque, torque * point.speed,
        mean_torque(point.fmep, swept, engine.cycle.turns), point.fmep, swept, (),
    )  # fmt: skip


@lru_cache(maxsize=64)
def _extremes(gas: OneChamber, part: SliderCrank, cycle: Cycle, period: float) -> tuple[float, float, float]:
    # largest pressure, its angle after firing, and least pressure
    if isinstance(gas, PressureTrace):
        return max(gas.pressures), peak_angle(np.array(gas.angles), np.array(gas.pressures)), min(gas.pressures)
    # at a dead centre the pressure is that after ignition
    return _sampled_extremes(lambda angles: pressure_at(gas, part, cycle, angles + _ROUNDING), period)


def _sampled_extremes(pressure: Callable[[Array], Array], period: float) -> tuple[float, float, float]:
    angles = period * np.arange(_STEPS) / _STEPS
    pressures = pressure(angles)
    peak = int(np.argmax(pressures > (1.0 - _ROUNDING) * pressures.max()))
    return float(pressures[peak]), float(angles[peak]), float(pressures.min())
