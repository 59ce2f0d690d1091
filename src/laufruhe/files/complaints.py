"""From what a validator found to one line that a user can act on."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import UnionType
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from laufruhe import units
from laufruhe.errors import Complaint, LaufruheError, ModelError

_CLOSE = 0.6
# tables of several sorts, and the key that says of which
_TAGS = {"gas": "model", "parts": "kind"}
_RULES = {
    "missing": "is missing",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "string_type": "must be text in quotes",
    "list_type": "must be a list in [ ]",
    "bool_type": "must be true or false",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "dict_type": "must be a table",
}


def complaints_of(error: ValidationError, model: type[BaseModel]) -> tuple[Complaint, ...]:
    """One complaint for every key that is wrong, in the order of the file."""
    found: dict[str, Complaint] = {}
    details = [(_without_tags(detail["loc"]), detail) for detail in error.errors(include_url=False)]
    unknown = [loc for loc, detail in details if detail["type"] == "extra_forbidden"]
    for loc, detail in details:
        if detail["type"] == "missing" and _is_misspelt(loc, unknown):
            continue
        found.setdefault(key_path(loc), _complaint(detail, loc, model))
    return tuple(found.values())


def _is_misspelt(loc: tuple[str | int, ...], unknown: Sequence[tuple[str | int, ...]]) -> bool:
    """Whether a missing key is there in another spelling: what is wrong is said once."""
    words = [str(other[-1]) for other in unknown if other[:-1] == loc[:-1]]
    return bool(difflib.get_close_matches(str(loc[-1]), words, n=1, cutoff=_CLOSE))


def key_path(loc: Sequence[str | int]) -> str:
    """engine.throws[2], counted from one as the reader counts."""
    text = ""
    for part in loc:
        text += f"[{part + 1}]" if isinstance(part, int) else (f".{part}" if text else str(part))
    return text


def short(value: Any) -> str:
    """A value as the file has it, cut where it is long."""
    if isinstance(value, dict | list):
        text = json.dumps(value, default=str, ensure_ascii=False)
    else:
        text = f'"{value}"' if isinstance(value, str) else str(value)
    text = "".join(c if c.isprintable() else "?" for c in text)
    return text if len(text) <= 60 else text[:57] + "..."


def nearest(word: str, words: Sequence[str]) -> str:
    """A remedy that names the nearest right word, or all of them."""
    close = difflib.get_close_matches(word, words, n=1, cutoff=_CLOSE)
    # a name may hold what no terminal should be sent
    shown = "".join(c if c.isprintable() else "?" for c in close[0]) if close else ""
    return f"did you mean '{shown}'?" if close else "use one of: " + ", ".join(sorted(words))


def _complaint(detail: Any, loc: tuple[str | int, ...], model: type[BaseModel]) -> Complaint:
    kind, where = detail["type"], key_path(loc)
    if kind == "extra_forbidden":
        table = _model_at(detail["loc"][:-1], model)
        return Complaint(where, short(detail["input"]), "is not a key here", nearest(str(loc[-1]), _keys(table)))
    if kind == "missing":
        return Complaint(where, "", "is missing", "add it")
    if kind.startswith("union_tag_"):
        where = f"{where}.{detail['ctx']['discriminator'].strip(chr(39))}"
    if kind == "union_tag_not_found":
        return Complaint(where, "", "is missing", "use one of: " + ", ".join(_tags(detail["loc"], model)))
    if kind in ("literal_error", "union_tag_invalid"):
        allowed = str(detail["ctx"].get("expected") or detail["ctx"].get("expected_tags"))
        value = detail["ctx"].get("tag", detail["input"])
        words = allowed.replace("' or '", "', '").replace("'", "").split(", ")
        return Complaint(where, short(value), "is not allowed", nearest(str(value), words))
    rule, _, remedy = _RULES.get(kind, _lowered(detail["msg"])).partition("; ")
    return Complaint(where, short(detail["input"]), rule, remedy or "correct it")


def _lowered(message: str) -> str:
    return (message[:1].lower() + message[1:]).replace("input should", "must")


def _keys(model: type[BaseModel] | None) -> list[str]:
    return [f.alias or name for name, f in model.model_fields.items()] if model else []


def _model_at(loc: Sequence[str | int], model: type[BaseModel]) -> type[BaseModel] | None:
    here: list[type[BaseModel]] = [model]
    for part in loc:
        if isinstance(part, int):
            continue
        fields = [m.model_fields[part] for m in here if part in m.model_fields]
        tagged = [m for m in here if any(str(part) in get_args(f.annotation) for f in m.model_fields.values())]
        here = [m for f in fields for m in _models_in(f.annotation)] if fields else tagged or here
    return here[0] if here else None


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) in (list, Union, UnionType) or get_args(annotation):
        return [m for part in get_args(annotation) for m in _models_in(part)]
    return []


def _tags(loc: Sequence[str | int], model: type[BaseModel]) -> list[str]:
    """What may stand where a table says of which sort it is."""
    *above, name = [part for part in loc if not isinstance(part, int)]
    table = _model_at(above, model)
    field = table.model_fields[str(name)] if table else None
    choices = _models_in(field.annotation) if field else []
    return [str(tag) for one in choices for tag in get_args(one.model_fields[_TAGS[str(name)]].annotation)]


def _without_tags(loc: tuple[str | int, ...]) -> tuple[str | int, ...]:
    """Drops what pydantic adds to a path for tagged tables: gas.seiliger.imep is gas.imep."""
    named = [k for k, part in enumerate(loc) if part in _TAGS]
    return tuple(part for k, part in enumerate(loc) if not any(_is_tag(loc, at, k) for at in named))


def _is_tag(loc: tuple[str | int, ...], table: int, k: int) -> bool:
    """Whether part k follows a tagged table's name, or its place in a list of them."""
    in_list = table + 1 < len(loc) and isinstance(loc[table + 1], int)
    return k == table + (2 if in_list else 1) and k < len(loc) and isinstance(loc[k], str)


class Refused(LaufruheError):
    """Raised while a problem is put together; the reader adds the file's name."""

    def __init__(self, where: str, value: Any, rule: str, remedy: str) -> None:
        self.complaint = Complaint(where, "" if value is None else short(value), rule, remedy)
        super().__init__(str(self.complaint))


def measured(text: str, unit: str, where: str, given: str | None = None) -> float:
    """SI value of a text such as '120 mm' in the dimension of `unit`.

    Parameters
    ----------
    where
        Key that it stands at.
    given
        What stands there, if the text is only made of it.

    Raises
    ------
    Refused
        If it is no such value.
    """
    try:
        return units.parse(text, unit)
    except units.UnitError as error:
        found = Complaint.of(error, where)
        raise Refused(where, given or text, found.rule, found.remedy) from None


@contextmanager
def blamed_on(where: str) -> Iterator[None]:
    """A machine that cannot exist is the fault of this key."""
    try:
        yield
    except ModelError as error:
        found = Complaint.of(error, where, remedy="correct it")
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


def all_different(things: Sequence[Any], where: str, rule: str) -> None:
    """Refuse two of the same."""
    for k, thing in enumerate(things):
        if thing in things[:k]:
            raise Refused(f"{where}[{k + 1}]", thing, f"two {rule}", "move or rename one")
