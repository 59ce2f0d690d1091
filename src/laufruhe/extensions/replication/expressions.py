"""A small language over the numbers and results of a replication: arithmetic, comparisons, a few named functions.

Values are numbers, texts, lists and labelled arrays; `mean["with shaft"]` is what a case gave. Python evaluates
them, after everything that `_PARTS` and `FUNCTIONS` do not list is refused: no attribute can be reached.
"""

from __future__ import annotations

import ast
import operator
import re
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cache, partial
from string import Formatter
from types import CodeType
from typing import Any, TypeAlias

import numpy as np
from pydantic import ValidationError

from laufruhe.errors import ModelError
from laufruhe.extensions.replication.functions import CONSTANTS, FUNCTIONS
from laufruhe.extensions.replication.models import EXPRESSIONS, CurveTable, GridTable
from laufruhe.files.complaints import nearest
from laufruhe.files.fields import Table

Place: TypeAlias = tuple[str | int, ...]
"""Position of a text in a file: keys, and indices of lists."""
MAX_LETTERS = 2000
_ARITHMETIC: Mapping[str, Any] = {
    "Add": operator.add, "Sub": operator.sub, "Mult": operator.mul, "Div": operator.truediv, "Mod": operator.mod,
    "Pow": lambda a, b: (float(a) if isinstance(a, int) else a) ** b,
}  # fmt: skip
_PARTS = (
    ast.BinOp, ast.UnaryOp, ast.Compare, ast.BoolOp, ast.Call, ast.Subscript, ast.List, ast.Name, ast.Constant,
)  # fmt: skip
_SPEC = re.compile(r"[+#]{0,2}(\.\d)?[efg]")


class ExpressionError(ModelError):
    """An invalid expression; the message says why, and what would be valid."""


def checks_in(
    entry: Any, known: Mapping[str, Sequence[Any]], cases: Collection[str], places: Sequence[str] = (), at: Place = ()
) -> Iterator[tuple[Place, Any, Callable[[str], None]]]:
    """Yield every text with expressions in a table: its place, the text, and a function that checks it.

    `known` are names with the values that each is repeated for. `places` are dimensions, which are also names in the
    `x` of a curve. `at` is the place of the table.
    """
    if isinstance(entry, Table):
        known_here = {**known, **getattr(entry, "loops", {})}
        for name, field in type(entry).model_fields.items():
            at_places = dict.fromkeys(places, ()) if isinstance(entry, CurveTable) and name == "x" else {}
            where = (*at, field.alias or name)
            yield from checks_in(getattr(entry, name), {**at_places, **known_here}, cases, places, where)
    elif isinstance(entry, list):
        for k, element in enumerate(entry):
            yield from checks_in(element, known, cases, places, (*at, k))
    elif isinstance(entry, str):
        key = next(key for key in reversed(at) if isinstance(key, str))
        checked = partial(check, known=known, cases=cases)

        def check_braces(text: str) -> None:
            for _, field, _ in _parts(text):
                if field:
                    checked(field)

        yield at, entry, checked if key in EXPRESSIONS else check_braces


def check(text: str, known: Mapping[str, Sequence[Any]], cases: Collection[str]) -> None:
    """Check an expression before any name has a value.

    `ExpressionError` if it cannot be read, or uses names, functions or cases that are not there.
    """
    nodes = _read(text)[0]
    called = {id(node.func) for node in nodes if isinstance(node, ast.Call)}
    for node in nodes:
        if isinstance(node, ast.Name) and id(node) not in called:
            check_name(node.id, {*CONSTANTS, *known}, "name")
        elif isinstance(node, ast.Subscript):
            place = node.slice
            for case in known.get(place.id, ()) if isinstance(place, ast.Name) else [getattr(place, "value", None)]:
                if isinstance(case, str):
                    check_name(case, cases, "case")


def check_name(name: str, known: Collection[str], what: str) -> None:
    """Raise `ExpressionError` with the nearest known name if `name` is not known; `what` is its noun."""
    if name not in known:
        raise ExpressionError(f"'{name}' is no {what} here; {nearest(name, list(known))}")


def value_of(text: Any, names: Mapping[str, Any]) -> Any:
    """Evaluate an expression; a value that is no text is returned as it is.

    `ExpressionError` if it cannot be read, or names what is not there.
    """
    if not isinstance(text, str):
        return text
    code = _read(text)[1]
    try:
        # `_read` admitted only allowed nodes
        return eval(code, {"__builtins__": {}, **_CALL_TABLE, **CONSTANTS, **names})
    except ExpressionError:
        raise
    except NameError as error:
        raise ExpressionError(
            f"'{error.name}' is no name here; {nearest(str(error.name), [*CONSTANTS, *names])}"
        ) from None
    except (TypeError, ValueError, LookupError, ArithmeticError, AttributeError, RecursionError, MemoryError) as error:
        raise ExpressionError(f"'{text}' has no value ({str(error).partition(chr(10))[0]}); correct it") from None


