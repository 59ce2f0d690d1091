"""Pages made of other files, which read without the site too: `python docs/extensions/pages.py` writes them."""

from __future__ import annotations

import ast
import json
import sys
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1]
sys.path.append(str(DOCS.parent / "tests"))

from schemas import alternatives, kind  # noqa: E402

HEAD = "| key | type | meaning | example |\n| --- | --- | --- | --- |\n"
KEYS = """\
# All keys

Every key of problem and study files, from the schemas that editors use. *Number* is a plain number; a dimension means
a number with a unit; *may be open* means that `{ between = [low, high] }` may stand in place of the number.
"""
GALLERY = """\
# Gallery

What the ready problems solve. Each program makes the pictures of its problem; the documentation site (`make docs`)
shows them.

| example | program |
| --- | --- |
"""


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


def which(table: dict[str, Any]) -> str:
    """What tells one of several tables of a key from the others."""
    told = [(key, table["properties"][key]) for key in ("kind", "model") if key in table["properties"]]
    return next((f' {key} = "{entry["const"]}"' for key, entry in told if "const" in entry), "")


def row(schema: dict[str, Any], key: str, entry: dict[str, Any]) -> str:
    """One key."""
    examples = ", ".join(f"`{shown(one)}`" for one in entry.get("examples", ()))
    cells = (f"`{key}`", kind(schema, entry), entry.get("description", ""), examples)
    return "| " + " | ".join(" ".join(cell.split()).replace("|", "\\|") for cell in cells) + " |\n"


def sections(schema: dict[str, Any], path: str, table: dict[str, Any], is_list: bool, seen: set[str]) -> Iterator[str]:
    """The section of a table, and then those of what stands in it, each table once."""
    name = f"`[[{path}]]`" if is_list else f"`[{path}]`" if path else "At the top of the file"
    told = [f"{table['description']}\n"] if "description" in table else []
    rows = "".join(row(schema, key, entry) for key, entry in table["properties"].items())
    yield "\n".join([f"### {name}{which(table)}\n", *told, HEAD + rows])
    for key, entry in table["properties"].items():
        for each, inner in tables_of(schema, entry):
            for part in parts_of(inner):
                one = next(alternatives(schema, part))
                mark = json.dumps(one, sort_keys=True)
                if mark not in seen:
                    seen.add(mark)
                    yield from sections(schema, f"{path}.{key}".strip("."), one, each, seen)


def keys() -> str:
    """Every key of both schemas."""
    found = [KEYS]
    for title, name in (("Problem files", "laufruhe"), ("Study files", "laufruhe-study")):
        schema = json.loads((files("laufruhe.files") / f"{name}.schema.json").read_text(encoding="utf-8"))
        found += [f"## {title}\n", *sections(schema, "", schema, False, set())]
    return "\n".join(found)


def gallery() -> str:
    """Every example, with its first lines."""
    rows = []
    for path in sorted(DOCS.glob("examples/plot_*.py")):
        title, _, *lines = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n")
        words = " ".join(" ".join(lines).split())
        rows.append(f"| **{title}** {words} | [{path.name}](examples/{path.name}) |\n")
    return GALLERY + "".join(rows)


PROVEN = """\
# What is proven when

How good a design is proven to be follows from what is open and what is asked. These tables are made from those that
choose the method; [the report](../reference/results.md) says it of each design.

## Methods

The first row that covers all kinds that are open, and that what is asked suits, decides. What is not in the second
table is decided by the last row. A limit or a term that a method with a closing bound does not know is left out for
its bound alone.

| method | open | what is asked may be | its bound proves |
| --- | --- | --- | --- |
"""
DEPENDENCES = """
## Quantities

How each quantity depends on numbers of one kind while all others are held, on elastic mounts at an even speed. A dash
means that it does not.

"""
SHORT = {
    "NONE": "-",
    "AFFINE": "affine",
    "BIAFFINE": "affine while unbalances are fixed",
    "BENT": "the same between bearings",
    "MASSES": "affine in masses that follow",
    "SHIFT": "sum of shifted parts",
    "SWING": "number of such a sum",
    "CONVEX": "convex",
    "MONOTONE_UP": "never falls",
    "MONOTONE_DOWN": "never rises",
    "SMOOTH": "smooth",
    "UNKNOWN": "unknown",
}


CLAIMS = """
## Norms

What each norm claims of itself; methods and bounds use nothing else of it. Every method with a bound needs a convex
one; boxes, stars and smooth programs need one that takes points alone, and boxes of sizes one of row lengths.

| norm | claims |
| --- | --- |
"""
FACTS = {
    "is_convex": "convex",
    "of_row_lengths": "of row lengths, and never falls with one",
    "is_pointwise": "takes points alone",
    "sums_lengths": "sum of lengths",
    "is_euclidean": "root of the sum of squares",
    "is_largest": "largest length",
    "is_diameter": "largest diameter of a signal",
    "is_largest_mean": "largest mean of a point",
    "averages": "averages about angles bound it",
}


def proven() -> str:
    """The methods, and how every quantity depends on every kind."""
    from laufruhe.numerics.norms import NORMS
    from laufruhe.problem.decision import KINDS
    from laufruhe.problem.dependence import TABLE, Dependence
    from laufruhe.solvers import METHODS

    rows = [PROVEN]
    for method in METHODS:
        every, missing = len(method.needs) >= len(KINDS) - 1, [k for k in KINDS.values() if k not in method.needs]
        kinds = ", ".join(kind.words for kind in method.needs) or "nothing"
        kinds = "anything" + "".join(f" but {kind.words}" for kind in missing) if every else kinds
        rows.append(f"| {method.name} | {kinds} | {_asked(method, every)} | {method.proves} |\n")
    kinds = list(next(iter(TABLE.values())))
    heads = " | ".join(kind.words for kind in kinds)
    rows += [DEPENDENCES, f"| quantity | {heads} |\n", "| --- " * (len(kinds) + 1) + "|\n"]
    for name, row in TABLE.items():
        rows.append(
            f"| {name} | " + " | ".join(SHORT[row.get(kind, Dependence.UNKNOWN).name] for kind in kinds) + " |\n"
        )
    rows += [CLAIMS, "".join(f"| {name} | {_claimed(norm)} |\n" for name, norm in NORMS.items())]
    return "".join(rows)


def _claimed(norm: Any) -> str:
    """What a norm claims of itself, in words."""
    return ", ".join(words for fact, words in FACTS.items() if getattr(norm, fact))


def _asked(method: Any, every: bool) -> str:
    """What a method may be asked for, in words."""
    if every or not method.needs:
        return "anything"
    found = dict.fromkeys(SHORT[each.name] for needs in method.needs.values() for each in needs)
    names = sorted(channel.name for channel in method.knows)
    return "; ".join(part for part in (", ".join(found), ", ".join(names)) if part)


PAGES = {"reference/keys.md": keys, "gallery.md": gallery, "how-to/what-is-proven.md": proven}

if __name__ == "__main__":
    for place, made in PAGES.items():
        (DOCS / place).write_text(made(), encoding="utf-8")
