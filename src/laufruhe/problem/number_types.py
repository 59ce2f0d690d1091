"""Types of the numbers that Python calls take: SI numbers, texts and quantities with units, open numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, Required, TypeAlias, TypedDict

import numpy as np
from numpy.typing import NDArray


class Quantity(Protocol):
    """Number or array with a unit, such as a quantity of pint."""

    @property
    def magnitude(self) -> Any:
        """Number or array without its unit."""

    @property
    def units(self) -> Any:
        """Unit; its format "~C" is a short text."""


Number: TypeAlias = float | str | np.number[Any] | Quantity
"""Number in SI units (angles in radians), text with a unit such as "86 mm", or quantity with a unit."""


class Open(TypedDict, total=False):
    """Open number: bounds, start value and tolerance of built engines."""

    between: Required[list[Number]]
    start: Number
    tolerance: str


Value: TypeAlias = Number | Open
"""Number that may be open."""
Array: TypeAlias = NDArray[Any] | Quantity
"""Array of numbers in SI units, or array with a unit."""
Values: TypeAlias = Sequence[Value] | Array
"""Numbers, of which some may be open."""
Table: TypeAlias = Mapping[str, Any]
"""Table of a problem file; `laufruhe.tables` has a function for each."""


def open_number(low: Number, high: Number, start: Number | None = None, tolerance: str | None = None) -> Open:
    """Return an open number, to stand in place of any number that may be decided.

    Parameters
    ----------
    low, high
        Bounds.
    start
        Value in the initial design; by default zero or the bound nearest to it.
    tolerance
        Deviation of built engines, such as "± 2 %".

    Examples
    --------
    >>> import laufruhe
    >>> laufruhe.open("0 kg m", "0.05 kg m")
    {'between': ['0 kg m', '0.05 kg m']}
    """
    number: Open = {"between": [low, high]}
    if start is not None:
        number["start"] = start
    if tolerance is not None:
        number["tolerance"] = tolerance
    return number
