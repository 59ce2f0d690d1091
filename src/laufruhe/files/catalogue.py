"""Engine catalogue: data of published engines as defaults of [engine] (docs/reference/engine-catalogue.md)."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from laufruhe.files.complaints import Refused, nearest

KEY = "catalogue"
"""Key of [engine]; `engine = "name"` is the same."""
# pairs of keys that exclude each other
_EITHER = (("rod_ratio", "rod_length"), ("rod", "rod_inertia_deficit"))
_PHASES = ("throws", "firing_order")


@dataclass(frozen=True)
class CatalogueEngine:
    """Published engine with its values of [engine].

    Values at the keys in `assumed` have no source. The published displacement checks bore and stroke.
    """

    key: str
    name: str
    source: str
    displacement: str
    assumed: tuple[str, ...]
    note: str
    engine: Mapping[str, Any]


@cache
def engines() -> Mapping[str, CatalogueEngine]:
    """Return the engines by key."""
    text = (files("laufruhe.files") / "engines.toml").read_text(encoding="utf-8")
    return {
        key: CatalogueEngine(key, **{**entry, "assumed": tuple(entry["assumed"]), "note": entry.get("note", "")})
        for key, entry in tomllib.loads(text).items()
    }


def engine_named(name: object, where: str) -> CatalogueEngine:
    """Return an engine of the catalogue by name; raise `Refused` at the key `where` if there is none."""
    engine = engines().get(name) if isinstance(name, str) else None
    if engine is None:
        remedy = nearest(str(name), list(engines()), "laufruhe engines lists them")
        raise Refused(where, name, "is not a key of an engine of the catalogue", remedy)
    return engine


def with_catalogue(tables: dict[str, Any]) -> dict[str, Any]:
    """Return the tables of a file with its catalogue engine written out; source and assumptions are added."""
    value = tables.get("engine")
    table = value if isinstance(value, dict) else {KEY: value} if isinstance(value, str) else {}
    if KEY not in table:
        return tables
    engine = engine_named(table[KEY], "engine" if isinstance(value, str) else f"engine.{KEY}")
    assumptions, source = tables.get("assumptions", []), tables.get("source", "")
    dropped = {key for pair in _EITHER if any(one in table for one in pair) for key in pair}
    if any(table.get(key) == "open" for key in _PHASES):
        dropped |= {*_PHASES}
    defaults = {key: entry for key, entry in engine.engine.items() if key not in dropped}
    completed = {**tables, "engine": {**defaults, **{key: entry for key, entry in table.items() if key != KEY}}}
    left = [f"{key.replace('_', ' ')} {as_text(engine.engine[key])}" for key in engine.assumed if key not in table]
    if isinstance(assumptions, list):
        sentences = [f"{engine.name}: assumed, not published: {', '.join(left)}."] if left else []
        completed["assumptions"] = [*assumptions, *sentences]
    if isinstance(source, str):
        completed["source"] = f"{source}; engine: {engine.source}" if source else engine.source
    return completed


def as_text(value: Any) -> str:
    """Return a value as text; entries of a list are joined by hyphens."""
    return "-".join(map(str, value)) if isinstance(value, list) else str(value)
