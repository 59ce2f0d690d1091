"""Report sections of extensions: tables, number files, and an entry of result.json."""

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
    """Tables and JSON numbers that one extension adds to the report of a result.

    Attributes
    ----------
    name
        Key in result.json.
    applies
        Function that returns True if a result has this section.
    tables
        Function that returns the tables of the report.
    record
        Function that returns the entry of result.json; None without one.
    printed
        Names of tables that are also written as CSV files, as printed.
    number_tables
        Further CSV files with numbers in full precision.
    controls
        Function that returns what moves on the page of a result, by its names in `page.html`; None for nothing.
    point_record
        Function of a result and the index of an operating point that returns its entries of result.json at this point.
    """

    name: str
    applies: Callable[[Result], bool]
    tables: Callable[[Result], Sequence[Table]] = lambda _: ()
    record: Callable[[Result], Mapping[str, Any]] | None = None
    printed: tuple[str, ...] = ()
    number_tables: NumberTables = field(default_factory=dict)
    controls: Callable[[Result], Mapping[str, Any] | None] = lambda _: None
    point_record: Callable[[Result, int], Mapping[str, Any]] = lambda _, __: {}


EXTENSION_SECTIONS: Mapping[str, Section] = extended("sections", Section, ())
"""Sections of extensions by their names."""


def controls_of(result: Result) -> Mapping[str, Any] | None:
    """Return what moves on the page of a result; None for nothing."""
    return next(filter(None, (section.controls(result) for section in EXTENSION_SECTIONS.values())), None)
