"""What every layout is made of: places of cylinders and throws, and the slider-cranks built from them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

from laufruhe.errors import KeyedError, ModelError
from laufruhe.machine.engine import Cycle
from laufruhe.machine.rotor import CRANKSHAFT, Role, Rotor, Shaft
from laufruhe.machine.slider_crank import Rod, SliderCrank
from laufruhe.numerics.turns import SAME_TURN, Turn, angle_of, as_turn, cis, within


@dataclass(frozen=True)
class Mechanism:
    """What all cylinders of an engine share.

    Attributes
    ----------
    crank_radius, rod_length, offset, bore
        [m]; see `SliderCrank`.
    reciprocating_mass
        Per cylinder [kg].
    rotating_mass
        Per throw, at the crank radius [kg].
    rod_rotating_mass
        The rod's share per cylinder [kg].
    rod_inertia_deficit
        [kg m2] (eq. 10).
    """

    crank_radius: float
    rod_length: float
    reciprocating_mass: float
    rotating_mass: float = 0.0
    rod_rotating_mass: float = 0.0
    rod_inertia_deficit: float = 0.0
    offset: float = 0.0
    bore: float | None = None

    def cylinder(
        self,
        number: int,
        x: float,
        throw: float,
        bank: float,
        firing_angle: float,
        pin_mass: float = 0.0,
        shaft: Shaft = CRANKSHAFT,
    ) -> SliderCrank:
        """One cylinder of an engine.

        Parameters
        ----------
        number
            Of the cylinder (C3).
        x, throw, bank, firing_angle, shaft
            Place [m] and angles [rad]; see `SliderCrank`.
        pin_mass
            What turns at the crank pin beside the rod's share [kg].
        """
        return SliderCrank(
            name=f"cylinder {number}",
            x=x,
            crank_radius=self.crank_radius,
            rod_length=self.rod_length,
            reciprocating_mass=self.reciprocating_mass,
            throw=throw,
            bank=bank,
            offset=self.offset,
            rotating_mass=pin_mass + self.rod_rotating_mass,
            rod_inertia_deficit=self.rod_inertia_deficit,
            bore=self.bore,
            firing_angle=firing_angle,
            shaft=shaft,
        )


@dataclass(frozen=True)
class Layout:
    """Where cylinders and throws are, without their masses.

    Attributes
    ----------
    positions, banks
        Place along x [m] and bank angle [rad] of every cylinder.
    pins
        Index of the throw that every cylinder works on.
    pin_offsets
        Angle of a cylinder's own pin from its throw [rad], for split pins.
    throw_positions
        Place along x of every throw [m].
    sides
        Share of the angle between the banks at which every cylinder leans; its pin is offset by as much of the
        split pins' angle the other way. Empty where no bank is.
    late
        Crank angle from alpha = 0 to the dead centre that every cylinder fires at [rad]; empty where there is none.
    throws
        Angle of every throw [rad] where the layout leaves no choice.
    """

    name: str
    positions: tuple[float, ...]
    banks: tuple[float, ...]
    pins: tuple[int, ...]
    pin_offsets: tuple[float, ...]
    throw_positions: tuple[float, ...]
    sides: tuple[float, ...] = ()
    late: tuple[float, ...] = ()
    throws: tuple[float, ...] | None = None

    def own_turn(self, k: int) -> Turn:
        """Crank angle at which alpha of cylinder k is 0, were its throw at zero, as a part of a turn (C5)."""
        return as_turn(self.banks[k]) - as_turn(self.pin_offsets[k])

    def dead_centre(self, throws: Sequence[float], k: int) -> Turn:
        """Crank angle of cylinder k's dead centre as a part of a turn (C5)."""
        late = as_turn(self.late[k]) if self.late else 0
        return self.own_turn(k) - as_turn(throws[self.pins[k]]) + late

    @property
    def spread(self) -> float:
        """How far firing intervals may be from even for dead centres that are late [rad]."""
        return max(self.late) - min(self.late) if self.late else 0.0

    def side(self, k: int) -> float:
        """Share of the angle between the banks at which cylinder k leans, 1/2 to the left, -1/2 to the right."""
        return self.sides[k] if self.sides else 0.0


