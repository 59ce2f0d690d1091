"""Numbers of a problem changed by the names that results show: given another value, left open, or fixed."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

from laufruhe import units
from laufruhe.files.complaints import Refused, nearest
from laufruhe.files.nested import at, put
from laufruhe.files.problem_file import EXTENSION_KEYS, file_model
from laufruhe.files.rotors import name_of_unbalance
from laufruhe.files.study_tables import keys_of

Keys: TypeAlias = tuple[Any, ...]
_AXES = {"x": 0, "y": 1, "z": 2}
_SIZES = ("mass", "unbalance", "balance_factor")
_ACROSS = {"y": 0, "z": 1}
_NUMBER = re.compile(r"\s*-\s*(?=[\d.])")
_THROW, _BUILT = re.compile(r"throw (\d{1,3})"), " built"


def with_values(tables: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers at other values; those that are open start there and stay open.

    Throws that are open together have no start: with values for all of them they are the crank that a result shows.
    """
    engine, found = tables.get("engine", {}), dict(tables)
    star = {int(throw[1]): name for name in values if (throw := _THROW.fullmatch(name))}
    told: set[str] = set()
    if engine.get("throws") == "open" and star and sorted(star) == list(range(1, len(star) + 1)):
        own = {key: values[name] for key in PHASES if (name := key.replace("_", " ")) in values}
        own["throws"] = [values[star[k]] for k in sorted(star)]
        built = {name: name.removesuffix(_BUILT) for name in values if name.endswith(_BUILT)}
        found = with_star(tables, own, [shaft for name, shaft in built.items() if not float(values[name])])
        told = {*star.values(), *built, *(key.replace("_", " ") for key in own)}
    for name, value in values.items():
        found = found if name in told else with_value(found, name, value)
    return found


def with_value(tables: Mapping[str, Any], name: str, value: Any) -> dict[str, Any]:
    """The number at another value; where it is open, it starts there and stays open."""
    keys = keys_by_name(tables, name)
    now = at(tables, keys)
    return put(tables, keys, {**now, "start": value} if _is_open(now) else value)


def opened(tables: Mapping[str, Any], name: str, low: Any, high: Any, start: Any = None) -> dict[str, Any]:
    """The number left open between two bounds; it starts where it stands unless told."""
    keys = keys_by_name(tables, name)
    now = at(tables, keys)
    given = start if start is not None else now.get("start") if _is_open(now) else now
    return put(tables, keys, {"between": [low, high], **({} if given is None else {"start": given})})


def fixed(tables: Mapping[str, Any], name: str, value: Any = None) -> dict[str, Any]:
    """The number no longer open: at a value, or where it starts."""
    keys = keys_by_name(tables, name)
    now = at(tables, keys)
    if value is None:
        if not _is_open(now):
            raise Refused(name, now, "is not open", "give the value that it is to have")
        value = now.get("start", _start(*now["between"]))
    found = put(tables, keys, value)
    # an angle is open with its size, or not at all
    if keys[-1] in _SIZES and _is_open(at(found, (*keys[:-1], "angle"))):
        return fixed(found, f"{name.rpartition('.')[0]}.angle")
    return found


PHASES = ("throws", "firing_order", "bank_angle", "split_pin_angle")
"""Keys of [engine] that a crank star gives."""


def with_star(tables: Mapping[str, Any], star: Mapping[str, Any], gone: Collection[str]) -> dict[str, Any]:
    """A crank with its firing order and the angles of its banks, without some shafts; none of them open any more."""
    given = {key: star[key] for key in PHASES if star.get(key) is not None}
    found = {**tables, "engine": {**tables["engine"], **given}}
    found.pop("phasing", None)
    if "balancer_shafts" in tables:
        kept = [shaft for shaft in tables["balancer_shafts"] if shaft.get("name") not in gone]
        found["balancer_shafts"] = [{k: v for k, v in shaft.items() if k != "optional"} for shaft in kept]
    return found


def _start(low: Any, high: Any) -> Any:
    """Where a number that is open stands if the file does not say: at zero, or the bound that is nearest."""
    if not _is_negative(low):
        return low
    if _is_negative(high):
        return high
    unit = units.unit_of(low) if isinstance(low, str) else ""
    return f"0 {unit}".rstrip() if isinstance(low, str) else 0


def _is_negative(value: Any) -> bool:
    return _NUMBER.match(value) is not None if isinstance(value, str) else value < 0


