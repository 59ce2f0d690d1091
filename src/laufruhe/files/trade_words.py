"""Words of the trade, and the keys and values of problem files that they mean."""

from __future__ import annotations

import re
import tomllib
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import Any

_FILE = Path(__file__).with_name("trade_words.toml")
_LETTERS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "é": "e"})


@cache
def _tables() -> dict[str, Any]:
    return tomllib.loads(_FILE.read_text(encoding="utf-8"))


@cache
def trade_words() -> tuple[tuple[str, str, str], ...]:
    """Return words of the trade, each with its key and a note on what the key is."""
    entries = _tables()["meanings"]
    return tuple((word, entry["key"], entry["note"]) for entry in entries for word in entry["words"].split(", "))


@cache
def _by_word() -> dict[str, list[tuple[str, str]]]:
    by_word = defaultdict(list)
    for word, key, note in trade_words():
        by_word[_plain(word)].append((key, note))
    return dict(by_word)


@cache
def _plain(word: str) -> str:
    letters = re.sub(r"[\s_/-]+", "", word.lower().translate(_LETTERS))
    for other, synonym in _tables()["synonyms"].items():
        letters = letters.replace(other, synonym)
    return letters


def meanings(word: str) -> list[tuple[str, str]]:
    """Return the keys that a word of the trade means, each with a note on what it is; empty for other words."""
    plain = _plain(word)
    return _by_word().get(plain) or _by_word().get(plain.removesuffix("s"), [])


@cache
def _values() -> dict[tuple[str, str], str]:
    words = ((entry, word) for entry in _tables()["values"] for word in (entry["value"], *entry["words"].split(", ")))
    return {(entry["key"], _plain(word)): entry["value"] for entry, word in words}


def trade_value(key: str, word: str) -> str | None:
    """Return the value of a key that a word of the trade means, also with a number as in V8; None for other words."""
    plain = _plain(word)
    return _values().get((key, plain)) or _values().get((key, re.sub(r"\d+", "", plain)))
