"""Numbers and units as an engineer reads them."""

from __future__ import annotations

import math
from typing import Protocol

from laufruhe.units import readable

DASH = "-"
RPM, DEGREE = readable("rad/s")[1], readable("rad")[1]
"""Factors on rad/s and on rad."""
NOTHING = 1e-9


def number(value: float, digits: int = 4, scale: float = 0.0) -> str:
    """Return a number with `digits` figures, without an exponent where possible.

    Parameters
    ----------
    scale
        Reference size: numbers that are a rounding of it become 0.
    """
    if not math.isfinite(value):
        return DASH
    if value == 0.0 or abs(value) <= NOTHING * scale:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if not -4 <= size <= 6:
        return f"{value:.{digits - 1}e}"
    # rounding may add a figure: 999.96 becomes 1000
    size = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    return f"{value:.{max(digits - 1 - size, 0)}f}"


def aligned(value: float, largest: float, digits: int = 5) -> str:
    """Return a number with as many decimals as the largest of its column needs for `digits` figures."""
    if value == 0.0 or largest <= 0.0 or not math.isfinite(largest) or not -4 <= math.log10(largest) < digits:
        return number(value, scale=largest)
    return f"{value:.{digits - 1 - math.floor(math.log10(largest))}f}"


def trimmed(value: float, digits: int = 4) -> str:
    """Return a number as `number` does, without trailing zeros."""
    text = number(value, digits)
    return text.rstrip("0").rstrip(".") if "." in text and "e" not in text else text


def with_unit(value: float, unit: str) -> str:
    """Return a value in readable units: 90 deg, 2500 rpm, 1.25 kg."""
    name, factor = readable(unit)
    return f"{trimmed(value * factor)} {name}".rstrip()


def figure(value: float, unit: str, digits: int = 4, scale: float = 0.0) -> str:
    """Return a number as `number` does, in readable units with the unit's name."""
    name, factor = readable(unit)
    return f"{number(value * factor, digits, scale * factor)} {name}".rstrip()


_WORKSHOP = {"kg": ("g", 1e3), "kg m": ("g mm", 1e6)}


def in_grams(value: float, unit: str, scale: float) -> str:
    """Return " = " and a mass in g or an unbalance in g mm; empty for other units."""
    if unit not in _WORKSHOP or abs(value) <= NOTHING * scale:
        return ""
    name, factor = _WORKSHOP[unit]
    return f" = {number(value * factor)} {name}"


def percent(share: float) -> str:
    """Return a relative change in percent, with sign."""
    return f"{100.0 * share:+.1f} %" if math.isfinite(share) else DASH


def share(value: float, digits: int = 2) -> str:
    """Return a share in percent."""
    return f"{trimmed(100.0 * value, digits)} %"


def price_of(price: float, unit: str, of: str, counts: bool = False) -> str:
    """Return a shadow price in readable units, such as N per kg; a dash for zero unless `counts`."""
    if math.isnan(price):
        return "not known"
    if not price and not counts:
        return DASH
    (name, factor), (of_name, of_factor) = readable(unit), readable(of)
    units = f"{name} per {of_name}".strip() if of_name else name
    return f"{number(price * factor / of_factor)} {units}".rstrip()


class Priced(Protocol):
    """A limit or a bound with a price on either side."""

    @property
    def unit(self) -> str:
        """Unit of the priced number."""

    @property
    def shadow_price(self) -> float:
        """Price of relaxing the edge."""

    @property
    def tightening_price(self) -> float | None:
        """Price of tightening the edge, if it differs."""


def prices_of(priced: Priced, unit: str, counts: bool = False) -> str:
    """Return the shadow price of a limit or bound, and the price of tightening it if that differs."""
    other = priced.tightening_price
    if other is None or math.isnan(other):
        return price_of(priced.shadow_price, unit, priced.unit, counts)
    relaxed = price_of(priced.shadow_price, unit, priced.unit, counts=True)
    tightened = "no design" if math.isinf(other) else price_of(other, unit, priced.unit, counts=True)
    return f"{relaxed} / {tightened}"
