"""Main bearings of the shafts of an engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from laufruhe.errors import ModelError, check_names
from laufruhe.machine import CRANKSHAFT, Engine, Shaft
from laufruhe.machine.extra import Extra


@dataclass(frozen=True)
class Bearing:
    """A plain bearing that carries a shaft in the block.

    Attributes
    ----------
    x
        Position of its middle along the crank axis [m] (C2).
    diameter, width
        Size of its journal [m]; needed for a pressure, the diameter for friction too.
    friction
        Coefficient of friction; needed for friction power only.
    """

    name: str
    x: float
    diameter: float | None = None
    width: float | None = None
    friction: float | None = None
    shaft: Shaft = CRANKSHAFT
    powers: ClassVar = dict.fromkeys(("x", "diameter", "width"), (0, 1))

    def __post_init__(self) -> None:
        for what, size in (("diameter", self.diameter), ("width", self.width)):
            if size is not None and not size > 0.0:
                raise ModelError(f"bearing '{self.name}' has a {what} of {size:g} m; it must be positive")

    @property
    def area(self) -> float:
        """Projected area, diameter times width [m2]."""
        if self.diameter is None or self.width is None:
            raise ModelError(f"bearing '{self.name}' has no diameter or no width, so its pressure is not known")
        return self.diameter * self.width

    @property
    def drag(self) -> float:
        """Coefficient of friction times the surface speed of the journal over the crank's angular speed [m] (B7)."""
        if self.diameter is None or self.friction is None:
            raise ModelError(
                f"bearing '{self.name}' has no diameter or no friction, so its friction power is not known"
            )
        return 0.5 * self.friction * self.diameter * abs(self.shaft.ratio)


@dataclass(frozen=True)
class MainBearings(Extra):
    """Main bearings of an engine."""

    name: ClassVar[str] = "main_bearings"
    bearings: tuple[Bearing, ...] = ()

    def __post_init__(self) -> None:
        check_names("bearings", self.labels)

    @property
    def supports(self) -> Mapping[str, Sequence[float]]:
        """Positions of the bearings of every shaft from the rear [m], by the name of the shaft."""
        shafts = dict.fromkeys(bearing.shaft for bearing in self.bearings)
        return {shaft.name: sorted(one.x for one in self.bearings if one.shaft == shaft) for shaft in shafts}

    @property
    def labels(self) -> Sequence[str]:
        """Return the names of the bearings."""
        return [bearing.name for bearing in self.bearings]


def bearings_of(engine: Engine) -> tuple[Bearing, ...]:
    """Return the main bearings of an engine."""
    extra = engine.extra(MainBearings)
    return extra.bearings if extra is not None else ()
