"""Volume of one cylinder over its cycle, charge and valve events of a computed one (G1-G3, G6, G21).

Volumes are in displacements, v = V / V_h, so that no bore enters. Angles gamma count
from the firing dead centre of the cylinder, alpha = 0 (C5), in the direction in which
the crank turns.

Pressure jumps where a valve opens or heat comes at once. All jumps are at dead centres,
where the piston stands, so that torque does not jump; a sample on one takes the mean of
both sides.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine.engine import Cycle
from laufruhe.machine.gas.base import AMBIENT_PRESSURE, OneChamber, check_pressures
from laufruhe.machine.slider_crank import SliderCrank
from laufruhe.numerics.arrays import Array

JUMP_WIDTH = 1e-11
MAX_COMPRESSION_RATIO = 1000.0
"""Largest compression ratio that gas models accept."""


def swept_volume(part: SliderCrank, angles: Array) -> Array:
    """Return the volume swept from the highest piston position over the displacement (G1), shape of `angles`."""
    highest = part.travel(np, np.asarray(part.dead_centres[0]))
    return np.asarray((part.travel(np, part.fires_at + _ratio(part) * angles) - highest) / part.stroke)


def chamber_volume(part: SliderCrank, since: Array) -> Array:
    """Return the volume of a chamber above its least [m3], at crank angles after its firing [rad] (Y3)."""
    chamber = part.swept.chamber
    return (
        chamber.piston_area
        * chamber.stroke
        * swept_volume(chamber, part.swept.pace * (since - part.swept.firing_delay))
    )


def dead_centres(part: SliderCrank) -> tuple[float, float]:
    """Return the angles gamma of the highest piston position, and of the lowest after it [rad] (G2)."""
    top, bottom = (_ratio(part) * (alpha - part.fires_at) for alpha in part.dead_centres)
    return top, bottom % math.tau


def stroke_ends(part: SliderCrank) -> tuple[float, ...]:
    """Return the dead centres of a cycle, where valves open and heat comes at once [rad] (G13)."""
    top, bottom = dead_centres(part)
    return bottom - math.tau, top, bottom, top + math.tau


def _ratio(part: SliderCrank) -> float:
    ratio = part.shaft.ratio
    if abs(ratio) != 1.0:
        raise ModelError(
            f"{part.name}: a working cycle on shaft '{part.shaft.name}' with ratio {ratio:g} is not modelled, "
            "the ratio must be 1 or -1; give a pressure trace"
        )
    return ratio


@dataclass(frozen=True, kw_only=True)
class Charge(OneChamber):
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

    def check(self, part: SliderCrank, /) -> None:
        """Refuse a compression ratio that the shape of a chamber does not allow (Y2)."""
        if self.compression_ratio > part.largest_ratio:
            raise ModelError(
                f"{self.compression_ratio:g} leaves {part.name} no chamber, whose shape allows "
                f"{part.largest_ratio:.4g} at most; reduce the compression ratio, or the eccentricity"
            )


@dataclass(frozen=True)
class ChargedCylinder:
    """Volumes of a cylinder over its cycle, and its valve events.

    The closed period runs from the lowest piston position before firing to that after
    it, lowest - 2 pi to lowest; exhaust and intake strokes follow in a four-stroke cycle.
    """

    gas: Charge
    part: SliderCrank
    cycle: Cycle

    @property
    def smallest(self) -> float:
        """Clearance ratio V_c / V_h."""
        return 1.0 / (self.gas.compression_ratio - 1.0)

    @property
    def largest(self) -> float:
        """Ratio (V_c + V_h) / V_h."""
        return self.gas.compression_ratio / (self.gas.compression_ratio - 1.0)

    def volume(self, angles: Array) -> Array:
        """Return V / V_h (G1)."""
        return self.smallest + swept_volume(self.part, angles)

    def pressure(self, closed: Callable[[Array], Array], angles: Array) -> Array:
        """Return the pressure over the cycle from that of the closed period, at a jump the mean of both sides [Pa].

        There is none but at a dead centre: valves open and close there, and heat is added there at once.
        """
        flat = np.ravel(angles)
        turns = [(flat - centre) / math.tau for centre in dead_centres(self.part)]
        top, bottom = (np.abs(turn - np.rint(turn)) <= JUMP_WIDTH / math.tau for turn in turns)
        jumps = np.flatnonzero(top | bottom)
        sides = np.concatenate([flat, flat[jumps] - JUMP_WIDTH, flat[jumps] + JUMP_WIDTH])
        values = self._one_sided(closed, sides)
        before, after = values[len(flat) :].reshape(2, -1)
        values[jumps] = 0.5 * (before + after)
        return values[: len(flat)].reshape(np.shape(angles))

    def _one_sided(self, closed: Callable[[Array], Array], angles: Array) -> Array:
        top, bottom = dead_centres(self.part)
        first = bottom - math.tau
        cycles = (angles - first) / self.cycle.angle
        local = first + self.cycle.angle * (cycles - np.floor(cycles))
        pressures = np.where(local < top + math.tau, self.gas.exhaust_pressure, self.gas.intake_pressure)
        is_closed = local < bottom
        pressures[is_closed] = closed(local[is_closed])
        return pressures


@dataclass(frozen=True)
class TrappedCharge(Charge):
    """Charge of a cut cylinder, whose valves do not move: p V^n is constant from the largest volume on (G21).

    Attributes
    ----------
    exponent
        Polytropic exponent n; zero if the valves stay open, so that the pressure is that of the intake.
    """

    exponent: float

    def motored(self, _cycle: Cycle, /) -> TrappedCharge:
        """Return this charge, which does not burn."""
        return self

    def cycle_pressure(self, piston: SliderCrank, cycle: Cycle, angles: Array, pace: float) -> Array:
        """Return the pressure of a charge that no valve lets out [Pa] (G21)."""
        cylinder = ChargedCylinder(self, piston, cycle)
        return np.asarray(self.intake_pressure * (cylinder.largest / cylinder.volume(pace * angles)) ** self.exponent)

    def cycle_breaks(self, _piston: SliderCrank, _cycle: Cycle, _pace: float, /) -> Array:
        """Return no angle, as the pressure has no kink."""
        return np.zeros(0)


def gas_exchange_pressure(gas: Charge, cycle: Cycle) -> float:
    """Return the mean pressure of exhaust and intake strokes [Pa]; zero in a two-stroke cycle (G6, G11)."""
    return gas.intake_pressure - gas.exhaust_pressure if cycle is Cycle.FOUR_STROKE else 0.0


def in_bar(pressure: float) -> str:
    """Return a pressure as text in bar."""
    return f"{pressure * 1e-5:.6g} bar"
