"""Working-gas models: what the cylinder pressure is described by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

AMBIENT_PRESSURE = 101_325.0


@dataclass(frozen=True)
class Seiliger:
    """Mixed cycle: heat at constant volume up to the peak pressure, then at constant
    pressure up to the cut-off that gives the indicated mean pressure wanted.

    Attributes
    ----------
    peak_pressure
        Absolute [Pa].
    imep
        Indicated mean effective pressure of the whole cycle [Pa].
    compression_ratio
        Largest over smallest volume.
    compression_exponent, expansion_exponent
        Polytropic exponents.
    intake_pressure, exhaust_pressure
        Absolute [Pa]; of the gas exchange and the start of compression.
    crankcase_pressure
        Absolute [Pa], on the underside of the piston.
    """

    peak_pressure: float
    imep: float
    compression_ratio: float = 17.0
    compression_exponent: float = 1.35
    expansion_exponent: float = 1.30
    intake_pressure: float = AMBIENT_PRESSURE
    exhaust_pressure: float = AMBIENT_PRESSURE
    crankcase_pressure: float = AMBIENT_PRESSURE


@dataclass(frozen=True)
class Wiebe:
    """Finite heat release: burnt fraction 1 - exp(-a x^(m+1)) over the burn.

    Attributes
    ----------
    imep
        Wanted [Pa]; the heat released is solved for it.
    start, duration
        Of combustion, crank angle from the firing dead centre [rad].
    shape
        Exponent m.
    completeness
        Fraction burnt at the end; a = -ln(1 - completeness).
    heat_ratio
        Ratio of specific heats of the charge while it burns.
    """

    imep: float
    start: float
    duration: float
    shape: float = 2.0
    completeness: float = 0.999
    compression_ratio: float = 17.0
    heat_ratio: float = 1.35
    intake_pressure: float = AMBIENT_PRESSURE
    exhaust_pressure: float = AMBIENT_PRESSURE
    crankcase_pressure: float = AMBIENT_PRESSURE


@dataclass(frozen=True)
class PressureTrace:
    """A measured trace over one cycle.

    Attributes
    ----------
    angles
        Crank angles after the firing dead centre [rad], ascending, one cycle.
    pressures
        Absolute [Pa].
    crankcase_pressure
        Absolute [Pa].
    """

    angles: tuple[float, ...]
    pressures: tuple[float, ...]
    crankcase_pressure: float = AMBIENT_PRESSURE


GasModel: TypeAlias = Seiliger | Wiebe | PressureTrace
