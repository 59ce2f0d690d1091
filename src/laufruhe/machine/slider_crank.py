"""Piston, rod and throw: the one mechanism of every piston engine."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar, Self, TypeVar

from laufruhe.errors import ModelError
from laufruhe.machine import kinematics
from laufruhe.machine.bodies import Motion, Outline
from laufruhe.machine.rotor import CRANKSHAFT, Shaft
from laufruhe.numerics.exact_angles import Turn, as_turn, cis

P = TypeVar("P", bound="SliderCrank")
_ON_ONE_AXIS = 1e-9


@dataclass(frozen=True)
class Swept:
    """Space that a charge works in: a cylinder, or similar chambers that fire one after the other.

    Attributes
    ----------
    piston
        Slider-crank that sweeps one chamber, its angle counted from firing.
    pace
        Crank angle of the piston over that of the engine.
    lags
        Crank angles of the engine by which each chamber fires before the first [rad].
    four_strokes
        True if a chamber makes four strokes whatever the cycle of the engine.
    charge
        Mechanism that sweeps the chamber, if that is not the piston alone.
    firing_delay
        Crank angle from the firing of the piston to that of its chamber [rad].
    """

    piston: SliderCrank
    pace: float = 1.0
    lags: tuple[float, ...] = (0.0,)
    four_strokes: bool = False
    charge: SliderCrank | None = None
    firing_delay: float = 0.0

    @property
    def chamber(self) -> SliderCrank:
        """Mechanism that gives the volume."""
        return self.charge or self.piston


@dataclass(frozen=True)
class SliderCrank:
    """Mechanism of one cylinder; other mechanisms are subclasses.

    Attributes
    ----------
    x
        Position along the crank axis [m].
    crank_radius
        Crank radius r [m].
    rod_length
        Distance l between the pins of the rod [m]; infinite for a Scotch yoke.
    reciprocating_mass
        Mass of piston and pin with the rod's share [kg].
    throw
        Angle theta of the crank pin when phi = 0 [rad] (C3).
    bank
        Angle beta of the cylinder axis [rad] (C5).
    offset
        Distance e of the pin's path from the crank axis, positive towards +i e^{i beta} [m].
    rotating_mass
        The rod's share at the crank pin [kg].
    rod_inertia_deficit
        True inertia of the rod less that of its two masses [kg m2] (eq. 10).
    bore
        Piston diameter [m]; needed with gas only.
    firing_angle
        Crank angle phi at which this cylinder fires [rad], within the cycle (C5).
    facing
        `Facing` piston that works in its chamber, out of step with it; None if there is none.
    big_end
        Diameter and width of the rod's bearing on the crank pin [m]; needed for a pressure only.
    """

    name: str
    x: float
    crank_radius: float
    rod_length: float
    reciprocating_mass: float
    throw: float = 0.0
    bank: float = 0.0
    offset: float = 0.0
    rotating_mass: float = 0.0
    rod_inertia_deficit: float = 0.0
    bore: float | None = None
    firing_angle: float = 0.0
    shaft: Shaft = CRANKSHAFT
    big_end: tuple[float, float] | None = None
    facing: Any = None
    noun: ClassVar[str] = "cylinder"
    """Noun in its name, before its number."""
    has_pin_loads: ClassVar[bool] = True
    """True if the force on its crank pin is known."""
    has_rod: ClassVar[bool] = True
    """True if a rod presses the piston against a cylinder wall."""
    is_balanced_by_share: ClassVar[bool] = True
    """True if a counterweight may balance a share of its reciprocating mass (eq. 13)."""
    powers: ClassVar = {
        **dict.fromkeys(("x", "crank_radius", "rod_length", "offset", "bore", "big_end"), (0, 1)),
        **dict.fromkeys(("reciprocating_mass", "rotating_mass"), (1, 0)), "rod_inertia_deficit": (1, 2),
    }  # fmt: skip
    """Powers of mass and length in the unit of every number."""

    def __post_init__(self) -> None:
        if not self.crank_radius > 0.0:
            raise ModelError(f"{self.name}: crank radius {self.crank_radius} m must be positive")
        if not self.rod_length > 0.0:
            raise ModelError(f"{self.name}: rod length {self.rod_length} m must be positive")
        if self.reciprocating_mass < 0.0 or self.rotating_mass < 0.0:
            raise ModelError(f"{self.name}: masses must not be negative")
        if math.isinf(self.rod_length) and self.offset != 0.0:
            raise ModelError(
                f"{self.name}: an offset has no effect with an infinite rod (Scotch yoke); set the offset to 0"
            )
        if self.rod_ratio + abs(self.offset_ratio) >= 1.0:
            raise ModelError(
                f"{self.name}: the crank cannot turn, (r + |e|) / l = "
                f"{self.rod_ratio + abs(self.offset_ratio):.4g} must be under 1"
            )

    @property
    def rod_ratio(self) -> float:
        """Rod ratio lambda = r / l."""
        return self.crank_radius / self.rod_length

    @property
    def offset_ratio(self) -> float:
        """Offset ratio epsilon = e / l."""
        return self.offset / self.rod_length

    @property
    def path(self) -> Hashable:
        """Numbers that determine the path of the piston over the angle of the crank."""
        return self.crank_radius, self.rod_length, self.offset

    @property
    def fires_at(self) -> float:
        """Local crank angle of the dead centre that firing is counted from [rad] (C5)."""
        return 0.0

    @cached_property
    def dead_centres(self) -> tuple[float, float]:
        """Local crank angles of the highest and the lowest piston position [rad] (G2).

        Crank and rod are in one line there. With an offset both lie off alpha = 0 and pi.
        """
        top = math.asin(self.offset_ratio / (1.0 + self.rod_ratio))
        return top, math.pi + math.asin(self.offset_ratio / (1.0 - self.rod_ratio))

    def travel(self, lib: Any, alpha: Any) -> Any:
        """Return the piston travel towards the crank from alpha = 0 [m] (K4)."""
        return self.crank_radius * kinematics.travel(lib, alpha, self.rod_ratio, self.offset_ratio)

    def velocity(self, lib: Any, alpha: Any) -> Any:
        """Return the velocity of the piston away from the crank, by the angle of its crank [m] (K5)."""
        return self.crank_radius * kinematics.piston_velocity(lib, alpha, self.rod_ratio, self.offset_ratio)

    def motion(self, lib: Any, alpha: Any) -> Motion:
        """Return the motion of piston and rod; positions count from alpha = 0, in the digits of `lib` and `alpha`."""
        zero = 0.0 * alpha
        radius, offset = zero + self.crank_radius, zero + self.offset
        shape = (lib, alpha, radius / self.rod_length, offset / self.rod_length)
        piston = (
            1j * offset - radius * kinematics.travel(*shape),
            radius * kinematics.piston_velocity(*shape),
            radius * kinematics.piston_acceleration(*shape),
        )
        rod = (-kinematics.rod_rate(*shape), -kinematics.rod_acceleration(*shape))
        return Motion(((self.reciprocating_mass, piston),), ((self.rod_inertia_deficit, rod),))

    @property
    def counterweight_mass(self) -> float | None:
        """Mass of its own counterweight [kg]; None if it has none."""
        return None

    def only(self, masses: Mapping[str, float]) -> Self:
        """Return the mechanism with these masses alone, by field name."""
        none: dict[str, Any] = {name: 0.0 for name, (mass_power, _) in self.powers.items() if mass_power}
        return replace(self, **none | dict(masses))

    @cached_property
    def star_turn(self) -> Turn:
        """Angle of the crank from the cylinder axis, theta - beta, at phi = 0, in turns (C5)."""
        return as_turn(self.throw) - as_turn(self.bank)

    def faces(self, other: SliderCrank) -> bool:
        """Return True if two pistons work against each other on one axis in one cylinder (C5)."""
        if self.x != other.x:
            return False
        axis, opposite = cis(as_turn(self.bank)), cis(as_turn(other.bank))
        between_axes = complex(other.shaft.z - self.shaft.z, other.shaft.y - self.shaft.y) * axis.conjugate()
        reach = _ON_ONE_AXIS * abs(between_axes)
        return abs(axis + opposite) < _ON_ONE_AXIS and abs(between_axes.imag) <= reach < between_axes.real

    @property
    def swept(self) -> Swept:
        """Space that its charge works in."""
        swept: Swept = Swept(self) if self.facing is None else self.facing.swept(self)
        return swept

    def lean(self, lib: Any, angles: Any) -> Any:
        """Return crank-pin force over gas force at crank angles after firing, turned to the cylinder axis (B2)."""
        sine, cosine = self.rod_lean(lib, self.fires_at + self.shaft.ratio * angles)
        return 1.0 - 1j * sine / cosine

    def rod_lean(self, lib: Any, alpha: Any) -> tuple[Any, Any]:
        """Return sine and cosine of the angle between rod and cylinder axis (K1, K2)."""
        shape = lib, alpha, self.rod_ratio, self.offset_ratio
        return kinematics.sin_psi(*shape), kinematics.cos_psi(*shape)

    @property
    def master_bank(self) -> float | None:
        """Bank angle of the cylinder whose rod carries this rod [rad]; None for a rod on the crank pin."""
        return None

    def on_pin(self, _lib: Any, _alpha: Any, force: Any, _with_masses: bool) -> Any:
        """Return the force on the rod's pin for a force on its piston pin, in the plane of its axis (B11).

        It may include the pull of masses at that pin that do not turn with the crank, at unit speed of the crank.
        """
        return force

    def on_wall_of_master(self, _lib: Any, alpha: Any, _force: Any) -> Any:
        """Return the wall force of the master's piston that a pin force adds (B11)."""
        return 0.0 * alpha

    def outlines(self, _alpha: float) -> tuple[Outline, ...]:
        """Return drawn bodies at a crank angle; without any, a piston and a rod are drawn."""
        return ()

    @property
    def largest_ratio(self) -> float:
        """Largest compression ratio that its shape allows."""
        return math.inf

    @property
    def piston_area(self) -> float:
        """Area on which the gas acts [m2]."""
        if self.bore is None:
            raise ModelError(f"{self.name}: gas forces need a bore")
        return math.pi * self.bore**2 / 4.0

    @property
    def big_end_area(self) -> float:
        """Projected area of the rod's bearing on its pin, diameter times width [m2]."""
        if self.big_end is None:
            raise ModelError(f"{self.name} has no big end, so the pressure on its pin is not known; add engine.big_end")
        return self.big_end[0] * self.big_end[1]

    @property
    def stroke(self) -> float:
        """Distance between the dead centres [m]; with an offset a little over 2 r."""
        if math.isinf(self.rod_length):
            return 2.0 * self.crank_radius
        e2 = self.offset**2
        top = math.sqrt((self.rod_length + self.crank_radius) ** 2 - e2)
        bottom = math.sqrt((self.rod_length - self.crank_radius) ** 2 - e2)
        return 4.0 * self.rod_length * self.crank_radius / (top + bottom)


@dataclass(frozen=True)
class OffsetCrank(SliderCrank):
    """Slider-crank with an offset that fires at its true dead centre, as in a row of a narrow-angle bank."""

    @property
    def fires_at(self) -> float:
        """Local crank angle of the highest piston position [rad] (G2)."""
        return self.dead_centres[0]


def displacement(parts: Iterable[SliderCrank]) -> float:
    """Return the swept volume of several cylinders [m3]."""
    return sum(part.piston_area * part.stroke for part in parts)


def as_kind(kind: type[P], part: SliderCrank, **numbers: Any) -> P:
    """Return a slider-crank as a mechanism of another class, with the fields that only this has."""
    return kind(**{shared.name: getattr(part, shared.name) for shared in fields(part)}, **numbers)
