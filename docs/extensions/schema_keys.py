"""Directive `schema-keys`: every key of a file as its JSON schema has it, a section for each table of the file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib.resources import files
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

HEADS = ("key", "type", "meaning", "example")
WIDTHS = (20, 25, 40, 15)
PLAIN = {"integer": "whole number", "number": "number", "string": "text", "boolean": "true or false", "object": "table"}


def resolved(schema: dict[str, Any], entry: dict[str, Any]) -> dict[str, Any]:
    """The definition behind a reference."""
    place = entry.get("$ref")
    return schema["definitions"][place.rpartition("/")[2]] if place else entry


def alternatives(schema: dict[str, Any], entry: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """What may stand for a key, but null."""
    found = resolved(schema, entry)
    for one in found.get("anyOf", found.get("oneOf", [found])):
        if one is found:
            yield found
        elif one.get("type") != "null":
            yield from alternatives(schema, one)


def tables_of(schema: dict[str, Any], entry: dict[str, Any]) -> Iterator[tuple[bool, dict[str, Any]]]:
    """Tables that a key holds, and whether it is a list of them."""
    for one in alternatives(schema, entry):
        if "properties" in one and "between" not in one["properties"]:
            yield False, one
        elif one.get("type") == "array" and isinstance(one.get("items"), dict):
            yield from ((True, table) for _, table in tables_of(schema, one["items"]))


def told(schema: dict[str, Any], entry: dict[str, Any]) -> str:
    """What a value is, in words."""
    words: list[str] = []
    for one in alternatives(schema, entry):
        if "between" in one.get("properties", {}):
            words.append("may be open")
        elif "properties" in one:
            words.append("table")
        elif "const" in one:
            words.append(json.dumps(one["const"], ensure_ascii=False))
        elif "enum" in one:
            words += [json.dumps(value, ensure_ascii=False) for value in one["enum"]]
        elif one.get("type") == "array":
            inner = told(schema, one["items"]) if isinstance(one.get("items"), dict) else "any"
            words.append(f"list ({inner})")
        elif one.get("type") == "string" and "pattern" in one and "description" in one:
            words.append(one["description"])
        else:
            words.append(PLAIN.get(one.get("type", ""), "any"))
    return ", ".join(dict.fromkeys(words))


def example(entry: dict[str, Any]) -> str:
    """The first example of a key."""
    found = entry.get("examples", [None])[0]
    return "" if found is None else json.dumps(found, ensure_ascii=False)


class SchemaKeys(SphinxDirective):
    """`{schema-keys} laufruhe.schema.json`."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Sections in the order of the schema, each table once."""
        self.schema = json.loads((files("laufruhe.files") / self.arguments[0]).read_text(encoding="utf-8"))
        self.seen: set[str] = set()
        return list(self.sections("", self.schema, False))

    def sections(self, path: str, table: dict[str, Any], is_list: bool) -> Iterator[nodes.Node]:
        """The section of a table, and then those of what stands in it."""
        name = f"[[{path}]]" if is_list else f"[{path}]" if path else "At the top of the file"
        title = f"{name}, {kind}" if (kind := self.kind(table)) else name
        section = nodes.section(ids=[nodes.make_id(f"{self.arguments[0]}-{title}")])
        section += nodes.title("", title)
        if "description" in table:
            section += nodes.paragraph("", table["description"])
        section += self.table(table["properties"])
        yield section
        for key, entry in table["properties"].items():
            for each, inner in tables_of(self.schema, entry):
                mark = json.dumps(inner, sort_keys=True)
                if mark not in self.seen:
                    self.seen.add(mark)
                    yield from self.sections(f"{path}.{key}".strip("."), inner, each)

    @staticmethod
    def kind(table: dict[str, Any]) -> str:
        """What tells one of several tables of a key from the others."""
        for key in ("kind", "model"):
            entry = table["properties"].get(key, {})
            if "const" in entry:
                return f'{key} = "{entry["const"]}"'
        return ""

    def table(self, keys: dict[str, Any]) -> nodes.table:
        """Keys, a row each."""
        group = nodes.tgroup(cols=len(HEADS))
        group += [nodes.colspec(colwidth=width) for width in WIDTHS]
        head, body = nodes.thead(), nodes.tbody()
        group += [head, body]
        head += self.row([nodes.Text(word) for word in HEADS])
        for key, entry in keys.items():
            shown = [
                nodes.literal("", key),
                nodes.Text(told(self.schema, entry)),
                nodes.Text(entry.get("description", "")),
            ]
            shown.append(nodes.literal("", example(entry)) if example(entry) else nodes.Text(""))
            body += self.row(shown)
        return nodes.table("", group)

    @staticmethod
    def row(cells: list[nodes.Node]) -> nodes.row:
        """A row of paragraphs."""
        return nodes.row("", *[nodes.entry("", nodes.paragraph("", "", cell)) for cell in cells])


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the directive known."""
    app.add_directive("schema-keys", SchemaKeys)
    return {"parallel_read_safe": True}
