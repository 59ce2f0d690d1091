"""Units of input and output (C1): text with a unit to SI, and SI to text."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pint

LONGEST = 100
"""Largest number of characters of a number with its unit."""
MAX_FACTORS = 12
"""Largest number of names in one unit."""
_QUANTITY = re.compile(
    r"^\s*(?P<sign>[+-]?)(?:(?P<whole>\d+)\s+(?=\d+/\d))?(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"(?:/(?P<divisor>\d+))?\s*(?P<unit>[A-Za-z°µ%][\w°µ%/*^ .·⁻-]*|(?:1 ?)?/ ?min|[\"″])?\s*$"
)
"""Number with a unit; 3 5/16 is a whole number and a fraction."""
_RATIO = re.compile(r"(?<=\d) ?: ?(?=\d)")
"""Sign of division in a ratio such as 10:1."""
ATMOSPHERE = 101_325.0
"""Standard pressure of the air [Pa]."""
_MARKED = re.compile(
    r"^\s*(?P<number>\d+\.?\d*|\.\d+)\s*(?P<unit>m?bar|psi|[kM]?Pa|kp/cm\^?2|at(?=ü))\s*"
    r"\(?(?:(?P<gauge>g|gauge|ü|überdruck)|a|abs|absolute)\.?\)?\s*$",
    re.IGNORECASE,
)
"""Pressure with a mark behind its unit, as in bar(g), psia or bar gauge."""
DECIMAL_COMMA = re.compile(r"^\s*[+-]?\d*,\d+(?![\d,.])(?P<end>\s*$)?")
"""Number with a decimal comma, which has an end if nothing follows."""
THOUSANDS = re.compile(r"^\s*[+-]?[1-9]\d{0,2},\d{3}(?!\d)")
"""Number with a comma that may separate thousands."""
# cm2 is read as cm^2; the digit of H2O is no power
_POWER = re.compile(r"(?<=[a-z])([23])\b")
# lb-ft is a product; the minus of min-1 stands before a digit
_HYPHEN = re.compile(r"(?<=[a-z])-(?=[a-z])")
_NAME = r"(?!\d)(?:(?![⁰¹²³⁴-⁹])[\w°%])+"
_POWERED = rf"{_NAME}(?:⁻?[⁰¹²³⁴-⁹]| ?(?:\^|\*\*) ?-?[0-9](?:\.[0-9]{{1,3}})?)?"
_PRODUCT = re.compile(rf"{_POWERED}(?:(?: ?[*/.] ?| +){_POWERED}){{,{MAX_FACTORS - 1}}}")
"""Unit as a product of names and powers below ten; the registry would evaluate other texts as expressions."""
_OF_ANGLES = ("rad", "rad/s", "N m/rad", "N m s/rad")
# full names of units of angle
_TURNING = re.compile("radian|degree|turn|revolution|arcminute|arcsecond|grad")
_DEFINITIONS = (
    "@alias kilogram_force = kp = kilopond",
    "newton_metre = newton * meter = Nm",
    "@alias pound = lbm",
    "metric_pound = 500 * gram",
    "pferdestaerke = 75 * kilogram_force * meter / second = PS",
)

_SPELLINGS: dict[str, dict[str, str]] = {
    "m": dict.fromkeys(("Zoll", '"', "″"), "inch"),
    "kg": {"Pfund": "metric_pound"},
    "W": dict.fromkeys(("HP", "bhp"), "hp"),
    "kg m": {"kgm": "kg m", "kgcm": "kg cm", "kgmm": "kg mm", "gcm": "g cm", "gmm": "g mm", "ozin": "oz in"},
    "kg m^2": {"kgm^2": "kg m^2", "kgm2": "kg m^2", "kgcm^2": "kg cm^2", "kgcm2": "kg cm^2", "kgmm^2": "kg mm^2"},
    "N": {"lb": "lbf", "lbs": "lbf"},
    "Pa": {"PSI": "psi", "kg/cm^2": "kgf/cm^2", "kg/cm2": "kgf/cm^2", "Torr": "torr", "ata": "at"},
    "N m": {
        **dict.fromkeys(("lb ft", "ft lb", "lbft", "ftlb"), "lbf ft"),
        **dict.fromkeys(("lb in", "in lb"), "lbf in"),
        **dict.fromkeys(("mkp", "kpm", "mkg"), "kp m"),
    },
    "N/m": {"lb/in": "lbf/in", "lbs/in": "lbf/in"},
    "rad": dict.fromkeys(("Grad", "°KW", "°CA"), "deg"),
    "rad/s": {
        **dict.fromkeys(
            ("RPM", "U/min", "r/min", "rev/min", "1/min", "/min", "min^-1", "min-1", "min⁻¹", "Upm", "upm"), "rpm"
        ),
        **dict.fromkeys(("Hz", "rps", "rev/s", "r/s", "U/s"), "turn/s"),
    },
}
"""Spellings of units in the trade, by SI unit: those that the registry does not know or reads as another unit."""

COMMON = {
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2},
    "kg": {"kg": 1.0, "g": 1e-3},
    "kg m": {"kg m": 1.0, "kg mm": 1e-3, "g m": 1e-3, "g cm": 1e-5, "g mm": 1e-6},
    "kg m^2": {"kg m^2": 1.0, "kg cm^2": 1e-4},
    "Pa": {"Pa": 1.0, "bar": 1e5, "kp/cm^2": 98066.5, "kPa": 1e3, "MPa": 1e6, "mbar": 1e2, "psi": 6894.7572931683635,
           "N/mm^2": 1e6},
    "N": {"N": 1.0, "kN": 1e3, "kp": 9.80665},
    "N m": {"N m": 1.0, "kN m": 1e3},
    "W": {"W": 1.0, "kW": 1e3},
    "N m/rad": {"N m/rad": 1.0},
    "N m s/rad": {"N m s/rad": 1.0},
    "N s/m": {"N s/m": 1.0},
    "kg/m^3": {"kg/m^3": 1.0},
    "N/m": {"N/m": 1.0, "N/mm": 1e3, "kN/mm": 1e6},
    "Hz": {"Hz": 1.0},
    "rad": {"rad": 1.0, "deg": math.radians(1.0)},
    "rad/s": {"rad/s": 1.0, "rpm": math.tau / 60.0, "Hz": math.tau},
    "m/s": {"m/s": 1.0},
    "m/s^2": {"m/s^2": 1.0},
    "s": {"s": 1.0, "ms": 1e-3},
    "": {"%": 1e-2},
}  # fmt: skip
"""SI values of frequent units by SI unit; for these the registry, which takes long to load, is not needed."""
_COMMON_UNITS = {unit for units in COMMON.values() for unit in units}


class UnitError(ValueError):
    """Text that is no number with a unit of the required dimension; rule and remedy, separated by '; '."""


class GaugePressureError(UnitError):
    """Pressure above that of the air, with the same number as a mean pressure.

    Attributes
    ----------
    absolute, mean
        Rule and remedy for a key that is an absolute pressure, and for one that is a mean effective pressure.
    """

    def __init__(self, absolute: str, mean: str) -> None:
        super().__init__(f"{absolute}, or {mean} for a mean pressure")
        self.absolute = absolute
        self.mean = f"is a gauge pressure, and a mean effective pressure counts from no other; write {mean}"


@cache
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    registry: pint.UnitRegistry[Any] = pint.UnitRegistry()
    for definition in _DEFINITIONS:
        registry.define(definition)
    return registry


@cache
def _factor(unit: str, si_unit: str) -> float:
    """Return the SI value of one `unit`, in the dimension of `si_unit`."""
    unit = _HYPHEN.sub(" ", unit)
    unit = _SPELLINGS.get(si_unit, {}).get(unit) or _POWER.sub(r"^\1", unit).replace("·", "*")
    if si_unit == "Hz" and "Hz" not in unit:
        # radians have no dimension, so rpm would pass for a frequency 2 pi too high
        raise UnitError(f"'{unit}' is no frequency in Hz; {advice(si_unit)}")
    wrong_dimension = UnitError(f"'{unit}' is not a unit of {dimension_name(si_unit)}; {_in_units(si_unit)}")
    if si_unit in COMMON and unit in _COMMON_UNITS:
        if unit not in COMMON[si_unit]:
            raise wrong_dimension
        return COMMON[si_unit][unit]
    unknown = UnitError(f"unit '{unit}' is not known; {_in_units(si_unit)}")
    if _PRODUCT.fullmatch(unit) is None:
        raise unknown
    registry = _registry()
    try:
        parsed = registry.parse_units(unit)
        unit_quantity = registry.Quantity(1.0, parsed)
        target = registry.parse_units(si_unit) if si_unit else registry.dimensionless
        ratio = float(unit_quantity.to(target).magnitude)
        doubled = float((2.0 * unit_quantity).to(target).magnitude)
    except Exception as error:
        # the registry and its tokenizer raise many kinds of errors
        if type(error).__name__ == "DimensionalityError":
            raise wrong_dimension from None
        raise unknown from None
    if (_TURNING.search(str(parsed)) is not None) != (si_unit in _OF_ANGLES):
        # a radian has no dimension, so 50 Hz would pass for 50 rad/s and 15 deg for a ratio
        raise wrong_dimension
    if not math.isclose(doubled, 2.0 * ratio):
        raise UnitError(f"'{unit}' is a scale with its own zero; {advice(si_unit)}")
    return ratio


def quantity(value: float, unit: str, target: Any = "") -> pint.Quantity[float]:
    """Return an SI value as a quantity, in the unit `target` if given.

    `target` is a text, or a unit of the caller's registry; by default the quantity is of the application's registry.
    """
    import pint

    of_application: Any = pint.application_registry
    registry = getattr(target, "_REGISTRY", of_application)
    result: pint.Quantity[float] = registry.Quantity(value, unit or "dimensionless")
    return result.to(target) if target else result


_EXAMPLES = {
    "m": ("a length", "120 mm"),
    "kg": ("a mass", "1.25 kg"),
    "kg m": ("an unbalance", "0.02 kg m"),
    "kg m^2": ("a moment of inertia", "4.2 kg cm^2"),
    "Pa": ("a pressure", "5.5 kp/cm^2"),
    "N": ("a force", "900 N"),
    "N m": ("a moment", "120 N m"),
    "N/s": ("a rate of force", "2e6 N/s"),
    "J": ("an energy", "432 J"),
    "kg/m^3": ("a density", "7250 kg/m^3"),
    "N/m": ("a stiffness", "300 N/mm"),
    "N m/rad": ("a torsional stiffness", "1.2e6 N m/rad"),
    "N m s/rad": ("a torsional damping", "2 N m s/rad"),
    "W": ("a power", "500 W"),
    "N s/m": ("a viscous damping", "800 N s/m"),
    "Hz": ("a frequency", "12 Hz"),
    "rad": ("an angle", "90 deg"),
    "rad/s": ("a speed of rotation", "2500 rpm"),
    "m/s": ("a speed", "10 m/s"),
    "m/s^2": ("an acceleration", "10 m/s^2"),
    "s": ("a time", "60 s"),
    "A": ("a current", "170 A"),
    "ohm": ("a resistance", "0.02 ohm"),
    "N m/A": ("a torque over current", "0.35 N m/A"),
    "": ("a plain number", "0.26"),
}


def dimension_name(unit: str) -> str:
    """Return the name of the dimension of an SI unit, with article: "a length"."""
    return _EXAMPLES.get(unit, (f"the dimension of {unit}", ""))[0]


def unit_of_dimension(name: str) -> str:
    """Return the SI unit of a dimension by its name with article."""
    return next(unit for unit, (dimension, _) in _EXAMPLES.items() if dimension == name)


def example(unit: str) -> str:
    """Return an example of a value in the dimension of an SI unit: "120 mm"."""
    return _EXAMPLES.get(unit, ("", f"1 {unit}"))[1]


def advice(unit: str) -> str:
    """Return the remedy for a wrong value in the dimension of an SI unit: an example."""
    return f"write for example {_written(example(unit), unit)}"


def _written(text: str, unit: str) -> str:
    return f'"{text}"' if unit else text


def usual(unit: str) -> str:
    """Return frequent units in the dimension of an SI unit, joined by commas."""
    return ", ".join(COMMON.get(unit) or [example(unit).partition(" ")[2]])


def _in_units(unit: str) -> str:
    return f"{advice(unit)}, in {usual(unit)} ..." if unit else advice(unit)


def parse(text: str, unit: str) -> float:
    """Return the SI value of a text such as '120 mm'; `UnitError` unless it has the dimension of the SI unit `unit`."""
    text = text if unit else _RATIO.sub("/", text)
    match = _QUANTITY.match(text) if len(text) <= LONGEST else None
    if unit == "Pa" and (marked := _MARKED.match(text[:LONGEST])):
        _refuse_mark(**marked.groupdict())
    if match is None and (comma := DECIMAL_COMMA.match(text[:LONGEST])):
        has_unit = comma["end"] is None or not unit
        end = "" if has_unit else f" {example(unit).partition(' ')[2]}"
        point, without_comma = (_written(text.replace(",", mark, 1).strip() + end, unit) for mark in (".", ""))
        either = f"{without_comma} or {point}" if THOUSANDS.match(text) else point
        raise UnitError(f"has a comma, and decimals follow a point; write {'' if has_unit else 'for example '}{either}")
    if match is None:
        raise UnitError(f"is not a number{' with a unit' * bool(unit)}; {advice(unit)}")
    name, below = match["unit"], float(match["divisor"] or 1)
    if below == 0.0:
        raise UnitError(f"divides by zero; {advice(unit)}")
    value = float(f"{match['sign']}1") * (float(match["whole"] or 0) + float(match["number"]) / below)
    if name is None and unit:
        raise UnitError(f"has no unit, {dimension_name(unit)} needs one; {advice(unit)}")
    value *= _factor(name.strip(), unit) if name else 1.0
    if not math.isfinite(value) or not math.isfinite(below):
        raise UnitError(f"is not finite; {advice(unit)}")
    return value


def _refuse_mark(number: str, unit: str, gauge: str | None) -> None:
    # the unit of the pressure is marked as that of a gauge or as absolute
    plain = f'"{number} {unit}"'
    if not gauge:
        raise UnitError(f"has a mark, and pressures are absolute without one; write {plain}")
    bars = 1e-5 * (float(number) * _factor(unit, "Pa") + ATMOSPHERE)
    raise GaugePressureError(f'is a gauge pressure, above that of the air; write "{bars:.4g} bar"', plain)


def unit_of(text: str) -> str:
    """Return the unit in a text such as '120 mm'; empty if there is none."""
    match = _QUANTITY.match(text)
    return (match["unit"] or "").strip() if match else ""


def dimension_of(text: str) -> str | None:
    """Return the SI unit for the dimension of a text such as '12 Hz'; None if it is no number with a known unit."""
    # the dimension of a frequent unit is found without the registry
    for unit in sorted(_EXAMPLES, key=lambda unit: unit_of(text) not in COMMON.get(unit, ())):
        with suppress(UnitError):
            parse(text, unit)
            return unit
    return None


_LENGTH, _MASS, _FORCE = "(?:[nµumcdk]?m|in|inch|ft)", "(?:[mkM]?g|t|lbm?|oz)", "(?:[mkM]?N|k?p|kgf|lbf)"
_BY, _OVER, _SQUARE = r"(?: ?[*·.] ?| |-)", " ?/ ?", r"(?:\^|\*\*)?2"
_WRITTEN = {
    "m": _LENGTH,
    "kg": _MASS,
    "kg m": f"{_MASS}{_BY}{_LENGTH}",
    "kg m^2": f"{_MASS}{_BY}{_LENGTH}{_SQUARE}",
    "Pa": f"[hkMG]?Pa|m?bar|psi|atm?|{_FORCE}{_OVER}{_LENGTH}{_SQUARE}",
    "N": _FORCE,
    "N m": f"[kM]?Nm|{_FORCE}{_BY}{_LENGTH}",
    "N/m": f"{_FORCE}{_OVER}{_LENGTH}",
    "N s/m": f"{_FORCE}{_BY}s{_OVER}{_LENGTH}|{_MASS}{_OVER}s",
    "N m/rad": f"(?:[kM]?Nm|{_FORCE}{_BY}{_LENGTH}){_OVER}(?:rad|deg)",
    "N m s/rad": f"(?:[kM]?Nm|{_FORCE}{_BY}{_LENGTH}){_BY}s{_OVER}(?:rad|deg)",
    "W": "[mkM]?W|PS|hp",
    "J": f"[mkM]?J|[kM]?Nm|{_FORCE}{_BY}{_LENGTH}",
    "kg/m^3": rf"{_MASS}{_OVER}{_LENGTH}(?:\^|\*\*)?3",
    "Hz": "[kM]?Hz",
    "rad": "m?rad|radians?|deg|degrees?|°|turns?",
    "rad/s": "rpm|(?:rad|deg|turns?|revolutions?) ?/ ?(?:s|min)",
    "m/s": f"(?:{_LENGTH}) ?/ ?(?:s|min|h)",
    "m/s^2": f"{_LENGTH}{_OVER}s(?:\\^|\\*\\*)?2",
    "s": "[nµum]?s|min|minutes?|h|hours?",
    "A": "[mk]?A",
    "ohm": "[mk]?ohm",
    "N m/A": f"(?:[kM]?Nm|{_FORCE}{_BY}{_LENGTH}){_OVER}[mk]?A",
}
_NUMBER = r"[+-]?(?:[0-9]+ +[0-9]+/[0-9]+|(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?(?:/[0-9]+)?)"


def pattern(unit: str) -> str:
    """Return the regular expression of a number with a unit in the dimension of an SI unit, for editors."""
    spellings = "".join(f"|{re.escape(spelling)}" for spelling in _SPELLINGS.get(unit, ()))
    return f"^ *{_NUMBER} *(?:{_WRITTEN[unit]}{spellings}) *$"


_UNITS = {
    "rad": ("deg", math.degrees(1.0)),
    "rad/s": ("rpm", 30.0 / math.pi),
    "m": ("mm", 1e3),
    "N/m": ("N/mm", 1e-3),
    "N/s": ("kN/s", 1e-3),
    "Pa": ("N/mm^2", 1e-6),
}


SLOW = 0.1
"""Velocity below which reports use mm/s [m/s]."""
_preferences: ContextVar[Mapping[str, str]] = ContextVar("units", default=MappingProxyType({}))


@contextmanager
def shown_in(units: Mapping[str, str]) -> Iterator[None]:
    """Let `readable` return other units within the block, by SI unit: those that a user wants to read."""
    token = _preferences.set(units)
    try:
        yield
    finally:
        _preferences.reset(token)


def readable(unit: str, usual: str = "") -> tuple[str, float]:
    """Return the unit of reports for an SI unit, with powers as printed, and the factor on an SI value.

    The unit is that of `shown_in`, else `usual`, else the usual one of reports.
    """
    name, factor = _UNITS.get(unit, (unit, 1.0))
    if other := _preferences.get().get(unit, usual):
        name, factor = other, 1.0 / _factor(other, unit)
    return name.replace("^2", "²").replace("^3", "³"), factor


def readable_unbalance(largest: float) -> tuple[str, float]:
    """Return the unit of reports for unbalances up to the largest one [kg m], and the factor: g mm, or kg m from 1."""
    return readable("kg m", "g mm" if largest < 1.0 else "kg m")


def usual_unit(value: float, unit: str) -> str:
    """Return the unit of reports for a value of this size: mm/s below 0.1 m/s, else empty for the usual one."""
    return "mm/s" if unit == "m/s" and abs(value) < SLOW else ""


def is_shown(unit: str) -> bool:
    """Return True if a user wants to read an SI unit in a unit of his own."""
    return unit in _preferences.get()


def quantity_text(value: float, unit: str, digits: int = 4) -> str:
    """Return an SI value as text with a common unit that files accept: degrees, mm, rpm, N/mm^2."""
    name, factor = _UNITS.get(unit, (unit, 1.0))
    return f"{value * factor:.{digits}g} {name}".rstrip()
