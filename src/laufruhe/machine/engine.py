"""The engine: a list of slider-cranks and rotors on mounts, and how it is run."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, TypeVar

from laufruhe.errors import ModelError, check_names
from laufruhe.machine.block import Block, LoadCase
from laufruhe.machine.extra import Extra, MachineTorque
from laufruhe.machine.facing import with_shared_chambers
from laufruhe.machine.load_torque import LoadTorque
from laufruhe.machine.mount import Mount
from laufruhe.machine.rotor import GearedInertia, Rotor, Shaft
from laufruhe.machine.slider_crank import SliderCrank
from laufruhe.numerics.exact_angles import as_turn, cis, direction, reduced_turn
from laufruhe.numerics.spectrum import as_order

if TYPE_CHECKING:
    from laufruhe.machine.gas.base import GasModel

E = TypeVar("E", bound=Extra)


class Cycle(Enum):
    """Turns of the crank in one working cycle (C6)."""

    TWO_STROKE = 1
    FOUR_STROKE = 2

    def __str__(self) -> str:
        return self.name.lower().replace("_", "-")

    @property
    def turns(self) -> int:
        """Crank turns per cycle."""
        return self.value

    @property
    def angle(self) -> float:
        """Crank angle of a cycle [rad]."""
        return math.tau * self.value

    @cached_property
    def base_order(self) -> Fraction:
        """Lowest order of gas loads (C6)."""
        return Fraction(1, self.value)


@dataclass(frozen=True)
class OperatingPoint:
    """A speed and a load.

    Attributes
    ----------
    speed
        Crank speed [rad/s].
    weight
        Weight in a measure over several points.
    fmep
        Friction mean effective pressure [Pa], which the torque of the gas loses inside the engine (L5b).
    """

    name: str
    speed: float
    gas: GasModel | None = None
    weight: float = 1.0
    fmep: float = 0.0

    @property
    def gas_models(self) -> tuple[GasModel, ...]:
        """Models of the gas of all cylinders, each once; empty without gas."""
        return self.gas.models if self.gas else ()


@dataclass(frozen=True)
class Engine:
    """Everything that moves, and what holds it.

    Attributes
    ----------
    slider_cranks
        Slider-cranks in the order of cylinder numbers (C3).
    mounts
        Mounts; empty if only shaking loads are requested.
    block
        Body that elastic mounts carry; None for rigid mounts.
    geared
        Inertias on shafts of other speeds, as shares of the inertia of all that turns.
    load_cases
        Static loads under which the block moves on its mounts.
    extras
        Parts that extensions add, one of a class.
    load_torque
        Torque of the driven machine over the crank angle; None if it is constant.
    gravity
        True if the weight of moving parts acts on the crank (T14).
    """

    name: str
    cycle: Cycle
    slider_cranks: tuple[SliderCrank, ...]
    rotors: tuple[Rotor, ...] = ()
    mounts: tuple[Mount, ...] = ()
    block: Block | None = None
    geared: tuple[GearedInertia, ...] = ()
    load_cases: tuple[LoadCase, ...] = ()
    extras: tuple[Extra, ...] = ()
    load_torque: LoadTorque | None = None
    gravity: bool = False

    def __post_init__(self) -> None:
        for kind in ("slider_cranks", "rotors", "mounts", "geared"):
            check_names(kind.replace("_", "-"), [part.name for part in getattr(self, kind)])
        places: dict[object, str] = {}
        for part in self.slider_cranks:
            place = (part.shaft.y, part.shaft.z, part.x, direction(part.bank))
            if place in places:
                raise ModelError(f"{part.name} has the same position as {places[place]}; move one of them")
            places[place] = part.name
        for shaft in self.shafts:
            if not _returns(shaft.ratio, self.cycle.turns):
                raise ModelError(
                    f"shaft '{shaft.name}' with ratio {shaft.ratio:g} does not return within the cycle of "
                    f"{self.cycle.turns} turns; use a multiple of 1/{self.cycle.turns}"
                )
        for part in self.slider_cranks:
            crank_angle = part.shaft.ratio * part.firing_angle + part.throw - part.bank - part.fires_at
            deviation = math.remainder(crank_angle, math.tau)
            if abs(deviation) > 1e-9:
                fires = f"{part.name} fires at {math.degrees(part.firing_angle):g} deg"
                raise ModelError(f"{fires}, {math.degrees(deviation):g} deg from its dead centre")

    def extra(self, kind: type[E]) -> E | None:
        """Return the part of an extension by its class, or None."""
        return next((one for one in self.extras if isinstance(one, kind)), None)

    def with_extra(self, extra: Extra) -> Engine:
        """Return the engine with a part of an extension, which replaces a part of the same class."""
        return replace(self, extras=(*(one for one in self.extras if type(one) is not type(extra)), extra))

    @property
    def supports(self) -> Mapping[str, Sequence[float]]:
        """Positions along x at which parts of extensions support its shafts [m], in order, by the name of the shaft."""
        places: dict[str, set[float]] = {}
        for one in self.extras:
            for shaft, at in one.supports.items():
                places.setdefault(shaft, set()).update(at)
        return {shaft: sorted(at) for shaft, at in places.items()}

    @property
    def turning_inertia(self) -> float | None:
        """Inertia of all rotating parts except pistons and rods [kg m2]; None if no part of an extension has it."""
        inertias = (one.turning_inertia(self.slider_cranks) for one in self.extras)
        return next((inertia for inertia in inertias if inertia is not None), None)

    def torques(self, point: OperatingPoint) -> tuple[MachineTorque, ...]:
        """Return the torques of machines of extensions at an operating point."""
        base = self.cycle.base_order
        return tuple(torque for one in self.extras for torque in one.torques(point.name, base))

    @property
    def unloaded(self) -> Engine:
        """Engine without the torques of its load and of machines of extensions."""
        return replace(self, load_torque=None, extras=tuple(one.only({}) for one in self.extras))

    def loaded_as(self, other: Engine) -> Engine:
        """Return the engine with the torques of load and machines of another engine."""
        return replace(self, load_torque=other.load_torque, extras=other.extras)

    @property
    def is_loaded(self) -> bool:
        """True if a load or a machine of an extension may have an alternating torque."""
        return self.load_torque is not None or any(one.only({}) != one for one in self.extras)

    @property
    def shafts(self) -> tuple[Shaft, ...]:
        """Shafts with cranks or rotors, in order of first use."""
        used = [part.shaft for part in self.slider_cranks] + [rotor.shaft for rotor in self.rotors]
        return tuple(dict.fromkeys(used))

    @property
    def pins(self) -> tuple[Rotor, ...]:
        """Rotating masses at the crank pins, as rotors."""
        return _pins(self.slider_cranks)

    @property
    def cylinders(self) -> tuple[SliderCrank, ...]:
        """Slider-cranks, one for each cylinder: the first of two pistons that face each other, none without a bore."""
        pistons: list[SliderCrank] = []
        for part in self.slider_cranks:
            if part.bore != 0.0 and not any(part.faces(other) for other in pistons):
                pistons.append(part)
        return tuple(pistons)

    @property
    def firing_intervals(self) -> tuple[float, ...]:
        """Crank angles from each firing to the next over a cycle [rad], the first from that of cylinder 1."""
        cycle_turns = self.cycle.turns
        fires = [as_turn(part.firing_angle) for part in self.cylinders]
        turns = sorted(reduced_turn(turn - fires[0], cycle_turns) for turn in fires)
        following = [*turns[1:], turns[0] + cycle_turns] if turns else []
        return tuple(math.tau * float(b - a) for a, b in zip(turns, following, strict=True))

    @property
    def simultaneous_firings(self) -> list[list[str]]:
        """Names of cylinders that fire at the same crank angle, in groups of two or more."""
        fires: dict[float, list[str]] = {}
        for part in self.cylinders:
            turn = round(float(reduced_turn(as_turn(part.firing_angle), self.cycle.turns)), 9)
            fires.setdefault(turn, []).append(part.name)
        return [names for names in fires.values() if len(names) > 1]


def parts_with_leads(parts: Sequence[SliderCrank], leads: Mapping[str, float]) -> tuple[SliderCrank, ...]:
    """Return the slider-cranks with other lead angles of their shafts [rad], by shaft name (L10)."""

    def turned(part: SliderCrank, lead: float) -> SliderCrank:
        throw, firing_angle = part.throw + part.shaft.ratio * lead, part.firing_angle - lead
        return replace(part, throw=throw, firing_angle=firing_angle) if lead else part

    return tuple(turned(part, leads.get(part.shaft.name, 0.0)) for part in parts)


def with_leads(engine: Engine, leads: Mapping[str, float]) -> Engine:
    """Return the engine with other lead angles of its geared shafts [rad], by shaft name (L10)."""
    parts = parts_with_leads(engine.slider_cranks, leads)
    if any(part.facing is not None for part in parts):
        parts = with_shared_chambers([replace(part, facing=None) for part in parts], engine.cycle.angle)
    turned = {shaft.name: cmath.exp(1j * shaft.ratio * leads.get(shaft.name, 0.0)) for shaft in engine.shafts}
    rotors = tuple(replace(rotor, unbalance=rotor.unbalance * turned[rotor.shaft.name]) for rotor in engine.rotors)
    return replace(engine, slider_cranks=parts, rotors=rotors)


@lru_cache(maxsize=64)
def _pins(parts: tuple[SliderCrank, ...]) -> tuple[Rotor, ...]:
    return tuple(
        Rotor(
            f"pin of {part.name}", part.x, part.rotating_mass * part.crank_radius * cis(as_turn(part.throw)), part.shaft
        )
        for part in parts
        if part.rotating_mass > 0.0
    )  # fmt: skip


@lru_cache(maxsize=256)
def _returns(ratio: float, turns: int) -> bool:
    shaft_turns = as_order(ratio) * turns
    return shaft_turns.denominator == 1 and shaft_turns != 0