def unit_of_bounds(tables: Mapping[str, Any], name: str) -> str:
    """The unit in which the bounds of an open number are written; empty where they have none."""
    now = at(tables, keys_by_name(tables, name))
    bound = now["between"][-1] if _is_open(now) else now
    return units.unit_of(bound) if isinstance(bound, str) else ""


def keys_by_name(tables: Mapping[str, Any], name: str) -> Keys:
    """Keys and places that lead to a number: by the name that a result shows, or by a path as studies have it."""
    first, _, rest = name.partition(".")
    if name.replace(" ", "_") in tables.get("engine", {}):
        # masses of all cylinders are called by their key alone
        return "engine", name.replace(" ", "_")
    if own := _THROW.fullmatch(name):
        return _throw(tables, name, int(own[1]) - 1)
    named = list(_named(tables))
    # a part may be called as a table is: the name that results show comes first
    known = [(label, keys) for label, keys in named if name.startswith(f"{label}.")]
    for label, keys in sorted(known, key=lambda pair: -len(pair[0])):
        found = _below(at(tables, keys), name.removeprefix(f"{label}.").split("."))
        if found is not None:
            return (*keys, *found)
    if first in file_model().model_fields and rest and (first in tables or first not in {label for label, _ in named}):
        parent, _, last = name.rpartition(".")
        keys = keys_of(dict(tables), parent)
        here = at(tables, keys)
        return (*keys, last) if isinstance(here, dict) else keys_of(dict(tables), name)
    raise Refused(name, None, "is no number of this problem", nearest(name, _examples(tables, named)))


def _throw(tables: Mapping[str, Any], name: str, k: int) -> Keys:
    throws = tables.get("engine", {}).get("throws")
    if not isinstance(throws, list) or not 0 <= k < len(throws):
        remedy = "give values for all throws, or write them into the problem file first"
        raise Refused(name, None, "is no number of this problem", remedy)
    return "engine", "throws", k


def _named(tables: Mapping[str, Any]) -> Iterator[tuple[str, Keys]]:
    """Weights, shafts, their unbalances, absorbers, the rim and mounts by the names that results show."""
    for k, weight in enumerate(tables.get("counterweights", ())):
        yield weight.get("name", ""), ("counterweights", k)
    for k, shaft in enumerate(tables.get("balancer_shafts", ())):
        names = [unbalance.get("name") for unbalance in shaft.get("unbalances", ())]
        for j in range(len(names)):
            yield name_of_unbalance(shaft.get("name", ""), names, j), ("balancer_shafts", k, "unbalances", j)
        yield shaft.get("name", ""), ("balancer_shafts", k)
    for k, shaft in enumerate(tables.get("engine", {}).get("shafts", ())):
        yield shaft.get("name", ""), ("engine", "shafts", k)
    if "rim" in tables.get("flywheel", {}):
        yield "flywheel", ("flywheel", "rim")
    for name, key in EXTENSION_KEYS.items():
        if name in tables:
            yield from key.numbers(tables[name])
    for k, geared in enumerate(tables.get("geared_inertias", ())):
        yield geared.get("name", ""), ("geared_inertias", k)
    for k, bearing in enumerate(tables.get("main_bearings", ())):
        yield bearing.get("name", str(k + 1)), ("main_bearings", k)
    for k, place in enumerate(tables.get("mounts", {}).get("places", ())):
        yield place.get("name", str(k + 1)), ("mounts", "places", k)


def _below(here: Mapping[str, Any], words: list[str]) -> Keys | None:
    """What a name says after that of its table; None where it says nothing of it."""
    if len(words) == 2 and words[1] in _AXES and isinstance(here.get(words[0]), list):
        return words[0], _AXES[words[1]]
    if len(words) == 1 and words[0] in _ACROSS and "ratio" in here:
        return "position", _ACROSS[words[0]]
    others = (*_SIZES, "angle", "x", "radius", "loss_factor")
    return (words[0],) if len(words) == 1 and (words[0] in here or words[0] in others) else None


def _examples(tables: Mapping[str, Any], named: Sequence[tuple[str, Keys]]) -> list[str]:
    numbers = (int, float, str, dict)
    return [
        f"{label}.{key}"
        for label, keys in named
        for key, value in at(tables, keys).items()
        if key not in ("name", "mirror_of") and isinstance(value, numbers) and not isinstance(value, bool)
    ] or ["engine.stroke"]


def _is_open(value: Any) -> bool:
    return isinstance(value, dict) and "between" in value
