"""The table [engine], its common keys and those that layouts own (docs/problem-files.md)."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import BaseModel, Field, create_model

from laufruhe.files import fields as f
from laufruhe.files.fields import Name, Table
from laufruhe.machine.layouts import LAYOUTS

T = TypeVar("T", bound=BaseModel)
Count: TypeAlias = Annotated[int, Field(ge=1, le=48)]
CylinderNumber: TypeAlias = Annotated[int, Field(ge=1, le=48)]
FiringOrder: TypeAlias = Annotated[list[int] | Literal["open"], f.OrOpen(list[CylinderNumber], "[1, 3, 4, 2]")]


class RodTable(Table):
    """The connecting rod as a rigid body."""

    mass: f.PositiveMass
    centre_of_gravity: f.Length = Field(description="Distance from the crank pin, on the line of the pins.")
    inertia: f.Inertia = Field(description="About the centre of gravity.")


class ShaftTable(Table):
    """A crankshaft of a free list of parts."""

    name: Name
    ratio: f.Ratio = 1.0
    position: Annotated[list[f.Length], Field(min_length=2, max_length=2)] = Field(description="y and z of its axis.")


class SliderCrankTable(Table):
    """One slider-crank of a free list of parts; what it leaves out it takes from [engine]."""

    x: f.Length
    bank_angle: f.Angle = Field(default=0.0, description="Of the cylinder axis, from upright towards the left.")
    throw: f.Angle = 0.0
    firing_angle: f.Angle | None = Field(default=None, description="Crank angle at which it fires.")
    shaft: str = "crankshaft"
    stroke: f.PositiveLength | None = None
    bore: f.PositiveLength | None = None
    rod_ratio: f.NonNegative | None = None
    rod_length: f.PositiveLength | None = None
    offset: f.Length | None = None
    reciprocating_mass: f.Mass | None = None
    rotating_mass: f.Mass | None = None
    rod_inertia_deficit: f.Inertia | None = None


_KINDS: dict[str, Any] = {
    "length": f.Length,
    "positive length": f.PositiveLength,
    "non-negative length": f.NonNegativeLength,
    "angle": f.Angle,
    "open angle": f.OpenAngle,
    "angles": list[f.Angle],
    "mass": f.Mass,
    "cylinder": CylinderNumber,
    "sign": Literal[1, -1],
    "rod": RodTable,
}


def _with_layout_keys(table: type[T]) -> type[T]:
    """[engine] with the names of all layouts, and a key for every one that they own."""
    names: Any = tuple(LAYOUTS)
    fields: dict[str, Any] = {"layout": (Literal[names], ...)}
    for key in (key for kind in LAYOUTS.values() for key in kind.keys):
        kind = _KINDS[key.kind] if key.default is not None else _KINDS[key.kind] | None
        fields[key.name] = (kind, Field(default=key.default, description=key.description or None))
    return create_model(table.__name__, __base__=table, __doc__=table.__doc__, __module__=__name__, **fields)


@_with_layout_keys
class EngineTable(Table):
    """What the engine is."""

    layout: str
    cycle: Literal["two-stroke", "four-stroke"]
    cylinders: Count | None = Field(default=None, description="Told by throws or firing order where left out.")
    bore: f.PositiveLength | None = Field(default=None, description="Needed with gas.")
    stroke: f.PositiveLength
    rod_ratio: f.NonNegative | None = Field(
        default=None, description="Crank radius over rod length; 0 is a Scotch yoke."
    )
    rod_length: f.PositiveLength | None = None
    offset: f.Length = Field(default=0.0, description="Of the pin's path from the crank axis.")
    reciprocating_mass: f.Mass = Field(description="Per cylinder, with the rod's share unless [engine.rod] is given.")
    rotating_mass: f.Mass = Field(default=0.0, description="Per throw, at the crank radius.")
    rod: RodTable | None = None
    rod_inertia_deficit: f.Inertia = Field(default=0.0, description="True inertia less that of the two masses.")
    throws: f.Throws | None = Field(default=None, description="At phi = 0; even firing where left out.")
    firing_order: FiringOrder | None = None
    shafts: list[ShaftTable] = Field(default_factory=list)
    slider_cranks: list[SliderCrankTable] = Field(default_factory=list)

    @property
    def given_throws(self) -> list[float] | None:
        """Throws, where every one is a number."""
        if self.throws is None or self.throws == "open":
            return None
        angles = [angle for angle in self.throws if isinstance(angle, float)]
        return angles if len(angles) == len(self.throws) else None

    @property
    def given_order(self) -> list[int] | None:
        """Firing order, where it is a list."""
        return None if self.firing_order is None or self.firing_order == "open" else self.firing_order

    def own(self, key: str) -> Any:
        """What stands at a key that a layout owns."""
        return getattr(self, key)
