"""Places of cylinders and throws, without their masses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from laufruhe.numerics.exact_angles import Turn, as_turn


@dataclass(frozen=True)
class Layout:
    """Positions of cylinders and throws, without masses.

    Attributes
    ----------
    positions, banks
        Position along x [m] and bank angle [rad] of every cylinder.
    pins
        Index of the throw that every cylinder works on.
    pin_offsets
        Angle of a cylinder's own pin from its throw [rad], for split pins.
    throw_positions
        Position along x of every throw [m].
    sides
        Share of the angle between the banks at which every cylinder leans; its pin is offset by as much of the
        split pins' angle the other way. Empty without such banks.
    firing_delays
        Crank angle from alpha = 0 to the dead centre that every cylinder fires at [rad]; empty if all are zero.
    offsets
        Offset of every cylinder [m], each fired at its true dead centre; empty if all have that of the engine.
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
    firing_delays: tuple[float, ...] = ()
    offsets: tuple[float, ...] = ()
    throws: tuple[float, ...] | None = None

    def dead_centre_turn(self, k: int) -> Turn:
        """Return the crank angle of cylinder k's dead centre if its throw is at zero, in turns (C5)."""
        delay = as_turn(self.firing_delays[k]) if self.firing_delays else 0
        return as_turn(self.banks[k]) - as_turn(self.pin_offsets[k]) + delay

    def dead_centre(self, throws: Sequence[float], k: int) -> Turn:
        """Return the crank angle of cylinder k's dead centre, in turns (C5)."""
        return self.dead_centre_turn(k) - as_turn(throws[self.pins[k]])

    @property
    def spread(self) -> float:
        """Largest deviation from even firing, because the dead centres of some cylinders come later [rad]."""
        return max(self.firing_delays) - min(self.firing_delays) if self.firing_delays else 0.0

    def throw_centre_turn(self, throw: int) -> Turn:
        """Return the dead centre of a throw's first cylinder if the throw is at zero, in turns (S6).

        It is equal for all throws unless cylinders stand in rows, or differ in their offset.
        """
        return self.dead_centre_turn(self.on_throw(throw)[0])

    def on_throw(self, throw: int) -> list[int]:
        """Return the cylinders of a throw; those that lean alike come in one order on all throws."""
        sides = [self.side(k) for k, pin in enumerate(self.pins) if pin == 0]
        return sorted((k for k, pin in enumerate(self.pins) if pin == throw), key=lambda k: sides.index(self.side(k)))

    def renumbered(self, places: Sequence[int]) -> Layout:
        """Return the layout whose cylinder k stands at place `places[k]`; throws go by their first cylinder."""
        pins = [self.pins[place] for place in places]
        throws = list(dict.fromkeys(pins))
        keys = {"positions": places, "banks": places, "pin_offsets": places, "sides": places, "firing_delays": places,
                "offsets": places, "throw_positions": throws, "throws": throws}  # fmt: skip
        numbers: dict[str, Any] = {
            key: tuple(values[k] for k in order) for key, order in keys.items() if (values := getattr(self, key))
        }
        return replace(self, pins=tuple(map(throws.index, pins)), **numbers)

    def side(self, k: int) -> float:
        """Return the share of the bank angle at which cylinder k leans: 1/2 left, -1/2 right."""
        return self.sides[k] if self.sides else 0.0


def stations(count: int, spacing: float | Sequence[float]) -> tuple[float, ...]:
    """Return `count` positions along x [m], the first at the front, the middle at x = 0 (C2).

    `spacing` is their common distance, or the distance of each to the next [m].
    """
    if isinstance(spacing, Sequence):
        return tuple(0.5 * (sum(spacing[k:]) - sum(spacing[:k])) for k in range(count))
    return tuple((count - 1 - 2 * k) * (0.5 * spacing) for k in range(count))
