"""Sizes of the running gear and the masses that follow: webs, rod shank, piston pin and bolts.

Crank pins are the big ends of the rods, journals the main bearings. What hangs on the sizes is written once here:
moduli and areas of sections, and masses (Z1, Z2).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar, Self, TypeAlias

from laufruhe.errors import ModelError
from laufruhe.machine import Engine
from laufruhe.machine.extra import Extra
from laufruhe.machine.rotor import Bearing, Rotor
from laufruhe.machine.slider_crank import SliderCrank

Size: TypeAlias = tuple[str, str]
"""Name of a part, and of its number."""

STEEL = 210e9
"""Elastic modulus where none is given [Pa]."""
PARTS, MOVED = ("webs", "rod", "piston_pin", "bolts"), ("width", "thickness", "diameter", "bore", "length")
BIG_END, ROD_LENGTH, _ACROSS = "big end", ("rod", "length"), ("diameter", "width")


@dataclass(frozen=True)
class Webs:
    """Two webs of a rectangular section beside every pin.

    Attributes
    ----------
    width, thickness
        Across the shaft and along it [m].
    """

    width: float
    thickness: float

    @property
    def modulus(self) -> float:
        """Against bending out of the plane of the web, b h^2 / 6 [m3]."""
        return self.width * self.thickness**2 / 6.0

    @property
    def area(self) -> float:
        """Area of the section [m2]."""
        return self.width * self.thickness


@dataclass(frozen=True)
class Shank:
    """Round shank of a rod, as long as the rod.

    Attributes
    ----------
    diameter, bore
        [m].
    """

    diameter: float
    bore: float = 0.0

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
    """A floating pin: part of its length in the small end of the rod, the rest in the two bosses of the piston.

    Attributes
    ----------
    diameter, bore, length
        [m].
    in_bosses
        Share of the length that the bosses hold.
    span
        Between the middles of the bosses [m]; by the share where it is not given.
    """

    diameter: float
    bore: float
    length: float
    in_bosses: float = 0.5
    given_span: float | None = None

    def __post_init__(self) -> None:
        _check_hollow("piston pin", self.diameter, self.bore)

    @property
    def span(self) -> float:
        """Between the middles of the bosses [m]."""
        return self.length * (1.0 - 0.5 * self.in_bosses) if self.given_span is None else self.given_span

    @property
    def boss_area(self) -> float:
        """Projected area in both bosses [m2]."""
        return self.diameter * self.length * self.in_bosses


@dataclass(frozen=True)
class Bolts:
    """Bolts that hold the cap of a big end.

    Attributes
    ----------
    diameter
        Diameter at the root of the thread [m].
    """

    count: int
    diameter: float

    @property
    def area(self) -> float:
        """Area of all bolts [m2]."""
        return self.count * ring_area(self.diameter, 0.0)


@dataclass(frozen=True)
class RunningGear(Extra):
    """Sizes that all throws share; empty where only rods, crank pins or journals are sized.

    Attributes
    ----------
    density
        Of the steel [kg/m3]; None where the sizes add nothing to the masses as given.
    throws
        Names of the rotors that pins and webs are, and which way each throw points (C4).
    """

    name: ClassVar[str] = "size"
    elastic_modulus: float = STEEL
    density: float | None = None
    webs: Webs | None = None
    rod: Shank | None = None
    piston_pin: PistonPin | None = None
    bolts: Bolts | None = None
    throws: tuple[tuple[str, complex], ...] = ()

    def part(self, name: str) -> Webs | Shank | PistonPin | Bolts:
        """Return one of its parts, which it must have."""
        one: Webs | Shank | PistonPin | Bolts | None = getattr(self, name)
        if one is None:
            raise ModelError(f"the running gear has no {name.replace('_', ' ')}; add it to [running_gear]")
        return one

    def move(self, engine: Engine, changes: Mapping[Any, float], _: Sequence[SliderCrank]) -> Engine:
        """Return an engine with changes of its sizes, and of the masses of these."""
        if not changes:
            return engine
        return resized(
            engine, {size: value + changes.get(size, 0.0) for size, value in moving_of(engine).sizes.items()}
        )

    def scaled(self, length: float, mass: float) -> Self:
        """Return the gear of an engine whose lengths and masses are so many times as large."""
        longer: dict[str, object] = {}
        for name in PARTS:
            one = getattr(self, name)
            if one is not None:
                sizes = {f.name: getattr(one, f.name) for f in fields(one) if f.name not in ("count", "in_bosses")}
                longer[name] = replace(one, **{k: None if v is None else v * length for k, v in sizes.items()})
        heavy = None if self.density is None else self.density * (mass / length**3)
        return replace(self, density=heavy, **longer)  # type: ignore[arg-type]

    def rod_masses(self, part: SliderCrank) -> tuple[float, float, float]:
        """Return the masses that shank and piston pin add to a slider-crank (Z2).

        Returns
        -------
        Reciprocating and rotating mass [kg], and the inertia deficit of a straight shank [kg m2].
        """
        density, length = self.density or 0.0, part.rod_length
        shank = 0.0 if self.rod is None or math.isinf(length) else density * self.rod.area * length
        pin = self.piston_pin
        ring = 0.0 if pin is None else density * ring_area(pin.diameter, pin.bore) * pin.length
        return 0.5 * shank + ring, 0.5 * shank, -shank * length**2 / 6.0 if shank else 0.0

    def throw_unbalance(self, radius: float, big_end: tuple[float, float] | None, journal: float) -> float:
        """Return the unbalance of crank pin and both webs [kg m] (Z2).

        Parameters
        ----------
        journal
            Diameter of the main bearings [m]: the web about it turns about its own middle.
        """
        across, width = big_end or (0.0, 0.0)
        total = ring_area(across, 0.0) * width * radius
        if self.webs is not None:
            total += self.webs.area * ((radius + 0.5 * across) ** 2 - 0.25 * journal**2)
        return (self.density or 0.0) * total


@dataclass(frozen=True)
class MovingGear:
    """Parts of an engine that sizes change: all that turns, reciprocates or carries."""

    gear: RunningGear | None
    parts: tuple[SliderCrank, ...]
    rotors: tuple[Rotor, ...]
    bearings: tuple[Bearing, ...]

    def weighed(self, sense: float = 1.0) -> MovingGear:
        """Return the parts with the masses of the running gear added (`sense` 1) or removed (-1) (Z2)."""
        gear = self.gear
        if gear is None or gear.density is None or not self.parts:
            return self
        unbalance, ways = sense * self.throw_unbalance, dict(gear.throws)
        rotors = (
            replace(r, unbalance=r.unbalance + unbalance * ways[r.name]) if r.name in ways else r for r in self.rotors
        )
        return replace(self, parts=tuple(_heavier(gear, part, sense) for part in self.parts), rotors=tuple(rotors))

    @cached_property
    def bare(self) -> MovingGear:
        """Parts without the masses of the running gear (Z2)."""
        return self.weighed(-1.0)

    @property
    def throw_unbalance(self) -> float:
        """Unbalance of pin and webs of one throw [kg m] (Z2)."""
        if self.gear is None or not self.parts:
            return 0.0
        # about the journal a web turns about its own middle
        journal = min((b.diameter for b in self.bearings if b.diameter is not None), default=0.0)
        return self.gear.throw_unbalance(self.parts[0].crank_radius, self.parts[0].big_end, journal)

    @property
    def sizes(self) -> dict[Size, float]:
        """Sizes that decisions may move [m]."""
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
        """Return the parts with other sizes, and the masses that follow from them."""
        unweighed = self.bare
        parts, gear = unweighed.parts, unweighed.gear
        length, end = sizes.get(ROD_LENGTH), tuple(sizes.get((BIG_END, key)) for key in _ACROSS)
        moved: dict[str, Any] = {}
        if parts and length is not None and length != parts[0].rod_length:
            moved["rod_length"] = length
        if end[0] is not None and end[1] is not None:
            moved["big_end"] = end
        if moved:
            parts = tuple(replace(part, **moved) for part in parts)
        bearings = tuple(
            replace(b, **{key: sizes.get((on(b), key), getattr(b, key)) for key in _ACROSS}) for b in unweighed.bearings
        )
        for name in PARTS if gear else ():
            one = getattr(gear, name)
            changed = {f.name: sizes[name, f.name] for f in fields(one) if (name, f.name) in sizes} if one else {}
            if changed and gear is not None:
                gear = replace(gear, **{name: replace(one, **changed)})
        return replace(unweighed, gear=gear, parts=parts, bearings=bearings).weighed()


def moving_of(engine: Engine) -> MovingGear:
    """Return what sizes move in an engine."""
    return MovingGear(engine.extra(RunningGear), engine.slider_cranks, engine.rotors, engine.bearings)


def resized(engine: Engine, sizes: Mapping[Size, float]) -> Engine:
    """Return the engine with sizes in place of its own, and the masses of these."""
    moved = moving_of(engine).resized(sizes)
    changed = replace(engine, slider_cranks=moved.parts, rotors=moved.rotors, bearings=moved.bearings)
    return changed if moved.gear is None else changed.with_extra(moved.gear)


def _heavier(gear: RunningGear, part: SliderCrank, sense: float) -> SliderCrank:
    reciprocating, rotating, deficit = (sense * mass for mass in gear.rod_masses(part))
    return replace(
        part,
        # what was added and is taken off again may leave a rounding
        reciprocating_mass=max(part.reciprocating_mass + reciprocating, 0.0),
        rotating_mass=max(part.rotating_mass + rotating, 0.0),
        rod_inertia_deficit=part.rod_inertia_deficit + deficit,
    )


def on(bearing: Bearing) -> str:
    """Return the name of a main bearing among those of parts."""
    return f"bearing {bearing.name}"


def ring_area(diameter: float, bore: float) -> float:
    """Return the area of a round section [m2]."""
    return math.pi / 4.0 * (diameter**2 - bore**2)


def round_modulus(diameter: float, bore: float = 0.0) -> float:
    """Return the section modulus in bending, twice which is that in torsion [m3] (Z1)."""
    return math.pi / 32.0 * (diameter**4 - bore**4) / diameter


def round_inertia(diameter: float, bore: float = 0.0) -> float:
    """Return the second moment of a round section [m4]."""
    return 0.5 * diameter * round_modulus(diameter, bore)


def _check_hollow(name: str, diameter: float, bore: float) -> None:
    if not diameter > bore >= 0.0:
        raise ModelError(f"{name}: a bore of {1e3 * bore:.6g} mm does not fit into {1e3 * diameter:.6g} mm")
