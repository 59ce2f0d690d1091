"""Open numbers at any address of a problem file, and the decisions about them.

Keys with known dependences read `{ between = [low, high] }` themselves. Other open numbers are read here: the file is
read with their start values, and the engine is built again for each other value.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, key_path, read_number
from laufruhe.files.nested import Place, annotations_at, at, number_at, tables_on, walk, with_value_at
from laufruhe.files.problem_file import EXTENSION_KEYS, WEIGHT_KEYS, Note, file_model
from laufruhe.files.rotors import FACTORS
from laufruhe.files.study_tables import path_text
from laufruhe.machine.layouts import LAYOUTS
from laufruhe.problem.decision import AddressDrive, Decision

_SIZES = ("mass", "unbalance")
_PISTONS = ("reciprocating_mass", "second_reciprocating_mass")
_TOGETHER = ("bank_angle", "split_pin_angle")


def without_open(tables: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[Decision, ...]]:
    """Return the tables with open numbers that no key reads replaced by their start, and the decisions about them."""
    closed, decisions = dict(tables), list[Decision]()
    for place, node in walk(tables):
        if not isinstance(node, dict) or "between" not in node or not annotations_at(file_model(), place):
            continue
        number = number_at(file_model(), place)
        if number is not None and number.openable and not _is_fixed_there(tables, place):
            continue
        reasons = [table.closed for table in tables_on(file_model(), place) if table.closed]
        reason = (number.closed if number is not None else "") or next(iter(reasons), "")
        if reason:
            raise Refused(key_path(place), node, f"cannot be left open: it {reason}", "give a number")
        if number is None:
            rule = "cannot be left open: it is a count, a name or a choice, not a physical number"
            raise Refused(key_path(place), node, rule, "give a fixed value, and compare other values in a study")
        open_number = read_number(replace(number, openable=True), place, node)
        assert isinstance(open_number, f.Open)
        drive = AddressDrive(place, number.unit)
        closed = with_value_at(closed, place, drive.written(open_number.start))
        decisions += open_number.decisions(path_text(tables, place), number.unit, drive)
    return closed, tuple(decisions)


NOTE = Note(
    "open numbers",
    without_open,
    lambda decisions, problem, _, __: replace(problem, decisions=(*problem.decisions, *decisions)),
)


def _is_fixed_there(tables: Mapping[str, Any], place: Place) -> bool:
    """Return True if the key can read an open number in general, but not in this engine."""
    engine = tables.get("engine", {})
    if place[0] == "engine" and place[1] in (*_TOGETHER, "throws"):
        kind = LAYOUTS.get(engine.get("layout"))
        knows = kind is not None and place[1] in kind.openable
        throws = engine.get("throws")
        is_given = throws is not None and throws != "open"
        if isinstance(throws, list):
            is_given = not any(isinstance(throw, dict) for throw in throws)
        return not knows or (place[1] in _TOGETHER and is_given)
    if "running_gear" not in EXTENSION_KEYS and (place[0] == "main_bearings" or place[1] in ("big_end", "rod_length")):
        return True
    if place[0] == "engine" and place[-1] == "rod_length":
        offset = engine.get("offset", 0)
        is_zero = offset == 0 or (isinstance(offset, str) and offset.strip().startswith(("0 ", "0m")))
        return bool(engine.get("rod") or engine.get("slider_cranks") or not is_zero)
    if place[0] == "engine" and place[-1] in _PISTONS:
        weights = tables.get("counterweights")
        rows = weights if isinstance(weights, list) else []
        return any(key in row for row in rows if isinstance(row, Mapping) for key in FACTORS)
    if place[0] in ("counterweights", "balancer_shafts") and place[-1] == "angle":
        row = at(tables, place[:2] if place[0] == "counterweights" else place[:4])
        sizes = [row.get(key) for key in _SIZES]
        # sizes in a table of an extension, such as a body
        sizes += [size for key in WEIGHT_KEYS for size in (row.get(key) or {}).values()]
        return not any(isinstance(size, dict) for size in sizes)
    if place[0] == "mounts":
        return bool(tables["mounts"].get("kind", "rigid") == "rigid")
    return False
