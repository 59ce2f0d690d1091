"""Key figures of a recorded pressure trace in an engine: peak, mean pressure, torque and power."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from laufruhe.machine import Engine, OperatingPoint, PressureTrace
from laufruhe.machine.chambers import CylinderGases
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.gas_cycle import chamber_cycle_of
from laufruhe.physics.gas_loads import gas_coefficients


@dataclass(frozen=True)
class GasFacts:
    """Key figures of a recorded trace at one operating point.

    Attributes
    ----------
    peak_pressure, peak_angle
        Largest absolute pressure [Pa], and its crank angle after firing, within half a cycle of it [rad].
    least_pressure, imep
        Least absolute pressure, and work of one cycle over the displacement (G3) [Pa].
    torque, power
        Mean torque of the gas in all cylinders [N m], and its power [W].
    displacement
        Swept volume of all cylinders [m3].
    recording
        Sentences about how the trace was read from its file.
    """

    peak_pressure: float
    peak_angle: float
    least_pressure: float
    imep: float
    torque: float
    power: float
    displacement: float
    recording: tuple[str, ...]


def cylinder_facts(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> list[tuple[str, GasFacts]]:
    """Return the key figures of recorded traces at an operating point, after its name; of each cylinder if they differ.

    The list is empty without a recorded trace.
    """
    gas, engines = fidelity.gas_of(point), [(point.name, point, engine)]
    if isinstance(gas, CylinderGases):
        engines = [
            (f"{point.name}, {part.name}", replace(point, gas=gas.of_cylinder(part.name)), alone)
            for part in engine.cylinders
            for alone in [replace(engine, slider_cranks=(part,))]
        ]
    facts = ((name, gas_facts(alone, one_point, fidelity)) for name, one_point, alone in engines)
    return [(name, figures) for name, figures in facts if figures is not None]


def gas_facts(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> GasFacts | None:
    """Return the key figures of the gas at an operating point; None without a recorded trace."""
    gas, parts = fidelity.gas_of(point), engine.slider_cranks
    if not isinstance(gas, PressureTrace) or not parts:
        return None
    torques = [float(gas_coefficients(gas, part, engine.cycle, fidelity).coefficients[0].real) for part in parts]
    swept = [part.swept.piston.piston_area * part.swept.piston.stroke for part in parts]
    cycle, pace = chamber_cycle_of(parts[0], engine.cycle)
    period = cycle.angle / pace
    work = torques[0] * period / len(parts[0].swept.lags)
    peak = max(range(len(gas.pressures)), key=lambda k: gas.pressures[k])
    return GasFacts(
        gas.pressures[peak], math.remainder(gas.angles[peak], period), min(gas.pressures), work / swept[0],
        sum(torques), sum(torques) * point.speed, sum(swept), gas.recording,
    )  # fmt: skip
