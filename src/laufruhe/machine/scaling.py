"""Parts of similar engines: all lengths and all masses multiplied by a factor each."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

T = TypeVar("T")


def scale_part(part: T, length: float, mass: float) -> T:
    """Return a part of an engine, and the parts in it, with lengths and masses multiplied by these factors.

    `powers` of a class has the powers of mass and length in the unit of a number, by its name; other numbers stay.
    """

    def scaled(value: Any, power: tuple[float, float] | None) -> Any:
        if isinstance(value, tuple):
            return tuple(scaled(entry, power) for entry in value)
        if is_dataclass(value):
            return scale_part(value, length, mass)
        if power is None or not isinstance(value, int | float | complex):
            return value
        return value * mass ** power[0] * length ** power[1]

    thing: Any = part
    powers = getattr(part, "powers", {})
    numbers = {one.name: scaled(getattr(part, one.name), powers.get(one.name)) for one in fields(thing) if one.init}
    changed: T = replace(thing, **numbers)
    return changed
