"""Engine in code: the tables of a problem file, which methods add one after the other."""

from __future__ import annotations

import html
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from laufruhe.errors import LaufruheWarning, counted
from laufruhe.files.complaints import errors_in_file
from laufruhe.files.nested import plain
from laufruhe.files.python_numbers import written
from laufruhe.files.reader import DEEPEST, load_tables, tables_and_path
from laufruhe.files.toml_text import toml_text
from laufruhe.problem.goals import Goals, QuantityName
from laufruhe.problem.number_types import Number, Table
from laufruhe.problem.problem import Problem
from laufruhe.python.keys import describe, keys_of
from laufruhe.python.parts import EngineParts

_IN_CODE = "engine in code"
_GOALS = {"minimise": "ObjectiveTable", "then_minimise": "ObjectiveTable", "limit": "ConstraintTable"}
for _name, _table in _GOALS.items():
    describe({"__module__": Goals.__module__, _name: vars(Goals)[_name]}, _table)


class EngineDraft(EngineParts, Mapping[str, Any]):
    """Engine in code, with its parts; a mapping of the tables that a problem file would have.

    Methods return a new engine and do not change this one. `problem` checks it.
    """

    def __init__(self, tables: Mapping[str, Any], method: str = "") -> None:
        self._tables, self._new = tables, method

    def _with(self, key: str, name: str, table: Mapping[str, Any]) -> Self:
        earlier = self.get(key, ()) if key == f"{name}s" else None
        place = (key,) if earlier is None else (key, len(earlier))
        with errors_in_file(_IN_CODE):
            new = written(plain(table, DEEPEST), place, {})
        return type(self)({**self.tables, key: new if earlier is None else [*earlier, new]}, name)

    @property
    def tables(self) -> Mapping[str, Any]:
        """Tables as a problem file has them."""
        self._new = ""
        return self._tables

    def __getitem__(self, key: str) -> Any:
        return self.tables[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self.tables)

    def __len__(self) -> int:
        return len(self.tables)

    def __del__(self) -> None:
        # as in asyncio, a result that nobody used is probably a mistake
        if self._new and not sys.is_finalizing():
            call = f"engine.{self._new}(...)"
            warnings.warn(f"{call} returned a new engine that was not used; write engine = {call}", LaufruheWarning, 2)

    @property
    def title(self) -> str:
        """Name of the engine by its layout or its key in the catalogue."""
        engine = self.tables["engine"]
        count = engine.get("cylinders") or len(engine.get("firing_order", ())) or len(engine.get("slider_cranks", ()))
        words = f"{engine.get('layout', engine.get('catalogue'))} engine"
        return f"{words}, {counted(count, 'cylinder')}" if count and "layout" in engine else words

    def problem(
        self,
        operating_points: Number | Table | Sequence[Number | Table] = (),
        minimise: QuantityName | Table | None = None,
        *,
        title: str | None = None,
        source: str | None = None,
        assumptions: Sequence[str] = (),
        tolerance: Number | None = None,
        name: str = "problem",
    ) -> Problem:
        """Return the problem of this engine, checked as a problem file is.

        Parameters
        ----------
        operating_points
            Speeds [rad/s], or tables of operating points; they follow those of `operating_point`.
        minimise
            Quantity, or table of an objective; by default the mean mount force of an engine on mounts.
        title
            Heading of report and pictures; by default that of the engine.
        source, assumptions
            Texts for the reader of a report.
        tolerance
            Relative gap at which an optimum counts as proven.
        name
            Name of the problem in messages and folders.

        Raises
        ------
        InputError
            With one line for everything wrong: key, value, rule, remedy.
        """
        listed: Any = operating_points
        points = listed if isinstance(listed, Sequence) and not isinstance(listed, str) else [listed]
        points = [{"speed": point} if not isinstance(point, Mapping) else dict(point) for point in points]
        goal = {"minimise": minimise} if isinstance(minimise, str) else minimise
        first = {"title": title or self.title, "source": source, "assumptions": list(assumptions) or None}
        called = plain(keys_of({"operating_points": points, "objective": goal, "tolerance": tolerance}), DEEPEST)
        called["operating_points"] = [*self.get("operating_points", ()), *called["operating_points"]]
        with errors_in_file(name):
            new = {key: written(value, (key,), called) for key, value in called.items()}
        return load_tables(tables_and_path(keys_of({**first, **self.tables, **new}))[0], Path(name))

    def to_toml(self) -> str:
        """Return the tables as the text of a problem file."""
        return toml_text(self.tables)

    def __repr__(self) -> str:
        parts = [counted(len(v), k.removesuffix("s").replace("_", " ")) if isinstance(v, list) else k
                 for k, v in self.tables.items() if k != "engine"]  # fmt: skip
        return f"<EngineDraft {self.title}{'; ' * bool(parts)}{', '.join(parts)}>"

    def _repr_html_(self) -> str:
        return f"<strong>{html.escape(self.title)}</strong><pre>{html.escape(self.to_toml())}</pre>"


def engine_of(arguments: Mapping[str, Any], fixed: Mapping[str, Any]) -> EngineDraft:
    """Return an engine from the arguments of a call, keys of [engine]."""
    engine = plain(keys_of(arguments, fixed), DEEPEST)
    with errors_in_file(_IN_CODE):
        return EngineDraft({"engine": written(engine, ("engine",), {"engine": engine})})
