"""Tables as the text of a TOML file."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(tables: Mapping[str, Any]) -> str:
    """Tables as a file that reads as the same tables again."""
    return "\n".join(_lines(tables, ())).strip("\n") + "\n"


def _lines(table: Mapping[str, Any], above: tuple[str, ...]) -> Iterator[str]:
    """Values first, then tables, then lists of tables."""
    lists = {key: value if isinstance(value, list) else [value] for key, value in table.items()}
    inner = {key: tables for key, tables in lists.items() if tables and all(map(_is_table, tables))}
    yield from (f"{toml_key(key)} = {toml_value(value)}" for key, value in table.items() if key not in inner)
    for key, tables in inner.items():
        path = (*above, key)
        name = ".".join(map(toml_key, path))
        for one in tables:
            yield from ("", f"[[{name}]]" if isinstance(table[key], list) else f"[{name}]", *_lines(one, path))


def _is_table(value: Any) -> bool:
    """Whether a value has lines of its own; an open number stays on one."""
    return isinstance(value, Mapping) and "between" not in value


def toml_key(key: str) -> str:
    """A key as a file has it, in quotes where it needs them."""
    return key if _BARE.fullmatch(key) else json.dumps(key, ensure_ascii=False)


def toml_value(value: Any) -> str:
    """A value on one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{toml_key(key)} = {toml_value(one)}' for key, one in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(toml_value, value))}]"
    return repr(value)
