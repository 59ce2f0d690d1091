"""The JSON schemas that ship with the package, made of the models: `python tests/schemas.py` writes them.

Every key has its meaning, its kind with the unit, and an example. What a field says of itself comes first. Keys that
mean the same wherever they stand have their words in `hover.toml`.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections import Counter
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from laufruhe import units
from laufruhe.files import problem_file, ready
from laufruhe.files.catalogue import KEY, engines
from laufruhe.files.fields import ANYWHERE, without_open
from laufruhe.files.problem_file import file_model
from laufruhe.machine.layouts import LAYOUTS
from laufruhe.python.keys import alternatives
from laufruhe.studies.reader import StudyFile

WORDS = Path(__file__).with_name("hover.toml")
FOLDER = Path(problem_file.__file__).parent

_PLAIN = {
    "integer": "whole number",
    "number": "number",
    "string": "text",
    "boolean": "true or false",
    "object": "table",
}
_NUMBERS: Mapping[str, Any] = {"integer": 1, "number": 1.0, "string": "text", "boolean": True}
CATALOGUE_TEXT = "Engine of the catalogue (laufruhe engines) that supplies every key which this table does not give."
HOVER = ("description", "examples", "x-taplo")
"""Words of a key that an editor shows."""
# a table within tables within a table is told by where it stands itself
_DEPTH = 4


@cache
def _texts() -> dict[str, dict[str, Any]]:
    return tomllib.loads(WORDS.read_text(encoding="utf-8"))


def explained(schema: dict[str, Any]) -> dict[str, Any]:
    """Return the schema, with words and an example on every key."""
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
        hover += f", by default `{text}`" if (text := default(schema, entry)) else ""
        entry |= {"description": words, "examples": [example], "x-taplo": {"docs": {"main": hover}}}
    return schema


def _short(name: str) -> str:
    """Name of a table without the module that pydantic puts before names of which there are two."""
    return name.rpartition("__")[2]


def _words(schema: Mapping[str, Any], entry: Mapping[str, Any], path: str) -> str:
    """Return the words of this key, else of its table, else of the key in any table."""
    words, of_table = _texts()["words"], _of_table(schema, entry)
    text = "" if of_table == ANYWHERE else of_table
    return str(words.get(path) or text or words.get(path.rpartition(".")[2], ""))


def kind(schema: Mapping[str, Any], entry: Mapping[str, Any]) -> str:
    """Return the kind of a value in words: its dimension, choices, or the members of a list."""
    words: list[str] = []
    for one in alternatives(schema, entry):
        if "between" in one.get("properties", {}):
            words.append("may be searched" if one.get("description") == ANYWHERE else "may be open")
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


def default(schema: Mapping[str, Any], entry: Mapping[str, Any]) -> str:
    """Return the default of a key as it stands in a file; empty without one."""
    value = entry.get("default")
    return (
        ""
        if value in (None, [], "") or isinstance(value, dict)
        else json.dumps(_written(schema, entry, value), ensure_ascii=False)
    )


def _written(schema: Mapping[str, Any], entry: Mapping[str, Any], value: Any) -> Any:
    """Return a value of the models as it stands in a file, numbers with their units."""
    for one in alternatives(schema, entry):
        if isinstance(value, list) and "items" in one:
            return [_written(schema, one["items"], each) for each in value]
        if isinstance(value, float) and "x-dimension" in one:
            unit = units.unit_of_dimension(one["x-dimension"])
            # pressures of gas are usual in bar, stresses in N/mm^2
            is_gas = unit == "Pa" and value < 1e7
            return f"{1e-5 * value:g} bar" if is_gas else units.quantity_text(value, unit, 6)
    return value


def _of_table(schema: Mapping[str, Any], entry: Mapping[str, Any]) -> str:
    """Return the description of the table of a key."""
    for one in alternatives(schema, entry):
        inner = one.get("items") if one.get("type") == "array" else one
        for table in alternatives(schema, inner) if isinstance(inner, dict) else ():
            if "properties" in table:
                return str(table.get("description", ""))
    return ""


def _example(schema: Mapping[str, Any], entry: Mapping[str, Any], path: str, depth: int) -> Any:
    """Return a value that may stand for a key."""
    examples = _texts()["examples"]
    if path in examples:
        return examples[path]
    if entry.get("examples"):
        return entry["examples"][0]
    if (default := entry.get("default")) and not any("x-dimension" in one for one in alternatives(schema, entry)):
        return default
    key = path.rpartition(".")[2]
    if key in examples and not _of_table(schema, entry):
        return examples[key]
    return _of(schema, next(alternatives(schema, entry)), depth)


def _of(schema: Mapping[str, Any], one: Mapping[str, Any], depth: int) -> Any:
    """Return an example of one of the kinds that may stand for a key."""
    if one.get("examples"):
        return one["examples"][0]
    if "const" in one or "enum" in one:
        return one.get("const", one.get("enum", [None])[0])
    if one.get("type") == "array":
        example = _example(schema, one.get("items", {}), "", depth)
        return [example] * max(1, int(one.get("minItems", 1)))
    if "properties" in one:
        required = (one.get("required") or list(one["properties"])[:1]) if depth else []
        inner = {key: (one["properties"][key], f"{one.get('title', '')}.{key}") for key in required}
        return {key: _example(schema, entry, path, depth - 1) for key, (entry, path) in inner.items()}
    return _NUMBERS.get(str(one.get("type")), {})


def problem_schema() -> dict[str, Any]:
    """Return the schema of problem files as the models have it now."""
    return _schema(file_model())


def schema() -> str:
    """Return the text of the schema of problem files."""
    return _text(problem_schema())


def _schema(model: type[BaseModel], selector: Callable[[Any], Any] = lambda found: found) -> dict[str, Any]:
    """Return the schema in the draft that editors support, with explanations."""
    found = selector(model.model_json_schema(ref_template="#/definitions/{model}"))
    whole: dict[str, Any] = {"$schema": "http://json-schema.org/draft-07/schema#", **found}
    whole["definitions"] = whole.pop("$defs")
    if "EngineTable" in whole["definitions"]:
        _with_catalogue_key(whole["definitions"]["EngineTable"])
        whole["definitions"]["EngineTable"] = dict(sorted(whole["definitions"]["EngineTable"].items()))
    return explained(whole)


def _text(schema: dict[str, Any]) -> str:
    return json.dumps(_named(schema), indent=2, ensure_ascii=False) + "\n"


def _named(schema: dict[str, Any]) -> dict[str, Any]:
    """Return the schema with each kind of number under one name, to which keys and tables refer."""
    names: dict[str, str] = {}
    kinds: dict[str, Any] = {}
    counts: Counter[str] = Counter()

    def refer(node: Any) -> Any:
        if isinstance(node, list):
            return [refer(each) for each in node]
        if not isinstance(node, dict):
            return node
        if "x-taplo" not in node and ("anyOf" in node or "between" in node.get("properties", {}) or "pattern" in node):
            text = json.dumps(node)
            if text not in names:
                dimension = re.search(r'"x-dimension": "([^"]+)"', text)
                word = dimension[1].partition(" ")[2].replace(" ", "-") if dimension else "value"
                counts[word] += 1
                names[text] = f"{word}-{counts[word]}"
                kinds[names[text]] = {key: refer(value) for key, value in node.items()}
            return {"$ref": f"#/definitions/{names[text]}"}
        return {key: refer(value) for key, value in node.items()}

    tables = {
        name: {key: refer(value) for key, value in table.items()} for name, table in schema["definitions"].items()
    }
    whole = {key: refer(value) for key, value in schema.items() if key != "definitions"}
    return whole | {"definitions": tables | dict(sorted(kinds.items()))}


def _with_catalogue_key(schema: dict[str, Any]) -> None:
    """Describe [engine] in a schema: a table, in which an engine of the catalogue may stand for the rest, or its name.

    One schema for both, so that an editor marks the key that is wrong and not the whole table.
    """
    required, names = schema.pop("required"), list(engines())
    schema["type"], schema["pattern"] = ["object", "string"], f"^({'|'.join(names)})$"
    schema["properties"] = {KEY: {"description": CATALOGUE_TEXT, "enum": names}, **schema["properties"]}
    pistons = {"required": [*required, "stroke", "reciprocating_mass"]}
    without = {
        "properties": {"layout": {"enum": [k for k, v in LAYOUTS.items() if not v.has_pistons]}},
        "required": required,
    }
    schema["anyOf"] = [{"type": "string"}, {"required": [KEY]}, pistons, without]


def study_schema() -> str:
    """Return the schema of study files, for editors: what a part leaves out may stand in [study.common]."""
    result = _schema(StudyFile, without_open)
    holder = result["definitions"]["StudyTable"]["properties"]["parts"]
    kinds = {kind: ref.rsplit("/", 1)[1] for kind, ref in holder["items"]["discriminator"]["mapping"].items()}
    keys: dict[str, Any] = {}
    for name in kinds.values():
        result["definitions"][name].pop("required", None)
        properties = result["definitions"][name]["properties"]
        keys |= {key: {word: one[word] for word in HOVER} for key, one in properties.items()}
    # a condition for each kind: an editor then marks the key that is wrong, and not the whole part
    holder["items"] = {
        "type": "object",
        "properties": {**keys, "kind": {**keys["kind"], "enum": list(kinds)}},
        "allOf": [
            {
                "if": {"properties": {"kind": {"const": kind}}, "required": ["kind"]},
                "then": {"$ref": f"#/definitions/{name}"},
            }
            for kind, name in kinds.items()
        ],
    }
    return _text(result)


if __name__ == "__main__":
    for name, text in zip(ready.SCHEMAS, (schema(), study_schema()), strict=True):
        (FOLDER / name).write_text(text, encoding="utf-8")
    # this file is imported there by its name
    from python_tables import MAKERS

    for path, make in MAKERS.items():
        path.write_text(make(), encoding="utf-8")