@cache
def _read(text: str) -> tuple[tuple[ast.AST, ...], CodeType]:
    """Return the allowed nodes of an expression, and its compiled code."""
    if len(text) > MAX_LETTERS:
        raise ExpressionError(
            f"an expression of {len(text)} characters is too long; split it into named parts under define"
        )
    try:
        # Python warns of 1[0], which has no value anyway
        with warnings.catch_warnings(action="ignore"):
            tree, copy = (ast.parse(text.strip(), mode="eval") for _ in range(2))
            nodes = tuple(ast.walk(tree.body))
            for node in nodes:
                if isinstance(node, ast.Call):
                    check_name(ast.unparse(node.func), FUNCTIONS, "function")
                if not _is_allowed(node):
                    rule = f"'{ast.unparse(node)}' is not allowed here"
                    raise ExpressionError(f"{rule}; use only numbers, names and functions, as in 2 * mass")
            return nodes, compile(ast.fix_missing_locations(_RenameCalls().visit(copy)), "", "eval")
    except ExpressionError:
        raise
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        write = "write for example 100 * (mean['b'] / mean['a'] - 1)"
        raise ExpressionError(f"'{text}' is no expression; {write}") from None


def _is_allowed(node: ast.AST) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float | str)
    if isinstance(node, ast.BinOp):
        return type(node.op).__name__ in _ARITHMETIC
    return isinstance(node, _PARTS) or not isinstance(node, ast.expr)


class _RenameCalls(ast.NodeTransformer):
    """Renames functions, which quantities may share a name with, and turns arithmetic into calls."""

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        node.func = ast.Name(f"{ast.unparse(node.func)}()", ast.Load())
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        return ast.Call(ast.Name(type(node.op).__name__ + "()", ast.Load()), [node.left, node.right], [])


def _numbers_only(function: Any) -> Any:

    def agreement(a: Any, b: Any) -> Any:
        if isinstance(a, str | list) or isinstance(b, str | list):
            raise TypeError("texts and lists cannot be used as numbers in an expression")
        return function(a, b)

    return agreement


_CALL_TABLE = {f"{name}()": function for name, function in FUNCTIONS.items()}
_CALL_TABLE |= {f"{name}()": _numbers_only(function) for name, function in _ARITHMETIC.items()}


def fill_in(text: Any, names: Mapping[str, Any]) -> Any:
    """Return a text, list or table with its `{expressions}` replaced; a single expression keeps its type."""
    fill = filler(text)
    return text if fill is None else fill(names)


def filler(text: Any) -> Callable[[Mapping[str, Any]], Any] | None:
    """Return a function that fills a text, list or table with names; None without expressions.

    All results share the entries without expressions.
    """
    if isinstance(text, dict):
        inside = {key: fill for key, value in text.items() if (fill := filler(value)) is not None}
        return (lambda names: {**text, **{key: fill(names) for key, fill in inside.items()}}) if inside else None
    if isinstance(text, list):
        fills = [filler(value) for value in text]
        pairs = list(zip(text, fills, strict=True))
        return (lambda names: [entry if fill is None else fill(names) for entry, fill in pairs]) if any(fills) else None
    return partial(_filled, text) if isinstance(text, str) and "{" in text else None


def _filled(text: str, names: Mapping[str, Any]) -> Any:
    parts = list(_parts(text))
    if len(parts) == 1 and not parts[0][0] and not parts[0][2]:
        return value_of(parts[0][1], names)
    filled = ""
    for plain, field, spec in parts:
        filled += plain
        if field:
            filled += format(number_of(field, names), spec) if spec else str(value_of(field, names))
    return filled


def _parts(text: str) -> Iterator[tuple[str, str, str]]:
    try:
        parts = list(Formatter().parse(text))
    except ValueError as error:
        raise ExpressionError(f"'{text}' cannot be read ({error}); check its braces") from None
    for plain, field, spec, _ in parts:
        if spec and not _SPEC.fullmatch(spec):
            raise ExpressionError(f"'{spec}' is no format for a number; write for example .1f, .3g or .0f")
        yield plain, field or "", spec or ""


def number_of(text: Any, names: Mapping[str, Any]) -> float:
    """Return the number of an expression; raise `ExpressionError` also if the value is not a single number."""
    value = value_of(text, names)
    try:
        return float(value)
    except (TypeError, ValueError):
        raise ExpressionError(
            f"'{text}' is no single number; take one of its numbers, for example by at() or max()"
        ) from None


def numbers_of(entries: Mapping[str, Any], names: Mapping[str, Any]) -> dict[str, Any]:
    """Return numbers by name, each an expression over earlier ones; a table is a grid along its own dimension."""
    numbers = dict(names)
    for name, text in entries.items():
        numbers[name] = grid(name, text) if isinstance(text, dict | GridTable) else value_of(text, numbers)
    return numbers


def grid(name: str, entry: GridTable | Mapping[str, Any]) -> Any:
    """Return listed or equally spaced values, labelled by themselves."""
    import xarray as xr

    try:
        table = GridTable.model_validate(entry)
    except ValidationError:
        raise ExpressionError(f"'{name}' is no grid; give values, or from, to and points") from None
    values = table.values or np.linspace(table.first or 0.0, table.last or 0.0, table.points or 2)
    return xr.DataArray(values, dims=name, coords={name: values})
