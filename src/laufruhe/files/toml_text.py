"""TOML text: writer of tables, and clear complaints about text that is not TOML."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

from laufruhe import units
from laufruhe.errors import Complaint, printed
from laufruhe.files.trade_words import meanings

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_AT = re.compile(r"^(.*) \(at (?:line (\d+), column (\d+)|end of document)\)$", re.DOTALL)
_TEXT = r'"(?:[^"\\\n]|\\.)*"|' r"'[^'\n]*'"
_NAME = re.compile(r"""\s*(?:((?:[\w-]|\.|"[^"]*"|'[^']*')+)\s*=|(\[+ *[\w.-]+ *\]+))""")
_QUOTES = re.compile("[“”„‟‘’‚‛«»″]")
_UNQUOTED = re.compile(r'[+-]?[\d.]+(?:[eE][+-]?\d+)? *[A-Za-z°%][^"=]*"?$')
_WORD = re.compile(r"[^\W\d][\w.-]*")
_PART = re.compile(r"""[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+'""")
_TOKEN = re.compile(
    r'"""(?:[^\\]|\\.)*?"""'
    r"|'''.*?'''"
    rf"|(?P<key>(?:{_PART.pattern})(?:[ \t]*+\.[ \t]*+(?:{_PART.pattern}))*+)"
    r"|#[^\n]*"
    r"|(?P<open>[\[{])"
    r"|(?P<close>[]}])",
    re.DOTALL,
)
_NOT_CLOSED = ("the text is not closed", "end it with the quote that it begins with")
_BY_MESSAGE = {
    "Unescaped": (r"\ in text begins a special character", "in a path write / in its place, or put it between ' and '"),
    "Invalid hex": (r"\ in text begins a special character", "in a path write / in its place"),
    "Duplicate": ("a key is given twice in one table", "keep one of them"),
    "Illegal character '\\n'": _NOT_CLOSED,
    "Unterminated": _NOT_CLOSED,
    'Expected "': _NOT_CLOSED,
    "Expected '='": ("no = follows the key", "write key = value"),
    "Expected newline": ("more stands behind the value", "take it out, or begin a new line"),
    "Expected ']": ("[ is not closed", "add ]"),
    "Unclosed array": ("a list is not closed before this place, or a comma is missing", "add ] or a comma"),
    "Unclosed inline": ("a table { is not closed before this place, or a comma is missing", "add } or a comma"),
    "Invalid statement": (
        "no key begins like this", "put a key with other characters than a to z, 0 to 9, _ and - in quotes"
    ),
}  # fmt: skip
"""Rules and remedies by the first words of the messages of the parser."""


def toml_text(tables: Mapping[str, Any]) -> str:
    """Return the text of a TOML file with these tables."""
    return "\n".join(_lines(tables, ())).strip("\n") + "\n"


def _lines(table: Mapping[str, Any], above: tuple[str, ...]) -> Iterator[str]:
    """Yield the lines of a table: values first, then inner tables; open numbers stay on one line."""
    lists = {key: value if isinstance(value, list) else [value] for key, value in table.items()}
    inner = {
        key: tables
        for key, tables in lists.items()
        if tables and all(isinstance(entry, Mapping) and "between" not in entry for entry in tables)
    }
    yield from (f"{toml_key(key)} = {toml_value(value)}" for key, value in table.items() if key not in inner)
    for key, tables in inner.items():
        path = (*above, key)
        name = ".".join(map(toml_key, path))
        head = f"[[{name}]]" if isinstance(table[key], list) else f"[{name}]"
        for entry in tables:
            yield from ("", head, *_lines(entry, path))


def toml_key(key: str) -> str:
    """Return a key as written in TOML, in quotes if necessary."""
    return key if _BARE_KEY.fullmatch(key) else json.dumps(key, ensure_ascii=False)


def toml_value(value: Any) -> str:
    """Return a value as TOML on one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{toml_key(key)} = {toml_value(entry)}' for key, entry in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(toml_value, value))}]"
    return repr(value)


def line_deeper_than(depth: int, text: str) -> int | None:
    """Return the first line, from one, with more than `depth` open brackets or parts of a key; None if there is none.

    The memory of the parser grows with the square of the number of parts of a key.
    """
    brackets = 0
    for token in _TOKEN.finditer(text):
        brackets += (token["open"] is not None) - (token["close"] is not None)
        if brackets > depth or (token["key"] and len(_PART.findall(token["key"])) > depth):
            return text.count("\n", 0, token.start()) + 1
    return None


def toml_complaint(content: bytes, error: tomllib.TOMLDecodeError) -> Complaint:
    """Return the complaint about a file that is not TOML: line and column, rule and remedy."""
    lines = content.decode("utf-8-sig").replace("\r\n", "\n").rstrip().split("\n")
    match = _AT.match(str(error))
    message, number, place = match.groups() if match else (str(error), None, None)
    row, column = int(number or len(lines)), int(place or len(lines[-1]) + 1)
    line = lines[row - 1] if row <= len(lines) else ""
    value, ahead = line.partition("=")[2].partition("#")[0].strip(), line[column - 1 :].partition("#")[0].strip()
    # text in straight quotes may hold any quotes
    quote = _QUOTES.search(re.sub(_TEXT, lambda text: " " * len(text.group()), line))
    rule, remedy = f"{message[:1].lower()}{message[1:]}", "correct it there"
    if quote:
        column = quote.start() + 1
        rule, remedy = f"{quote.group()} is no quote here", 'put text between straight quotes, as in "80 mm"'
    elif message.startswith("Cannot"):
        name = _NAME.match(line)
        rule = f"{name.group(1) or name.group(2) if name else 'a key'} is given twice"
        remedy = "keep one of them, or write [[ ]] for each of several tables"
    elif units.DECIMAL_COMMA.match(value):
        point = printed(value.replace(",", ".", 1), 40)
        rule, remedy = "a comma divides the number", f"decimals follow a point, as in {point}"
    elif _UNQUOTED.match(value):
        remedy = f'a number with its unit stands in quotes, as in "{printed(value.strip(chr(34)), 40)}"'
        rule = "a unit stands without quotes"
    elif (
        (key := _WORD.match(line.strip()))
        and not key.group().isascii()
        and message.startswith(("Expected '='", "Invalid statement"))
    ):
        meant = [f"write {name}" for name, _ in meanings(key.group()) if name]
        rule = f"the key {key.group()} has letters other than a to z"
        remedy = " or ".join([*meant, f"put it in quotes, as in {toml_key(key.group())}"])
    elif known := next((known for start, known in _BY_MESSAGE.items() if message.startswith(start)), None):
        rule, remedy = known
    elif message == "Invalid value" and "".join(lines[: row - 1]).rstrip().endswith((",", "[")):
        rule, remedy = "the list before it has no end", "add ]"
    elif message == "Invalid value" and not ahead:
        rule, remedy = "no value follows", "write one, or leave the key out"
    elif message == "Invalid value" and (word := _WORD.match(ahead)):
        rule = "text stands without quotes, and true and false have small letters"
        remedy = f'write "{printed(word.group(), 40)}", true or false'
    return Complaint(f"line {row}, column {column}", "", f"is no TOML: {rule}", remedy)
