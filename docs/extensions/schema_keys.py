"""Directive `schema-keys`: every key of a file as its JSON schema has it, a section for each table of the file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib.resources import files
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from laufruhe.files.hover import alternatives, kind

HEADS = ("key", "type", "meaning", "example")
WIDTHS = (20, 25, 40, 15)


def tables_of(schema: dict[str, Any], entry: dict[str, Any]) -> Iterator[tuple[bool, dict[str, Any]]]:
    """Tables that a key holds, and whether it is a list of them."""
    for one in alternatives(schema, entry):
        if "properties" in one and "between" not in one["properties"]:
            yield False, one
        elif one.get("type") == "array" and isinstance(one.get("items"), dict):
            yield from ((True, table) for _, table in tables_of(schema, one["items"]))


def parts_of(table: dict[str, Any]) -> list[dict[str, Any]]:
    """Tables of which one stands there, as its kind says."""
    return [choice["then"] for choice in table.get("allOf", ())] or [table]


def shown(value: Any) -> str:
    """A value as it stands in a file."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {shown(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(shown, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


class SchemaKeys(SphinxDirective):
    """`{schema-keys} laufruhe.schema.json`."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Sections in the order of the schema, each table once."""
        path = files("laufruhe.files") / self.arguments[0]
        self.env.note_dependency(str(path))
        self.schema = json.loads(path.read_text(encoding="utf-8"))
        self.seen: set[str] = set()
        return list(self.sections("", self.schema, False))

    def sections(self, path: str, table: dict[str, Any], is_list: bool) -> Iterator[nodes.Node]:
        """The section of a table, and then those of what stands in it."""
        name = f"[[{path}]]" if is_list else f"[{path}]" if path else "At the top of the file"
        title = f"{name}, {which}" if (which := self.which(table)) else name
        section = nodes.section(ids=[nodes.make_id(f"{self.arguments[0]}-{title}")])
        section += nodes.title("", title)
        if "description" in table:
            section += nodes.paragraph("", table["description"])
        section += self.table(table["properties"])
        yield section
        for key, entry in table["properties"].items():
            for each, inner in tables_of(self.schema, entry):
                for part in parts_of(inner):
                    table = next(alternatives(self.schema, part))
                    mark = json.dumps(table, sort_keys=True)
                    if mark not in self.seen:
                        self.seen.add(mark)
                        yield from self.sections(f"{path}.{key}".strip("."), table, each)

    @staticmethod
    def which(table: dict[str, Any]) -> str:
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
            words = [nodes.Text(word) for word in (kind(self.schema, entry), entry.get("description", ""))]
            example = [nodes.literal("", shown(one)) for one in entry.get("examples", ())]
            body += self.row([nodes.literal("", key), *words, *example])
        return nodes.table("", group)

    @staticmethod
    def row(cells: list[nodes.Node]) -> nodes.row:
        """A row of paragraphs."""
        return nodes.row("", *[nodes.entry("", nodes.paragraph("", "", cell)) for cell in cells])


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the directive known."""
    app.add_directive("schema-keys", SchemaKeys)
    return {"parallel_read_safe": True}
