"""Working-gas models: descriptions of the cylinder pressure."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from laufruhe import units
from laufruhe.errors import ModelError

AMBIENT_PRESSURE = units.ATMOSPHERE
# largest values that gas models accept
MAX_COMPRESSION_RATIO = 1000.0
MAX_EXPONENT = 5.0
MAX_HEAT_RATIO = 1.7
MAX_SHAPE = 20.0


@dataclass(frozen=True, kw_only=True)
class Charge:
    """Charge and gas exchange of a computed cycle.

    Attributes
    ----------
    compression_ratio
        Largest over smallest volume.
    intake_pressure, exhaust_pressure
        Absolute pressures of the gas exchange [Pa]; compression starts at the first. A two-stroke
        needs no exhaust pressure.
    crankcase_pressure
        Absolute pressure on the underside of the piston [Pa].
    """

    compression_ratio: float = 17.0
    intake_pressure: float = AMBIENT_PRESSURE
    exhaust_pressure: float = AMBIENT_PRESSURE
    crankcase_pressure: float = AMBIENT_PRESSURE

    def __post_init__(self) -> None:
        check_pressures(self, "intake_pressure", "exhaust_pressure", "crankcase_pressure")
        if not 1.0 < self.compression_ratio <= MAX_COMPRESSION_RATIO:
            raise ModelError(
                f"compression_ratio {self.compression_ratio:g} must be over 1 and at most {MAX_COMPRESSION_RATIO:g}; "
                "give the largest over the smallest volume"
            )


@dataclass(frozen=True)
class Seiliger(Charge):
    """Mixed cycle, its heat given at constant volume and then at constant pressure.

    Heat at constant volume raises the pressure to its peak. Heat at constant pressure lasts up to the cut-off that
    gives the indicated mean effective pressure.

    Attributes
    ----------
    peak_pressure
        Absolute peak pressure [Pa].
    imep
        Indicated mean effective pressure of the whole cycle, gas exchange included [Pa].
    compression_exponent, expansion_exponent
        Polytropic exponents.
    """

    peak_pressure: float
    imep: float
    compression_exponent: float = 1.35
    expansion_exponent: float = 1.30

    def __post_init__(self) -> None:
        super().__post_init__()
        check_pressures(self, "peak_pressure")
        _check_imep(self.imep)
        for name in ("compression_exponent", "expansion_exponent"):
            exponent = getattr(self, name)
            if not 0.0 < exponent <= MAX_EXPONENT:
                raise ModelError(
                    f"{name} {exponent:g} must be over 0 and at most {MAX_EXPONENT:g}; "
                    "1.2 to 1.4 is usual, 1 is a constant temperature"
                )


@dataclass(frozen=True)
class Wiebe(Charge):
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
        _check_imep(self.imep)
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


@dataclass(frozen=True)
class TrappedCharge(Charge):
    """Charge of a cut cylinder, whose valves do not move: p V^n is constant from the largest volume on (G21).

    Attributes
    ----------
    exponent
        Polytropic exponent n; zero if the valves stay open, so that the pressure is that of the intake.
    """

    exponent: float


@dataclass(frozen=True)
class PressureTrace:
    """Measured cylinder pressure over one cycle.

    Attributes
    ----------
    angles
        Ascending crank angles of one cycle after the firing dead centre [rad]; the end may repeat the beginning.
    pressures, crankcase_pressure
        Absolute pressures in the cylinder, and on the underside of the piston [Pa].
    recording
        Sentences about how the trace was read from its file.
    motored
        Trace of the same cylinder without combustion; None if it was not recorded.
    is_motored
        True for such a trace.
    """

    angles: tuple[float, ...]
    pressures: tuple[float, ...]
    crankcase_pressure: float = AMBIENT_PRESSURE
    recording: tuple[str, ...] = field(default=(), compare=False)
    motored: PressureTrace | None = None
    is_motored: bool = False

    def __post_init__(self) -> None:
        check_pressures(self, "crankcase_pressure")
        angles, pressures = np.asarray(self.angles, dtype=float), np.asarray(self.pressures, dtype=float)
        if len(angles) != len(pressures) or len(angles) < 4:
            rule = f"the trace has {len(angles)} angles and {len(pressures)} pressures"
            raise ModelError(f"{rule}; give four points at least, each with an angle and a pressure")
        if not (np.isfinite(angles).all() and (np.diff(angles) > 0.0).all()):
            raise ModelError("the angles of the trace must be finite and rise; sort it and keep one point an angle")
        if not (pressures.min() > 0.0 and np.isfinite(pressures).all()):
            raise ModelError("the pressures of the trace must be positive and finite; give absolute pressures")


def check_pressures(gas: object, *names: str) -> None:
    """Raise `ModelError` if one of the pressures `names` of a gas model is not positive and finite."""
    for name in names:
        pressure = getattr(gas, name)
        if not 0.0 < pressure < math.inf:
            raise ModelError(f"{name} {pressure * 1e-5:g} bar must be positive and finite; give an absolute pressure")


def _check_imep(imep: float) -> None:
    if not math.isfinite(imep):
        raise ModelError(f"imep {imep} must be finite; give a mean pressure such as 9 bar")
