"""Numbers of Python calls as a problem file writes them: SI numbers get units, complex weights size and angle."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from typing import Any

from laufruhe.files.complaints import Refused, key_path
from laufruhe.files.fields import Number
from laufruhe.files.measures import EDGES
from laufruhe.files.nested import Place, at, number_at
from laufruhe.files.problem_file import file_model
from laufruhe.problem.measure import MEASURES, Measure

SIZES = ("mass", "unbalance")
"""Keys of weights that a complex number may give, with their angle (C4)."""
_TWO_TURNS = 4.0 * math.pi


def written(value: Any, place: Place, tables: Mapping[str, Any]) -> Any:
    """Return a value of a Python call as the file writes it at an address; `tables` contain it.

    Raises
    ------
    Refused
        If an angle is given in degrees without a unit, or a complex number at a key that is no size of a weight.
    """
    if isinstance(value, Mapping) and "between" not in value:
        table = {key: entry for key, entry in value.items() if entry is not None}
        for key in SIZES:
            if isinstance(table.get(key), complex):
                table |= sized(key, table[key], table.get("angle"), place)
        return {key: written(entry, (*place, key), tables) for key, entry in table.items()}
    if isinstance(value, Mapping):
        bounds = [written(bound, place, tables) for bound in value["between"]]
        start = {"start": written(value["start"], place, tables)} if "start" in value else {}
        return {**value, "between": bounds, **start}
    if isinstance(value, list):
        return [written(entry, (*place, k), tables) for k, entry in enumerate(value)]
    if isinstance(value, complex):
        rule = "is complex, and only the unbalance or mass of a weight has size and angle"
        raise Refused(key_path(place), value, rule, "give a real number")
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    number = number_at(file_model(), place)
    if number is not None and number.plain is not None:
        return _angle(value, number, place)
    unit = "" if number is None else number.unit
    if number is None and place[0] == "constraints" and len(place) > 2 and place[2] in EDGES:
        # the edges of a limit have the unit of its quantity
        quantity = at(tables, place[:2]).get("limit")
        unit = Measure(*MEASURES[quantity]).unit if quantity in MEASURES else ""
    return f"{value!r} {unit}" if unit else value


def sized(key: str, value: complex, angle: Any, place: Place) -> dict[str, float]:
    """Return size and angle [rad] of a complex weight by their keys."""
    if angle is not None:
        rule = "is complex and stands beside an angle"
        raise Refused(key_path((*place, key)), value, rule, "leave the angle out, or give the size alone")
    return {key: abs(value), "angle": cmath.phase(value)}


def _angle(value: float, number: Number, place: Place) -> float | str:
    """Return an angle [rad] in whole or decimal degrees if this is exact, else as text."""
    if (isinstance(value, int) and value) or abs(value) > _TWO_TURNS:
        what = "a whole number" if isinstance(value, int) else "more than two turns"
        rule = f"is {what}, and angles without a unit are in radians"
        raise Refused(key_path(place), value, rule, f'write "{value:g} deg" or numpy.radians({value:g})')
    if not math.isfinite(value):
        return value
    degrees = round(math.degrees(value), 9)
    degrees = int(degrees) if degrees.is_integer() else degrees
    return degrees if degrees * (number.plain or 1.0) == value else f"{value!r} rad"
