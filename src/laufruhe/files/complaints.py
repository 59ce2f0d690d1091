"""Complaints about a problem file: one line with key, value, rule and remedy.

Code that assembles a problem raises `Refused`; the reader turns it into an `InputError` with the name of the file.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticCustomError

from laufruhe import units
from laufruhe.errors import Complaint, InputError, LaufruheError, ModelError, printed
from laufruhe.extension import HOMES, INSTALL, Tables, is_installed, missing_extension
from laufruhe.files.fields import FORMS, Number, Open
from laufruhe.files.nested import least_length
from laufruhe.files.toml_text import toml_key, toml_value
from laufruhe.files.trade_words import meanings, trade_value

Loc: TypeAlias = tuple[str | int, ...]
MAX_COMPLAINTS = 20
"""Largest number of complaints about a file at once."""
MISSING = "is missing"
"""Beginning of the rule about a key that is missing."""
_CLOSE = 0.6
_NESTED: Mapping[str | int, Tables] = {
    "counterweights": "weight_keys", "balancer_shafts": "weight_keys",
    "gas": "gas_models", "operating_points": "gas_models",
}  # fmt: skip
"""Kinds of extension objects by the tables of a file in which these add keys."""
_MAX_NAMED = 3
_UNIT_SUFFIX = re.compile(r"_(mm|cm|m|kg|g|rpm|bar|deg|Nm|N)$")
_TABLES: Mapping[str, Tables] = {
    "kind": "study_kinds", "layout": "layouts", "drive": "drives", "model": "gas_models",
}  # fmt: skip
"""Kinds of extension objects by the keys of a file that name such an object."""
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
    """Return one complaint for each wrong key of a file, at most `MAX_COMPLAINTS`, and the number of further ones.

    If keys belong to extensions that are not installed, only these are reported.
    """
    complaints: dict[str, Complaint] = {}
    errors = error.errors(include_url=False)[: 10 * MAX_COMPLAINTS]
    details = [(*_walk(detail["loc"], model), detail) for detail in errors]
    unknown = [loc for loc, _, detail in details if detail["type"] == "extra_forbidden"]
    for loc, tables, detail in details:
        if detail["type"] == "list_type" and isinstance(loc[-1], int):
            entries = [(one[-1], entry["input"]) for one, _, entry in details if one[:-1] == loc[:-1]]
            if [k for k, _ in entries] == [*range(least_length(model, loc))]:
                # a single pair, without the brackets of the list of pairs
                flat, where = [value for _, value in entries], key_path(loc[:-1])
                example = f"write for example {toml_value([flat])}"
                complaints.setdefault(where, Complaint(where, value_text(flat), "must be a list of lists", example))
                continue
        # a missing key may be present in another spelling, which is a complaint of its own
        words = [str(loc_unknown[-1]) for loc_unknown in unknown if loc_unknown[:-1] == loc[:-1]]
        words += [key for word in words for key, _ in meanings(word)]
        if detail["type"] == "missing" and difflib.get_close_matches(str(loc[-1]), words, n=1, cutoff=_CLOSE):
            continue
        complaints.setdefault(key_path(loc), _complaint(detail, loc, tables, model))
    lacking = tuple(complaint for complaint in complaints.values() if complaint.remedy == INSTALL)
    if lacking:
        # other complaints may follow from the missing extension
        return lacking
    first = list(complaints.values())[:MAX_COMPLAINTS]
    further = error.error_count() - len(errors) + len(complaints) - len(first)
    summary = [Complaint("file", "", f"has {further} more keys with faults", "correct these first")] if further else []
    return (*first, *summary)


def _walk(loc: Loc, model: type[BaseModel]) -> tuple[Loc, list[type[BaseModel]]]:
    """Return the path of an error in the file, and the models of the tables at its end.

    Tags of unions, such as seiliger in gas.seiliger.imep, are removed from the path `loc` of pydantic.
    """
    path: list[str | int] = []
    models = [model]
    for part in loc:
        fields = [table.model_fields[part] for table in models if part in table.model_fields]
        if len(models) > 1 and isinstance(part, str):
            models = [
                table for table in models if any(part in get_args(f.annotation) for f in table.model_fields.values())
            ]
            continue
        path.append(part)
        if isinstance(part, str) and fields:
            models = [table for field in fields for table in _tables_in(field.annotation)]
    return tuple(path), models


def _tables_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [table for part in get_args(annotation) for table in _tables_in(part)]


def key_path(loc: Sequence[str | int]) -> str:
    """Return a path as text such as engine.throws[2], with indices from one and unusual keys in quotes."""
    text = ""
    for part in loc:
        key = f"[{part + 1}]" if isinstance(part, int) else toml_key(part)
        text += key if not text or isinstance(part, int) else f".{key}"
    return text


def value_text(value: Any) -> str:
    """Return a value as it stands in the file, cut after 60 characters."""
    if isinstance(value, dict | list):
        return printed(json.dumps(value, default=str, ensure_ascii=False), 60)
    return printed(f'"{value}"' if isinstance(value, str) else str(value), 60)


def _plain(word: str) -> str:
    # words have small letters and stand in alphabetical order
    return " ".join(sorted(re.split(r"[\s_-]+", word.lower())))


def nearest(word: str, words: Sequence[str], otherwise: str = "") -> str:
    """Return the remedy for a word that is not among the allowed words.

    It names the nearest word, or the words that contain it; else it is `otherwise`, by default a list of all words.
    """
    plain = {_plain(candidate): candidate for candidate in words}
    parts = set(_plain(word).split())
    holding = sorted(
        candidate for candidate in words
        if len(word) >= _MAX_NAMED and (word.lower() in candidate.lower() or parts < set(_plain(candidate).split()))
    )  # fmt: skip
    close = difflib.get_close_matches(_plain(word), plain, n=1, cutoff=_CLOSE)
    if len(holding) == 1 or (close and not holding):
        return f"did you mean '{holding[0] if holding else plain[close[0]]}'?"
    return "use one of: " + ", ".join(holding) if holding else otherwise or "use one of: " + ", ".join(sorted(words))


def nearest_file(path: Path, otherwise: str) -> str:
    """Return the remedy for a missing file: the nearest file name in its folder, or `otherwise`."""
    names = [path_in_folder.stem for path_in_folder in path.parent.glob("*.toml")] if path.parent.is_dir() else []
    close = difflib.get_close_matches(path.stem, names, n=1, cutoff=_CLOSE)
    return f"did you mean '{path.with_name(close[0])}.toml'?" if close else otherwise


def _complaint(detail: Any, loc: Loc, tables: Sequence[type[BaseModel]], model: type[BaseModel]) -> Complaint:
    kind, where = detail["type"], key_path(loc)
    if kind == "extra_forbidden":
        kind_of_key = "keys" if len(loc) == 1 else _NESTED.get(loc[0])
        home = HOMES[kind_of_key].get(str(loc[-1])) if kind_of_key else None
        if home and not is_installed(home):
            return Complaint(where, "", *missing_extension(home))
        fields = {field.alias or name: field for table in tables[:1] for name, field in table.model_fields.items()}
        keys_of_tables = {key for key, field in fields.items() if _tables_in(field.annotation)}
        remedy = _key_remedy(str(loc[-1]), [*fields], keys_of_tables, model)
        return Complaint(where, value_text(detail["input"]), "is not a key here", remedy)
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
        key = where.rpartition(".")[2]
        table = _TABLES.get(key)
        if table and (extension := HOMES[table].get(str(value))):
            return Complaint(where, value_text(value), *missing_extension(extension))
        words = allowed.replace("' or '", "', '").replace("'", "").split(", ")
        # two or three words are all named, because the nearest spelling may be the wrong one
        remedy = nearest(str(value), words) if len(words) > _MAX_NAMED else "use one of: " + ", ".join(words)
        if (meant := trade_value(key, str(value))) in words:
            remedy = f"did you mean '{meant}'?"
        return Complaint(where, value_text(value), "is not allowed", remedy)
    if kind in _COUNTED:
        sense, key, remedy = _COUNTED[kind]
        rule = f"has {detail['ctx']['actual_length']} entries, and {sense} {detail['ctx'][key]} are allowed"
        return Complaint(where, value_text(detail["input"]), rule, remedy)
    if kind.startswith("model_") and tables:
        remedy = f"give {', '.join([*tables[0].model_fields][:_MAX_NAMED])} there"
        return Complaint(where, value_text(detail["input"]), _RULES[kind], remedy)
    if kind == "list_type" and not isinstance(detail["input"], dict):
        # the same value for every entry of a list of fixed length
        example = toml_value([detail["input"]] * least_length(model, loc))
        return Complaint(where, value_text(detail["input"]), _RULES[kind], f"write for example {example}")
    message = (detail["msg"][:1].lower() + detail["msg"][1:]).replace("input should", "must")
    form = FORMS.get(detail["ctx"]["pattern"]) if kind == "string_pattern_mismatch" else None
    rule, _, remedy = (form or _RULES.get(kind, message)).partition("; ")
    return Complaint(where, value_text(detail["input"]), rule, remedy or "correct it")


def _homes(key: str, model: type[BaseModel]) -> list[str]:
    # tables of a file that have a key, as they are written
    fields = model.model_fields
    return [
        _head(name, model) for name in fields if any(key in t.model_fields for t in _tables_in(fields[name].annotation))
    ]


def _head(name: str, model: type[BaseModel]) -> str:
    return f"[[{name}]]" if str(model.model_fields[name].annotation).startswith("list[") else f"[{name}]"


def _key_remedy(word: str, keys: Sequence[str], keys_of_tables: Set[str], model: type[BaseModel]) -> str:
    """Return the remedy for a word that is none of the keys of a table, of which some have tables.

    A key that the word means in the trade comes first, then the tables that have such a key, then a similar key.
    """
    stem = _UNIT_SUFFIX.sub("", word)
    if stem in keys:
        return f"did you mean '{stem}', whose unit stands with its number, as in \"120 mm\"?"
    for key, note in sorted(meanings(word), key=lambda meaning: meaning[0] not in keys):
        homes = _homes(key, model)
        if key in keys and note.startswith("a table ") and key not in keys_of_tables:
            # here the key is a number, such as the mass of a big end
            continue
        if not key:
            return note
        if key in keys or (0 < len(homes) <= _MAX_NAMED and key not in model.model_fields):
            place = "" if key in keys else f" of {' or '.join(homes)}"
            return f"did you mean '{key}'{place}{f', {note}' if note else ''}?"
        if key in model.model_fields:
            return f"did you mean the table {_head(key, model)}{f', {note}' if note else ''}?"
    if word in model.model_fields:
        return f"it is the table {_head(word, model)}"
    homes = _homes(word, model)
    return f"it stands in {' or '.join(homes)}" if homes else nearest(word, keys)


class Refused(LaufruheError):
    """Refusal of a key such as engine.throws[2] while a problem is assembled; the reader adds the name of the file.

    The rule is the end of a sentence about the key, the remedy an instruction. A value of None is left out.
    """

    def __init__(self, where: str, value: Any, rule: str, remedy: str) -> None:
        self.complaint = Complaint(where, "" if value is None else value_text(value), rule, remedy)
        super().__init__(str(self.complaint))


def read_number(number: Number, place: Sequence[str | int], raw: Any) -> float | Open:
    """Return the number that a field reads from a raw value of a file [SI]; raise `Refused` at `place` if it cannot."""
    try:
        return number.read(raw)
    except PydanticCustomError as error:
        rule, _, remedy = error.message().partition("; ")
        raise Refused(key_path(place), raw, rule, remedy) from None


@contextmanager
def errors_in_file(source: object) -> Iterator[None]:
    """Turn `Refused` in the block into `InputError` with the name of the file, `source`."""
    try:
        yield
    except Refused as refused:
        raise InputError(str(source), (refused.complaint,)) from None


def si_value(text: str | float, unit: str, where: str, unit_text: str | None = None) -> float:
    """Return the SI value of a text such as '120 mm', or of a plain number.

    Complaints about the key `where` show `unit_text` if the file gives a unit without a number there.
    """
    try:
        return units.parse(str(text), unit)
    except units.UnitError as error:
        complaint = Complaint.from_error(error, where)
        # the complaint about a key for units must not ask for a number
        remedy = f"use {units.usual(unit)} ..." if unit_text else complaint.remedy
        raise Refused(where, unit_text or text, complaint.rule, remedy) from None


@contextmanager
def errors_at_key(where: str, value: str = "") -> Iterator[None]:
    """Turn `ModelError` in the block into `Refused` at this key, with its value."""
    try:
        yield
    except ModelError as error:
        complaint = Complaint.from_error(error, where, value, remedy="correct it")
        raise Refused(complaint.where, complaint.value or None, complaint.rule, complaint.remedy) from None


def require_one_of(table: BaseModel, where: str, key: str, other: str, value: Any = None, named: str = "") -> None:
    """Raise `Refused` unless exactly one of two keys of the table at `where` is given.

    The message shows `value`, and the remedy calls the other key `named`.
    """
    present = [getattr(table, k) not in (None, []) for k in (key, other)]
    if present[0] == present[1]:
        state = f"is given twice, also as {other}" if present[0] else "is missing"
        raise Refused(f"{where}.{key}", value, state, f"give {key} or {named or other}, one of them")


def refuse_keys(table: BaseModel, keys: Sequence[str], where: str, rule: str, remedy: str) -> None:
    """Raise `Refused` if one of these keys of a table differs from its default."""
    for key in keys:
        if getattr(table, key) != type(table).model_fields[key].default:
            raise Refused(f"{where}.{key}", None, rule, remedy)


def require_distinct(things: Sequence[Any], where: str, rule: str, remedy: str = "rename one") -> None:
    """Raise `Refused` if two values are equal; `rule` follows the word "two"."""
    for k, thing in enumerate(things):
        if thing in things[:k]:
            raise Refused(f"{where}[{k + 1}]", thing, f"two {rule}", remedy)
