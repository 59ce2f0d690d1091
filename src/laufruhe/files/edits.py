"""Edits of the tables of a problem file: numbers, by their names in results, get other values, are opened or fixed."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping
from typing import Any, TypeAlias

from laufruhe import units
from laufruhe.files.complaints import Refused, nearest, read_number
from laufruhe.files.fields import Number, Open
from laufruhe.files.nested import at, number_at, with_value_at
from laufruhe.files.problem_file import EXTENSION_KEYS, file_model
from laufruhe.files.python_numbers import SIZES, sized, written
from laufruhe.files.rotors import name_of_unbalance
from laufruhe.files.study_tables import keys_of

Keys: TypeAlias = tuple[Any, ...]
_AXES = {"x": 0, "y": 1, "z": 2}
_SIZES = ("mass", "unbalance", "balance_factor")
_ANGLE = Number("rad", plain=math.radians(1.0))
_ACROSS = {"y": 0, "z": 1}
_THROW, _BUILT = re.compile(r"throw (\d{1,3})"), " built"


def with_values(tables: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return tables with other values of named numbers; an open number starts at its value and stays open.

    Open throws have no start, so values for all throws fix the crank of a result.
    """
    engine, edited = tables.get("engine", {}), dict(tables)
    star = {int(throw[1]): name for name in values if (throw := _THROW.fullmatch(name))}
    done: set[str] = set()
    if engine.get("throws") == "open" and star and sorted(star) == list(range(1, len(star) + 1)):
        phases = {key: values[name] for key in PHASES if (name := key.replace("_", " ")) in values}
        phases["throws"] = [values[star[k]] for k in sorted(star)]
        phases = {key: written(phase, ("engine", key), tables) for key, phase in phases.items()}
        built_names = {name: name.removesuffix(_BUILT) for name in values if name.endswith(_BUILT)}
        edited = with_star(tables, phases, [shaft for name, shaft in built_names.items() if not float(values[name])])
        done = {*star.values(), *built_names, *(key.replace("_", " ") for key in phases)}
    for name, value in values.items():
        edited = edited if name in done else with_value(edited, name, value)
    return edited


def with_value(tables: Mapping[str, Any], name: str, value: Any) -> dict[str, Any]:
    """Return tables with another value of one number; an open number starts at the value and stays open."""
    keys = keys_by_name(tables, name)
    if isinstance(value, complex) and keys[-1] in SIZES:
        return _with_vector(tables, keys, value)
    return _with_start(tables, keys, value)


def _with_start(tables: Mapping[str, Any], keys: Keys, value: Any) -> dict[str, Any]:
    now, new = at(tables, keys), written(value, keys, tables)
    return with_value_at(tables, keys, {**now, "start": new} if _is_open(now) else new)


def _with_vector(tables: Mapping[str, Any], keys: Keys, value: complex) -> dict[str, Any]:
    # tables with size and angle of a weight; `keys` are the address of the size
    now = at(tables, (*keys[:-1], "angle"))
    parts = sized(keys[-1], value, None, keys[:-1])
    if _is_open(now):
        low = read_number(_ANGLE, (*keys[:-1], "angle"), now["between"][0])
        assert isinstance(low, float)
        parts["angle"] = low + (parts["angle"] - low) % math.tau
    return _with_start(_with_start(tables, keys, parts[keys[-1]]), (*keys[:-1], "angle"), parts["angle"])


def with_goal(tables: Mapping[str, Any], key: str, goal: Mapping[str, Any], adds: bool) -> dict[str, Any]:
    """Return tables with an objective or a limit, the table `goal`; it replaces earlier ones unless `adds`.

    `within` of a further objective is the share of the one before it.
    """
    earlier = tables.get(key, []) if adds else []
    goals = [*(earlier if isinstance(earlier, list) else [earlier]), dict(goal)]
    if len(goals) > 1 and "within" in goals[-1]:
        goals[-2] = {**goals[-2], "within": goals[-1].pop("within")}
    goals[-1] = written(goals[-1], (key, len(goals) - 1), {**tables, key: goals})
    # a complaint about a single objective has no index
    return {**tables, key: goals if adds else goals[-1]}


def open_number(tables: Mapping[str, Any], name: str, low: Any, high: Any, start: Any = None) -> dict[str, Any]:
    """Return tables with a number open between `low` and `high`; by default it starts at its present value."""
    keys = keys_by_name(tables, name)
    now = at(tables, keys)
    low, high, start = (written(value, keys, tables) for value in (low, high, start))
    first = start if start is not None else now.get("start") if _is_open(now) else now
    return with_value_at(tables, keys, {"between": [low, high], **({} if first is None else {"start": first})})


def fix_number(tables: Mapping[str, Any], name: str, value: Any = None) -> dict[str, Any]:
    """Return tables with a number fixed at a value, by default at its start."""
    keys = keys_by_name(tables, name)
    now = at(tables, keys)
    if isinstance(value, complex) and keys[-1] in SIZES:
        edited = _with_vector(tables, keys, value)
        return fix_number(edited, name) if _is_open(now) else edited
    if value is None:
        if not _is_open(now):
            raise Refused(name, now, "is not open", "give a value for it")
        new = now["start"] if "start" in now else written(number(tables, name)[0], keys, tables)
    else:
        new = written(value, keys, tables)
    edited = with_value_at(tables, keys, new)
    # an angle may be open only together with its size
    if keys[-1] in _SIZES and _is_open(at(edited, (*keys[:-1], "angle"))):
        return fix_number(edited, f"{name.rpartition('.')[0]}.angle")
    return edited


