"""Ways to damage a file: its text, the tables in it, or the rows of a trace."""

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
    "${HOME}", "\x1b[31mred", "a\u2066b\u2069", "\x9b2J", "tab\there", "line\nline", "\ud7ff\uffff", "e\u0301" * 40,
    "a.b.c", "a;b", "../../etc/passwd", "/dev/null", "front left", "mean mount force", "four-strok", "open",
    "[1]", "7 parsec", "1 rpm", "90 deg", "1 PS",
)  # fmt: skip
SPOILT_VALUES: tuple[Any, ...] = (
    *SPOILT_TEXTS, 0, -1, 1, 2, 7, 48, 49, 10**30, -(10**30), 0.0, -0.0, 1e-300, 1e300, -1e300, 0.5, 1e6, math.nan,
    math.inf, -math.inf, True, False, [], [[]], [0], [0, 180], [1, 1, 1, 1], [4, 3, 2, 1], [None], {}, {"": 1},
    {"between": []}, {"between": [360, 0]}, {"between": [0, 360]}, {"between": ["3 kg", "0 kg"]},
    {"between": [0, 1, 2]},
    {"between": ["0 kg", "3 kg"], "start": "9 kg"}, {"between": [0, 360], "strat": 1}, {"between": "0 kg"},
    {"between": [math.nan, math.nan]}, {"between": ["1 kg m", "1 kg m"]}, {"between": [-1e300, 1e300]},
    [[[[[[[[[[]]]]]]]]]], list(range(3000)), ["x"] * 3000, [0.1] * 3000, {f"key{k}": k for k in range(300)}, 10**400,
    {"between": [10, 100]}, {"between": ["0 kg", "1e308 kg"]},
)  # fmt: skip

CELLS = (
    "",
    " ",
    "nan",
    "inf",
    "-inf",
    "1e308",
    "1e-308",
    "-1e999",
    "0",
    "x",
    '"',
    '"1',
    "1,5",
    "1;5",
    "#",
    "9" * 5000,
    "x" * 200_000,
    "\u202e1",
    "1\x00",
    "\x1b[2J",
    "1e5 bar",
    "0x10",
    "-30",
    "360",
    "720",
    "1_0",
)

Path = tuple[str | int, ...]


def damaged_text(text: str, rng: random.Random) -> bytes:
    """Return the text with something cut, added, doubled, overwritten, or nested without end."""
    data = text.encode()
    kind = rng.randrange(9)
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
    if kind == 6:
        return rng.randbytes(rng.randint(0, 400))
    deep = rng.choice((20, 90, 300, 2000))
    ends = (b"[" * deep + b"]" * deep, b"{a=" * deep + b"1" + b"}" * deep, b"x" * 50 * deep, b".a" * deep)
    return data[:a] + rng.choice(ends) + data[b if kind == 7 else a :]


def damaged_rows(text: str, rng: random.Random) -> bytes:
    """Return a trace with cells that are no numbers, rows out of order, or the damage of any text."""
    if rng.random() < 0.5:
        return damaged_text(text, rng)
    rows = [row.split(",") for row in text.splitlines()]
    for _ in range(rng.choice((1, 2, 5))):
        k, cell = rng.randrange(len(rows)), rng.randrange(2)
        rows[k][cell : cell + 1] = [rng.choice(CELLS)] if rng.random() < 0.8 else []
    if rng.random() < 0.2:
        rng.shuffle(rows)
    return rng.choice("\n\n\n\r\0").join(rng.choice(",,,;\t").join(row) for row in rows).encode()


def damaged_tables(tables: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """Return a copy of the tables in which one to three things are wrong."""
    out = copy.deepcopy(tables)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        paths = list(_paths(out))
        if paths:
            rng.choice(_DAMAGES)(out, rng.choice(paths), rng)
    return out


def _paths(tables: Any) -> list[Path]:
    found: list[Path] = []
    left: list[tuple[Path, Any]] = [((), tables)]
    while left:
        at, node = left.pop()
        found += [at] if at else []
        items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
        left += [((*at, key), value) for key, value in items]
    return found


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
    """Insert an entry of a list once more, or very often."""
    parent, key = _parent(tables, path), path[-1]
    if isinstance(parent, list):
        again = [copy.deepcopy(parent[int(key)]) for _ in range(rng.choice((1, 1, 1, 3, 300)))]
        if rng.random() < 0.5:
            # many that have names of their own
            for k, entry in enumerate(entry for entry in again if isinstance(entry, dict) and "name" in entry):
                entry["name"] = f"{entry['name']} {k}"
        parent[int(key) : int(key)] = again


def _nest(tables: Any, path: Path, rng: random.Random) -> None:
    parent, key = _parent(tables, path), path[-1]
    for _ in range(rng.choice((5, 40, 150))):
        parent[key] = [parent[key]] if rng.random() < 0.5 else {"a": parent[key]}


def _swap(tables: Any, path: Path, rng: random.Random) -> None:
    """Swap two values."""
    other = rng.choice(_paths(tables))
    if path[: len(other)] == other or other[: len(path)] == path:
        return
    here, there = _parent(tables, path), _parent(tables, other)
    here[path[-1]], there[other[-1]] = there[other[-1]], here[path[-1]]


def _move(tables: Any, path: Path, rng: random.Random) -> None:
    target = _parent(tables, rng.choice(_paths(tables)))
    if isinstance(target, dict):
        target[str(path[-1])] = copy.deepcopy(_parent(tables, path)[path[-1]])


def _wrap(tables: Any, path: Path, rng: random.Random) -> None:
    parent, key = _parent(tables, path), path[-1]
    parent[key] = rng.choice(([parent[key]], {"between": [parent[key], parent[key]]}, str(parent[key])))


def _scale(tables: Any, path: Path, rng: random.Random) -> None:
    """Change the size or sign of a number."""
    parent, key = _parent(tables, path), path[-1]
    value, factor = parent[key], rng.choice((-1.0, 0.0, 1e-12, 1e-3, 10.0, 1e3, 1e12, 1e200))
    if isinstance(value, str) and value.split(" ")[0].replace(".", "").lstrip("-").isdigit():
        number, _, unit = value.partition(" ")
        parent[key] = f"{float(number) * factor:g} {unit}"
    elif isinstance(value, int) and not isinstance(value, bool) and rng.random() < 0.7:
        parent[key] = rng.choice((0, 1, 2, 3, 5, 8, 12, 24, 36, 47, 48, 49, 100, 1000, 10**6, 10**9))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        parent[key] = value * factor


_DAMAGES: tuple[Callable[[Any, Path, random.Random], None], ...] = (
    _delete, _replace, _replace, _replace, _misspell, _duplicate, _move, _swap, _wrap, _nest, _scale, _scale,
)  # fmt: skip


def as_toml(tables: dict[str, Any]) -> str:
    """Return the tables as TOML text, every table but the outermost inline."""
    return "".join(f"{json.dumps(key)} = {_inline(value)}\n" for key, value in tables.items())


def _inline(value: Any) -> str:
    if isinstance(value, str):
        # TOML has no \\ud800 of JSON, and needs DEL escaped
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
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
    return str(value)
