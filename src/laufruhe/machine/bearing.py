"""Main bearings of a shaft."""

from __future__ import annotations

from dataclasses import dataclass, replace

from laufruhe.errors import ModelError
from laufruhe.machine.rotor import CRANKSHAFT, Shaft


@dataclass(frozen=True)
class Bearing:
    """A plain bearing that carries a shaft in the block.

    Attributes
    ----------
    x
        Middle of it along the crank axis [m] (C2).
    diameter, width
        Of its journal [m]; needed for a pressure, the diameter for friction too.
    friction
        Coefficient of friction; needed for friction power only.
    """

    name: str
    x: float
    diameter: float | None = None
    width: float | None = None
    friction: float | None = None
    shaft: Shaft = CRANKSHAFT

    def __post_init__(self) -> None:
        for what, size in (("diameter", self.diameter), ("width", self.width)):
            if size is not None and not size > 0.0:
                raise ModelError(f"bearing '{self.name}' has a {what} of {size:g} m; it must be positive")

    def scaled(self, length: float) -> Bearing:
        """Return the bearing in another size."""
        diameter, width = (None if size is None else size * length for size in (self.diameter, self.width))
        return replace(self, x=self.x * length, diameter=diameter, width=width, shaft=self.shaft.scaled(length))

    @property
    def area(self) -> float:
        """Projected area, diameter times width [m2]."""
        if self.diameter is None or self.width is None:
            raise ModelError(f"bearing '{self.name}' has no diameter or no width, so its pressure is not known")
        return self.diameter * self.width

    @property
    def drag(self) -> float:
        """Coefficient of friction times the speed of the journal over that of the crank [m] (B7)."""
        if self.diameter is None or self.friction is None:
            raise ModelError(
                f"bearing '{self.name}' has no diameter or no friction, so its friction power is not known"
            )
        return 0.5 * self.friction * self.diameter * abs(self.shaft.ratio)
