"""Lists of parts: rows of numbers at addresses of a problem file, and the file with some rows in it.

A combination has one row of each list. A subset has some rows of each list. The file of a subset leaves each number
open between the least and the largest of these rows, so that its lower bound holds for every combination in it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, TypeAlias

from laufruhe.errors import Complaint, counted
from laufruhe.files.complaints import Refused, key_path, nearest
from laufruhe.files.edits import keys_by_name
from laufruhe.files.nested import Place, at, with_value_at
from laufruhe.problem.problem import Extra
from laufruhe.solvers.result import ResultDetails

Tables: TypeAlias = Mapping[str, Any]
Subset: TypeAlias = tuple[tuple[int, ...], ...]
"""For each list, the indices of some of its rows."""
RANKED = 5
"""Number of best combinations that are ranked: no other one is better."""
_HEAD = re.compile(r"^(.*?)\s*(?:\[(.*)\])?$")


@dataclass(frozen=True)
class Column:
    """Numbers of a list in a unit, one for each row, and their addresses; `side` is "max" or "min" for a limit."""

    head: str
    unit: str
    values: tuple[float, ...]
    places: tuple[Place, ...]
    side: str = ""

    def varies(self, rows: Sequence[int]) -> bool:
        """Return True if some rows differ in this number, and it is no limit."""
        return not self.side and len({self.values[row] for row in rows}) > 1

    def over(self, rows: Sequence[int]) -> Any:
        """Return what a file has for some rows: a number, the widest limit, or an open number."""
        low, high = min(self.values[row] for row in rows), max(self.values[row] for row in rows)
        if not self.varies(rows):
            return self._written(low if self.side == "min" else high)
        return {"between": [self._written(low), self._written(high)], "start": self._written(0.5 * (low + high))}

    def _written(self, value: float) -> str | float:
        return f"{value!r} {self.unit}" if self.unit else value


@dataclass(frozen=True)
class PartsList:
    """Table [[choices]] with its key `where`, and the cells and lines of its CSV file.

    `columns` and `prices`, of all parts that are bought, are empty before `with_columns`.
    """

    name: str
    file: str
    where: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    parts: tuple[str, ...]
    sets: Mapping[str, str]
    count: int
    columns: tuple[Column, ...] = ()
    prices: tuple[float, ...] = ()

    def refused(self, rule: str, remedy: str, row: int | None = None, head: str = "") -> Refused:
        """Return the complaint about the file of the list, one of its rows or a cell of it."""
        place = "" if row is None else f"has in line {self.lines[row]}, row '{self.rows[row][0]}'"
        place += f", column '{head}': " if head else ": " if place else ""
        return Refused(f"{self.where}.file", self.file, place + rule, remedy)

    def refused_file(self, row: int, fault: Complaint) -> Refused:
        """Return the complaint about a row from that about the file with its numbers."""
        places = [(column.head, key_path(place)) for column in self.columns for place in column.places]
        heads = {head for head, path in places if path == fault.where}
        rule = f"{fault.where} = {fault.value} {fault.rule}" if fault.value else f"{fault.where} {fault.rule}"
        return self.refused(rule, fault.remedy, row, heads.pop() if len(heads) == 1 else "")

    def with_columns(self, tables: Tables) -> PartsList:
        """Return the list with the addresses of its columns in a file; raise `Refused` for wrong heads and cells."""
        columns, prices = list[Column](), (0.0,) * len(self.rows)
        names, units = zip(*(_HEAD.findall(head)[0] for head in self.heads), strict=True)
        for name in self.sets:
            if name not in names[1:]:
                raise Refused(f"{self.where}.sets", name, f"is no column of {self.file}", nearest(name, names[1:]))
        for k, (name, unit, head) in enumerate(zip(names, units, self.heads, strict=True)):
            if k == 0 or name.startswith("("):
                continue
            if name == "price" and name not in self.sets:
                prices = tuple(self.count * price for price in self._numbers(k))
                columns.append(Column(head, "", prices, (), "max"))
                continue
            paths = [self.sets[name]] if name in self.sets else [f"{part}.{name}" for part in self.parts]
            try:
                places = tuple(keys_by_name(tables, path) for path in paths)
            except Refused as error:
                raise self.refused(f"has the column '{head}', and {error}", "put other heads in ( )") from None
            if not places or any(isinstance(at(tables, place), dict) for place in places):
                rule = f"has the column '{head}', which sets {'an open number' if places else 'no number'}"
                remedy = (
                    "give a number in the file" if places else "name parts, list it in sets, or put its head in ( )"
                )
                raise self.refused(rule, remedy)
            side = next((str(p[-1]) for p in places if p[0] == "constraints" and p[-1] in ("max", "min")), "")
            columns.append(Column(head, unit, self._numbers(k), places, side))
        return replace(self, columns=tuple(columns), prices=prices)

    def _numbers(self, column: int) -> tuple[float, ...]:
        numbers = list[float]()
        for k, row in enumerate(self.rows):
            try:
                numbers.append(float(row[column]))
            except ValueError:
                numbers.append(math.nan)
            if not math.isfinite(numbers[-1]):
                rule, remedy = f"'{row[column]}' is no number", "write it with a decimal point, its unit in the head"
                raise self.refused(rule, remedy, k, self.heads[column])
        return tuple(numbers)


@dataclass(frozen=True)
class Combination:
    """Combination that was solved: its value [SI], infinite without a design, its lower bound, and the proof."""

    rows: tuple[int, ...]
    value: float
    bound: float
    proof: str


@dataclass(frozen=True)
class Outcome(ResultDetails):
    """Outcome of a choice: combinations that were solved, the best first, and numbers of all and of excluded ones."""

    lists: tuple[PartsList, ...]
    solved: tuple[Combination, ...]
    whole: int
    excluded: int

    @property
    def rows(self) -> dict[str, str]:
        """Names of the chosen rows by the names of the lists."""
        return dict(zip((parts.name for parts in self.lists), self.names(self.solved[0]), strict=True))

    @property
    def lines(self) -> list[str]:
        """Chosen rows as lines of a printed result."""
        return [f"{name}: {row}" for name, row in self.rows.items()]

    def names(self, known: Combination) -> list[str]:
        """Return the names of the rows of a combination."""
        return [parts.rows[row][0] for parts, row in zip(self.lists, known.rows, strict=True)]

    @property
    def words(self) -> str:
        """Description of the search."""
        whole = counted(self.whole, "combination")
        return f"{len(self.solved)} of {whole} solved, {self.excluded} excluded by bounds of subsets"


@dataclass(frozen=True)
class Choices(Extra):
    """Choice of one row of each list."""

    lists: tuple[PartsList, ...]
    words: ClassVar[str] = "the choice from lists of parts"

    @property
    def open_names(self) -> tuple[str, ...]:
        """Names of the choices."""
        return tuple(f"row of '{parts.name}'" for parts in self.lists)

    def at_addresses(self, tables: Tables) -> tuple[PartsList, ...]:
        """Return the lists with the addresses of their columns in a file; raise `Refused` for wrong heads or cells."""
        lists, taken = tuple(parts.with_columns(tables) for parts in self.lists), dict[Place, str]()
        for parts, column, place in ((p, c, place) for p in lists for c in p.columns for place in c.places):
            if place in taken:
                rule = f"has the column '{column.head}' for {key_path(place)}, which {taken[place]} sets"
                raise parts.refused(rule, "leave one of the two columns out")
            taken[place] = f"'{column.head}' of '{parts.name}'"
        return lists


def with_rows(tables: Tables, lists: Sequence[PartsList], subset: Subset) -> Tables:
    """Return the tables of the file of a subset, with the least price of its combinations."""
    edited = dict(tables)
    for parts, rows in zip(lists, subset, strict=True):
        for column in parts.columns:
            for place in column.places:
                edited = with_value_at(edited, place, column.over(rows))
    if "parts_price" in edited and any(any(parts.prices) for parts in lists):
        total = sum(min(parts.prices[row] for row in rows) for parts, rows in zip(lists, subset, strict=True))
        edited["parts_price"] = {"total": total}
    return edited
