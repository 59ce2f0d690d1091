"""The Python functions for tables of problem files, made of the schema: `python tests/schemas.py` writes them.

A function for each table inside a table, a method for each table of an engine or of a problem, and a function for each
layout. Every key of the file is an argument; `describe` adds to the docstring what the schema says of the key.
"""

from __future__ import annotations

import keyword
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import laufruhe
from laufruhe.files.engine import EngineTable
from laufruhe.machine.drives import DRIVES
from laufruhe.machine.layouts import LAYOUTS
from laufruhe.python.keys import NAMES, alternatives
from schemas import problem_schema

PACKAGE = Path(laufruhe.__file__).parent
PARTS, TABLES, LAYOUT_CALLS, GOALS = (
    PACKAGE / place for place in ("python/parts.py", "python/tables.py", "python/layouts.py", "problem/goals.py")
)
TEXTS = ("title", "source", "assumptions", "tolerance")
"""Keys of the file that are arguments of `laufruhe.problem`."""
GOAL_KEYS = ("objective", "constraints")
WIDTH = 120
MADE = "`python tests/schemas.py` makes this file of the models of problem files."
ARGUMENTS = {key: name for name, key in NAMES.items()}
CHOICES = 40

Entry = Mapping[str, Any]


@cache
def schema() -> dict[str, Any]:
    return problem_schema()


