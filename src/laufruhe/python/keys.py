"""Keys of tables from the arguments of a call."""

from __future__ import annotations

import inspect
import json
import textwrap
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Self

from laufruhe.files.problem_file import SCHEMA
from laufruhe.units import unit_of_dimension

NAMES = {"how": "as"}
"""Keys that are no names in Python, by the names of their arguments."""


def keys_of(arguments: Mapping[str, Any], fixed: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the keys of a table from the arguments of a call, without those that are None, after `fixed` ones."""
    keys = {NAMES.get(name, name): value for name, value in arguments.items() if name != "self" and value is not None}
    return {**(fixed or {}), **keys}


class Parts(ABC):
    """Base of generated methods that add tables: the method `name` at a key of the file, plural for lists."""

    @abstractmethod
    def _with(self, key: str, name: str, table: Mapping[str, Any]) -> Self: ...


def alternatives(schema: Mapping[str, Any], entry: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Yield the JSON schemas that a value of a key may follow, without that of null."""
    reference = entry.get("$ref")
    resolved = schema["definitions"][reference.rpartition("/")[2]] if reference else entry
    # conditions on a table are no alternatives to it
    choices = None if "properties" in resolved else resolved.get("anyOf") or resolved.get("oneOf")
    if choices is None:
        yield from [resolved] if resolved.get("type") != "null" else []
    for one in choices or ():
        yield from alternatives(schema, one)


def description(schema: Mapping[str, Any], entry: Mapping[str, Any]) -> str:
    """Return the description of a key with its SI unit in brackets."""
    words = entry.get("description", "No description.")
    for one in alternatives(schema, entry):
        while one.get("type") == "array":
            one = next(alternatives(schema, one["items"]))
        if "x-dimension" in one:
            unit = f" [{unit_of_dimension(one['x-dimension'])}]"
            return words if unit in words else f"{words.removesuffix('.')}{unit}."
    return str(words)


@cache
def _schema() -> dict[str, Any]:
    return dict(json.loads((files("laufruhe.files") / SCHEMA).read_text(encoding="utf-8")))


def describe(calls: Mapping[str, Any], title: str = "") -> None:
    """Add the keys of tables of the schema to the docstrings of the functions of a module or class.

    A function has the keys of the table `title` as arguments, by default those of the table of its own name. A key that
    the docstring names in `marks` is left as it is.
    """
    home = calls.get("__name__") or calls["__module__"]
    for function, call in calls.items():
        if inspect.isfunction(call) and call.__module__ == home:
            table = title or "".join(map(str.capitalize, function.removeprefix("gas_").split("_"))) + "Table"
            entries = _schema()["definitions"][table]["properties"]
            text = inspect.cleandoc(call.__doc__ or "")
            lines = [text, "", "Parameters", "----------"]
            for name in inspect.signature(call).parameters:
                if name != "self" and f"`{name}`" not in text:
                    words = description(_schema(), entries[NAMES.get(name, name)])
                    lines += [name, textwrap.indent(textwrap.fill(words, 112), "    ")]
            call.__doc__ = "\n".join(lines)
