"""Key figures of the gas in an engine: peak, mean pressure, torque and power."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from laufruhe.machine import Cycle, Engine, GasModel, OperatingPoint, SliderCrank
from laufruhe.machine.gas.base import chamber_cycle_of
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gas_loads import gas_coefficients
from laufruhe.physics.willans import mean_torque


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
    gas = fidelity.gas_of(point)
    shares = gas.shares(engine) if gas is not None and engine.slider_cranks else ()
    return [
        (f"{point.name}, {name}" if name else point.name, _facts(one, parts, engine.cycle, point, fidelity))
        for name, one, parts in shares
    ]


def gas_facts(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> GasFacts | None:
    """Return the key figures of the gas at an operating point.

    The result is None without gas, for several chambers on a rod, and for an engine whose cylinders differ in gas.
    """
    return dict(cylinder_facts(engine, point, fidelity)).get(point.name)


def _facts(
    gas: GasModel, parts: Sequence[SliderCrank], cycle: Cycle, point: OperatingPoint, fidelity: Fidelity
) -> GasFacts:
    torques = [float(gas_coefficients(gas, part, cycle, fidelity).coefficients[0].real) for part in parts]
    swept = [gas.swept_volume(part) for part in parts]
    first = max(range(len(parts)), key=lambda k: swept[k])
    chamber_cycle, pace = chamber_cycle_of(parts[first], cycle)
    period = chamber_cycle.angle / pace
    work = torques[first] * period / len(parts[first].swept.lags)
    peak, angle, minimum = _extremes(gas, parts[first], cycle)
    return GasFacts(
        peak, math.remainder(angle, period), minimum, work / swept[first], sum(torques), sum(torques) * point.speed,
        mean_torque(point.fmep, sum(swept), cycle.turns), point.fmep, sum(swept), gas.recording,
    )  # fmt: skip


@lru_cache(maxsize=64)
def _extremes(gas: GasModel, part: SliderCrank, cycle: Cycle) -> tuple[float, float, float]:
    return gas.extremes(part, cycle)
