"""Tables of study files: cases and sweeps, and paths such as engine.rod_ratio into the tables of a problem file."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

from pydantic import BeforeValidator, Field

from laufruhe import units
from laufruhe.files import fields as f
from laufruhe.files import nested
from laufruhe.files.complaints import Refused, nearest, si_value
from laufruhe.files.fields import Name, Table, refusal
from laufruhe.files.measures import SIDES, limit_name
from laufruhe.files.nested import number_at
from laufruhe.files.problem_file import file_model

MAX_POINTS = 100_000
DIGITS = 12


def _single(raw: object) -> object:
    if raw is not None and not isinstance(raw, bool | int | float | str):
        raise refusal("is neither a number nor a text; write one of them")
    return raw


Value: TypeAlias = Annotated[bool | int | float | str, BeforeValidator(_single)]
Setting: TypeAlias = Annotated[
    bool | int | float | str | list[bool | int | float | str],
    BeforeValidator(lambda raw: [_single(entry) for entry in raw] if isinstance(raw, list) else _single(raw)),
]
End: TypeAlias = Annotated[int | float | str | None, BeforeValidator(_single)]


class CaseTable(Table):
    """Case of a study: a problem file with changes."""

    name: Name
    problem: str
    set: dict[str, Setting] = f.optional(
        "Paths and their values, or lists of these. A key that the problem file lacks is added.", {}
    )
    without: list[str] = f.optional("Paths that are left out, such as balancer_shafts or engine.throws.", [])
    equal_power_to: Annotated[int, Field(ge=1, le=48)] | None = f.optional(
        "The engine is rebuilt with the power of this many of its cylinders."
    )


def at(tables: dict[str, Any], where: str) -> Any:
    """Return the value at a path such as counterweights.web.balance_factor; raise `Refused` if there is none."""
    return nested.at(tables, keys_of(tables, where))


def changed(tables: dict[str, Any], where: str, value: Any) -> dict[str, Any]:
    """Return a copy of tables with another value at a path; raise `Refused` if problem files have no such key."""
    return nested.with_value_at(tables, keys_of(tables, where, adds=True), value)


def without(tables: dict[str, Any], where: str) -> dict[str, Any]:
    """Return a copy of tables without the key or list entry at a path; raise `Refused` if there is none."""
    *above, last = keys_of(tables, where)
    table = nested.at(tables, above)
    rest: Any = [*table[:last], *table[last + 1 :]] if isinstance(table, list) else {**table}
    if isinstance(rest, dict):
        del rest[last]
    return nested.with_value_at(tables, above, rest) if above else rest


def joined(tables: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Return tables updated by `changes`: nested tables are merged recursively, other values are replaced."""
    merged = [key for key, change in changes.items() if isinstance(change, dict) and isinstance(tables.get(key), dict)]
    return {**tables, **changes, **{key: joined(tables[key], changes[key]) for key in merged}}


def keys_of(tables: Mapping[str, Any], where: str, adds: bool = False) -> tuple[Any, ...]:
    """Return the address (keys and indices) of a path in a problem file; raise `Refused` if it leads nowhere.

    With `adds` the path may be that of a key of problem files that this file lacks.
    """
    node: Any = tables
    keys, parts = list[Any](), parts_of(where)
    for k, part in enumerate(parts):
        options = _options(node)
        if part not in options:
            address = (*keys, *parts[k:])
            if adds and isinstance(node, Mapping) and nested.annotations_at(file_model(), address):
                return address
            remedy = _remedy(tables, node, parts, k)
            raise Refused(".".join(parts[: k + 1]), None, "is not the path of a quantity of this problem", remedy)
        keys.append(options[part])
        node = node[options[part]]
    return tuple(keys)


def path_text(tables: Any, place: Sequence[str | int]) -> str:
    """Return the path to an address; entries of lists have their names, or are counted from one."""
    parts, node = list[str](), tables
    for key in place:
        names = {k: name for name, k in _options(node).items() if isinstance(key, str) or "." not in name}
        parts.append(names[key] if key in names else str(int(key) + 1))
        node = node[key]
    return ".".join(parts)


def _remedy(tables: Mapping[str, Any], node: Any, parts: Sequence[str], k: int) -> str:
    # the path fails at its part `k`
    for path in _paths(tables):
        remaining = iter(path)
        if path[-1] == parts[-1] and all(part in remaining for part in parts):
            return f"write the whole path, {'.'.join(path)}"
    if not (options := list(_options(node))):
        return "name a number of the problem file"
    is_known = isinstance(node, dict) and field_at(".".join(parts)) is not None
    return nearest(parts[k], options, "write it into the problem file first" if is_known else "")


