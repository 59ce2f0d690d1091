"""Pages made of other files, which read without the site too: `python docs/extensions/pages.py` writes them."""

from __future__ import annotations

import ast
import json
import re
import sys
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeAlias

DOCS = Path(__file__).parents[1]
sys.path.append(str(DOCS.parent / "tests"))

from schemas import alternatives, default, kind  # noqa: E402

HEAD = "| key | type | meaning | default | example |\n| --- | --- | --- | --- | --- |\n"
KEYS = """\
# All keys

Every key of problem and study files, from the schemas that editors use. *Number* is a plain number; a dimension means
a number with a unit; *may be open* means that `{ between = [low, high] }` may stand in place of the number.

The example shows how to write a value. The value that counts without the key is the *default*: `required` if the file
must have the key, and blank if nothing is assumed or if the meaning says what follows. Keys of `[engine]` may also come
from the catalogue, and those of a part of a study from `[study.common]`.
"""
GALLERY = """\
# Programs of the gallery

Each program solves a ready problem and draws its pictures. The documentation site (`make docs`) shows them.

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


def row(schema: dict[str, Any], key: str, entry: dict[str, Any], is_required: bool) -> str:
    """One key."""
    usual = "required" if is_required else f"`{text}`" if (text := default(schema, entry)) else ""
    examples = ", ".join(f"`{shown(one)}`" for one in entry.get("examples", ()))
    cells = (f"`{key}`", kind(schema, entry), entry.get("description", ""), usual, examples)
    return "| " + " | ".join(" ".join(cell.split()).replace("|", "\\|") for cell in cells) + " |\n"


def sections(schema: dict[str, Any], path: str, table: dict[str, Any], is_list: bool, seen: set[str]) -> Iterator[str]:
    """The section of a table, and then those of what stands in it, each table once."""
    name = f"`[[{path}]]`" if is_list else f"`[{path}]`" if path else "At the top of the file"
    told = [f"{table['description']}\n"] if "description" in table else []
    needed = table.get("required", ())
    rows = "".join(row(schema, key, entry, key in needed) for key, entry in table["properties"].items())
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

Two things decide how good a design can be proven to be: which numbers are open, and which quantities count in the
objective and limits. This page has the tables from which the program chooses its method.
[The report](../reference/results.md) states the proof of each design, and
[What a proof claims](../theory/proofs.md) explains the words.

To look up a problem:

1. List the kinds of numbers that are open, such as unbalances and stiffness.
2. Find in the second table how each quantity depends on each of these kinds.
3. Take the first row of the first table whose kinds include all open ones, and which accepts these dependences.

Labels such as P13 are those of [the theory](../theory/equations.md).

## Methods

The first row that fits decides. Only the last row accepts quantities that are not in the second table. If a
method does not cover one of the limits or terms, its bound leaves this limit or term out.

The first table calls the following the *quantities of elastic mounts*: {of_mounts}.

| method | open | quantities may be | its bound proves |
| --- | --- | --- | --- |
"""
DEPENDENCES = """
## Quantities

Each row shows how its quantities depend on numbers of each kind while all other numbers are fixed. The table holds for
elastic mounts at an even speed. Quantities in one row depend on all kinds in the same way. A dash means no
dependence.

| words | meaning |
| --- | --- |
"""
WORDS = {
    "affine": "a constant plus multiples of the open numbers",
    "affine while unbalances are fixed": "affine in these numbers once the unbalances are fixed",
    "affine between bearings": "the same, with a kink where a place passes a bearing of its shaft",
    "affine in masses that follow": "affine in masses that sizes set, times a monotone factor",
    "sum of shifted parts": "a sum over throws or shafts, each earlier by its own angle",
    "number of shifted parts": "one number of a signal that is a sum of shifted parts",
    "convex": "any tangent lies below it",
    "never falls, never rises": "monotone in each number",
    "smooth": "continuous, and nothing more is claimed",
}
SHORT = {
    "NONE": "-",
    "AFFINE": "affine",
    "BIAFFINE": "affine while unbalances are fixed",
    "KINKED": "affine between bearings",
    "MASSES": "affine in masses that follow",
    "SHIFT": "sum of shifted parts",
    "SWING": "number of shifted parts",
    "CONVEX": "convex",
    "MONOTONE_UP": "never falls",
    "MONOTONE_DOWN": "never rises",
    "SMOOTH": "smooth",
    "UNKNOWN": "unknown",
}


CLAIMS = """
## Norms

A norm makes one number of a signal, such as its mean or its largest value. Methods and bounds use only the properties
in this table. Every method with a bound needs a convex norm. Boxes, stars and smooth programs also need the property
*points alone*, and boxes of sizes the property *of row lengths*.

- *Of row lengths* means that only the lengths of the vectors count, and not their directions. The norm never
  falls if one length grows.
- *Points alone* means that the norm does not depend on which samples belong to which operating point.
- *Averages bound it* means that averages about the angles bound the whole cycle (P7).

| norm | properties |
| --- | --- |
"""
FACTS = {
    "is_convex": "convex",
    "is_monotone_in_lengths": "of row lengths",
    "is_pointwise": "points alone",
    "sums_lengths": "sum of lengths",
    "is_euclidean": "root of the sum of squares",
    "is_largest": "largest length",
    "is_diameter": "largest diameter of a signal",
    "is_largest_mean": "largest mean of an operating point",
    "averages": "averages bound it",
}


