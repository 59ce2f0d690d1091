"""[[choices]] and [parts_price] of a problem file, and the CSV files of parts to choose from."""

from __future__ import annotations

import csv
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from pydantic import Field

from laufruhe.errors import counted
from laufruhe.extensions.parts_lists.lists import Choices, Sheet
from laufruhe.extensions.parts_lists.price import PartsPrice
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, require_distinct
from laufruhe.files.fields import Name, Table
from laufruhe.files.problem_file import ExtensionContext, Key
from laufruhe.problem.problem import Problem

MAX_LISTS, MAX_ROWS, MAX_BYTES = 8, 500, 1_000_000
_EXAMPLE = "write a head such as: name, stiffness.z [N/mm], and one line for each part"


class ChoiceTable(Table):
    """A part to choose: one row of a CSV file of parts that can be bought."""

    closed: ClassVar[str] = "chooses a part, and is no number of the engine"

    name: Name
    file: str = f.required("CSV file beside the problem file, with one row for each part that can be bought.")
    parts: list[str] = f.optional(
        "Parts of this file whose keys are the columns, by their names in results or paths; all take one row.", []
    )
    sets: dict[str, str] = f.optional(
        "Path of another number, such as the max of a limit, for each column that gives its value.", {}
    )
    count: int | None = Field(
        default=None, ge=1, le=1000, description="Number of parts to buy; by default one for each of `parts`."
    )


class PartsPriceTable(Table):
    """Price of the parts that the lists replace, in the currency of the lists."""

    closed: ClassVar[str] = "is the price of parts, and no number of the engine"

    total: f.NonNegative = f.required("Price of the parts as the file gives them; the prices of rows replace it.")


def _cells(file: str, path: Path, where: str) -> list[tuple[int, list[str]]]:
    """Return number and cells of each line of a CSV file that is neither blank nor a comment."""
    try:
        with path.open("rb") as stream:
            text = stream.read(MAX_BYTES).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        reason = error.strerror or "error" if isinstance(error, OSError) else "it is no UTF-8 text"
        raise Refused(where, file, f"cannot be read ({reason})", "give a CSV file beside the problem") from None
    lines = [(k, line) for k, line in enumerate(text.splitlines(), 1) if line.strip() and line.lstrip()[0] != "#"]
    separator = max(",;\t", key=lines[0][1].count) if lines else ","
    rows = csv.reader((line for _, line in lines), delimiter=separator, skipinitialspace=True)
    return [(k, [cell.strip() for cell in row]) for (k, _), row in zip(lines, rows, strict=False)]


def _sheet(table: ChoiceTable, context: ExtensionContext, where: str) -> Sheet:
    at, lines = f"{where}.file", _cells(table.file, context.folder / table.file, f"{where}.file")
    (_, heads), *rows = lines or [(1, [])]
    if not 0 < len(rows) <= MAX_ROWS or len(heads) < 2:
        rule = f"has {counted(len(heads), 'column')} and {counted(len(rows), 'row')}, and may have up to {MAX_ROWS}"
        raise Refused(at, table.file, rule, _EXAMPLE)
    if len(set(heads)) < len(heads) or "" in heads:
        twice = next(head for head in heads if heads.count(head) > 1 or not head)
        raise Refused(
            at, table.file, f"has no column or two columns '{twice}'", "give each column a heading of its own"
        )
    for line, row in rows:
        if len(row) != len(heads):
            rule = f"has {counted(len(row), 'cell')} in line {line}, row '{row[0]}', and {len(heads)} in its head"
            raise Refused(at, table.file, rule, "give each row as many cells as the head")
    names = Counter(row[0] for _, row in rows)
    if "" in names or max(names.values()) > 1:
        name = "" if "" in names else max(names, key=names.__getitem__)
        line = [line for line, row in rows if row[0] == name][-1]
        rule = f"has in line {line}, column '{heads[0]}': '{name}', which names no part or two parts"
        raise Refused(at, table.file, rule, "give each row a name of its own")
    return Sheet(
        table.name, table.file, where, tuple(heads), tuple(tuple(row) for _, row in rows),
        tuple(line for line, _ in rows), tuple(table.parts), dict(table.sets), table.count or max(len(table.parts), 1),
    )  # fmt: skip


def _choices(tables: list[ChoiceTable], problem: Problem, context: ExtensionContext) -> Problem:
    require_distinct([table.name for table in tables], "choices", "choices have one name")
    if len(tables) > MAX_LISTS:
        raise Refused("choices", None, f"has {len(tables)} lists", f"choose from at most {MAX_LISTS} at once")
    sheets = tuple(_sheet(table, context, f"choices[{k}]") for k, table in enumerate(tables, 1))
    return replace(problem, extras=(*problem.extras, Choices(sheets)))


def _price(table: PartsPriceTable, problem: Problem, _: ExtensionContext) -> Problem:
    return replace(problem, engine=problem.engine.with_extra(PartsPrice(table.total)))


CHOICES = Key("choices", list[ChoiceTable], _choices, single=True)
PRICE = Key("parts_price", PartsPriceTable, _price)
