"""State of a page as its requests carry it: changes of offered numbers, by name."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from laufruhe.files import edits
from laufruhe.files.complaints import Refused

Tables: TypeAlias = Mapping[str, Any]

MAX_EDITS, LONGEST, MAX_ENTRIES = 300, 100, 96
"""Largest number of edits in a request, of characters in a text, of entries in a list."""


@dataclass(frozen=True)
class Edit:
    """Change of the problem's tables: kind of change, name of the number, value as in a file."""

    what: str
    name: str
    value: Any

    def __call__(self, tables: Tables) -> dict[str, Any]:
        """Return the changed tables; `Refused` if the change is impossible."""
        return _WAYS[self.what](tables, self.name, self.value)


@dataclass(frozen=True)
class PageState:
    """State of a page: edits by the user, and the numbers of the design that is shown by name [SI].

    Attributes
    ----------
    fixed
        Edits that fix open numbers at their values in the last whole solution, while affine decisions follow a slider.
    has
        Key of the model that the page has; `LATER` if it wants no model yet.
    position
        Number that the page gives its settings; claims about them carry it.
    """

    edits: tuple[Edit, ...] = ()
    fixed: tuple[Edit, ...] = ()
    design: Mapping[str, float] = field(default_factory=dict)
    has: str = ""
    position: int = 0

    @classmethod
    def from_json(cls, body: object) -> PageState:
        """Return the state of a page from the JSON of its request; `Refused` if it is malformed."""
        if not isinstance(body, dict) or not set(body) <= {"edits", "held", "design", "has", "position"}:
            raise _strange("request", "must be a table of edits, held, design, has and position")
        design, has, position = body.get("design", {}), body.get("has", ""), body.get("position", 0)
        if not isinstance(design, dict) or len(design) > MAX_EDITS or not all(map(_is_number, design.values())):
            raise _strange("design", "is no table of names with numbers")
        if not isinstance(has, str) or len(has) > LONGEST:
            raise _strange("has", "is no key of a model")
        if not isinstance(position, int) or not _is_number(position):
            raise _strange("position", "is no whole number")
        numbers = {str(name): float(value) for name, value in design.items()}
        return cls(_edits(body.get("edits", []), "edits"), _edits(body.get("held", []), "held"), numbers, has, position)

    def tables(self, tables: Tables, with_fixed: bool) -> dict[str, Any]:
        """Return the tables of the problem file with the page's edits, also fixed numbers if `with_fixed`."""
        changed = dict(tables)
        for edit in (*self.edits, *(self.fixed if with_fixed else ())):
            changed = edit(changed)
        return changed

    def check(self, offered: Sequence[str]) -> None:
        """Refuse numbers that the page was not offered: a path might lead to a file name."""
        for edit in (*self.edits, *self.fixed):
            if edit.name not in offered:
                raise _strange(edit.name, "is an edit that this page does not offer")


def _edits(body: object, where: str) -> tuple[Edit, ...]:
    if not isinstance(body, list) or len(body) > MAX_EDITS:
        raise _strange(where, f"is no list of at most {MAX_EDITS} changes")
    for entry in body:
        if not isinstance(entry, list) or len(entry) != 3 or entry[0] not in _WAYS or not isinstance(entry[1], str):
            raise _strange(where, "holds a change of unknown kind; known kinds are " + ", ".join(_WAYS))
        if not _is_plain(entry[2]) or len(entry[1]) > LONGEST:
            raise _strange(where, f"holds a value of '{entry[1][:LONGEST]}' that no number has")
    return tuple(Edit(*entry) for entry in body)


def _is_number(value: object) -> bool:
    # an integer may exceed all floats
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _is_plain(value: object, deep: int = 0) -> bool:
    if isinstance(value, dict) and not deep:
        items = value.items()
        return len(value) <= MAX_ENTRIES and all(isinstance(k, str) and _is_plain(v, deep + 1) for k, v in items)
    if isinstance(value, list) and deep < 2:
        return len(value) <= MAX_ENTRIES and all(_is_plain(entry, deep + 1) for entry in value)
    return value is None or (len(value) <= LONGEST if isinstance(value, str) else _is_number(value))


def _strange(where: str, rule: str) -> Refused:
    return Refused(where, None, rule, "load the page again")


def _star(tables: Tables, _: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict) or not isinstance(value.get("throws"), list):
        raise _strange("star", "has no throws")
    return edits.with_star(tables, value, value.get("without") or [])


def _open_crank(tables: Tables, _: str, __: Any) -> dict[str, Any]:
    engine = {key: value for key, value in tables["engine"].items() if key != "firing_intervals"}
    if "cylinders" not in engine and isinstance(engine.get("firing_order"), list):
        engine["cylinders"] = len(engine["firing_order"])
    return {**tables, "engine": {**engine, "throws": "open", "firing_order": "open"}}


def _first(tables: Tables, _: str, value: Any) -> dict[str, Any]:
    ranks = tables.get("objective")
    if not isinstance(ranks, list) or not isinstance(value, int) or not 0 <= value < len(ranks):
        raise _strange("objective", "is none of this problem's")
    order = [ranks[value], *(rank for k, rank in enumerate(ranks) if k != value)]
    last = {key: entry for key, entry in order[-1].items() if key != "within"}
    return {**tables, "objective": [*order[:-1], last]}


_WAYS: Mapping[str, Callable[[Tables, str, Any], dict[str, Any]]] = {
    "set": edits.with_value,
    "fix": edits.fix_number,
    "star": _star,
    "open crank": _open_crank,
    "first": _first,
}
LATER = "later"
STAR, CRANK, OBJECTIVE = "star", "crank", "objective"
"""Names of edits that change more than one number."""
