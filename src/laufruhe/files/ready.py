"""Ready problems and studies of the package."""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from laufruhe.errors import refused
from laufruhe.files.complaints import nearest
from laufruhe.files.nested import texts_in
from laufruhe.files.problem_file import SCHEMA

STUDY_SCHEMA = "laufruhe-study.schema.json"
SCHEMAS = (SCHEMA, STUDY_SCHEMA)
_PACKAGE = Path(__file__).parents[1]
_LIST, _OTHER = "uses.csv", "other uses"


@dataclass(frozen=True)
class Ready:
    """Ready problem or study of the package, an example of a use; it needs further files of its folder."""

    name: str
    title: str
    use: str
    path: Path
    is_study: bool
    needs: tuple[str, ...]


@cache
def folder() -> Path:
    """Return the folder of the ready files, in the package or in the repository."""
    return next(place for place in (_PACKAGE / "problems", _PACKAGE.parents[1] / "problems") if place.is_dir())


@cache
def ready() -> dict[str, Ready]:
    """Return ready problems and studies by name, grouped by use."""
    with (folder() / _LIST).open(encoding="utf-8", newline="") as stream:
        use_of = {row["problem"]: row["use"] for row in csv.DictReader(stream)}
    use_of |= {path.stem: _OTHER for path in sorted(folder().glob("*.toml")) if path.stem not in use_of}
    uses = list(dict.fromkeys(use_of.values()))
    entries: dict[str, Ready] = {}
    for name, use in sorted(use_of.items(), key=lambda pair: uses.index(pair[1])):
        path = folder() / f"{name}.toml"
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
        texts = (text for _, text in texts_in(tables) if 0 < len(text) <= 80 and "/" not in text)
        needs = sorted({text for text in texts if (folder() / text).is_file()})
        entries[name] = Ready(name, tables["title"], use, path, "study" in tables, tuple(needs))
    return entries


def ready_named(name: str) -> Ready:
    """Return a ready problem by name; raise `InputError` if there is none."""
    entry = ready().get(name.removesuffix(".toml"))
    if entry is None:
        advice = nearest(name, list(ready()), "laufruhe examples lists them")
        raise refused("name", name, "is no ready problem", advice)
    return entry


def copies(names: Iterable[str]) -> dict[str, str]:
    """Return the texts of ready problems by file name, with the files that they need and schemas for editors."""
    texts: dict[str, str] = {}
    left = [ready_named(name) for name in names]
    while left:
        entry = left.pop(0)
        texts.setdefault(entry.path.name, f"{schema_line(entry.is_study)}\n{entry.path.read_text(encoding='utf-8')}")
        texts.setdefault(*schema_file(entry.is_study))
        for needed in (name for name in entry.needs if name not in texts):
            if problem := ready().get(needed.removesuffix(".toml")):
                left.append(problem)
            else:
                texts[needed] = (folder() / needed).read_text(encoding="utf-8")
    return texts


def schema_line(is_study: bool = False) -> str:
    """Return the first line of a file, which names its schema for editors."""
    return f"#:schema ./{STUDY_SCHEMA if is_study else SCHEMA}"


def schema_file(is_study: bool = False) -> tuple[str, str]:
    """Return name and text of the schema for a file."""
    name = STUDY_SCHEMA if is_study else SCHEMA
    return name, Path(__file__).with_name(name).read_text(encoding="utf-8")
