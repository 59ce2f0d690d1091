"""Numbers and units as text."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from laufruhe.units import is_shown, readable, usual_unit

if TYPE_CHECKING:
    from laufruhe.solvers.values import DecisionValue, LimitValue

DASH = "-"
RPM, DEGREE = readable("rad/s")[1], readable("rad")[1]
"""Factors on rad/s and on rad."""
ROUNDS_TO_ZERO = 1e-9


def number(value: float, digits: int = 4, scale: float = 0.0) -> str:
    """Return a number with `digits` figures, if possible without an exponent; rounding errors of `scale` become 0."""
    if not math.isfinite(value):
        return DASH
    if value == 0.0 or abs(value) <= ROUNDS_TO_ZERO * scale:
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
    return fixed(value, digits - 1 - math.floor(math.log10(largest)))


def fixed(value: float, decimals: int, sign: str = "") -> str:
    """Return a number with fixed decimals; 0 where all figures are zero. With `sign` "+", all others have a sign."""
    text = f"{value:{sign}.{decimals}f}"
    return text if float(text) else "0"


def trimmed(value: float, digits: int = 4) -> str:
    """Return a number as `number` does, without trailing zeros."""
    text = number(value, digits)
    return text.rstrip("0").rstrip(".") if "." in text and "e" not in text else text


def with_unit(value: float, unit: str) -> str:
    """Return a value in readable units: 90 deg, 2500 rpm, 1.25 kg."""
    name, factor = readable(unit, usual_unit(value, unit))
    return f"{trimmed(value * factor)} {name}".rstrip()


def between(lower: float, upper: float, unit: str) -> str:
    """Return the bounds of a number with their unit."""
    name, factor = readable(unit)
    return f"{trimmed(lower * factor)} to {trimmed(upper * factor)} {name}".rstrip()


def figure(value: float, unit: str, digits: int = 4, scale: float = 0.0) -> str:
    """Return a number as `number` does, in readable units with the unit's name."""
    name, factor = readable(unit, usual_unit(value, unit))
    return f"{number(value * factor, digits, scale * factor)} {name}".rstrip()


_WORKSHOP = {"kg": ("g", 1e3), "kg m": ("g mm", 1e6)}


def in_grams(value: float, unit: str, scale: float) -> str:
    """Return a mass or an unbalance once more in workshop units, as " = 12 g" or " = 30 g mm".

    The text is empty for other units, for values that are zero by rounding of `scale`, from a million on, and if the
    user chose a unit.
    """
    name, factor = _WORKSHOP.get(unit, ("", 0.0))
    if not name or is_shown(unit) or not ROUNDS_TO_ZERO * scale < abs(value) < 1e6 / factor:
        return ""
    return f" = {number(value * factor)} {name}"


def percent(share: float) -> str:
    """Return a relative change in percent, with sign."""
    return f"{fixed(100.0 * share, 1, '+')} %" if math.isfinite(share) else DASH


def share(value: float, digits: int = 2) -> str:
    """Return a share in percent."""
    return f"{trimmed(100.0 * value, digits)} %"


def price_of(price: float, unit: str, limit_unit: str, with_zero: bool = False) -> str:
    """Return a shadow price in readable units, such as N per kg; a dash for zero unless `with_zero`."""
    if math.isnan(price):
        return "not known"
    if not price and not with_zero:
        return DASH
    (name, factor), (limit_name, limit_factor) = readable(unit), readable(limit_unit)
    units = f"{name} per {limit_name}".strip() if limit_name else name
    return f"{number(price * factor / limit_factor)} {units}".rstrip()


def prices_of(priced: LimitValue | DecisionValue, unit: str, with_zero: bool = False) -> str:
    """Return the shadow price of a limit or bound, and the price of tightening it if that differs."""
    tightening = priced.tightening_price
    if tightening is None or math.isnan(tightening):
        return price_of(priced.shadow_price, unit, priced.unit, with_zero)
    relaxed = price_of(priced.shadow_price, unit, priced.unit, with_zero=True)
    tightened = "no design" if math.isinf(tightening) else price_of(tightening, unit, priced.unit, with_zero=True)
    return f"{relaxed} / {tightened}"
