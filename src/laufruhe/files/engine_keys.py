"""Tables within [engine], and the keys that layouts and drives own."""

from __future__ import annotations

from typing import Any, Literal, TypeVar

from pydantic import BaseModel, Field

from laufruhe.files import fields as f
from laufruhe.files.fields import CylinderNumber, Name, Open, Table
from laufruhe.machine.drives import DRIVES
from laufruhe.machine.layouts import LAYOUTS

T = TypeVar("T", bound=BaseModel)


class RodTable(Table):
    """The connecting rod as a rigid body."""

    mass: f.PositiveMass
    centre_of_gravity: f.Length = f.needed(
        "Distance of the centre of gravity from the crank pin, on the line of the pins."
    )
    inertia: f.Inertia = f.needed("Moment of inertia about the centre of gravity.")


class BigEndTable(Table):
    """The rod's bearing on the crank pin."""

    diameter: f.OpenPositiveLength
    width: f.OpenPositiveLength

    @property
    def size(self) -> tuple[float, float]:
        """Diameter and width, where they start if they are open."""
        return Open.of(self.diameter).start, Open.of(self.width).start


class ShaftTable(Table):
    """A crankshaft of a free list of parts."""

    name: Name
    ratio: f.Ratio = 1.0
    position: f.Pair[f.Length] = f.needed("Position of the axis: y to the left, z up.")
    lead: f.OpenAngle = f.told("Crank angle by which all that it carries comes earlier.", 0.0)


class SliderCrankTable(Table):
    """One slider-crank of a free list of parts; what it leaves out it takes from [engine]."""

    x: f.Length
    bank_angle: f.Angle = f.told("Angle of the cylinder axis, from upright towards the left.", 0.0)
    throw: f.Angle = 0.0
    firing_angle: f.Angle | None = f.told("Crank angle at which it fires.")
    shaft: str = "crankshaft"
    stroke: f.PositiveLength | None = None
    bore: f.PositiveLength | None = None
    rod_ratio: f.NonNegative | None = None
    rod_length: f.PositiveLength | None = None
    offset: f.Length | None = None
    reciprocating_mass: f.OpenMass | None = None
    rotating_mass: f.Mass | None = None
    rod_inertia_deficit: f.Inertia | None = None


_KINDS: dict[str, Any] = {
    "length": f.Length,
    "positive length": f.PositiveLength,
    "non-negative length": f.NonNegativeLength,
    "angle": f.Angle,
    "open angle": f.OpenAngle,
    "open lead": f.OpenAngle,
    "angles": list[f.Angle],
    "mass": f.Mass,
    "inertia": f.Inertia,
    "open mass": f.OpenMass,
    "ratio": f.Positive,
    "cylinder": CylinderNumber,
    "sign": Literal[1, -1],
    "rod": RodTable,
}


def with_owned_keys(table: type[T]) -> type[T]:
    """[engine] with the names of all layouts and drives, and a key for every one that they own."""
    names: Any = tuple(LAYOUTS)
    drives: Any = tuple(DRIVES)
    fields: dict[str, Any] = {"layout": (Literal[names], ...), "drive": (Literal[drives], "slider-crank")}
    owned = [kind.keys for kind in LAYOUTS.values()] + [kind.keys for kind in DRIVES.values()]
    for key in (key for keys in owned for key in keys):
        kind = _KINDS[key.kind] if key.default is not None else _KINDS[key.kind] | None
        fields[key.name] = (kind, Field(default=key.default, description=key.description or None))
    return f.with_keys(table, fields)