def stations(count: int, spacing: float) -> tuple[float, ...]:
    """`count` places a `spacing` apart, the first at the front, the middle at x = 0 (C2)."""
    return tuple((count - 1 - 2 * k) * (0.5 * spacing) for k in range(count))


def check_even(cylinders: int, what: str) -> None:
    """Two banks share the cylinders."""
    if cylinders < 2 or cylinders % 2:
        raise ModelError(f"{what} needs an even number of cylinders, got {cylinders}")


@dataclass(frozen=True)
class Key:
    """A key of [engine] that a layout takes.

    Attributes
    ----------
    kind
        "length", "positive length", "non-negative length", "angle", "open angle", "angles", "cylinder", "sign",
        "mass", or "rod" of a mass, centre of gravity and inertia.
    default
        Where it is left out.
    remedy
        What to do where it is left out, if it must not be.
    """

    name: str
    kind: str
    description: str = ""
    default: Any = None
    remedy: str = ""


SPACING = Key("cylinder_spacing", "positive length", "Between throws; in a boxer, of a bank.")


@dataclass(frozen=True)
class Asked:
    """What is said of an engine.

    Attributes
    ----------
    own
        The layout's own keys in SI, None where left out or open.
    piston_mass
        Reciprocating mass without the share of `rod` [kg].
    rod
        Where it is given as a rigid body.
    gas
        Whether gas acts on the pistons.
    """

    cycle: Cycle
    cylinders: int
    mechanism: Mechanism
    own: Mapping[str, Any]
    firing_order: tuple[int, ...] | None = None
    piston_mass: float = 0.0
    rod: Rod | None = None
    gas: bool = False

    @property
    def spacing(self) -> float:
        """Between cylinders [m]; that of one alone does not matter."""
        given = self.own["cylinder_spacing"]
        if given is None and self.cylinders > 1:
            raise KeyedError("cylinder_spacing", 'is missing; add it, for example "125 mm"')
        return 1.0 if given is None else float(given)


class LayoutKind(ABC):
    """What a layout takes and builds: a new one is a file of its own and a line in `LAYOUTS`.

    Attributes
    ----------
    keys
        Of [engine], beside those of every layout.
    lists
        Of the keys `throws`, `firing_order`, `slider_cranks` and `shafts` those that it takes.
    openable
        Keys that may be left open.
    cylinders_per_throw
        Cylinders that share a throw.
    is_free
        Whether every slider-crank is listed, and nothing is placed.
    """

    name: ClassVar[str]
    keys: ClassVar[tuple[Key, ...]] = (SPACING,)
    lists: ClassVar[tuple[str, ...]] = ("throws", "firing_order")
    openable: ClassVar[tuple[str, ...]] = ()
    cylinders_per_throw: ClassVar[int] = 1
    is_free: ClassVar[bool] = False

    def takes(self, key: str) -> bool:
        """Whether a key means anything here."""
        return key in self.lists or any(own.name == key for own in self.keys)

    @abstractmethod
    def place(self, asked: Asked) -> Layout:
        """Places, banks and pins.

        Raises
        ------
        ModelError
            A `KeyedError` where one key is to blame.
        """

    def parts(
        self, asked: Asked, layout: Layout, throws: Sequence[float]
    ) -> tuple[tuple[SliderCrank, ...], tuple[Throw, ...]]:
        """Slider-cranks and the throws that they work on."""
        return build(asked.cycle, layout, asked.mechanism, throws, asked.firing_order)


def firing_angles(
    cycle: Cycle, layout: Layout, throws: Sequence[float], firing_order: Sequence[int]
) -> tuple[float, ...]:
    """Crank angle at which every cylinder fires [rad], each at the first dead centre after the one before.

    Raises
    ------
    ModelError
        If these throws cannot fire in this order within one cycle.
    """
    previous: Turn = Fraction(-1)
    angles = [0.0] * len(layout.positions)
    start: Turn | None = None
    for number in firing_order:
        k = number - 1
        centre = within(layout.dead_centre(throws, k), 1)
        while centre <= previous + SAME_TURN:
            centre += 1
        start = centre if start is None else start
        if centre >= start + cycle.turns - SAME_TURN:
            raise ModelError(
                f"throws {[round(math.degrees(t), 3) for t in throws]} deg cannot fire in the order "
                f"{list(firing_order)} within {cycle.turns} turn(s): cylinder {number} would come after "
                f"{math.degrees(angle_of(centre)):.6g} deg"
            )
        angles[k] = angle_of(centre)
        previous = centre
    return tuple(angles)