PHASES = ("throws", "firing_order", "bank_angle", "split_pin_angle")
"""Keys of [engine] that a crank star fixes."""


def with_star(tables: Mapping[str, Any], star: Mapping[str, Any], gone: Collection[str]) -> dict[str, Any]:
    """Return tables with a crank star that fixes the keys in `PHASES`, and without the balancer shafts in `gone`."""
    phases = {key: star[key] for key in PHASES if star.get(key) is not None}
    edited = {**tables, "engine": {**tables["engine"], **phases}}
    edited.pop("phasing", None)
    if "balancer_shafts" in tables:
        remaining = [shaft for shaft in tables["balancer_shafts"] if shaft.get("name") not in gone]
        edited["balancer_shafts"] = [{k: v for k, v in shaft.items() if k != "optional"} for shaft in remaining]
    return edited


def number(tables: Mapping[str, Any], name: str) -> tuple[float, str]:
    """Return value or start of a number [SI], by its name in results or its path, and its unit."""
    keys = keys_by_name(tables, name)
    value, field = at(tables, keys), number_at(file_model(), keys)
    if field is None or value is None:
        raise Refused(name, value, "is no number of this problem", "name a number of the problem file")
    return Open.from_value(read_number(field, keys, value)).start, field.unit


def unit_of_bounds(tables: Mapping[str, Any], name: str) -> str:
    """Return the unit in which the file gives a number or its bounds; empty without a unit."""
    now = at(tables, keys_by_name(tables, name))
    bound = now["between"][-1] if _is_open(now) else now
    return units.unit_of(bound) if isinstance(bound, str) else ""


def keys_by_name(tables: Mapping[str, Any], name: str) -> Keys:
    """Return the address (keys and indices) of a number from its name in results or its path in studies."""
    first, _, remainder = name.partition(".")
    if name.replace(" ", "_") in tables.get("engine", {}):
        # numbers of all cylinders are named by their key alone
        return "engine", name.replace(" ", "_")
    if throw := _THROW.fullmatch(name):
        throws, k = tables.get("engine", {}).get("throws"), int(throw[1]) - 1
        if not isinstance(throws, list) or not 0 <= k < len(throws):
            remedy = "give values for all throws, or write them into the problem file first"
            raise Refused(name, None, "is not the name of a number of this problem", remedy)
        return "engine", "throws", k
    labelled = list(_named(tables))
    # names in results come before names of tables
    matches = [(label, keys) for label, keys in labelled if name.startswith(f"{label}.")]
    for label, keys in sorted(matches, key=lambda pair: -len(pair[0])):
        below = _below(at(tables, keys), name.removeprefix(f"{label}.").split("."))
        if below is not None:
            return (*keys, *below)
    if (
        first in file_model().model_fields
        and remainder
        and (first in tables or first not in {label for label, _ in labelled})
    ):
        parent, _, last = name.rpartition(".")
        keys = keys_of(tables, parent)
        parent_value = at(tables, keys)
        return (*keys, last) if isinstance(parent_value, dict) else keys_of(tables, name)
    names = [
        f"{label}.{key}"
        for label, keys in labelled
        for key, value in at(tables, keys).items()
        if key not in ("name", "mirror_of") and type(value) in (int, float, str, dict)
    ]
    raise Refused(name, None, "is not the name of a number of this problem", nearest(name, names or ["engine.stroke"]))


def _named(tables: Mapping[str, Any]) -> Iterator[tuple[str, Keys]]:
    """Yield the name of each part in results, and the address of its table in the file."""
    for k, weight in enumerate(tables.get("counterweights", ())):
        yield weight.get("name", ""), ("counterweights", k)
    for k, shaft in enumerate(tables.get("balancer_shafts", ())):
        names = [unbalance.get("name") for unbalance in shaft.get("unbalances", ())]
        for j in range(len(names)):
            yield name_of_unbalance(shaft.get("name", ""), names, j), ("balancer_shafts", k, "unbalances", j)
        yield shaft.get("name", ""), ("balancer_shafts", k)
    for k, shaft in enumerate(tables.get("engine", {}).get("shafts", ())):
        yield shaft.get("name", ""), ("engine", "shafts", k)
    for name, key in EXTENSION_KEYS.items():
        if name in tables:
            yield from key.numbers(tables[name])
    for k, geared in enumerate(tables.get("geared_inertias", ())):
        yield geared.get("name", ""), ("geared_inertias", k)
    for k, place in enumerate(tables.get("mounts", {}).get("places", ())):
        yield place.get("name", str(k + 1)), ("mounts", "places", k)


def _below(table: Mapping[str, Any], words: list[str]) -> Keys | None:
    # the words after the name of a part are an address within its table
    if len(words) == 2 and words[1] in _AXES and isinstance(table.get(words[0]), list):
        return words[0], _AXES[words[1]]
    if len(words) == 1 and words[0] in _ACROSS and "ratio" in table:
        return "position", _ACROSS[words[0]]
    further_keys = (*_SIZES, "angle", "x", "radius", "loss_factor")
    return (words[0],) if len(words) == 1 and (words[0] in table or words[0] in further_keys) else None


def _is_open(value: Any) -> bool:
    return isinstance(value, dict) and "between" in value