def _paths(node: Any, above: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    # entries of lists have their names
    for key, name in {key: name for name, key in _options(node).items()}.items():
        yield (*above, name)
        yield from _paths(node[key], (*above, name))


def parts_of(where: str) -> list[str]:
    """Return the parts of a path between points; the name of a limit may itself contain points, as in order 0.5."""
    parts = where.split(".")
    if parts[0] == "constraints" and parts[-1] in SIDES and len(parts) > 3:
        return [parts[0], ".".join(parts[1:-1]), parts[-1]]
    return parts


def _options(node: Any) -> dict[str, Any]:
    # keys and indices have names; entries of lists also have numbers from one
    if isinstance(node, Mapping):
        return {key: key for key in node}
    if isinstance(node, list):
        # limits without a name have a default one
        tables = [entry if isinstance(entry, dict) else {} for entry in node]
        names = [table.get("name") or (limit_name(table) if "limit" in table else None) for table in tables]
        named = {name: k for k, name in enumerate(names) if isinstance(name, str) and names.count(name) == 1}
        return {**{str(k + 1): k for k in range(len(node))}, **named}
    return {}


def field_at(where: str) -> f.Number | None:
    """Return the field that reads the number at a path; None for a text, a list or a choice."""
    return number_at(file_model(), tuple(parts_of(where)))


@dataclass(frozen=True)
class Span:
    """Range of a quantity, a path in the problem file, that is swept or drawn, linearly or by its logarithm.

    The ends are in the unit of the study file, which is "1" for plain numbers. `is_text` is True if a problem file
    gives the quantity as text with its unit.
    """

    quantity: str
    unit: str
    low: float
    high: float
    is_log: bool
    is_text: bool


def span_of(quantity: str, first: Value, last: Value, spacing: str | None) -> Span:
    """Return the range of a quantity between two ends; raise `Refused` if these do not fit."""
    for key, end in (("from", first), ("to", last)):
        # each end separately, so that complaints name the wrong one
        measured(quantity, (end,), key)
    unit, numbers = measured(quantity, (first, last), "from")
    if numbers is None and isinstance(first, str) and units.dimension_of(first) is not None:
        remedy = "write its whole path, such as operating_points.1.speed"
        raise Refused("quantity", quantity, "is not the path of a number in the problem file", remedy)
    if numbers is None:
        raise Refused("from", first, "is no number", "list the labels under values")
    low, high = numbers
    if low >= high:
        raise Refused("from", first, "does not lie below to", "write the smaller end of the range first")
    if spacing == "log" and low <= 0.0:
        raise Refused(
            "from", first, "is not above zero, so a logarithmic sweep cannot begin there", 'leave spacing = "log" out'
        )
    is_text = isinstance(first, str) and (unit != "1" or _is_limit(quantity))
    return Span(quantity, unit, low, high, spacing == "log", is_text)


def measured(quantity: str, values: tuple[Value, ...], key: str) -> tuple[str, tuple[float, ...] | None]:
    """Return the unit of the first swept value, and all values in this unit; None in place of values for labels."""
    field = field_at(quantity)
    numbers = [value for value in values if isinstance(value, int | float) and not isinstance(value, bool)]
    # a whole number may be beyond all floats
    plain = [float(value) if abs(value) <= sys.float_info.max else math.inf for value in numbers]
    if not all(map(math.isfinite, plain)):
        raise Refused(key, list(values), "is not finite", "give numbers")
    texts = [value for value in values if isinstance(value, str)]
    limited = units.dimension_of(texts[0]) if texts and _is_limit(quantity) else None
    unit_needed = limited if field is None else field.unit
    if unit_needed is None or len(plain) + len(texts) < len(values):
        return ("1", tuple(plain)) if len(plain) == len(values) else ("", None)
    if not texts:
        return "deg" if field is not None and field.plain is not None else "1", tuple(plain)
    si = [si_value(text, unit_needed, key) for text in texts]
    if plain:
        raise Refused(key, list(values), "mixes numbers with and without a unit", "write all alike")
    unit = units.unit_of(texts[0])
    unit_value = units.parse(f"1 {unit}", unit_needed)
    return unit or "1", tuple(float(f"{number / unit_value:.{DIGITS}g}") for number in si)


def _is_limit(quantity: str) -> bool:
    # the model fixes no dimension for a side of a limit; its text does
    parts = parts_of(quantity)
    return parts[0] == "constraints" and parts[-1] in SIDES
