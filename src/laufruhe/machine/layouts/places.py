"""Places of cylinders and throws, without their masses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from laufruhe.errors import ModelError
from laufruhe.numerics.turns import Turn, as_turn


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
