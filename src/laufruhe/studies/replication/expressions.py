"""A small language over the numbers and results of a replication: arithmetic, comparisons, a few named functions.

Values are numbers, texts, lists and labelled arrays; `mean["with shaft"]` is what a case gave. Nothing but
what stands in `FUNCTIONS` can be called, and no attribute can be reached.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from string import Formatter
from typing import Any

import numpy as np
from pydantic import ValidationError

from laufruhe.errors import ModelError
from laufruhe.files.complaints import nearest
from laufruhe.files.fields import Table
from laufruhe.studies.replication.functions import CONSTANTS, FUNCTIONS
from laufruhe.studies.replication.models import EXPRESSIONS, CurveTable, GridTable

MOST_LETTERS = 2000
_BINARY: Mapping[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Mod: operator.mod, ast.Pow: lambda a, b: (float(a) if isinstance(a, int) else a) ** b,
}  # fmt: skip
_COMPARED: Mapping[type, Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge, ast.Eq: operator.eq,
}  # fmt: skip
_SPEC = re.compile(r"[+#]{0,2}(\.\d)?[efg]")
_UNARY: Mapping[type, Callable[[Any], Any]] = {ast.USub: operator.neg, ast.Not: operator.not_}


class ExpressionError(ModelError):
    """An expression that means nothing here; says which, why, and what would."""


def check_table(
    told: Any, known: Mapping[str, Sequence[Any]], cases: Collection[str], places: Sequence[str] = (), key: str = ""
) -> None:
    """Whether all expressions in a table of a file could have a value, before any name has one.

    Parameters
    ----------
    known
        Names, and the values that each is repeated for, where it is.
    places
        Dimensions, which the `x` of a curve knows too.
    key
        That `told` stands at.

    Raises
    ------
    ExpressionError
        As `check` does.
    """
    if isinstance(told, Table):
        own = {**known, **getattr(told, "each", {})}
        for field in type(told).model_fields:
            at_places = dict.fromkeys(places, ()) if isinstance(told, CurveTable) and field == "x" else {}
            check_table(getattr(told, field), {**at_places, **own}, cases, places, field)
    elif isinstance(told, list):
        for one in told:
            check_table(one, known, cases, places, key)
    elif isinstance(told, str):
        for text in [told] if key in EXPRESSIONS else expressions_in(told):
            check(text, known, cases)


def check(text: str, known: Mapping[str, Sequence[Any]], cases: Collection[str]) -> None:
    """Whether an expression could have a value, before any name has one.

    Raises
    ------
    ExpressionError
        If it cannot be read, or uses names, functions or cases that are not there.
    """
    nodes = [node for node in ast.walk(_parsed(text)) if isinstance(node, ast.expr)]
    calls = [node for node in nodes if isinstance(node, ast.Call)]
    unknown = {ast.unparse(node.args[1]) for node in calls if ast.unparse(node.func) == "root" and len(node.args) == 4}
    called = {id(node.func) for node in calls}
    names = {*known, *CONSTANTS, *unknown}
    for node in nodes:
        _check_node(node)
        if isinstance(node, ast.Name) and id(node) not in called:
            check_among(node.id, names, "name")
        elif isinstance(node, ast.Subscript):
            place = node.slice
            for case in known.get(place.id, ()) if isinstance(place, ast.Name) else [getattr(place, "value", None)]:
                if isinstance(case, str):
                    check_among(case, cases, "case")


def _check_node(node: ast.expr) -> None:
    if type(node) not in _NODES:
        raise ExpressionError(f"'{ast.unparse(node)}' is not allowed here; use numbers, names and functions alone")
    if isinstance(node, ast.Call):
        check_among(ast.unparse(node.func), FUNCTIONS, "function")


def check_among(name: str, known: Collection[str], what: str) -> None:
    """Whether a name is one of those that there are.

    Raises
    ------
    ExpressionError
        With the nearest one.
    """
    if name not in known:
        raise ExpressionError(f"'{name}' is no {what} here; {nearest(name, list(known))}")


def expressions_in(text: str) -> list[str]:
    """What stands in the braces of a text."""
    return [field for _, field, _ in _parts(text) if field]


def value_of(text: Any, names: Mapping[str, Any]) -> Any:
    """What an expression is worth; what is no text is worth itself.

    Raises
    ------
    ExpressionError
        If it cannot be read, or names what is not there.
    """
    if not isinstance(text, str):
        return text
    try:
        return _value(_parsed(text), names)
    except ExpressionError:
        raise
    except (TypeError, ValueError, LookupError, ArithmeticError, AttributeError, RecursionError) as error:
        raise ExpressionError(f"'{text}' has no value ({str(error).splitlines()[0]}); correct it") from None


def filled(text: Any, names: Mapping[str, Any]) -> Any:
    """Text with its `{expressions}` replaced, lists and tables inside and out; one that is all of it keeps its type."""
    if isinstance(text, dict):
        return {key: filled(value, names) for key, value in text.items()}
    if isinstance(text, list):
        return [filled(value, names) for value in text]
    if not isinstance(text, str) or "{" not in text:
        return text
    parts = _parts(text)
    if len(parts) == 1 and not parts[0][0] and not parts[0][2]:
        return value_of(parts[0][1], names)
    return "".join(plain + (_shown(value_of(field, names), spec) if field else "") for plain, field, spec in parts)


def _parts(text: str) -> list[tuple[str, str, str]]:
    """Plain text, the expression after it, and how its number is written."""
    try:
        parts = [(plain, field or "", spec or "") for plain, field, spec, _ in Formatter().parse(text)]
    except ValueError as error:
        raise ExpressionError(f"'{text}' cannot be read ({error}); check its braces") from None
    for _, _, spec in parts:
        if spec and not _SPEC.fullmatch(spec):
            raise ExpressionError(f"'{spec}' is no format of a number; write for example .1f, .3g or .0f")
    return parts


def _shown(value: Any, spec: str) -> str:
    return format(float(value), spec) if spec else str(value)


def _parsed(text: str) -> ast.expr:
    if len(text) > MOST_LETTERS:
        raise ExpressionError(f"an expression of {len(text)} letters is too long; split it under define")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ExpressionError(
            f"'{text}' is no expression; write for example 100 * (mean['b'] / mean['a'] - 1)"
        ) from None


def _value(node: ast.expr, names: Mapping[str, Any]) -> Any:
    _check_node(node)
    return _NODES[type(node)](node, names)


def _name(node: ast.Name, names: Mapping[str, Any]) -> Any:
    known = {**CONSTANTS, **names}
    check_among(node.id, known, "name")
    return known[node.id]


def _call(node: ast.Call, names: Mapping[str, Any]) -> Any:
    name = ast.unparse(node.func)
    called = FUNCTIONS[name]
    given = {str(word.arg): _value(word.value, names) for word in node.keywords}
    if name == "root":
        # its first argument is no value yet: it has one at every place that is tried
        return called(lambda x: _value(node.args[0], {**names, node.args[1].id: x}), *(  # type: ignore[attr-defined]
            _value(one, names) for one in node.args[2:]))  # fmt: skip
    return called(*(_value(one, names) for one in node.args), **given)


def _compared(node: ast.Compare, names: Mapping[str, Any]) -> Any:
    values = [_value(one, names) for one in (node.left, *node.comparators)]
    found = [_COMPARED[type(op)](a, b) for op, a, b in zip(node.ops, values, values[1:], strict=False)]
    return found[0] if len(found) == 1 else all(map(bool, found))


def _joined(node: ast.BoolOp, names: Mapping[str, Any]) -> bool:
    return (all if isinstance(node.op, ast.And) else any)(bool(_value(one, names)) for one in node.values)


def _number(node: ast.expr, names: Mapping[str, Any]) -> Any:
    value = _value(node, names)
    if isinstance(value, str | list):
        raise TypeError("texts and lists are no numbers")
    return value


def _constant(node: ast.Constant, _: Mapping[str, Any]) -> Any:
    if not isinstance(node.value, int | float | str):
        raise ExpressionError(f"'{node.value!r}' is neither number nor text; write one")
    return node.value


_NODES: Mapping[type, Callable[[Any, Mapping[str, Any]], Any]] = {
    ast.Constant: _constant,
    ast.Name: _name,
    ast.Call: _call,
    ast.Compare: _compared,
    ast.BoolOp: _joined,
    ast.List: lambda node, names: [_value(one, names) for one in node.elts],
    ast.Subscript: lambda node, names: _value(node.value, names)[_value(node.slice, names)],
    ast.UnaryOp: lambda node, names: _UNARY[type(node.op)](_value(node.operand, names)),
    ast.BinOp: lambda node, names: _BINARY[type(node.op)](*(_number(one, names) for one in (node.left, node.right))),
}


def numbers_of(given: Mapping[str, Any], names: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers by name, each an expression over those before it; a table is a grid along a dimension of its name.

    Raises
    ------
    ExpressionError
        As `value_of` does.
    """
    found = dict(names)
    for name, text in given.items():
        found[name] = grid(name, text) if isinstance(text, dict | GridTable) else value_of(text, found)
    return found


def grid(name: str, given: GridTable | Mapping[str, Any]) -> Any:
    """Values listed, or so many from one end to the other, labelled by themselves."""
    import xarray as xr

    try:
        table = GridTable.model_validate(given)
    except ValidationError:
        raise ExpressionError(f"'{name}' is no grid; give values, or from, to and points") from None
    values = table.values or np.linspace(table.first or 0.0, table.last or 0.0, table.points or 2)
    return xr.DataArray(values, dims=name, coords={name: values})
