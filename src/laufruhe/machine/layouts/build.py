"""Slider-cranks and throws at the places of a layout."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from laufruhe.errors import ModelError, counted
from laufruhe.machine.engine import Cycle
from laufruhe.machine.layouts.places import Layout
from laufruhe.machine.rotor import CRANKSHAFT, Role, Rotor, Shaft
from laufruhe.machine.slider_crank import OffsetCrank, SliderCrank, as_kind
from laufruhe.numerics.exact_angles import SAME_TURN, Turn, angle_of, as_turn, cis, reduced_turn


@dataclass(frozen=True)
class Mechanism:
    """Slider-crank of a cylinder at angles of zero, which all cylinders share unless some have their own.

    Attributes
    ----------
    part
        Slider-crank; its mass at the crank pin is that of the rod alone.
    rotating_mass
        Rotating mass per throw without rods, at the crank radius [kg].
    pin_mass
        Part of the rotating mass of its throw that belongs to this cylinder [kg]; None for an equal share.
    """

    part: SliderCrank
    rotating_mass: float = 0.0
    pin_mass: float | None = None

    def cylinder(
        self, number: int, x: float, throw: float, bank: float, firing_angle: float, shaft: Shaft = CRANKSHAFT
    ) -> SliderCrank:
        """Return the slider-crank of a cylinder."""
        return replace(
            self.part, name=f"{self.part.noun} {number}", x=x, throw=throw, bank=bank, firing_angle=firing_angle,
            shaft=shaft,
        )  # fmt: skip


def angles_in_order(
    cycle: Cycle, centres: Sequence[Turn], firing_order: Sequence[int], intervals: Sequence[float] = ()
) -> tuple[float, ...]:
    """Return the crank angles at which cylinders fire [rad], from a dead centre of each in turns.

    Each fires at its first dead centre after the one before, or after the interval that is given [rad].
    """
    turns = [reduced_turn(centre, 1) for centre in centres]
    start = previous = turns[firing_order[0] - 1]
    angles = [angle_of(turn) for turn in turns]
    for place, number in enumerate(firing_order[1:], 1):
        if intervals:
            centre = start + sum(map(as_turn, intervals[:place]))
            if abs(math.remainder(float(centre - turns[number - 1]), 1.0)) > SAME_TURN:
                first = reduced_turn(turns[number - 1] - start, 1)
                after = " or ".join(f"{360.0 * float(first + turn):.6g}" for turn in range(cycle.turns))
                raise ModelError(
                    f"order {list(firing_order)} cannot have these intervals: cylinder {number} would fire "
                    f"{360.0 * float(centre - start):.6g} deg after cylinder {firing_order[0]}, and its dead centre is "
                    f"{after} deg after it"
                )
        else:
            centre = turns[number - 1]
            while centre <= previous + SAME_TURN:
                centre += 1
        if centre >= start + cycle.turns - SAME_TURN:
            raise ModelError(
                f"the throws cannot fire in the order {list(firing_order)} within {counted(cycle.turns, 'turn')}: "
                f"cylinder {number} would come after {math.degrees(angle_of(centre - start)):.6g} deg"
            )
        angles[number - 1] = angle_of(centre)
        previous = centre
    return tuple(angles)


def even_throws(
    cycle: Cycle, layout: Layout, firing_order: Sequence[int], intervals: Sequence[float] = ()
) -> tuple[float, ...]:
    """Return the throw angles of even firing in this order, or of these intervals [rad].

    The first cylinder of the order has its dead centre at phi = 0.
    """
    step, upright = Fraction(cycle.turns, len(firing_order)), [0.0] * len(layout.throw_positions)
    inputs: dict[int, tuple[Turn, int]] = {}
    for place, number in enumerate(firing_order):
        k = number - 1
        fires = sum(map(as_turn, intervals[:place])) if intervals else place * step
        turn = (layout.dead_centre(upright, k) - fires) % 1
        first, neighbour = inputs.setdefault(layout.pins[k], (turn, number))
        if abs(math.remainder(float(first - turn), 1.0)) > SAME_TURN:
            raise ModelError(
                f"firing order {list(firing_order)} cannot {'have these intervals' if intervals else 'be even'} with "
                f"these pins and banks: cylinder {number} needs its throw at {math.degrees(angle_of(turn)):.6g} deg, "
                f"cylinder {neighbour} on the same throw at {math.degrees(angle_of(first)):.6g} deg; "
                f"{'correct the intervals' if intervals else 'give the throws'}"
            )
    for pin in range(len(layout.throw_positions)):
        if pin not in inputs:
            rule = f"fixes no angle of throw {pin + 1}, none of whose cylinders fires; give the throws"
            raise ModelError(f"firing order {list(firing_order)} {rule}")
    return tuple(angle_of(inputs[pin][0]) for pin in range(len(layout.throw_positions)))


@dataclass(frozen=True)
class Throw:
    """Throw of a crankshaft, at position x along its axis [m] and at `angle` when phi = 0 [rad] (C3).

    Attributes
    ----------
    cylinders
        Indices of the slider-cranks that work on it.
    unbalance
        Unbalance of its rotating mass without rods [kg m].
    """

    x: float
    angle: float
    cylinders: tuple[int, ...]
    unbalance: complex = 0.0
    shaft: Shaft = CRANKSHAFT


def throw_rotors(throws: Sequence[Throw]) -> tuple[Rotor, ...]:
    """Return the rotating masses of the throws as rotors."""
    return tuple(
        Rotor(f"throw {k + 1}", throw.x, throw.unbalance, throw.shaft, Role.THROW)
        for k, throw in enumerate(throws)
        if throw.unbalance != 0.0
    )


def build(
    cycle: Cycle,
    layout: Layout,
    mechanism: Mechanism | Sequence[Mechanism],
    angles: Sequence[float],
    firing_order: Sequence[int] | None = None,
    intervals: Sequence[float] = (),
) -> tuple[tuple[SliderCrank, ...], tuple[Throw, ...]]:
    """Return the slider-cranks, and the throws that they work on, at these angles when phi = 0 [rad] (C3).

    Without firing intervals [rad] each cylinder fires at its first dead centre after the one before. Without a firing
    order every cylinder is taken to fire at its first dead centre, which matters to gas loads alone. The mechanism is
    that of all cylinders, or one for each.
    """
    if len(angles) != len(layout.throw_positions):
        raise ModelError(f"{counted(len(angles), 'throw')} given, but the layout has {len(layout.throw_positions)}")
    cylinders = range(len(layout.positions))
    centres = [layout.dead_centre(angles, k) for k in cylinders]
    fires = (
        angles_in_order(cycle, centres, firing_order, intervals)
        if firing_order
        else [angle_of(reduced_turn(centre, 1)) for centre in centres]
    )
    mechanisms = [mechanism] * len(cylinders) if isinstance(mechanism, Mechanism) else mechanism
    slider_cranks = tuple(
        mechanisms[k].cylinder(
            k + 1, layout.positions[k], angles[layout.pins[k]] + layout.pin_offsets[k], layout.banks[k], fires[k]
        )
        for k in cylinders
    )
    if layout.offsets:
        slider_cranks = tuple(
            as_kind(OffsetCrank, replace(part, offset=offset))
            for part, offset in zip(slider_cranks, layout.offsets, strict=True)
        )
    throws = []
    for pin, x in enumerate(layout.throw_positions):
        on_throw = tuple(k for k, own_pin in enumerate(layout.pins) if own_pin == pin)
        unbalance = throw_unbalance([mechanisms[k] for k in on_throw])
        throws.append(Throw(x, angles[pin], on_throw, unbalance * cis(as_turn(angles[pin]))))
    return slider_cranks, tuple(throws)


def throw_unbalance(mechanisms: Sequence[Mechanism]) -> float:
    """Return the unbalance of a throw without rods, from the mechanisms of the cylinders on it [kg m]."""
    first, count = mechanisms[0], len(mechanisms)
    if all(mechanism.pin_mass is None for mechanism in mechanisms):
        return first.rotating_mass * first.part.crank_radius
    masses = (one.rotating_mass / count if one.pin_mass is None else one.pin_mass for one in mechanisms)
    return sum(masses) * first.part.crank_radius
