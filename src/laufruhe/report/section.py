"""Report sections of extensions: tables, files of numbers, and an entry of result.json."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from laufruhe.extension import extended
from laufruhe.present.tables import Table
from laufruhe.solvers.result import Result

NumberTables: TypeAlias = Mapping[str, tuple[Callable[[Result], object], Callable[[Result], Table]]]
"""File names, each with a function that tests for the table and one that returns it."""


@dataclass(frozen=True)
class Section:
    """Tables and numbers of one extension.

    Attributes
    ----------
    name
        Key in result.json.
    applies
        Return whether a result has any of it.
    tables
        Return the tables of the report.
    record
        Return the entry of result.json, if there is one.
    printed
        Names of the tables that are files as they are printed.
    number_tables
        Further files of numbers.
    """

    name: str
    applies: Callable[[Result], bool]
    tables: Callable[[Result], Sequence[Table]] = lambda _: ()
    record: Callable[[Result], Mapping[str, Any]] | None = None
    printed: tuple[str, ...] = ()
    number_tables: NumberTables = field(default_factory=dict)


EXTENSION_SECTIONS: Mapping[str, Section] = extended("sections", Section, ())
"""Sections of extensions by their names."""
