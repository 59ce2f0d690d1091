"""[quantities] of a problem file: numbers that several numbers of the file follow, one class each.

A quantity sets the numbers that follow it before the engine is assembled. An open quantity is a decision like any
number of the file.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from pydantic import Field, create_model

from laufruhe.extension import extended
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, key_path, number_read
from laufruhe.files.nested import Place, at, put
from laufruhe.problem.decision import AddressDrive


class Quantity(ABC):
    """Number that several numbers of the file follow.

    Attributes
    ----------
    name
        Key in [quantities].
    unit
        SI unit of the quantity, empty for a plain number.
    words
        Description for editors.
    follow
        Places of the numbers that follow it, and the SI unit of each.
    """

    name: ClassVar[str]
    unit: ClassVar[str] = ""
    words: ClassVar[str]
    follow: ClassVar[Mapping[Place, str]]

    @abstractmethod
    def values(self, value: float, given: Mapping[Place, float]) -> Mapping[Place, float]:
        """Return the numbers that follow [SI] from the quantity and from what the file gives for them."""


class StrokeOverBore(Quantity):
    """Ratio of stroke to bore at the displacement that the file gives."""

    name = "stroke_over_bore"
    words = "Ratio of stroke to bore; both follow at the displacement that engine.stroke and engine.bore give."
    follow: ClassVar[Mapping[Place, str]] = {("engine", "stroke"): "m", ("engine", "bore"): "m"}

    def values(self, value: float, given: Mapping[Place, float]) -> Mapping[Place, float]:
        """Return stroke and bore: s b^2 stays, s = value b."""
        stroke, bore = given["engine", "stroke"], given["engine", "bore"]
        own = math.cbrt(stroke * bore**2 / value)
        return {("engine", "stroke"): value * own, ("engine", "bore"): own}


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


def followed(tables: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the tables with every number that follows a quantity of [quantities] in its place.

    Raises
    ------
    Refused
        If a number that has to follow is not given, or cannot be read.
    """
    quantities = tables.get("quantities")
    if not isinstance(quantities, Mapping):
        return tables
    for name, quantity in QUANTITIES.items():
        if name in quantities:
            value = number_read(_NUMBERS[name], ("quantities", name), quantities[name])
            assert isinstance(value, float)
            given = {place: _given(tables, place, unit, name) for place, unit in quantity.follow.items()}
            for place, number in quantity.values(value, given).items():
                tables = put(tables, place, AddressDrive(place, quantity.follow[place]).written(number))
    return tables


def _given(tables: Mapping[str, Any], place: Place, unit: str, name: str) -> float:
    try:
        number = at(tables, place)
    except (TypeError, KeyError, IndexError, AttributeError):
        number = None
    if number is None or isinstance(number, Mapping | list):
        rule = f"follows quantities.{name}, and is not given as a number"
        raise Refused(key_path(place), number, rule, "give it, or leave the quantity out")
    value = number_read(f.Number(unit), place, number)
    assert isinstance(value, float)
    return value