def proven() -> str:
    """Return the methods, and how every quantity depends on every kind."""
    from laufruhe.numerics.norms import NORMS
    from laufruhe.problem.decision import KINDS
    from laufruhe.problem.dependence import TABLE, Dependence
    from laufruhe.solvers import METHODS
    from laufruhe.solvers.method import OF_MOUNTS

    rows = [PROVEN.format(of_mounts=", ".join(sorted(channel.name for channel in OF_MOUNTS)))]
    for method in METHODS:
        every, missing = (
            len(method.dependences) >= len(KINDS) - 1,
            [k for k in KINDS.values() if k not in method.dependences],
        )
        kinds = ", ".join(kind.words for kind in method.dependences) or "nothing"
        kinds = "anything" + "".join(f" but {kind.words}" for kind in missing) if every else kinds
        rows.append(f"| {method.name} | {kinds} | {_asked(method, every)} | {method.proves} |\n")
    kinds = list(next(iter(TABLE.values())))
    heads = " | ".join(kind.words for kind in kinds)
    rows += [DEPENDENCES, *(f"| {words} | {meaning} |\n" for words, meaning in WORDS.items())]
    rows += [f"\n| quantities | {heads} |\n", "| --- " * (len(kinds) + 1) + "|\n"]
    names: dict[str, list[str]] = {}
    for name, row in TABLE.items():
        cells = " | ".join(SHORT[row.get(kind, Dependence.UNKNOWN).name] for kind in kinds)
        names.setdefault(cells, []).append(name)
    rows += [f"| {', '.join(alike)} | {cells} |\n" for cells, alike in names.items()]
    rows += [CLAIMS, "".join(f"| {name} | {_claimed(norm)} |\n" for name, norm in NORMS.items())]
    return "".join(rows)


def _claimed(norm: Any) -> str:
    """Return the properties that a norm claims, in words."""
    return ", ".join(words for fact, words in FACTS.items() if getattr(norm, fact))


def _asked(method: Any, every: bool) -> str:
    """Return the quantities that a method accepts, in words."""
    from laufruhe.solvers.method import OF_MOUNTS

    if every or not method.dependences:
        return "anything"
    found = dict.fromkeys(SHORT[each.name] for allowed in method.dependences.values() for each in allowed)
    of_mounts = method.known_channels >= OF_MOUNTS
    names = sorted(channel.name for channel in method.known_channels - (OF_MOUNTS if of_mounts else frozenset()))
    names += ["quantities of elastic mounts"] if of_mounts else []
    return "; ".join(part for part in (", ".join(found), ", ".join(names)) if part)


EQUATIONS = """\
# Equations

This table gives the page and the section of every label of the theory. A label is a letter for the subject and a
number; comments in the code, messages and other pages cite equations and statements by it.

Sources are named where they are used. Hasselgruber is *Grundlagen der Landtechnik* 1964, whose equation numbers stand
in parentheses. Roetscher is *Die Maschinenelemente*, chapter 14. The textbook and the worked diesel are named in the
[sources](../sources.md). Labels N are steps of the nonlinear programs, which `solvers/smooth/nonlinear.py` explains.

| labels | section | page |
| --- | --- | --- |
"""
LABEL = re.compile(r"\*\*([A-Z])(\d+)([a-z]?)\b|\\tag\{([A-Z])(\d+)([a-z]?)\}")

Label: TypeAlias = tuple[str, int, str]
"""Letter, number, and a small letter or nothing."""
Section: TypeAlias = tuple[str, str, str]
"""Link, heading, and title of the page."""


def equations() -> str:
    """Return the table of all labels of the theory, in their order, with the section that each stands in."""
    listed = re.findall(r"^   theory/([a-z-]+)$", (DOCS / "index.rst").read_text(encoding="utf-8"), re.MULTILINE)
    places: dict[Label, Section] = {}
    for name in listed:
        if name != "equations":
            places |= _labels_of(DOCS / "theory" / f"{name}.md")
    rows: list[tuple[Section, list[Label]]] = []
    for label in sorted(places):
        if not rows or rows[-1][0] != places[label] or rows[-1][1][-1][0] != label[0]:
            rows.append((places[label], []))
        rows[-1][1].append(label)
    return EQUATIONS + "".join(
        f"| {_span(labels)} | [{heading}]({link}) | {title} |\n" for (link, heading, title), labels in rows
    )


def _labels_of(page: Path) -> dict[Label, Section]:
    """Return the labels of a page, each with the section that it stands in first."""
    found: dict[Label, Section] = {}
    title = heading = ""
    for line in page.read_text(encoding="utf-8").splitlines():
        if head := re.match(r"#{1,3} (.*)", line):
            heading = head.group(1)
            title = title or heading
        anchor = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        section = (f"{page.name}#{anchor}", heading, title)
        for bold, number, letter, tag, tagged, small in LABEL.findall(line):
            found.setdefault((bold or tag, int(number or tagged), letter or small), section)
    return found


def _span(labels: list[Label]) -> str:
    """Return labels as words: `K1 to K6`, or the two or one that there are."""
    names = [f"{letter}{number}{small}" for letter, number, small in labels]
    return (
        names[0] if len(names) == 1 else f"{names[0]}, {names[1]}" if len(names) == 2 else f"{names[0]} to {names[-1]}"
    )


PAGES = {
    "reference/keys.md": keys,
    "theory/equations.md": equations,
    "gallery.md": gallery,
    "how-to/what-is-proven.md": proven,
}

if __name__ == "__main__":
    for place, made in PAGES.items():
        (DOCS / place).write_text(made(), encoding="utf-8")