def quoted(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else repr(value)


def argument(key: str) -> str:
    name = ARGUMENTS.get(key, key)
    assert not keyword.iskeyword(name), key
    return name


def type_of(entry: Entry, key: str = "", table: Entry | None = None) -> str:
    """Type annotation of a key, without None."""
    found: list[str] = []
    for one in alternatives(schema(), entry):
        if "between" in one.get("properties", {}):
            found.append("Open")
        elif "properties" in one or one.get("type") == "object":
            found.append("Table")
        elif "const" in one or "enum" in one:
            choices = one.get("enum", [one.get("const")])
            if key in ("limit", "minimise", "quantity"):
                found.append("QuantityName")
            elif len(choices) > CHOICES:
                found.append("str")
            else:
                found.append(f"Literal[{', '.join(map(quoted, choices))}]")
        elif one.get("type") == "array":
            inner = type_of(one["items"])
            is_row = inner in ("Number", "Value")
            found.append("Values" if is_row else f"Sequence[{inner}]")
            if inner == "Values":
                found.append("Array")
        elif "x-dimension" in one or one.get("type") == "number":
            found.append("Number")
        else:
            kinds = one["type"] if isinstance(one["type"], list) else [one["type"]]
            names = {"integer": "int", "boolean": "bool", "string": "str", "object": "Table", "number": "Number"}
            found += [names[kind] for kind in kinds]
    found = list(dict.fromkeys(found))
    if "Number" in found:
        found = [name for name in found if name not in ("str", "int", "float")]
    if key in ("unbalance", "mass") and table is not None and "angle" in table["properties"]:
        found.append("complex")
    return " | ".join(found).replace("Number | Open", "Value")


def wrapped(text: str, indent: str) -> str:
    return textwrap.fill(text, WIDTH, initial_indent=indent, subsequent_indent=indent, break_long_words=False)


def packed(items: Sequence[str], indent: str, mark: str = ",") -> str:
    """Return the items with a mark behind each, as many on a line as fit, long ones divided at commas."""
    lines: list[str] = []
    for item in items:
        if lines and len(lines[-1]) + len(item) + 1 + len(mark) <= WIDTH:
            lines[-1] += f" {item}{mark}"
        elif len(indent + item + mark) <= WIDTH:
            lines.append(f"{indent}{item}{mark}")
        else:
            divided = packed(re.split(r"(?<=['\"]), ", item), indent + "    ").split("\n")
            lines += [indent + divided[0].strip(), *divided[1:]]
    return "\n".join(lines)


class Call:
    """A function or method that takes the keys of one table."""

    def __init__(
        self, name: str, summary: str, table: Entry, returns: str, body: str, *, first: str = "", method: bool = False,
        fixed: Mapping[str, Any] | None = None, required: frozenset[str] = frozenset(),
    ) -> None:  # fmt: skip
        self.name, self.summary, self.returns, self.body, self.method = name, summary, returns, body, method
        self.first, self.table = first, table
        self.keys = {key: entry for key, entry in table["properties"].items() if key not in (fixed or {})}
        self.required = required or frozenset(table.get("required", ()))

    def text(self) -> str:
        indent = "    " if self.method else ""
        needed = [key for key in self.keys if key in self.required and key != self.first]
        others = [key for key in self.keys if key not in self.required and key != self.first]
        signature = ["self"] if self.method else []
        if self.first:
            plain = self.annotated(self.first, self.first in self.required)
            signature += [plain]
        if needed or others:
            signature.append("*")
        signature += [self.annotated(key, True) for key in needed] + [self.annotated(key, False) for key in others]
        arguments = ", ".join(signature)
        head = f"{indent}def {self.name}({arguments}) -> {self.returns}:"
        if len(head) > WIDTH:
            head = f"{indent}def {self.name}(\n{packed(signature, f'{indent}    ')}\n{indent}) -> {self.returns}:"
        doc = f'{indent}    """{self.summary}'
        if len(doc) + 3 > WIDTH:
            summary, _, more = self.summary.partition(". ")
            doc = f'{indent}    """{summary}.\n\n' + wrapped(more, indent + "    ") + f"\n{indent}    "
        return f'{head}\n{doc}"""\n{indent}    return {self.body}\n'

    def annotated(self, key: str, required: bool) -> str:
        kind = type_of(self.keys[key], key, self.table)
        return f"{argument(key)}: {kind}" if required else f"{argument(key)}: {kind} | None = None"


def snake(title: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", title.removesuffix("Table")).lower()


def tables_of(entry: Entry) -> Iterator[tuple[bool, Entry]]:
    """Yield the tables that may stand for a key, and whether it is a list of them."""
    for one in alternatives(schema(), entry):
        if "properties" in one and "between" not in one["properties"]:
            yield False, one
        elif one.get("type") == "array":
            yield from ((True, table) for _, table in tables_of(one["items"]))


def fixed_of(table: Entry) -> dict[str, str]:
    """Return the key that tells a table from others of its key, with its value."""
    return {key: table["properties"][key]["const"] for key in ("model",) if "const" in table["properties"].get(key, {})}


def nested() -> list[Entry]:
    """Return the tables inside tables, each once."""
    seen: dict[str, Entry] = {}

    def visit(table: Entry) -> None:
        for entry in table["properties"].values():
            for _, inner in tables_of(entry):
                if inner["title"] not in seen:
                    seen[inner["title"]] = inner
                    visit(inner)

    for entry in schema()["properties"].values():
        for _, table in tables_of(entry):
            visit(table)
    return [seen[title] for title in sorted(seen)]


def imports(text: str, names: Mapping[str, tuple[str, ...]]) -> str:
    """Import lines of those names that a text uses."""
    lines = []
    text = re.sub(r'""".*?"""', "", text, flags=re.DOTALL)
    for module, members in names.items():
        used = [name for name in members if re.search(rf"\b{name}\b", text)]
        if used:
            lines.append(wrapped(f"from {module} import {', '.join(used)}", "").replace("\n", " \\\n    "))
    return "\n".join(lines)


STANDARD = {"collections.abc": ("Sequence",), "typing": ("Literal", "Self", "TypeAlias")}
OWN = ("Array", "Number", "Open", "Table", "Value", "Values")


def module(doc: str, body: str, extra: Mapping[str, tuple[str, ...]]) -> str:
    gap = "\n" if body.startswith(("def", "class")) else ""
    head = imports(body, STANDARD)
    own = imports(body, {**extra, "laufruhe.problem.number_types": OWN})
    own = "\n".join(sorted(own.split("\n")))
    doc = f'"""{doc}\n\n{MADE}\n"""\n# fmt: off\n'
    return f"{doc}\nfrom __future__ import annotations\n\n{head}\n\n{own}\n\n{gap}{body}"


def first_of(table: Entry) -> str:
    return next((key for key in ("name", "speed") if key in table["properties"]), "")


def article(words: str) -> str:
    return f"{'an' if words[0] in 'aeiou' else 'a'} {words}"


def tables_module() -> str:
    calls = []
    for table in nested():
        name, fixed = snake(table["title"]), fixed_of(table)
        summary = f"Return a table `{name}`. {table.get('description', '')}".rstrip()
        given = f"keys_of(locals(), {fixed})" if fixed else "keys_of(locals())"
        calls.append(Call(name, summary, table, "Table", given, first=first_of(table), fixed=fixed).text())
    body = "\n\n".join([*calls, "describe(globals())\n"])
    extra = {"laufruhe.python.keys": ("describe", "keys_of"), "laufruhe.problem.goals": ("QuantityName",)}
    return module("Tables inside the tables of a problem file, such as an unbalance of a shaft.", body, extra)


def parts_module() -> str:
    calls = []
    for key, entry in schema()["properties"].items():
        if key == "engine" or key in (*TEXTS, *GOAL_KEYS):
            continue
        for is_list, table in tables_of(entry):
            fixed = fixed_of(table)
            name = key.removesuffix("s") if is_list else "_".join((key, *fixed.values()))
            words = name.replace("_", " ")
            summary = f"Return the engine with {article(words) if is_list else words}. {entry.get('description', '')}"
            given = f"keys_of(locals(), {fixed})" if fixed else "keys_of(locals())"
            body = f'self._with("{key}", "{name}", {given})'
            call = Call(name, summary.rstrip(), table, "Self", body, first=first_of(table), method=True, fixed=fixed)
            calls.append(call.text())
    head = (
        'class EngineParts(Parts):\n    """Methods that add a table of a problem file to an engine; each returns a new '
        'engine."""\n\n'
    )
    extra = {"laufruhe.python.keys": ("Parts", "describe", "keys_of"), "laufruhe.problem.goals": ("QuantityName",)}
    return module(
        "Parts and settings of an engine in code.",
        "\n".join([head + calls[0], *calls[1:], "\ndescribe(vars(EngineParts))\n"]),
        extra,
    )


def goals_module() -> str:
    objective, limit = (next(table for _, table in tables_of(schema()["properties"][key])) for key in GOAL_KEYS)
    names = next(alternatives(schema(), limit["properties"]["limit"]))["enum"]
    alias = (
        f"QuantityName: TypeAlias = Literal[\n{packed([quoted(name) for name in names], '    ')}\n] | str\n"
        '"""Quantities that may be minimised or limited; those of extensions of users are texts."""\n\n\n'
    )
    replaces = "Return the problem with this objective, in place of earlier ones."
    follows = "Return the problem with one more objective, among the designs that are best by earlier ones. "
    follows += "`within` is the share by which the objective before this one may exceed its least value."
    calls = [
        Call(
            "minimise", replaces, objective, "Self", 'self._with_goal("objective", locals(), False)', first="minimise",
            method=True, fixed={"within": None},
        ),
        Call(
            "then_minimise", follows, objective, "Self", 'self._with_goal("objective", locals(), True)',
            first="minimise", method=True,
        ),
        Call(
            "limit", "Return the problem with one more limit.", limit, "Self",
            'self._with_goal("constraints", locals(), True)', first="limit", method=True,
        ),
    ]  # fmt: skip
    head = (
        'class Goals(ABC):\n    """Methods that add objectives and limits; each returns a new problem."""\n\n'
        "    @abstractmethod\n    def _with_goal(self, key: str, keys: Table, adds: bool) -> Self: ...\n\n"
    )
    body = alias + head + "\n".join(call.text() for call in calls)
    return module("Objectives and limits of a problem in code.", body, {}).replace(
        "from collections.abc", "from abc import ABC, abstractmethod\nfrom collections.abc", 1
    )


def layouts_module() -> str:
    _, engine = next(tables_of(schema()["properties"]["engine"]))
    engine = next(one for one in alternatives(schema(), schema()["properties"]["engine"]) if "properties" in one)
    required = frozenset(key for key, field in EngineTable.model_fields.items() if field.is_required()) - {"layout"}
    lists = {key for kind in LAYOUTS.values() for key in kind.lists}
    owned = {key.name for kind in LAYOUTS.values() for key in kind.keys} | lists
    pistons = {"drive", "bore", "stroke", "rod_ratio", "rod_length", "offset", "reciprocating_mass", "rod",
               "rod_inertia_deficit", *(key.name for kind in DRIVES.values() for key in kind.keys)}  # fmt: skip
    calls = []
    for name, kind in LAYOUTS.items():
        keys = {
            key: entry
            for key, entry in engine["properties"].items()
            if key not in ("layout", "catalogue")
            and (kind.takes(key) or key not in owned)
            and (kind.has_pistons or key not in pistons)
        }
        doc = (type(kind).__doc__ or "").split("\n")[0].rstrip(".")
        summary, given = f"Return an engine of layout {name}. {doc}.", f'engine_of(locals(), {{"layout": "{name}"}})'
        call = Call(
            name.replace("-", "_"), summary, {"properties": keys}, "EngineDraft", given, first="cylinders",
            required=required,
        )  # fmt: skip
        calls.append(call.text())
    summary, keys = "Return an engine of the catalogue; arguments replace its numbers.", dict(engine["properties"])
    call = Call(
        "engine", summary, {"properties": keys}, "EngineDraft", "engine_of(locals(), {})", first="catalogue",
        required=frozenset({"catalogue"}),
    )  # fmt: skip
    calls.append(call.text())
    extra = {"laufruhe.python.draft": ("EngineDraft", "engine_of"), "laufruhe.python.keys": ("describe",)}
    return module(
        "Engines in code: a function for each layout, and one for the catalogue.",
        "\n\n".join([*calls, 'describe(globals(), "EngineTable")\n']),
        extra,
    )


MAKERS = {GOALS: goals_module, TABLES: tables_module, PARTS: parts_module, LAYOUT_CALLS: layouts_module}
"""Functions that return the text of each file that is made of the schema."""
