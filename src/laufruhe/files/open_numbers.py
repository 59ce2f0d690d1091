"""Numbers left open at any address of a problem file, and the decisions about them.

Keys whose dependence is known read `{ between = [low, high] }` themselves. At any other number it is read here: the
file is read with the start in its place, and the engine is put together anew for every other value.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, key_path, number_read
from laufruhe.files.model_walk import annotations_at, number_at, tables_on
from laufruhe.files.nested import Place, at, inside, put
from laufruhe.files.problem_file import Note, ProblemFile, file_model
from laufruhe.files.rotors import FACTORS
from laufruhe.machine.layouts import LAYOUTS
from laufruhe.problem.decision import AddressDrive, Decision
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Interval

_SIZES = ("mass", "unbalance")
_PISTONS = ("reciprocating_mass", "second_reciprocating_mass")
_TOGETHER = ("bank_angle", "split_pin_angle")


@dataclass(frozen=True)
class OpenNumber:
    """A number of the file that is open, and how it is read and written."""

    place: Place
    name: str
    unit: str
    given: f.Open

    @property
    def start(self) -> str | float:
        """Return its start as the file has a number."""
        return self._drive.written(self.given.start)

    @property
    def decision(self) -> Decision:
        """Return what is to be decided of it."""
        return Decision(self.name, self.unit, Interval(*self.given.bounds), self.given.start, (self._drive,))

    @property
    def _drive(self) -> AddressDrive:
        return AddressDrive(self.place, self.unit)


def without_open(tables: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[Decision, ...]]:
    """Return the tables with the start of every open number that no key reads itself, and the decisions about these."""
    found, decisions = dict(tables), []
    for place, node in inside(tables):
        if not isinstance(node, dict) or "between" not in node or not annotations_at(file_model(), place):
            continue
        number = number_at(file_model(), place)
        if number is not None and number.openable and not _is_fixed_there(tables, place):
            continue
        own = _read(tables, place, number, node)
        found = put(found, place, own.start)
        decisions += [own.decision] if own.given.is_open else []
    return found, tuple(decisions)


def _put(decisions: Sequence[Decision], problem: Problem, _: ProblemFile, __: Mapping[str, Any]) -> Problem:
    return replace(problem, decisions=(*problem.decisions, *decisions))


NOTE = Note("open numbers", without_open, _put)


def _read(tables: Mapping[str, Any], place: Place, number: f.Number | None, node: dict[str, Any]) -> OpenNumber:
    where = key_path(place)
    closed = [table.closed for table in tables_on(file_model(), place) if table.closed]
    if number is not None and number.closed:
        closed = [number.closed]
    if closed:
        raise Refused(where, node, f"cannot be left open: it {closed[0]}", "give a number")
    if number is None:
        rule = "cannot be left open: it is no number with a unit but a count, a name or a choice"
        raise Refused(where, node, rule, "give one, and compare others in a study")
    given = number_read(replace(number, openable=True), place, node)
    assert isinstance(given, f.Open)
    return OpenNumber(place, _name(tables, place), number.unit, given)


def _name(tables: Mapping[str, Any], place: Place) -> str:
    """The path by which studies and `with_values` know a number: entries of lists by their names, or counted from 1."""
    parts = list[str]()
    here: Any = tables
    for key in place:
        entry = here[key]
        name = entry.get("name") if isinstance(key, int) and isinstance(entry, dict) else None
        alone = isinstance(name, str) and "." not in name and sum(one.get("name") == name for one in here) == 1
        parts.append(str(name) if alone else str(key + 1) if isinstance(key, int) else key)
        here = entry
    return ".".join(parts)


def _is_fixed_there(tables: Mapping[str, Any], place: Place) -> bool:
    """Tell if a number that its key may leave open is none of the decisions that the key knows of in this engine."""
    engine = tables.get("engine", {})
    if place[0] == "engine" and place[1] in (*_TOGETHER, "throws"):
        kind = LAYOUTS.get(engine.get("layout"))
        knows = kind is not None and place[1] in kind.openable
        return not knows or (place[1] in _TOGETHER and _is_given(engine.get("throws")))
    if place[0] == "engine" and place[-1] == "rod_length":
        return bool(engine.get("rod") or engine.get("slider_cranks") or _is_offset(engine))
    if place[0] == "engine" and place[-1] in _PISTONS:
        return any(key in weight for weight in _rows(tables.get("counterweights")) for key in FACTORS)
    if place[0] in ("counterweights", "balancer_shafts") and place[-1] == "angle":
        return not any(isinstance(at(tables, (*place[:-1], key)), dict) for key in _SIZES)
    if place[0] == "mounts":
        return bool(tables["mounts"].get("kind", "rigid") == "rigid")
    return False


def _is_given(throws: Any) -> bool:
    """Tell if every throw is a number, or the crank a named one."""
    if isinstance(throws, list):
        return not any(isinstance(throw, dict) for throw in throws)
    return throws is not None and throws != "open"


def _is_offset(engine: Mapping[str, Any]) -> bool:
    offset = engine.get("offset", 0)
    return not (isinstance(offset, str) and offset.strip().startswith(("0 ", "0m"))) and offset != 0


def _rows(tables: Any) -> Sequence[Mapping[str, Any]]:
    return [row for row in tables if isinstance(row, Mapping)] if isinstance(tables, list) else []
