"""What editors say of every key of a schema: its meaning, its kind with the unit, and an example.

What a field says of itself comes first. Keys that mean the same wherever they stand have their words in `hover.toml`.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.resources import files
from typing import Any

_PLAIN = {
    "integer": "whole number",
    "number": "number",
    "string": "text",
    "boolean": "true or false",
    "object": "table",
}
_NUMBERS: Mapping[str, Any] = {"integer": 1, "number": 1.0, "string": "text", "boolean": True}
HOVER = ("description", "examples", "x-taplo")
"""What of a key an editor shows."""
# a table within tables within a table is told by where it stands itself
_DEPTH = 4


@cache
def _told() -> dict[str, dict[str, Any]]:
    return tomllib.loads((files("laufruhe.files") / "hover.toml").read_text(encoding="utf-8"))


def explained(schema: dict[str, Any]) -> dict[str, Any]:
    """The schema, with words and an example on every key."""
    tables = {schema["title"]: schema, **schema["definitions"]}
    keys = [(name, key) for name, table in tables.items() for key in table.get("properties", {})]
    # all of them before any is written: examples of tables are made of those of their keys
    examples = [
        _example(schema, tables[name]["properties"][key], f"{_short(name)}.{key}", _DEPTH) for name, key in keys
    ]
    for (name, key), example in zip(keys, examples, strict=True):
        entry = tables[name]["properties"][key]
        own = entry.get("description")
        words = own if own and own != entry.get("x-dimension") else _words(schema, entry, f"{_short(name)}.{key}")
        hover = f"{words}\n\n{kind(schema, entry)}, for example `{json.dumps(example, ensure_ascii=False)}`"
        entry |= {"description": words, "examples": [example], "x-taplo": {"docs": {"main": hover}}}
    return schema


def _short(name: str) -> str:
    """Name of a table without the module that pydantic puts before names of which there are two."""
    return name.rpartition("__")[2]


def _words(schema: Mapping[str, Any], entry: Mapping[str, Any], path: str) -> str:
    """What is told of this key alone, what its table says of itself, or what is told of the key wherever it stands."""
    told = _told()["words"]
    return str(told.get(path) or _of_table(schema, entry) or told.get(path.rpartition(".")[2], ""))


def alternatives(schema: Mapping[str, Any], entry: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """What may stand for a key, but null."""
    place = entry.get("$ref")
    found = schema["definitions"][place.rpartition("/")[2]] if place else entry
    # conditions on a table are no alternatives to it
    choices = None if "properties" in found else found.get("anyOf") or found.get("oneOf")
    if choices is None:
        yield from [found] if found.get("type") != "null" else []
    for one in choices or ():
        yield from alternatives(schema, one)


def kind(schema: Mapping[str, Any], entry: Mapping[str, Any]) -> str:
    """What a value is, in words: its dimension, choices, or what a list holds."""
    words: list[str] = []
    for one in alternatives(schema, entry):
        if "between" in one.get("properties", {}):
            words.append("may be open")
        elif "const" in one or "enum" in one:
            choices = one.get("enum", [one.get("const")])
            words += [json.dumps(value, ensure_ascii=False) for value in choices]
        elif one.get("type") == "array" and isinstance(one.get("items"), dict):
            words.append(f"list of {kind(schema, one['items'])}")
        elif "x-dimension" in one:
            words.append(one["x-dimension"])
        else:
            kinds = one.get("type", "")
            words += [_PLAIN.get(each, "any value") for each in ([kinds] if isinstance(kinds, str) else kinds)]
    return ", ".join(dict.fromkeys(words))


def _of_table(schema: Mapping[str, Any], entry: Mapping[str, Any]) -> str:
    """What the table of a key says of itself."""
    for one in alternatives(schema, entry):
        inner = one.get("items") if one.get("type") == "array" else one
        for table in alternatives(schema, inner) if isinstance(inner, dict) else ():
            if "properties" in table:
                return str(table.get("description", ""))
    return ""


def _example(schema: Mapping[str, Any], entry: Mapping[str, Any], path: str, depth: int) -> Any:
    """A value that may stand for a key."""
    told = _told()["examples"]
    if path in told:
        return told[path]
    if entry.get("examples"):
        return entry["examples"][0]
    if (default := entry.get("default")) and not any("x-dimension" in one for one in alternatives(schema, entry)):
        return default
    key = path.rpartition(".")[2]
    if key in told and not _of_table(schema, entry):
        return told[key]
    return _of(schema, next(alternatives(schema, entry)), depth)


def _of(schema: Mapping[str, Any], one: Mapping[str, Any], depth: int) -> Any:
    """An example of one of the kinds that may stand for a key."""
    if one.get("examples"):
        return one["examples"][0]
    if "const" in one or "enum" in one:
        return one.get("const", one.get("enum", [None])[0])
    if one.get("type") == "array":
        example = _example(schema, one.get("items", {}), "", depth)
        return [example] * max(1, int(one.get("minItems", 1)))
    if "properties" in one:
        wanted = (one.get("required") or list(one["properties"])[:1]) if depth else []
        inner = {key: (one["properties"][key], f"{one.get('title', '')}.{key}") for key in wanted}
        return {key: _example(schema, entry, path, depth - 1) for key, (entry, path) in inner.items()}
    return _NUMBERS.get(str(one.get("type")), {})
