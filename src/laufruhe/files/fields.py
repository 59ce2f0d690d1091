"""Field types of problem files: numbers with units, and open numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    PlainValidator,
    TypeAdapter,
    WithJsonSchema,
    create_model,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from laufruhe import units
from laufruhe.errors import refused
from laufruhe.extension import HOMES, is_installed, missing_extension
from laufruhe.machine.crank_names import CRANKS
from laufruhe.problem.decision import Decision, Drive
from laufruhe.problem.sets import Interval

# SI; squares and products of numbers between these stay finite and nonzero
SMALLEST, LARGEST = 1e-40, 1e12
# ratios are fractions with a denominator of at most a thousand
SLOWEST = 1e-3

_JOINED = re.compile(r"\s*\d+(?:\s*[-–,;/ ]\s*\d+)+\s*")
"""Whole numbers in a row, as firing orders are written: 1-3-4-2."""

T = TypeVar("T")
TableModel = TypeVar("TableModel", bound=BaseModel)


# a tolerance behind a number; the reader checks it
_BEHIND = "(?:(?:±|[+]/?-).*)?$"
ANYWHERE = "A number that a local search decides, without a bound."
"""Description of an open number without known dependences, in the schema."""
_TOLERANCE = {"type": "string", "description": "How far a built one may be off.", "examples": ["± 2 %"]}


@dataclass(frozen=True)
class Open:
    """Open number with lower bound, upper bound and start value [SI]."""

    lower: float
    upper: float
    start: float

    @classmethod
    def from_value(cls, value: float | Open | None) -> Open:
        """Return a value as an open number; a fixed value gets equal bounds, None counts as zero."""
        return value if isinstance(value, Open) else cls(*(float(value or 0.0),) * 3)

    @property
    def bounds(self) -> tuple[float, float]:
        """Lower and upper bound."""
        return self.lower, self.upper

    @property
    def is_open(self) -> bool:
        """True if the bounds differ."""
        return self.lower < self.upper

    def decisions(self, name: str, unit: str, *drives: Drive) -> list[Decision]:
        """Return a list with one decision if the bounds differ, else an empty list."""
        return [Decision(name, unit, Interval(*self.bounds), self.start, drives)] if self.is_open else []


@dataclass(frozen=True)
class Number:
    """Pydantic field that reads a number with a unit into SI (C1).

    Attributes
    ----------
    unit
        SI unit; "" for a plain number.
    openable
        True if `{ between = [low, high] }` is allowed in place of the number.
    minimum, above, maximum, below
        Inclusive and exclusive lower bound, inclusive and exclusive upper bound [SI].
    plain
        Factor that turns a bare number into SI, if bare numbers are allowed (degrees).
    closed
        Reason why the number may never be open, as the end of a sentence "it ..."; empty if it may be open.
    is_mean
        True for a mean effective pressure, which is no pressure of a gas.
    """

    unit: str
    openable: bool = False
    minimum: float = -math.inf
    above: float = -math.inf
    maximum: float = math.inf
    below: float = math.inf
    plain: float | None = None
    closed: str = ""
    is_mean: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        number = self._number_schema()
        if self.closed:
            return number
        pair = {"type": "array", "items": number, "minItems": 2, "maxItems": 2}
        between = {
            "type": "object",
            "properties": {"between": pair, "start": number, "tolerance": _TOLERANCE},
            "required": ["between"],
            "additionalProperties": False,
        }
        return {"anyOf": [number, between if self.openable else {**between, "description": ANYWHERE}]}

    def _number_schema(self) -> dict[str, Any]:
        if not self.unit:
            # a number with a tolerance is text
            return {"anyOf": [{"type": "number"}, {"type": "string", "examples": ["0.26 ± 1 %"]}]}
        dimension = units.dimension_name(self.unit)
        annotations = {"description": dimension, "x-dimension": dimension, "examples": [units.example(self.unit)]}
        text = {"type": "string", "pattern": units.pattern(self.unit)[:-1] + _BEHIND, **annotations}
        return {"anyOf": [text, {"type": "number"}]} if self.plain is not None else text

    def read(self, raw: Any) -> float | Open:
        """Return a raw value of a file as a number or open number [SI]; raise a pydantic error if it is neither."""
        return self._open(raw) if isinstance(raw, dict) else self._bounded(self._number(raw))

    def _number(self, raw: Any) -> float:
        if isinstance(raw, bool) or not isinstance(raw, int | float | str):
            raise refusal(f"is no {'number' if not self.unit else 'number with a unit'}; {units.advice(self.unit)}")
        if isinstance(raw, str):
            try:
                return units.parse(raw, self.unit)
            except units.GaugePressureError as error:
                raise refusal(error.mean if self.is_mean else error.absolute) from None
            except units.UnitError as error:
                raise refusal(_without_note(raw) or str(error)) from None
        if self.unit and self.plain is None:
            raise refusal(f"has no unit, {units.dimension_name(self.unit)} needs one; {units.advice(self.unit)}")
        value = raw * (1.0 if self.plain is None else self.plain)
        if not math.isfinite(value):
            raise refusal("is not finite; give a number")
        return value

    def _bounded(self, value: float) -> float:
        if abs(value) > LARGEST:
            raise refusal(f"is too large for any engine; {units.advice(self.unit)}")
        if 0.0 < abs(value) < SMALLEST:
            raise refusal(f"is too small for any engine; {units.advice(self.unit)}, or 0")
        if value <= self.above:
            raise refusal(f"must be more than {units.quantity_text(self.above, self.unit)}; {units.advice(self.unit)}")
        if value >= self.below:
            raise refusal(f"must be less than {units.quantity_text(self.below, self.unit)}; give a smaller value")
        if value < self.minimum:
            raise refusal(f"must be at least {units.quantity_text(self.minimum, self.unit)}; give a larger value")
        if value > self.maximum:
            is_percentage = not self.unit and value <= 100.0 * self.maximum
            hint = f', or "{value:g} %" if per cent is meant' if is_percentage else ""
            raise refusal(f"must be at most {units.quantity_text(self.maximum, self.unit)}; give a smaller value{hint}")
        return value

    def _open(self, raw: dict[str, Any]) -> Open:
        if not self.openable:
            raise refusal("cannot be left open here; give a number")
        if unknown := set(raw) - {"between", "start"}:
            rule = f"has an unknown key '{min(unknown)}'"
            raise refusal(
                _without_note(min(unknown)) or f"{rule}; write {{ between = [low, high] }}, start = ... is optional"
            )
        pair = raw.get("between")
        if not isinstance(pair, list) or len(pair) != 2:
            raise refusal("needs two bounds; write { between = [low, high] }")
        low, high = (self._part(bound, "bound") for bound in pair)
        if low > high:
            raise refusal("has its bounds reversed; write the smaller one first")
        start = self._part(raw["start"], "start") if "start" in raw else min(max(0.0, low), high)
        if not low <= start <= high:
            raise refusal("starts outside its bounds; change start or the bounds")
        return Open(low, high, start)

    def _part(self, raw: Any, name: str) -> float:
        try:
            return self._bounded(self._number(raw))
        except PydanticCustomError as error:
            text = f'"{raw}"' if isinstance(raw, str) else raw
            raise refusal(f"{name} {text}: {error.message()}") from None


def _without_note(text: str) -> str:
    # the text may have a note of an extension that is not installed; other texts give no complaint
    home = next((home for mark, home in HOMES["notes"].items() if mark in text), "")
    return "" if not home or is_installed(home) else "; ".join(missing_extension(home))


@dataclass(frozen=True)
class OrWord:
    """Pydantic field that reads a list of the type `inner`, one of some words, or the name of a list in `named`."""

    inner: Any
    example: str
    named: tuple[tuple[str, tuple[float, ...]], ...] = ()
    words: tuple[str, ...] = ("open",)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_wrap_validator_function(self._read, handler.generate_schema(self.inner))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        words = [*self.words, *dict(self.named)]
        return {"anyOf": [handler(schema), {"enum": words} if len(words) > 1 else {"const": words[0]}]}

    def _read(self, raw: Any, inner: Callable[[Any], Any]) -> Any:
        if isinstance(raw, str):
            if raw in self.words:
                return raw
            if raw in dict(self.named):
                return inner(list(dict(self.named)[raw]))
            if _JOINED.fullmatch(raw):
                raise refusal(f"is no list; write [{', '.join(re.findall(r'[0-9]+', raw))}]")
            words, names = [f'"{word}"' for word in self.words], ", ".join(f'"{name}"' for name, _ in self.named)
            alternatives = f", {' or '.join(words)} or a name: {names}" if names else f" or {' or '.join(words)}"
            raise refusal(
                f"is neither a list nor {' nor '.join(words)}; write for example {self.example}{alternatives}"
            )
        return inner(raw)


@cache
def _adapter(annotation: Any) -> TypeAdapter[Any]:
    return TypeAdapter(annotation)


@dataclass(frozen=True)
class ListOrSingle:
    """Pydantic field that reads a list, or a single value as a list of one."""

    inner: Any

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        list_type: Any = list[self.inner]  # type: ignore[name-defined]
        return core_schema.no_info_wrap_validator_function(self._read, handler.generate_schema(list_type))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        list_schema = handler(schema)
        return {"anyOf": [list_schema["items"], list_schema]}

    def _read(self, raw: Any, inner: Callable[[Any], Any]) -> Any:
        # a complaint about a single value has no index
        return inner(raw) if isinstance(raw, list) else [_adapter(self.inner).validate_python(raw)]


def refusal(text: str) -> PydanticCustomError:
    """Return the pydantic error for a text of rule and remedy, separated by '; '."""
    # pydantic would read braces in a message as a template
    return PydanticCustomError("laufruhe", "{text}", {"text": text})


def _turning(ratio: float) -> float:
    if abs(ratio) < SLOWEST:
        raise refusal(f"is almost a standing shaft; give at least {SLOWEST:g} or at most -{SLOWEST:g}")
    return ratio


def _side(raw: Any) -> str | float:
    # the unit is checked with the quantity
    if isinstance(raw, bool) or not isinstance(raw, int | float | str):
        raise refusal("must be text in quotes")
    return raw


_DEG = math.radians(1.0)

Length: TypeAlias = Annotated[float, Number("m")]
PositiveLength: TypeAlias = Annotated[float, Number("m", above=0.0)]
Mass: TypeAlias = Annotated[float, Number("kg", minimum=0.0)]
PositiveMass: TypeAlias = Annotated[float, Number("kg", above=0.0)]
Inertia: TypeAlias = Annotated[float, Number("kg m^2")]
OpenInertia: TypeAlias = Annotated[float | Open, Number("kg m^2", above=0.0, openable=True)]
Density: TypeAlias = Annotated[float, Number("kg/m^3", above=0.0)]
MeanPressure: TypeAlias = Annotated[float, Number("Pa", is_mean=True)]
PositiveMeanPressure: TypeAlias = Annotated[float, Number("Pa", above=0.0, is_mean=True)]
PositivePressure: TypeAlias = Annotated[float, Number("Pa", above=0.0)]
Moment: TypeAlias = Annotated[float, Number("N m")]
SignedForce: TypeAlias = Annotated[float, Number("N")]
Factor: TypeAlias = Annotated[float, Number("", minimum=-1000.0, maximum=1000.0)]
NonNegativeMeanPressure: TypeAlias = Annotated[float, Number("Pa", minimum=0.0, is_mean=True)]
NonNegativeTorque: TypeAlias = Annotated[float, Number("N m", minimum=0.0)]
Angle: TypeAlias = Annotated[float, Number("rad", plain=_DEG)]
OpenAngle: TypeAlias = Annotated[float | Open, Number("rad", plain=_DEG, openable=True)]
Speed: TypeAlias = Annotated[float, Number("rad/s", above=0.0)]
PistonSpeed: TypeAlias = Annotated[float, Number("m/s", above=0.0)]
Time: TypeAlias = Annotated[float, Number("s", above=0.0)]
_GEARED = "is a gear ratio, and the orders of loads jump between ratios"
Ratio: TypeAlias = Annotated[float, Number("", minimum=-100.0, maximum=100.0, closed=_GEARED), AfterValidator(_turning)]
NonNegative: TypeAlias = Annotated[float, Number("", minimum=0.0)]
Part: TypeAlias = Annotated[float, Number("", minimum=0.0, maximum=1.0)]
Positive: TypeAlias = Annotated[float, Number("", above=0.0)]
Tolerance: TypeAlias = Annotated[
    float, Number("", above=0.0, below=1.0, closed="sets the accuracy of the computation, not the engine")
]
OpenFraction: TypeAlias = Annotated[float | Open, Number("", minimum=-10.0, maximum=10.0, openable=True)]
NonNegativeLength: TypeAlias = Annotated[float, Number("m", minimum=0.0)]
Unbalance: TypeAlias = Annotated[float, Number("kg m", minimum=0.0)]
Force: TypeAlias = Annotated[float, Number("N", above=0.0)]
OpenUnbalance: TypeAlias = Annotated[float | Open, Number("kg m", minimum=0.0, openable=True)]
OpenMass: TypeAlias = Annotated[float | Open, Number("kg", minimum=0.0, openable=True)]
LossFactor: TypeAlias = Annotated[float, Number("", minimum=0.0, maximum=10.0)]
Stiffness: TypeAlias = Annotated[float, Number("N/m", minimum=0.0)]
PositiveInertia: TypeAlias = Annotated[float, Number("kg m^2", above=0.0)]
OpenFrequency: TypeAlias = Annotated[float | Open, Number("Hz", above=0.0, openable=True)]
OpenLossFactor: TypeAlias = Annotated[float | Open, Number("", minimum=0.0, maximum=10.0, openable=True)]
OpenPositiveLength: TypeAlias = Annotated[float | Open, Number("m", above=0.0, openable=True)]
OpenNonNegativeLength: TypeAlias = Annotated[float | Open, Number("m", minimum=0.0, openable=True)]
OpenLength: TypeAlias = Annotated[float | Open, Number("m", openable=True)]
OpenStiffness: TypeAlias = Annotated[float | Open, Number("N/m", minimum=0.0, openable=True)]
Damping: TypeAlias = Annotated[float, Number("N s/m", minimum=0.0)]
Delay: TypeAlias = Annotated[float, Number("s", minimum=0.0)]
OpenDelay: TypeAlias = Annotated[float | Open, Number("s", minimum=0.0, openable=True)]
OpenDamping: TypeAlias = Annotated[float | Open, Number("N s/m", minimum=0.0, openable=True)]
Side: TypeAlias = Annotated[
    str | float, PlainValidator(_side), WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "number"}]})
]
Throws: TypeAlias = Annotated[
    list[float | Open] | Literal["open"], OrWord(list[OpenAngle], "[0, 180, 180, 0]", tuple(CRANKS.items()))
]
_LINE, _SLUG, _SHARE, _FORMAT = r"^[^\t\n]+$", "^[a-z0-9][a-z0-9-]*$", r"^\d+(\.\d+)? ?%$", r"^(#?(\.\d)?[efg])?$"
FORMS = {
    _LINE: "must be text on one line, without tabs",
    _SLUG: 'must have small letters, digits and hyphens only; write for example "fig-2"',
    _SHARE: 'must be a percentage; write for example "15 %"',
    _FORMAT: 'must be a number format; write for example ".2f"',
}
"""Messages about texts that do not match the pattern of a field."""
Name: TypeAlias = Annotated[str, Field(min_length=1, max_length=60, pattern=_LINE)]
Slug: TypeAlias = Annotated[str, Field(pattern=_SLUG, max_length=60)]
Share: TypeAlias = Annotated[str, Field(pattern=_SHARE)]
Format: TypeAlias = Annotated[str, Field(pattern=_FORMAT)]
CylinderNumber: TypeAlias = Annotated[int, Field(ge=1, le=48)]
Pair: TypeAlias = Annotated[list[T], Field(min_length=2, max_length=2)]
Three: TypeAlias = Annotated[list[T], Field(min_length=3, max_length=3)]


def without_open(schema: Any) -> Any:
    """Return a JSON schema without the alternative of open numbers at keys that do not read them."""
    if isinstance(schema, list):
        return [without_open(entry) for entry in schema]
    if not isinstance(schema, dict):
        return schema
    choices = schema.get("anyOf", [])
    number = next((entry for entry in choices if entry.get("description") == ANYWHERE), None)
    if number is None:
        return {key: without_open(entry) for key, entry in schema.items()}
    alternatives = [entry for entry in choices if entry is not number]
    # the alternatives are the number, the open number, and further ones of pydantic
    first = [*alternatives[0].get("anyOf", [alternatives[0]]), *alternatives[1:]]
    remaining = {key: without_open(entry) for key, entry in schema.items() if key != "anyOf"}
    return dict(sorted({**({"anyOf": first} if len(first) > 1 else first[0]), **remaining}.items()))


class Table(BaseModel):
    """TOML table with fixed keys; base of all tables of files."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)
    closed: ClassVar[str] = ""
    """Reason why numbers in the table may not be open, as the end of a sentence "it ..."; empty if they may."""

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return the JSON schema of the table.

        If `closed` gives a reason, no number may be open, and the schema does not offer bounds in place of a number.
        """
        reference = handler(schema)
        if cls.closed:
            resolved = handler.resolve_ref_schema(reference)
            resolved |= without_open(resolved)
        return reference


FORMAT = 1
"""Newest format of problem files, study files and result.json."""


FormatNumber = Annotated[int, Field(ge=1)]


def check_format(record: Mapping[str, Any], source: object) -> None:
    """Refuse a file of a newer format before anything else is read; raise `InputError`."""
    number = record.get("format", FORMAT)
    if isinstance(number, int) and number > FORMAT:
        rule = f"is newer than {FORMAT}, the newest format that this version reads"
        raise refused("format", str(number), rule, "install a newer Laufruhe", source)


def required(text: str) -> Any:
    """Return a required field with its description for editors."""
    return Field(description=text)


def optional(text: str, default: Any = None) -> Any:
    """Return an optional field with its description for editors."""
    return Field(default=default, description=text)


def with_keys(table: type[TableModel], keys: Mapping[str, Any]) -> type[TableModel]:
    """Return a subclass of a table with further keys, each with its type and field."""
    model = create_model(table.__name__, __base__=table, __doc__=table.__doc__, __module__=table.__module__, **keys)
    # before pydantic 2.14.1 a model is not copied to another process unless it is built
    model.model_rebuild()
    return model
