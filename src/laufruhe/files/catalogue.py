"""Engines that were built, whose figures a problem takes as defaults (docs/reference/engine-catalogue.md)."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from laufruhe.files.complaints import Refused, nearest

KEY = "catalogue"
"""Of [engine]; `engine = "name"` says the same."""
# of each two one is given: whoever gives one means it
_EITHER = (("rod_ratio", "rod_length"), ("rod", "rod_inertia_deficit"))
_PHASES = ("throws", "firing_order")


@dataclass(frozen=True)
class CatalogueEngine:
    """One engine, as it was published.

    Attributes
    ----------
    key
        In a problem file.
    source
        Of what is not assumed.
    displacement
        As published: it checks bore and stroke.
    assumed
        Keys of `engine` that no source gives.
    note
        What else a user should know.
    engine
        Keys and values of [engine].
    """

    key: str
    name: str
    source: str
    displacement: str
    assumed: tuple[str, ...]
    note: str
    engine: Mapping[str, Any]

    def assumption(self, own: Mapping[str, Any]) -> str:
        """What is assumed where a problem has no value of its own; empty where it has all."""
        left = [f"{key.replace('_', ' ')} {shown(self.engine[key])}" for key in self.assumed if key not in own]
        return f"{self.name}: assumed, not published: {', '.join(left)}." if left else ""

    def under(self, own: Mapping[str, Any]) -> dict[str, Any]:
        """[engine] with its figures where the problem has none."""
        told = dict(self.engine)
        for key, other in _EITHER:
            if key in own or other in own:
                told.pop(key, None)
                told.pop(other, None)
        if any(own.get(key) == "open" for key in _PHASES):
            told = {key: value for key, value in told.items() if key not in _PHASES}
        return {**told, **{key: value for key, value in own.items() if key != KEY}}


@cache
def engines() -> Mapping[str, CatalogueEngine]:
    """The whole catalogue, by key."""
    text = (files("laufruhe.files") / "engines.toml").read_text(encoding="utf-8")
    return {
        key: CatalogueEngine(key, **{**entry, "assumed": tuple(entry["assumed"]), "note": entry.get("note", "")})
        for key, entry in tomllib.loads(text).items()
    }


def engine_named(name: object, where: str) -> CatalogueEngine:
    """An engine of the catalogue; `Refused` where there is none of that name."""
    found = engines().get(name) if isinstance(name, str) else None
    if found is None:
        remedy = nearest(str(name), list(engines()), "laufruhe engines lists them")
        raise Refused(where, name, "is no engine of the catalogue", remedy)
    return found


def with_catalogue(tables: dict[str, Any]) -> dict[str, Any]:
    """Tables of a problem in which the engine that they name is written out, with its source and what is assumed."""
    given = tables.get("engine")
    own = given if isinstance(given, dict) else {KEY: given} if isinstance(given, str) else {}
    if KEY not in own:
        return tables
    found = engine_named(own[KEY], "engine" if isinstance(given, str) else f"engine.{KEY}")
    told = {key: value for key, value in own.items() if key != KEY}
    assumptions, source = tables.get("assumptions", []), tables.get("source", "")
    whole = {**tables, "engine": found.under(told)}
    if isinstance(assumptions, list):
        whole["assumptions"] = [*assumptions, *filter(None, (found.assumption(told),))]
    if isinstance(source, str):
        whole["source"] = f"{source}; engine: {found.source}" if source else found.source
    return whole


def shown(value: Any) -> str:
    """A value as a sentence has it."""
    return "-".join(map(str, value)) if isinstance(value, list) else str(value)
