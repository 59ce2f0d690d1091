"""Cylinder pressure over the working cycle, whatever describes it (G1-G12).

Every model meets the indicated mean pressure wanted of the whole cycle: that of a
four-stroke cycle includes its gas exchange.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Cycle, GasModel, PressureTrace, Seiliger, SliderCrank
from laufruhe.physics.pressure_trace import trace_pressure
from laufruhe.physics.seiliger_cycle import seiliger_pressure
from laufruhe.physics.wiebe_cycle import wiebe_pressure


def cylinder_pressure(gas: GasModel, part: SliderCrank, cycle: Cycle, samples: int) -> NDArray[np.float64]:
    """Absolute cylinder pressure [Pa] at equal steps of the crank angle from the firing dead centre, shape (samples,).

    Raises
    ------
    ModelError
        If the model cannot meet its indicated mean pressure, or a trace does not cover the cycle.
    """
    angles = cycle.angle * np.arange(samples) / samples
    if isinstance(gas, PressureTrace):
        return trace_pressure(gas, cycle, angles)
    if isinstance(gas, Seiliger):
        return seiliger_pressure(gas, part, cycle, angles)
    return wiebe_pressure(gas, part, cycle, angles)
