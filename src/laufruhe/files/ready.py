"""Ready problems and studies that come with the package: listed by what they are for, and copied."""

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
    """A ready problem or study.

    Attributes
    ----------
    use
        What it is an example of.
    path
        Of its file in the package.
    needs
        Files beside it that it refers to, by their names there.
    """

    name: str
    title: str
    use: str
    path: Path
    is_study: bool
    needs: tuple[str, ...]


@cache
def folder() -> Path:
    """Where they are: in the package, or beside its source in the repository."""
    return next(place for place in (_PACKAGE / "problems", _PACKAGE.parents[1] / "problems") if place.is_dir())


@cache
def ready() -> dict[str, Ready]:
    """All of them by name, those of one use together."""
    with (folder() / _LIST).open(encoding="utf-8", newline="") as stream:
        use_of = {row["problem"]: row["use"] for row in csv.DictReader(stream)}
    use_of |= {path.stem: _OTHER for path in sorted(folder().glob("*.toml")) if path.stem not in use_of}
    uses = list(dict.fromkeys(use_of.values()))
    return {name: _found(name, use) for name, use in sorted(use_of.items(), key=lambda pair: uses.index(pair[1]))}


def ready_named(name: str) -> Ready:
    """One of them; `InputError` where there is none of that name."""
    found = ready().get(name.removesuffix(".toml"))
    if found is None:
        advice = nearest(name, list(ready()), "laufruhe examples lists them")
        raise refused("name", name, "is no ready problem", advice)
    return found


def copies(names: Iterable[str]) -> dict[str, str]:
    """Texts of ready problems by file name, with all that they refer to and the schemas that editors check them by."""
    texts: dict[str, str] = {}
    left = [ready_named(name) for name in names]
    while left:
        one = left.pop(0)
        texts.setdefault(one.path.name, f"{schema_line(one.is_study)}\n{one.path.read_text(encoding='utf-8')}")
        texts.setdefault(*schema_file(one.is_study))
        for other in (name for name in one.needs if name not in texts):
            known = ready().get(other.removesuffix(".toml"))
            if known is not None:
                left.append(known)
            else:
                texts[other] = (folder() / other).read_text(encoding="utf-8")
    return texts


def schema_line(is_study: bool = False) -> str:
    """The first line of a file, by which an editor finds its schema."""
    return f"#:schema ./{STUDY_SCHEMA if is_study else SCHEMA}"


def schema_file(is_study: bool = False) -> tuple[str, str]:
    """Name and text of the schema that goes beside a file."""
    name = STUDY_SCHEMA if is_study else SCHEMA
    return name, (Path(__file__).parent / name).read_text(encoding="utf-8")


def _found(name: str, use: str) -> Ready:
    path = folder() / f"{name}.toml"
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    needs = sorted({t for _, t in texts_in(tables) if 0 < len(t) <= 80 and "/" not in t and (folder() / t).is_file()})
    return Ready(name, tables["title"], use, path, "study" in tables, tuple(needs))
