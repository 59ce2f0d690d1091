"""From what a validator found to one line that a user can act on; all that assembles a problem raises `Refused`."""

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
"""That a file gets at once."""
_CLOSE = 0.6
_FEW = 3
_TABLES: Mapping[str, Tables] = {"kind": "study_kinds", "layout": "layouts", "drive": "drives"}
"""Tables of objects that a file names, by their keys."""
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
    """One complaint for every key that is wrong, in the order of the file, as far as a reader follows."""
    found: dict[str, Complaint] = {}
    told = error.errors(include_url=False)[: 10 * MOST_COMPLAINTS]
    details = [(*_walk(detail["loc"], model), detail) for detail in told]
    unknown = [loc for loc, _, detail in details if detail["type"] == "extra_forbidden"]
    for loc, tables, detail in details:
        if detail["type"] == "missing" and _is_misspelt(loc, unknown):
            continue
        found.setdefault(key_path(loc), _complaint(detail, loc, tables, _home(str(loc[-1]), model)))
    lacking = tuple(complaint for complaint in found.values() if complaint.remedy == INSTALL)
    if lacking:
        # keys of an extension that is not there are no faults
        return lacking
    first = list(found.values())[:MOST_COMPLAINTS]
    rest = error.error_count() - len(told) + len(found) - len(first)
    more = [Complaint("file", "", f"has {rest} more such faults", "correct these first")] if rest else []
    return (*first, *more)


def _walk(loc: Loc, model: type[BaseModel]) -> tuple[Loc, list[type[BaseModel]]]:
    """A path without what pydantic adds for tables of several sorts (gas.seiliger.imep), and the tables at its end."""
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


def _is_misspelt(loc: Loc, unknown: Sequence[Loc]) -> bool:
    """Whether a missing key is there in another spelling: what is wrong is said once."""
    words = [str(other[-1]) for other in unknown if other[:-1] == loc[:-1]]
    return bool(difflib.get_close_matches(str(loc[-1]), words, n=1, cutoff=_CLOSE))


def key_path(loc: Sequence[str | int]) -> str:
    """engine.throws[2], counted from one as the reader counts; in quotes what TOML has in quotes."""
    text = ""
    for part in loc:
        key = f"[{part + 1}]" if isinstance(part, int) else toml_key(part)
        text += key if not text or isinstance(part, int) else f".{key}"
    return text


def short(value: Any) -> str:
    """A value as the file has it, cut where it is long."""
    if isinstance(value, dict | list):
        return printed(json.dumps(value, default=str, ensure_ascii=False), 60)
    return printed(f'"{value}"' if isinstance(value, str) else str(value), 60)


def _plain(word: str) -> str:
    """A name as it is compared: in small letters, its words in one order."""
    return " ".join(sorted(re.split(r"[\s_-]+", word.lower())))


def nearest(word: str, words: Sequence[str], otherwise: str = "") -> str:
    """A remedy that names the nearest right word, those that hold it, or all of them; `otherwise` in place of all."""
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


def beside(path: Path, otherwise: str) -> str:
    """A remedy that names the file most like one that is not there."""
    names = [other.stem for other in path.parent.glob("*.toml")] if path.parent.is_dir() else []
    close = difflib.get_close_matches(path.stem, names, n=1, cutoff=_CLOSE)
    return f"did you mean '{path.with_name(close[0])}.toml'?" if close else otherwise


def _home(key: str, model: type[BaseModel]) -> str:
    """In which tables of a file a key stands; empty where in none."""
    found = []
    for name, field in model.model_fields.items():
        table = f"[[{name}]]" if field.annotation is not None and "list[" in str(field.annotation) else f"[{name}]"
        found += [table] * any(key in inner.model_fields for inner in _tables_in(field.annotation))
    return f"it stands in {' or '.join(found)}" if found else ""


def _complaint(detail: Any, loc: Loc, tables: Sequence[type[BaseModel]], home: str) -> Complaint:
    kind, where = detail["type"], key_path(loc)
    if kind == "extra_forbidden" and len(loc) == 1 and loc[0] in HOMES["keys"]:
        return Complaint(where, "", *lack(HOMES["keys"][str(loc[0])]))
    if kind == "extra_forbidden":
        keys = [field.alias or name for table in tables[:1] for name, field in table.model_fields.items()]
        of_unit = 'a unit stands beside its number, as in "120 mm"'
        remedy = of_unit if loc[-1] == "unit" else nearest(str(loc[-1]), keys, home)
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
        # of two or three all are told: the nearest in letters need not be the one that is meant
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
    """Raised while a problem is put together; the reader adds the file's name."""

    def __init__(self, where: str, value: Any, rule: str, remedy: str) -> None:
        self.complaint = Complaint(where, "" if value is None else short(value), rule, remedy)
        super().__init__(str(self.complaint))


def number_read(number: Number, place: Sequence[str | int], given: Any) -> float | Open:
    """Return what stands at a place of a file, as its key reads a number.

    Raises
    ------
    Refused
        If it is no such number.
    """
    try:
        return number.read(given)
    except PydanticCustomError as error:
        rule, _, remedy = error.message().partition("; ")
        raise Refused(key_path(place), given, rule, remedy) from None


@contextmanager
def in_file(source: object) -> Iterator[None]:
    """What is refused within is led by the name of the file it stands in."""
    try:
        yield
    except Refused as refused:
        raise InputError(str(source), (refused.complaint,)) from None


def measured(text: str | float, unit: str, where: str, given: str | None = None) -> float:
    """SI value of a text such as '120 mm', or of a plain number; `given` stands at the key that the text is made of."""
    try:
        return units.parse(str(text), unit)
    except units.UnitError as error:
        found = Complaint.of(error, where)
        # where the unit has a key of its own, it stands there without a number
        remedy = f"use {units.usual(unit)} ..." if given else found.remedy
        raise Refused(where, given or text, found.rule, remedy) from None


@contextmanager
def blamed_on(where: str, value: str = "") -> Iterator[None]:
    """A machine that cannot exist is the fault of this key, at which a value stands."""
    try:
        yield
    except ModelError as error:
        found = Complaint.of(error, where, value, remedy="correct it")
        raise Refused(found.where, found.value or None, found.rule, found.remedy) from None


def one_of(table: BaseModel, where: str, key: str, other: str, shown: Any = None, named: str = "") -> None:
    """Refuse two keys of which one is wanted, where both or neither stand; `named` is the other as a remedy says it."""
    given = [getattr(table, k) not in (None, []) for k in (key, other)]
    if given[0] == given[1]:
        state = f"is given twice, also as {other}" if given[0] else "is missing"
        raise Refused(f"{where}.{key}", shown, state, f"give {key} or {named or other}, one of them")


def none_of(table: BaseModel, keys: Sequence[str], where: str, rule: str, remedy: str) -> None:
    """Refuse keys that mean nothing here, where they do not stand as if left out."""
    for key in keys:
        if getattr(table, key) != type(table).model_fields[key].default:
            raise Refused(f"{where}.{key}", None, rule, remedy)


def all_different(things: Sequence[Any], where: str, rule: str, remedy: str = "rename one") -> None:
    """Refuse two of the same."""
    for k, thing in enumerate(things):
        if thing in things[:k]:
            raise Refused(f"{where}[{k + 1}]", thing, f"two {rule}", remedy)
