"""[[choices]] and [parts_price] of a problem file, and the CSV files of parts to choose from."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from pydantic import Field

from laufruhe.errors import counted
from laufruhe.extensions.parts_lists.lists import Choices, PartsList
from laufruhe.extensions.parts_lists.price import PartsPrice
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, require_distinct
from laufruhe.files.fields import Name, Table
from laufruhe.files.problem_file import ExtensionContext, Key
from laufruhe.problem.problem import Problem

MAX_LISTS, MAX_ROWS, MAX_BYTES = 8, 500, 1_000_000
_EXAMPLE = "write a head such as: name, stiffness.z [N/mm], and one line for each part"


class ChoiceTable(Table):
    """A part to choose: one row of a CSV file with the parts of a maker."""

    closed: ClassVar[str] = "chooses a part, and is no number of the engine"

    name: Name
    file: str = f.required("CSV file beside the problem file, with one row for each part on sale.")
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


def _cells(table: ChoiceTable, path: Path, where: str) -> list[tuple[int, list[str]]]:
    """Return number and cells of each line of a CSV file that is neither blank nor a comment."""
    try:
        with path.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
        lines = [(k, line) for k, line in enumerate(content.decode("utf-8-sig").splitlines(), 1) if line.strip()]
    except (OSError, ValueError) as error:
        reason = error.strerror or "error" if isinstance(error, OSError) else "it is no UTF-8 text"
        raise Refused(where, table.file, f"cannot be read ({reason})", "give a CSV file beside the problem") from None
    lines = [(k, line) for k, line in lines if not line.lstrip().startswith("#")]
    separator = max(",;\t", key=lines[0][1].count) if lines else ","
    rows = csv.reader((line for _, line in lines), delimiter=separator, skipinitialspace=True)
    cells = [(k, [cell.strip() for cell in row]) for (k, _), row in zip(lines, rows, strict=False)]
    if not 2 <= len(cells) <= MAX_ROWS + 1 or len(content) > MAX_BYTES:
        rule = f"has {counted(max(len(cells) - 1, 0), 'row')}, and 1 to {MAX_ROWS} are allowed in {MAX_BYTES:,} bytes"
        raise Refused(where, table.file, rule, _EXAMPLE)
    return cells


def _list(table: ChoiceTable, context: ExtensionContext, where: str) -> PartsList:
    at = f"{where}.file"
    (_, heads), *rows = _cells(table, context.folder / table.file, at)
    if twice := [head for k, head in enumerate(heads) if not head or head in heads[:k]]:
        rule = f"has no head for a column, or two heads '{twice[0]}'"
        raise Refused(at, table.file, rule, "give each column a head of its own")
    names = set[str]()
    for line, row in rows:
        place = f"has in line {line}, row '{row[0]}'"
        if len(row) != len(heads) or len(heads) < 2:
            rule = f"{place}: {counted(len(row), 'cell')}, and {len(heads)} in its head"
            raise Refused(at, table.file, rule, "give each row as many cells as the head, two or more")
        if not row[0] or row[0] in names:
            rule = f"{place}, column '{heads[0]}': no name, or that of another row"
            raise Refused(at, table.file, rule, "give each row a name of its own")
        names.add(row[0])
    return PartsList(
        table.name, table.file, where, tuple(heads), tuple(tuple(row) for _, row in rows),
        tuple(line for line, _ in rows), tuple(table.parts), table.sets, table.count or max(len(table.parts), 1),
    )  # fmt: skip


def _choices(tables: list[ChoiceTable], problem: Problem, context: ExtensionContext) -> Problem:
    require_distinct([table.name for table in tables], "choices", "choices have one name")
    if len(tables) > MAX_LISTS:
        raise Refused("choices", None, f"has {len(tables)} lists", f"choose from at most {MAX_LISTS} at once")
    lists = tuple(_list(table, context, f"choices[{k}]") for k, table in enumerate(tables, 1))
    return replace(problem, extras=(*problem.extras, Choices(lists))) if lists else problem


def _price(table: PartsPriceTable, problem: Problem, _: ExtensionContext) -> Problem:
    return replace(problem, engine=problem.engine.with_extra(PartsPrice(table.total)))


CHOICES = Key("choices", list[ChoiceTable], _choices, single=True)
PRICE = Key("parts_price", PartsPriceTable, _price)
