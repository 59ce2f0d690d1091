"""Sizes of the running gear and the masses that follow: webs, rod shank, piston pin and bolts.

Crank pins are the big ends of the rods, journals are the main bearings. This module alone defines section moduli, areas
and masses from sizes (Z1, Z2).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar, TypeAlias

from laufruhe.errors import ModelError
from laufruhe.extensions.bearing_loads.machine import Bearing, MainBearings, bearings_of
from laufruhe.machine import Engine
from laufruhe.machine.extra import Extra
from laufruhe.machine.rotor import Rotor
from laufruhe.machine.slider_crank import SliderCrank

Size: TypeAlias = tuple[str, str]
"""Name of a part, and name of one of its sizes."""

STEEL = 210e9
"""Default elastic modulus [Pa]."""
PARTS, MOVED = ("webs", "rod", "piston_pin", "bolts"), ("width", "thickness", "diameter", "bore", "length")
BIG_END, ROD_LENGTH, _ACROSS = "big end", ("rod", "length"), ("diameter", "width")


@dataclass(frozen=True)
class Webs:
    """Two webs of a rectangular section adjacent to each pin: width across the shaft, thickness along it [m]."""

    width: float
    thickness: float
    powers: ClassVar = {"width": (0, 1), "thickness": (0, 1)}

    @property
    def modulus(self) -> float:
        """Section modulus against bending out of the plane of the web, b h^2 / 6 [m3]."""
        return self.width * self.thickness**2 / 6.0

    @property
    def area(self) -> float:
        """Area of the section [m2]."""
        return self.width * self.thickness


@dataclass(frozen=True)
class Shank:
    """Round shank of a rod, as long as the rod: outer and inner diameter [m]."""

    diameter: float
    bore: float = 0.0
    powers: ClassVar = {"diameter": (0, 1), "bore": (0, 1)}

    def __post_init__(self) -> None:
        _check_hollow("rod", self.diameter, self.bore)

    @property
    def area(self) -> float:
        """Area of the section [m2]."""
        return ring_area(self.diameter, self.bore)

    @property
    def inertia(self) -> float:
        """Second moment of the section [m4]."""
        return round_inertia(self.diameter, self.bore)


@dataclass(frozen=True)
class PistonPin:
    """Floating pin, partly in the small end of the rod and partly in the two bosses of the piston [m].

    Attributes
    ----------
    in_bosses
        Share of the length in the bosses.
    given_span
        Distance between the middles of the bosses [m]; None to derive it from `in_bosses`.
    """

    diameter: float
    bore: float
    length: float
    in_bosses: float = 0.5
    given_span: float | None = None
    powers: ClassVar = dict.fromkeys(("diameter", "bore", "length", "given_span"), (0, 1))

    def __post_init__(self) -> None:
        _check_hollow("piston pin", self.diameter, self.bore)

    @property
    def span(self) -> float:
        """Distance between the middles of the bosses [m]."""
        return self.length * (1.0 - 0.5 * self.in_bosses) if self.given_span is None else self.given_span

    @property
    def boss_area(self) -> float:
        """Projected area in both bosses [m2]."""
        return self.diameter * self.length * self.in_bosses


@dataclass(frozen=True)
class Bolts:
    """Bolts of the cap of each big end, with the diameter at the root of the thread [m]."""

    count: int
    diameter: float
    powers: ClassVar = {"diameter": (0, 1)}

    @property
    def area(self) -> float:
        """Area of all bolts [m2]."""
        return self.count * ring_area(self.diameter, 0.0)


@dataclass(frozen=True)
class RunningGear(Extra):
    """Sizes that all throws share; empty if only rod length, crank pins or journals are open.

    Attributes
    ----------
    elastic_modulus
        Elastic modulus of all parts [Pa].
    density
        Density of the steel [kg/m3]; None if sizes add no masses.
    webs, rod, piston_pin, bolts
        Parts; None for a part without sizes.
    throws
        Names of the rotors of pins and webs, and direction of each throw (C4).
    """

    name: ClassVar[str] = "size"
    powers: ClassVar = {"density": (1, -3)}
    elastic_modulus: float = STEEL
    density: float | None = None
    webs: Webs | None = None
    rod: Shank | None = None
    piston_pin: PistonPin | None = None
    bolts: Bolts | None = None
    throws: tuple[tuple[str, complex], ...] = ()

    def part(self, name: str) -> Webs | Shank | PistonPin | Bolts:
        """Return a part of the running gear by its name; raise ModelError if the part is missing."""
        part: Webs | Shank | PistonPin | Bolts | None = getattr(self, name)
        if part is None:
            raise ModelError(f"the running gear has no {name.replace('_', ' ')}; add it to [running_gear]")
        return part

    def move(self, engine: Engine, changes: Mapping[Any, float], _: Sequence[SliderCrank]) -> Engine:
        """Return the engine with other sizes of its running gear, and the masses that follow from them."""
        if not changes:
            return engine
        return resized(
            engine, {size: value + changes.get(size, 0.0) for size, value in moving_gear(engine).sizes.items()}
        )

    def rod_masses(self, part: SliderCrank) -> tuple[float, float, float]:
        """Return the masses that shank and piston pin add to a slider-crank (Z2).

        These are the reciprocating and the rotating mass [kg], and the inertia deficit of a straight shank [kg m2].
        """
        density, length = self.density or 0.0, part.rod_length
        shank = 0.0 if self.rod is None or math.isinf(length) else density * self.rod.area * length
        pin = self.piston_pin
        ring = 0.0 if pin is None else density * ring_area(pin.diameter, pin.bore) * pin.length
        return 0.5 * shank + ring, 0.5 * shank, -shank * length**2 / 6.0 if shank else 0.0


@dataclass(frozen=True)
class MovingGear:
    """Parts of an engine that sizes change: gear, slider-cranks, rotors and bearings."""

    gear: RunningGear | None
    parts: tuple[SliderCrank, ...]
    rotors: tuple[Rotor, ...]
    bearings: tuple[Bearing, ...]

    def with_gear_masses(self, sense: float = 1.0) -> MovingGear:
        """Return the parts with the masses of the running gear added (`sense` 1) or removed (-1) (Z2)."""
        gear = self.gear
        if gear is None or gear.density is None or not self.parts:
            return self
        unbalance, directions = sense * self.throw_unbalance, dict(gear.throws)
        rotors = (
            replace(rotor, unbalance=rotor.unbalance + unbalance * directions[rotor.name])
            if rotor.name in directions
            else rotor
            for rotor in self.rotors
        )
        parts = []
        for part in self.parts:
            reciprocating, rotating, deficit = (sense * mass for mass in gear.rod_masses(part))
            # adding and removing a mass may leave a negative rounding error
            parts.append(
                replace(
                    part,
                    reciprocating_mass=max(part.reciprocating_mass + reciprocating, 0.0),
                    rotating_mass=max(part.rotating_mass + rotating, 0.0),
                    rod_inertia_deficit=part.rod_inertia_deficit + deficit,
                )
            )
        return replace(self, parts=tuple(parts), rotors=tuple(rotors))

    @cached_property
    def bare(self) -> MovingGear:
        """Parts without the masses of the running gear (Z2)."""
        return self.with_gear_masses(-1.0)

    @property
    def throw_unbalance(self) -> float:
        """Unbalance of pin and webs of one throw [kg m] (Z2)."""
        if self.gear is None or not self.parts:
            return 0.0
        radius, (diameter, width) = self.parts[0].crank_radius, self.parts[0].big_end or (0.0, 0.0)
        total = ring_area(diameter, 0.0) * width * radius
        if self.gear.webs is not None:
            # the part of a web around the journal has no unbalance
            journal = smallest_journal(self.bearings)
            total += self.gear.webs.area * ((radius + 0.5 * diameter) ** 2 - 0.25 * journal**2)
        return (self.gear.density or 0.0) * total

    @property
    def sizes(self) -> dict[Size, float]:
        """Sizes that decisions may change [m]."""
        sizes: dict[Size, float] = {}
        if self.parts:
            sizes[ROD_LENGTH] = self.parts[0].rod_length
            if self.parts[0].big_end is not None:
                sizes |= {(BIG_END, key): value for key, value in zip(_ACROSS, self.parts[0].big_end, strict=True)}
        for bearing in self.bearings:
            sizes |= {(on(bearing), k): getattr(bearing, k) for k in _ACROSS if getattr(bearing, k) is not None}
        for name in PARTS if self.gear else ():
            part = getattr(self.gear, name)
            sizes |= {(name, f.name): getattr(part, f.name) for f in fields(part) if f.name in MOVED} if part else {}
        return sizes

    def resized(self, sizes: Mapping[Size, float]) -> MovingGear:
        """Return the parts with other sizes [m], and with the masses that follow."""
        bare_gear = self.bare
        parts, gear = bare_gear.parts, bare_gear.gear
        length, big_end = sizes.get(ROD_LENGTH), tuple(sizes.get((BIG_END, key)) for key in _ACROSS)
        changes: dict[str, Any] = {}
        if parts and length is not None and length != parts[0].rod_length:
            changes["rod_length"] = length
        if big_end[0] is not None and big_end[1] is not None:
            changes["big_end"] = big_end
        if changes:
            parts = tuple(replace(part, **changes) for part in parts)
        bearings = tuple(
            replace(bearing, **{key: sizes.get((on(bearing), key), getattr(bearing, key)) for key in _ACROSS})
            for bearing in bare_gear.bearings
        )
        for name in PARTS if gear else ():
            part = getattr(gear, name)
            new_sizes = {f.name: sizes[name, f.name] for f in fields(part) if (name, f.name) in sizes} if part else {}
            if new_sizes and gear is not None:
                gear = replace(gear, **{name: replace(part, **new_sizes)})
        return replace(bare_gear, gear=gear, parts=parts, bearings=bearings).with_gear_masses()


def moving_gear(engine: Engine) -> MovingGear:
    """Return the parts of an engine that sizes change."""
    return MovingGear(engine.extra(RunningGear), engine.slider_cranks, engine.rotors, bearings_of(engine))


def resized(engine: Engine, sizes: Mapping[Size, float]) -> Engine:
    """Return the engine with other sizes of its running gear [m], and with the masses that follow from them."""
    new_parts = moving_gear(engine).resized(sizes)
    resized_engine = replace(engine, slider_cranks=new_parts.parts, rotors=new_parts.rotors)
    if new_parts.gear is not None:
        resized_engine = resized_engine.with_extra(new_parts.gear)
    return resized_engine.with_extra(MainBearings(new_parts.bearings)) if new_parts.bearings else resized_engine


def smallest_journal(bearings: Sequence[Bearing]) -> float:
    """Return the smallest diameter of main bearings [m]; zero without diameters."""
    return min((b.diameter for b in bearings if b.diameter is not None), default=0.0)


def on(bearing: Bearing) -> str:
    """Return the key of a main bearing among the parts with sizes."""
    return f"bearing {bearing.name}"


def ring_area(diameter: float, bore: float) -> float:
    """Return the area of a round section [m2]."""
    return math.pi / 4.0 * (diameter**2 - bore**2)


def round_modulus(diameter: float, bore: float = 0.0) -> float:
    """Return the section modulus in bending [m3]; that in torsion is twice as large (Z1)."""
    return math.pi / 32.0 * (diameter**4 - bore**4) / diameter


def round_inertia(diameter: float, bore: float = 0.0) -> float:
    """Return the second moment of a round section [m4]."""
    return 0.5 * diameter * round_modulus(diameter, bore)


def _check_hollow(name: str, diameter: float, bore: float) -> None:
    if not diameter > bore >= 0.0:
        raise ModelError(f"{name}: a bore of {1e3 * bore:.6g} mm does not fit into {1e3 * diameter:.6g} mm")