def even_throws(cycle: Cycle, layout: Layout, firing_order: Sequence[int]) -> tuple[float, ...]:
    """Angles of the throws that fire evenly in this order, from cylinder 1's dead centre at phi = 0.

    Raises
    ------
    ModelError
        If cylinders on one throw ask for two different angles.
    """
    step = Fraction(cycle.turns, len(firing_order))
    asked: dict[int, Turn] = {}
    for place, number in enumerate(firing_order):
        k = number - 1
        turn = (layout.own_turn(k) - place * step) % 1
        first = asked.setdefault(layout.pins[k], turn)
        if abs(math.remainder(float(first - turn), 1.0)) > SAME_TURN:
            raise ModelError(
                f"firing order {list(firing_order)} cannot be even with these pins and banks: cylinder {number} "
                f"wants its throw at {math.degrees(angle_of(turn)):.6g} deg, another on it at "
                f"{math.degrees(angle_of(first)):.6g} deg; give the throws"
            )
    return tuple(angle_of(asked[pin]) for pin in range(len(layout.throw_positions)))


@dataclass(frozen=True)
class Throw:
    """One throw of the crankshaft.

    Attributes
    ----------
    x
        Place along the crank axis [m].
    angle
        At phi = 0 [rad] (C3).
    cylinders
        Indices of the slider-cranks that work on it.
    unbalance
        Of its rotating mass, rods not included [kg m].
    """

    x: float
    angle: float
    cylinders: tuple[int, ...]
    unbalance: complex = 0.0


def throw_rotors(throws: Sequence[Throw]) -> tuple[Rotor, ...]:
    """The rotating masses of the throws."""
    return tuple(
        Rotor(f"throw {k + 1}", throw.x, throw.unbalance, role=Role.THROW)
        for k, throw in enumerate(throws)
        if throw.unbalance != 0.0
    )


def build(
    cycle: Cycle,
    layout: Layout,
    mechanism: Mechanism,
    angles: Sequence[float],
    firing_order: Sequence[int] | None = None,
) -> tuple[tuple[SliderCrank, ...], tuple[Throw, ...]]:
    """Slider-cranks and the throws that they work on.

    Parameters
    ----------
    cycle
        Two- or four-stroke.
    layout
        Places, banks and pins.
    mechanism
        What every cylinder shares.
    angles
        Angle of every throw when phi = 0 [rad] (C3).
    firing_order
        Cylinder numbers; without it every cylinder is taken to fire at its first dead
        centre, which matters to gas loads alone.

    Raises
    ------
    ModelError
        If the order cannot be met by the throws.
    """
    if len(angles) != len(layout.throw_positions):
        raise ModelError(f"{len(angles)} throw(s) given where the layout has {len(layout.throw_positions)}")
    cylinders = range(len(layout.positions))
    fires = (
        firing_angles(cycle, layout, angles, firing_order)
        if firing_order
        else tuple(angle_of(within(layout.dead_centre(angles, k), 1)) for k in cylinders)
    )
    slider_cranks = tuple(
        mechanism.cylinder(
            k + 1,
            layout.positions[k],
            angles[layout.pins[k]] + layout.pin_offsets[k],
            layout.banks[k],
            fires[k],
        )
        for k in cylinders
    )
    return slider_cranks, _throws_of(layout, mechanism, angles)


def _throws_of(layout: Layout, mechanism: Mechanism, angles: Sequence[float]) -> tuple[Throw, ...]:
    return tuple(
        Throw(
            x,
            angles[pin],
            tuple(k for k, own in enumerate(layout.pins) if own == pin),
            mechanism.rotating_mass * mechanism.crank_radius * cis(as_turn(angles[pin])),
        )
        for pin, x in enumerate(layout.throw_positions)
    )
