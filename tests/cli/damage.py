"""Ways to damage a problem file: its text, or the tables in it."""

from __future__ import annotations

import copy
import json
import math
import random
import string
from collections.abc import Callable
from typing import Any

SPOILT_TEXTS = (
    "", " ", "120", "mm", "120 mmm", "120 kg", "-120 mm", "0 mm", "1e999 mm", "1e308 m", "1e-320 mm", "nan mm",
    "inf kg", "12,5 mm", "1/0 mm", "1/3 mm", "3 kg m", "25 degC", "1 mm**-9999", "2 kg^1000", "5 m^-1", "0x10 mm",
    "1 " + "m*" * 200 + "m", "x" * 5000, "²", "٣ mm", "1 µm", "1 mm\n2 mm", "1 mm\u0000", "\u202e mm", "{text}",
    "${HOME}", "front left", "mean mount force", "four-strok", "open", "[1]", "7 parsec", "1 rpm", "90 deg", "1 PS",
)  # fmt: skip
SPOILT_VALUES: tuple[Any, ...] = (
    *SPOILT_TEXTS, 0, -1, 1, 2, 7, 48, 49, 10**30, -(10**30), 0.0, -0.0, 1e-300, 1e300, -1e300, 0.5, 1e6, math.nan,
    math.inf, -math.inf, True, False, [], [[]], [0], [0, 180], [1, 1, 1, 1], [4, 3, 2, 1], [None], {}, {"": 1},
    {"between": []}, {"between": [360, 0]}, {"between": [0, 360]}, {"between": ["3 kg", "0 kg"]},
    {"between": [0, 1, 2]},
    {"between": ["0 kg", "3 kg"], "start": "9 kg"}, {"between": [0, 360], "strat": 1}, {"between": "0 kg"},
    {"between": [math.nan, math.nan]}, {"between": ["1 kg m", "1 kg m"]}, {"between": [-1e300, 1e300]},
    {"between": [10, 100]}, {"between": ["0 kg", "1e308 kg"]},
)  # fmt: skip

Path = tuple[str | int, ...]


def damaged_text(text: str, rng: random.Random) -> bytes:
    """The text with something cut, added, doubled or overwritten."""
    data = text.encode()
    kind = rng.randrange(7)
    a, b = sorted(rng.randrange(len(data)) for _ in range(2))
    if kind == 0:
        return data[:a]
    if kind == 1:
        return data[:a] + data[min(b, a + 40) :]
    if kind == 2:
        return data[:a] + rng.randbytes(rng.randint(1, 6)) + data[a:]
    if kind == 3:
        return data[:a] + rng.choice(string.printable).encode() + data[a + 1 :]
    if kind == 4:
        lines = data.splitlines(keepends=True)
        k = rng.randrange(len(lines))
        return b"".join([*lines[: k + 1], lines[k], *lines[k + 1 :]])
    if kind == 5:
        lines = data.splitlines(keepends=True)
        rng.shuffle(lines)
        return b"".join(lines)
    return rng.randbytes(rng.randint(0, 400))


def damaged_tables(tables: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """A copy of the tables in which one to three things are wrong."""
    out = copy.deepcopy(tables)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        paths = list(_paths(out))
        if paths:
            rng.choice(_DAMAGES)(out, rng.choice(paths), rng)
    return out


def _paths(node: Any, at: Path = ()) -> list[Path]:
    below: list[Path] = [at] if at else []
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in items:
        below += _paths(value, (*at, key))
    return below


def _parent(tables: Any, path: Path) -> Any:
    for key in path[:-1]:
        tables = tables[key]
    return tables


def _delete(tables: Any, path: Path, rng: random.Random) -> None:
    del _parent(tables, path)[path[-1]]


def _replace(tables: Any, path: Path, rng: random.Random) -> None:
    _parent(tables, path)[path[-1]] = copy.deepcopy(rng.choice(SPOILT_VALUES))


def _misspell(tables: Any, path: Path, rng: random.Random) -> None:
    parent, key = _parent(tables, path), path[-1]
    if isinstance(parent, dict):
        word = str(key)
        k = rng.randrange(len(word) + 1)
        parent[word[:k] + rng.choice(string.ascii_lowercase + "_. -ü") + word[k + 1 :]] = parent.pop(key)


def _duplicate(tables: Any, path: Path, rng: random.Random) -> None:
    parent, key = _parent(tables, path), path[-1]
    if isinstance(parent, list):
        parent.insert(int(key), copy.deepcopy(parent[int(key)]))


def _move(tables: Any, path: Path, rng: random.Random) -> None:
    target = _parent(tables, rng.choice(_paths(tables)))
    if isinstance(target, dict):
        target[str(path[-1])] = copy.deepcopy(_parent(tables, path)[path[-1]])


def _wrap(tables: Any, path: Path, rng: random.Random) -> None:
    parent, key = _parent(tables, path), path[-1]
    parent[key] = rng.choice(([parent[key]], {"between": [parent[key], parent[key]]}, str(parent[key])))


def _scale(tables: Any, path: Path, rng: random.Random) -> None:
    """The same number with another size or sign."""
    parent, key = _parent(tables, path), path[-1]
    value, factor = parent[key], rng.choice((-1.0, 0.0, 1e-12, 1e-3, 10.0, 1e3, 1e12, 1e200))
    if isinstance(value, str) and value.split(" ")[0].replace(".", "").lstrip("-").isdigit():
        number, _, unit = value.partition(" ")
        parent[key] = f"{float(number) * factor:g} {unit}"
    elif isinstance(value, int | float) and not isinstance(value, bool):
        parent[key] = value * factor


_DAMAGES: tuple[Callable[[Any, Path, random.Random], None], ...] = (
    _delete, _replace, _replace, _misspell, _duplicate, _move, _wrap, _scale, _scale,
)  # fmt: skip


def as_toml(tables: dict[str, Any]) -> str:
    """Tables as TOML text, every table but the outermost inline."""
    return "".join(f"{json.dumps(key)} = {_inline(value)}\n" for key, value in tables.items())


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_inline(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_inline(entry) for entry in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value)
    if value is None:
        return '""'
    return str(value) if isinstance(value, int) else json.dumps(value)
