"""[quantities] of a problem file: numbers that determine several other numbers of the file.

Each quantity has a class. It sets the numbers that follow from it before the engine is built. An open quantity is a
decision like any number of the file.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from pydantic import Field, create_model

from laufruhe.extension import extended
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, key_path, read_number
from laufruhe.files.nested import Place, at, with_value_at
from laufruhe.problem.decision import AddressDrive


class Quantity(ABC):
    """Number of [quantities], such as stroke over bore, that determines several other numbers of the file.

    Attributes
    ----------
    name
        Key in [quantities].
    unit
        SI unit of the quantity, empty for a plain number.
    words
        Description for editors.
    follow
        Addresses of the numbers that follow from it, with the SI unit of each.
    """

    name: ClassVar[str]
    unit: ClassVar[str] = ""
    words: ClassVar[str]
    follow: ClassVar[Mapping[Place, str]]

    @abstractmethod
    def values(self, value: float, followers: Mapping[Place, float]) -> Mapping[Place, float]:
        """Return the numbers that follow from the value of the quantity and from their values in the file [SI]."""


class StrokeOverBore(Quantity):
    """Ratio of stroke to bore at constant displacement."""

    name = "stroke_over_bore"
    words = "Ratio of stroke to bore; both follow at the displacement that engine.stroke and engine.bore give."
    follow: ClassVar[Mapping[Place, str]] = {("engine", "stroke"): "m", ("engine", "bore"): "m"}

    def values(self, value: float, followers: Mapping[Place, float]) -> Mapping[Place, float]:
        """Return stroke s and bore b with s / b = value and s b^2 as in the file [m]."""
        stroke, bore = followers["engine", "stroke"], followers["engine", "bore"]
        new_bore = math.cbrt(stroke * bore**2 / value)
        return {("engine", "stroke"): value * new_bore, ("engine", "bore"): new_bore}


QUANTITIES: Mapping[str, Quantity] = extended("quantities", Quantity, (StrokeOverBore(),))
_NUMBERS = {name: f.Number(one.unit, above=0.0) for name, one in QUANTITIES.items()}
_KEYS: dict[str, Any] = {
    name: (Annotated[float, _NUMBERS[name]] | None, Field(default=None, description=one.words))
    for name, one in QUANTITIES.items()
}
QuantitiesTable = create_model(
    "QuantitiesTable", __base__=f.Table, __doc__="Numbers that several numbers of the file follow.",
    __module__=__name__, **_KEYS,
)  # fmt: skip


def with_followers(tables: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the tables with the numbers that the quantities of [quantities] determine.

    Raise `Refused` if a quantity cannot be read.
    """
    quantities = tables.get("quantities")
    if not isinstance(quantities, Mapping):
        return tables
    for name, quantity in QUANTITIES.items():
        if name in quantities:
            value = read_number(_NUMBERS[name], ("quantities", name), quantities[name])
            assert isinstance(value, float)
            followers = {place: _follower(tables, place, unit, name) for place, unit in quantity.follow.items()}
            for place, number in quantity.values(value, followers).items():
                tables = with_value_at(tables, place, AddressDrive(place, quantity.follow[place]).written(number))
    return tables


def _follower(tables: Mapping[str, Any], place: Place, unit: str, name: str) -> float:
    try:
        number = at(tables, place)
    except (TypeError, KeyError, IndexError, AttributeError):
        number = None
    if number is None or isinstance(number, Mapping | list):
        rule = f"must be a number, because it follows from quantities.{name}"
        raise Refused(key_path(place), number, rule, "give a number, or remove it from [quantities]")
    value = read_number(f.Number(unit), place, number)
    assert isinstance(value, float)
    return value
