"""Complaints about a file: one line with place, rule and remedy. Code that assembles a problem raises `Refused`."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticCustomError

from laufruhe import units
from laufruhe.errors import Complaint, InputError, LaufruheError, ModelError, printed
from laufruhe.extension import HOMES, INSTALL, Tables, lack
from laufruhe.files.fields import FORMS, Number, Open
from laufruhe.files.toml_text import toml_key

Loc: TypeAlias = tuple[str | int, ...]
MOST_COMPLAINTS = 20
"""Largest number of complaints about a file at once."""
_CLOSE = 0.6
_FEW = 3
_TABLES: Mapping[str, Tables] = {"kind": "study_kinds", "layout": "layouts", "drive": "drives"}
"""Tables of extensions by the keys that name their objects."""
_COUNTED = {
    "too_short": ("at least", "min_length", "add what is missing"),
    "too_long": ("at most", "max_length", "take some out"),
}
_RULES = {
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "string_type": "must be text in quotes",
    "list_type": "must be a list in [ ], or tables in [[ ]]",
    "bool_type": "must be true or false",
    "model_type": "must be one table, in [ ]",
    "model_attributes_type": "must be one table, in [ ]",
    "dict_type": "must be one table, in [ ]",
    "string_too_short": "is empty; write something",
}


def complaints_of(error: ValidationError, model: type[BaseModel]) -> tuple[Complaint, ...]:
    """Return a complaint for every wrong key in the order of the file, up to a readable number."""
    complaints: dict[str, Complaint] = {}
    errors = error.errors(include_url=False)[: 10 * MOST_COMPLAINTS]
    details = [(*_walk(detail["loc"], model), detail) for detail in errors]
    unknown = [loc for loc, _, detail in details if detail["type"] == "extra_forbidden"]
    for loc, tables, detail in details:
        # a key that is missing may be there in another spelling, which is a complaint of its own
        words = [str(other[-1]) for other in unknown if other[:-1] == loc[:-1]]
        if detail["type"] == "missing" and difflib.get_close_matches(str(loc[-1]), words, n=1, cutoff=_CLOSE):
            continue
        complaints.setdefault(key_path(loc), _complaint(detail, loc, tables, model))
    lacking = tuple(complaint for complaint in complaints.values() if complaint.remedy == INSTALL)
    if lacking:
        # keys of a missing extension are no faults
        return lacking
    first = list(complaints.values())[:MOST_COMPLAINTS]
    rest = error.error_count() - len(errors) + len(complaints) - len(first)
    more = [Complaint("file", "", f"has {rest} more such faults", "correct these first")] if rest else []
    return (*first, *more)


def _walk(loc: Loc, model: type[BaseModel]) -> tuple[Loc, list[type[BaseModel]]]:
    """Return a path without the tags of unions (gas.seiliger.imep), and the tables at its end."""
    path: list[str | int] = []
    here = [model]
    for part in loc:
        fields = [table.model_fields[part] for table in here if part in table.model_fields]
        if len(here) > 1 and isinstance(part, str):
            here = [table for table in here if any(part in get_args(f.annotation) for f in table.model_fields.values())]
            continue
        path.append(part)
        if isinstance(part, str) and fields:
            here = [table for field in fields for table in _tables_in(field.annotation)]
    return tuple(path), here


def _tables_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [table for part in get_args(annotation) for table in _tables_in(part)]


def key_path(loc: Sequence[str | int]) -> str:
    """Return a path as engine.throws[2], counted from one, with keys in quotes as in TOML."""
    text = ""
    for part in loc:
        key = f"[{part + 1}]" if isinstance(part, int) else toml_key(part)
        text += key if not text or isinstance(part, int) else f".{key}"
    return text


def short(value: Any) -> str:
    """Return a value as the file has it, cut if it is long."""
    if isinstance(value, dict | list):
        return printed(json.dumps(value, default=str, ensure_ascii=False), 60)
    return printed(f'"{value}"' if isinstance(value, str) else str(value), 60)


def _plain(word: str) -> str:
    # small letters, words in alphabetical order
    return " ".join(sorted(re.split(r"[\s_-]+", word.lower())))


def nearest(word: str, words: Sequence[str], otherwise: str = "") -> str:
    """Return a remedy that names the nearest word, the words that contain it, or else `otherwise` or all words."""
    plain = {_plain(each): each for each in words}
    parts = set(_plain(word).split())
    holding = sorted(
        each for each in words
        if len(word) >= _FEW and (word.lower() in each.lower() or parts < set(_plain(each).split()))
    )  # fmt: skip
    close = difflib.get_close_matches(_plain(word), plain, n=1, cutoff=_CLOSE)
    if len(holding) == 1 or (close and not holding):
        return f"did you mean '{holding[0] if holding else plain[close[0]]}'?"
    return "use one of: " + ", ".join(holding) if holding else otherwise or "use one of: " + ", ".join(sorted(words))


def nearest_file(path: Path, otherwise: str) -> str:
    """Return a remedy that names the file closest to a missing one."""
    names = [other.stem for other in path.parent.glob("*.toml")] if path.parent.is_dir() else []
    close = difflib.get_close_matches(path.stem, names, n=1, cutoff=_CLOSE)
    return f"did you mean '{path.with_name(close[0])}.toml'?" if close else otherwise


def _complaint(detail: Any, loc: Loc, tables: Sequence[type[BaseModel]], model: type[BaseModel]) -> Complaint:
    kind, where = detail["type"], key_path(loc)
    if kind == "extra_forbidden" and len(loc) == 1 and loc[0] in HOMES["keys"]:
        return Complaint(where, "", *lack(HOMES["keys"][str(loc[0])]))
    if kind == "extra_forbidden":
        keys = [field.alias or name for table in tables[:1] for name, field in table.model_fields.items()]
        homes = [
            f"[[{name}]]" if "list[" in str(field.annotation) else f"[{name}]"
            for name, field in model.model_fields.items()
            if any(str(loc[-1]) in inner.model_fields for inner in _tables_in(field.annotation))
        ]
        remedy = nearest(str(loc[-1]), keys, f"it stands in {' or '.join(homes)}" if homes else "")
        if loc[-1] == "unit":
            remedy = 'a unit stands beside its number, as in "120 mm"'
        return Complaint(where, short(detail["input"]), "is not a key here", remedy)
    if kind == "missing":
        return Complaint(where, "", "is missing", "add it")
    if kind.startswith("union_tag_"):
        key = detail["ctx"]["discriminator"].strip("'")
        where = f"{where}.{key}"
    if kind == "union_tag_not_found":
        tags = [tag for table in tables for tag in get_args(table.model_fields[key].annotation)]
        return Complaint(where, "", "is missing", "use one of: " + ", ".join(tags))
    if kind in ("literal_error", "union_tag_invalid"):
        allowed = str(detail["ctx"].get("expected") or detail["ctx"].get("expected_tags"))
        value = detail["ctx"].get("tag", detail["input"])
        table = _TABLES.get(where.rpartition(".")[2])
        if table and (extension := HOMES[table].get(str(value))):
            return Complaint(where, short(value), *lack(extension))
        words = allowed.replace("' or '", "', '").replace("'", "").split(", ")
        # of two or three words all are named: the nearest in letters may not be meant
        remedy = nearest(str(value), words) if len(words) > _FEW else "use one of: " + ", ".join(words)
        return Complaint(where, short(value), "is not allowed", remedy)
    if kind in _COUNTED:
        sense, key, remedy = _COUNTED[kind]
        rule = f"has {detail['ctx']['actual_length']} entries, and {sense} {detail['ctx'][key]} belong there"
        return Complaint(where, short(detail["input"]), rule, remedy)
    message = (detail["msg"][:1].lower() + detail["msg"][1:]).replace("input should", "must")
    form = FORMS.get(detail["ctx"]["pattern"]) if kind == "string_pattern_mismatch" else None
    rule, _, remedy = (form or _RULES.get(kind, message)).partition("; ")
    return Complaint(where, short(detail["input"]), rule, remedy or "correct it")


class Refused(LaufruheError):
    """Complaint while a problem is assembled; the reader adds the name of the file."""

    def __init__(self, where: str, value: Any, rule: str, remedy: str) -> None:
        self.complaint = Complaint(where, "" if value is None else short(value), rule, remedy)
        super().__init__(str(self.complaint))


def number_read(number: Number, place: Sequence[str | int], raw: Any) -> float | Open:
    """Read the number at a place of a file.

    Raises
    ------
    Refused
        If it is no such number.
    """
    try:
        return number.read(raw)
    except PydanticCustomError as error:
        rule, _, remedy = error.message().partition("; ")
        raise Refused(key_path(place), raw, rule, remedy) from None


@contextmanager
def in_file(source: object) -> Iterator[None]:
    """Turn `Refused` into `InputError` with the name of the file."""
    try:
        yield
    except Refused as refused:
        raise InputError(str(source), (refused.complaint,)) from None


def measured(text: str | float, unit: str, where: str, unit_text: str | None = None) -> float:
    """Return the SI value of a text such as '120 mm' or of a number; `given` is the unit alone at a key for units."""
    try:
        return units.parse(str(text), unit)
    except units.UnitError as error:
        complaint = Complaint.from_error(error, where)
        # a key for units has no number
        remedy = f"use {units.usual(unit)} ..." if unit_text else complaint.remedy
        raise Refused(where, unit_text or text, complaint.rule, remedy) from None


@contextmanager
def blamed_on(where: str, value: str = "") -> Iterator[None]:
    """Turn `ModelError` into a complaint about this key and its value."""
    try:
        yield
    except ModelError as error:
        complaint = Complaint.from_error(error, where, value, remedy="correct it")
        raise Refused(complaint.where, complaint.value or None, complaint.rule, complaint.remedy) from None


def one_of(table: BaseModel, where: str, key: str, other: str, shown: Any = None, named: str = "") -> None:
    """Refuse both or none of two keys; `named` is the name of the other in the remedy."""
    present = [getattr(table, k) not in (None, []) for k in (key, other)]
    if present[0] == present[1]:
        state = f"is given twice, also as {other}" if present[0] else "is missing"
        raise Refused(f"{where}.{key}", shown, state, f"give {key} or {named or other}, one of them")


def none_of(table: BaseModel, keys: Sequence[str], where: str, rule: str, remedy: str) -> None:
    """Refuse keys that mean nothing here, unless they have their default."""
    for key in keys:
        if getattr(table, key) != type(table).model_fields[key].default:
            raise Refused(f"{where}.{key}", None, rule, remedy)


def all_different(things: Sequence[Any], where: str, rule: str, remedy: str = "rename one") -> None:
    """Refuse equal things."""
    for k, thing in enumerate(things):
        if thing in things[:k]:
            raise Refused(f"{where}[{k + 1}]", thing, f"two {rule}", remedy)
