"""Lists of parts: rows of numbers at addresses of a problem file, and the file with some rows in it.

A combination has one row of each list. A subset has some rows of each list. The file of a subset leaves each number
open between the least and the largest of these rows, so that its lower bound holds for every combination in it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

from laufruhe.errors import Complaint
from laufruhe.files.complaints import Refused, key_path, nearest
from laufruhe.files.edits import keys_by_name
from laufruhe.files.nested import Place, at, with_value_at
from laufruhe.problem.problem import Extra

Tables: TypeAlias = Mapping[str, Any]
Subset: TypeAlias = tuple[tuple[int, ...], ...]
"""For each list, the indices of some of its rows."""
PRICE, _SIDES = "price", {"max": max, "min": min}
_HEAD = re.compile(r"(.*?)\s*(?:\[(.*)\])?")


@dataclass(frozen=True)
class Sheet:
    """Table [[choices]] with its key `where`, and the cells and lines of its CSV file."""

    name: str
    file: str
    where: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    parts: tuple[str, ...]
    sets: Mapping[str, str]
    count: int

    def refused(self, rule: str, remedy: str) -> Refused:
        """Return the complaint about the file of the list."""
        return Refused(f"{self.where}.file", self.file, rule, remedy)

    def refused_cell(self, row: int, column: str, rule: str, remedy: str) -> Refused:
        """Return the complaint about a row, in the column with this heading unless it is empty."""
        where = f"line {self.lines[row]}, row '{self.rows[row][0]}'" + (f", column '{column}'" if column else "")
        return self.refused(f"has in {where}: {rule}", remedy)

    def numbers(self, column: int) -> tuple[float, ...]:
        """Return the numbers of a column."""
        numbers = list[float]()
        for k, row in enumerate(self.rows):
            try:
                numbers.append(float(row[column]))
            except ValueError:
                numbers.append(math.nan)
            if not math.isfinite(numbers[-1]):
                remedy = "write a number with a decimal point, and its unit in the head"
                raise self.refused_cell(k, self.heads[column], f"'{row[column]}', which is no number", remedy)
        return tuple(numbers)


@dataclass(frozen=True)
class Column:
    """Numbers of a list, one for each row in a unit, and their addresses; `side` is "max" or "min" for a limit."""

    head: str
    unit: str
    values: tuple[float, ...]
    places: tuple[Place, ...]

    @property
    def side(self) -> str:
        """Side of a limit that the column sets; empty for other numbers."""
        return next((str(p[-1]) for p in self.places if p[0] == "constraints" and p[-1] in _SIDES), "")

    def varies(self, rows: Sequence[int]) -> bool:
        """Return True if some rows differ in this number, and it is no limit."""
        return not self.side and len({self.values[row] for row in rows}) > 1

    def over(self, rows: Sequence[int]) -> Any:
        """Return what a file has for some rows: a number, the widest limit, or an open number."""
        values = [self.values[row] for row in rows]
        if not self.varies(rows):
            return self._written(_SIDES[self.side or "max"](values))
        low, high = min(values), max(values)
        return {"between": [self._written(low), self._written(high)], "start": self._written(0.5 * (low + high))}

    def _written(self, value: float) -> str | float:
        return f"{value!r} {self.unit}" if self.unit else value


@dataclass(frozen=True)
class PartsList:
    """Rows of a list: numbers that they set, and prices of all parts that are bought."""

    sheet: Sheet
    columns: tuple[Column, ...]
    prices: tuple[float, ...]


@dataclass(frozen=True)
class Combination:
    """Combination that was solved: its value [SI], infinite without a design, its lower bound, and the proof."""

    rows: tuple[int, ...]
    value: float
    bound: float
    proof: str


@dataclass(frozen=True)
class Outcome:
    """Outcome of a choice: combinations that were solved, the best first, and numbers of all and of excluded ones."""

    lists: tuple[PartsList, ...]
    solved: tuple[Combination, ...]
    whole: int
    excluded: int


@dataclass(frozen=True)
class Choices(Extra):
    """Choice of one row of each list; with its outcome after the solve."""

    sheets: tuple[Sheet, ...]
    outcome: Outcome | None = None
    words: ClassVar[str] = "the choice from lists of parts"

    @property
    def open_names(self) -> tuple[str, ...]:
        """Names of the choices."""
        return tuple(f"row of '{sheet.name}'" for sheet in self.sheets)


def lists_of(choices: Choices, tables: Tables) -> tuple[PartsList, ...]:
    """Return the lists with the addresses of their columns in a file; raise `Refused` for wrong heads or cells."""
    lists, taken = tuple(_list(sheet, tables) for sheet in choices.sheets), dict[Place, str]()
    for parts, column, place in ((p, c, place) for p in lists for c in p.columns for place in c.places):
        if place in taken:
            rule = f"has the column '{column.head}' for {key_path(place)}, which {taken[place]} sets"
            raise parts.sheet.refused(rule, "leave one of the two columns out")
        taken[place] = f"'{column.head}' of '{parts.sheet.name}'"
    return lists


def _list(sheet: Sheet, tables: Tables) -> PartsList:
    columns, prices = list[Column](), (0.0,) * len(sheet.rows)
    names = [str(_HEAD.fullmatch(head)[1]) for head in sheet.heads]  # type: ignore[index]
    for name in sheet.sets:
        if name not in names[1:]:
            raise Refused(f"{sheet.where}.sets", name, f"is no column of {sheet.file}", nearest(name, names[1:]))
    for k, (name, head) in enumerate(zip(names, sheet.heads, strict=True)):
        if k == 0 or name.startswith("("):
            continue
        if name == PRICE and name not in sheet.sets:
            prices = tuple(sheet.count * price for price in sheet.numbers(k))
            continue
        paths = [sheet.sets[name]] if name in sheet.sets else [f"{part}.{name}" for part in sheet.parts]
        try:
            places = tuple(keys_by_name(tables, path) for path in paths)
        except Refused as error:
            raise sheet.refused(f"has the column '{head}', and {error}", "put other headings in ( )") from None
        if not places or any(isinstance(at(tables, place), dict) for place in places):
            state = "sets a number that is open in the file" if places else "sets no number"
            remedy = "give a number in the file" if places else "name parts, list it in sets, or put its heading in ( )"
            raise sheet.refused(f"has the column '{head}', which {state}", remedy)
        columns.append(Column(head, _HEAD.fullmatch(head)[2] or "", sheet.numbers(k), places))  # type: ignore[index]
    return PartsList(sheet, tuple(columns), prices)


def with_rows(tables: Tables, lists: Sequence[PartsList], subset: Subset) -> Tables:
    """Return the tables of the file of a subset, with the least price of its combinations."""
    edited = dict(tables)
    for parts, rows in zip(lists, subset, strict=True):
        for column in parts.columns:
            for place in column.places:
                edited = with_value_at(edited, place, column.over(rows))
    if "parts_price" in edited:
        total = sum(min(parts.prices[row] for row in rows) for parts, rows in zip(lists, subset, strict=True))
        edited["parts_price"] = {"total": total}
    return edited


def refused_row(lists: Sequence[PartsList], k: int, row: int, fault: Complaint) -> Refused:
    """Return the complaint about a row of list k from the complaint about the file with its numbers."""
    columns = (c.head for c in lists[k].columns if any(fault.where.startswith(key_path(p[:-1])) for p in c.places))
    heads = [c.head for c in lists[k].columns if fault.where in map(key_path, c.places)] or [*columns]
    rule = f"{fault.where} = {fault.value} {fault.rule}" if fault.value else f"{fault.where} {fault.rule}"
    return lists[k].sheet.refused_cell(row, heads[0] if len(heads) == 1 else "", rule, fault.remedy)
